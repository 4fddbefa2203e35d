"""Who leads the robot by what is seen of the partner: as the dissertation writes it, or the live loop of inphase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import inphase
from experiments.handshake.anatomy import MUSCLES
from experiments.handshake.encounter import LASTS, Encounter
from experiments.handshake.sensors import HAND, PRESSURES
from experiments.study.leading import lead
from inphase.runtime.clock import Clock
from inphase.runtime.conduct import Conduct
from inphase.runtime.device import Command, Sample, Signal
from inphase.runtime.journal import Journal
from inphase.runtime.limits import Limits
from inphase.runtime.loop import Loop
from inphase.runtime.safety import State
from inphase.runtime.smoothing import AlphaBeta, Motion, wanted_at
from inphase.session import Session

HIGHEST = 0.65  # [MPa] that may be asked of a muscle
RESPONDS, PLAYS = 3.0, 10.0  # [1/s] in the dissertation


@dataclass(frozen=True, eq=False)
class Led:
    """What was believed. beliefs: (K, 5) time [s], phase, its std, velocity [1/s], its std.

    asked: (R,) [s] when a response was made. responses: (R, S, 28) their times [s] and pressures [MPa]. held: how often
    the loop thought better of going on.
    """

    beliefs: np.ndarray
    asked: np.ndarray
    responses: np.ndarray
    held: int


class Notes(Journal):
    """What a session said, taken down while an encounter lasts."""

    def __init__(self) -> None:
        super().__init__()
        self._estimates: list[inphase.Estimate] = []
        self._responses: list[tuple[float, inphase.Response]] = []

    def step(self, values: np.ndarray, estimate: inphase.Estimate) -> None:
        """What is believed after a sample."""
        self._estimates.append(estimate)

    def response(self, time: float, response: inphase.Response) -> None:
        """What is to come."""
        self._responses.append((time, response))

    @property
    def led(self) -> Led:
        """All of it; of the responses no more than three a second."""
        kept = self._responses[:: max(round(len(self._responses) / (LASTS * RESPONDS)), 1)]
        fields = ("time", "phase", "phase_std", "phase_velocity", "phase_velocity_std")
        held = [event for event in self.events if event.kind == "safety" and event.after != State.RUNNING.name]
        return Led(
            np.array([[getattr(estimate, name) for name in fields] for estimate in self._estimates]),
            np.array([time for time, _ in kept]),
            np.array([np.column_stack([response.times, response.mean]) for _, response in kept]),
            len(held),
        )


def as_written(encounter: Encounter, session: Session) -> Led:
    """Inference and a response at 3 Hz, followed at 10 Hz with an alpha-beta filter between responses (2.4, 2.5.3)."""
    notes, smooth = Notes(), AlphaBeta()
    motion = Motion.at_rest(encounter.arm.air.reference)
    response: inphase.Response | None = None
    for tick in range(round(LASTS * PLAYS * RESPONDS)):
        time = tick / (PLAYS * RESPONDS)
        encounter.until(time)
        if tick % round(PLAYS) == 0:
            seen = encounter.read[-1][: len(HAND)]
            notes.step(seen, session.observe(time, seen))
            response = session.respond(samples=50)
            notes.response(time, response)
        if tick % round(RESPONDS) == 0 and response is not None:
            motion = smooth.step(motion, wanted_at(response, np.array([time]))[0])
            encounter.arm.air.reference = np.clip(motion.positions, 0.0, HIGHEST)
    encounter.until(LASTS)
    return notes.led


def live(encounter: Encounter, session: Session) -> Led:
    """The live loop with nothing set: 60 looks, 30 responses and 60 commands a second."""
    notes = Notes()
    clock, free = Simulated(encounter), np.full(len(MUSCLES), np.inf)
    loop = Loop(
        session,
        [Skeleton(encounter)],
        Valves(encounter),
        clock,
        Conduct(Limits(np.zeros(len(MUSCLES)), np.full(len(MUSCLES), HIGHEST), free, free)),
        journal=notes,
        shared_clock=["camera"],
    )
    lead(loop, clock, LASTS)
    encounter.until(LASTS)
    return notes.led


class Simulated:
    """A clock whose time is the simulation's: to wait is to let it go on."""

    def __init__(self, encounter: Encounter) -> None:
        self._encounter, self._now = encounter, 0.0

    def now(self) -> float:
        """The time [s]."""
        return self._now

    def wait_until(self, time: float) -> None:
        """Go on to that time [s], which lies within the encounter or a little after it."""
        self._encounter.until(time)
        self._now = max(self._now, time, self._encounter.time)  # its steps do not end where somebody waits for


class Skeleton:
    """The camera as a sensor of the loop: a sample for every picture."""

    name = "camera"
    signals = tuple(Signal(name, "m") for name in HAND)

    def __init__(self, encounter: Encounter) -> None:
        self._encounter, self._read = encounter, 0

    def start(self, clock: Clock) -> None:
        """It runs already."""

    def stop(self) -> None:
        """Nobody else needs it."""

    def read(self) -> list[Sample]:
        """All since the last look."""
        encounter, begin = self._encounter, self._read
        self._read = len(encounter.times)
        new = zip(encounter.times[begin:], encounter.read[begin:], strict=True)
        return [Sample(values[: len(HAND)], time, time) for time, values in new]


class Valves:
    """The muscles as a robot of the loop: sent where pressures are to be, standing where they are."""

    name = "muscles"
    signals = tuple(Signal(name, "MPa") for name in PRESSURES)

    def __init__(self, encounter: Encounter) -> None:
        self._encounter = encounter

    def start(self, clock: Clock) -> None:
        """They are under pressure already."""

    def stop(self) -> None:
        """They keep their pressures."""

    def state(self) -> Sample:
        """The newest pressures."""
        encounter = self._encounter
        return Sample(encounter.arm.air.pressure, encounter.time, encounter.time)

    def command(self, command: Command) -> None:
        """Tell the valves."""
        self._encounter.arm.air.reference = np.clip(command.positions[0], 0.0, HIGHEST)
