"""A live loop on a bench: stand-ins for its devices, a clock that is told, and the law of limits for what was sent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from interactions import CONTROLLED, dataset, taught

import inphase
from inphase.io import read_recording
from inphase.recording import Recording
from inphase.replay import identical, provenance_of, replay
from inphase.runtime import Command, FakeClock, Sample, Sensor, Signal
from inphase.runtime.conduct import Conduct
from inphase.runtime.devices import SimulatedPartner, SimulatedRobot
from inphase.runtime.journal import Journal
from inphase.runtime.limits import Limits
from inphase.runtime.loop import Loop
from inphase.runtime.playing import Play
from inphase.runtime.rates import Rates
from inphase.runtime.recorder import Recorder
from inphase.runtime.safety import State

JOINTS = tuple(Signal(name) for name in CONTROLLED)
HOME = np.array([0.8, 0.0])
MOST_COMMANDS = 5000  # of a run; one that sends more does not end


class Hung(BaseException):
    """The loop does not come to its end; no loop may catch this."""


def learned() -> inphase.Model:
    """A small model: two channels observed, two controlled, 2 s long."""
    return taught(dataset(np.random.default_rng(0)))


def never(now: float) -> bool:
    return False


class Watched:
    """A robot that takes down what it is asked and sent, and fails when it is told to.

    silent, raises, refuses: at which times it says and takes nothing, raises whatever is asked, raises for commands.
    `carried` (D,) is how far it has been carried away.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        self.name, self.signals = robot.name, robot.signals
        self.robot = robot
        self.silent = self.raises = self.refuses = never
        self.carried: Callable[[float], np.ndarray] = lambda now: np.zeros(len(robot.signals))
        self.sent: list[tuple[float, Command, State]] = []  # when, what, and in which state of the loop
        self.stood: list[tuple[float, np.ndarray, float]] = []  # all answers: when, where, received
        self.taken: list[float] = []  # times of the commands that were taken
        self.running = False
        self.loop: Loop | None = None
        self._clock = FakeClock()

    def start(self, clock: FakeClock) -> None:
        self._clock, self.running = clock, True
        self.robot.start(clock)

    def stop(self) -> None:
        self.running = False
        self.robot.stop()

    def state(self) -> Sample | None:
        now = self._clock.now()
        if self.raises(now):
            raise ConnectionError("no route to the robot")
        self.robot.answers = not self.silent(now)
        sample = self.robot.state()
        if sample is None:
            return None
        sample = replace(sample, values=sample.values + self.carried(now))
        self.stood.append((now, sample.values, sample.received))
        return sample

    def command(self, command: Command) -> None:
        now = self._clock.now()
        assert self.loop is not None
        self.sent.append((now, command, self.loop.state))
        if len(self.sent) > MOST_COMMANDS:
            raise Hung
        if self.raises(now) or self.refuses(now):
            raise ConnectionError("the robot takes no command")
        self.robot.answers = not self.silent(now)
        if self.robot.answers:
            self.taken.append(now)
        self.robot.command(Command(command.times, command.positions - self.carried(now)))

    def began_anew(self, silence: float) -> list[float]:
        """When it stood somewhere, after it had not been well for longer than that [s]: what is sent may begin anew."""
        known = sorted(received for _, _, received in self.stood)
        return [now for now, _, _ in self.stood if self._well_before(now, known) < now - silence]

    def _well_before(self, now: float, known: list[float]) -> float:
        """When before that time it last answered, and took its commands too."""
        earlier = [t for t in known if t < now - 0.002]  # a step of the simulation, at most: the answer before
        answered = earlier[-1] if earlier else -np.inf
        sent = [t for t, _, _ in self.sent if t < now]
        taken = [t for t in self.taken if t < now]
        refused = bool(sent) and (not taken or sent[-1] > taken[-1])
        return min(answered, taken[-1] if refused and taken else np.inf)


class Listed:
    """A sensor that takes down all it gave."""

    def __init__(self, sensor: Sensor) -> None:
        self.name, self.signals, self.start, self.stop = sensor.name, sensor.signals, sensor.start, sensor.stop
        self._sensor = sensor
        self.given: list[Sample] = []
        self.looks: list[list[Sample]] = []

    def read(self) -> list[Sample]:
        samples = self._sensor.read()
        self.given.extend(samples)
        self.looks.append(samples)
        return samples


@dataclass
class Bench:
    """All parts of a run, before and after it."""

    model: inphase.Model
    clock: FakeClock
    partner: Any
    robot: Watched
    loop: Loop
    conduct: Conduct
    file: Path | None = None
    told: list[Any] = field(default_factory=list)

    def run(self, duration: float | None = 10.0, **options: Any) -> Any:
        """The report; the recording is closed whatever happens."""
        try:
            return self.loop.run(duration, watch=False, **options)
        finally:
            if self.loop.journal.recorder is not None:
                self.loop.journal.recorder.close()
            assert not self.robot.running

    @property
    def silence(self) -> float:
        """[s] without a command after which what is sent begins at rest."""
        return self.loop.actuation.watchdog.patience

    @property
    def safety(self) -> list[Any]:
        return [event for event in self.told if event.kind == "safety"]

    def states(self, begin: float, end: float = np.inf) -> set[State]:
        """Those in which commands were sent between these times [s]."""
        return {state for now, _, state in self.robot.sent if begin < now < end}

    def recorded(self) -> Recording:
        """What was recorded, which replays to the last bit."""
        assert self.file is not None
        recording = read_recording(self.file)
        assert "damage" not in recording.provenance
        made = list(replay(recording, self.model))
        assert len(made) == len(recording.estimates)
        assert all(identical(one, other) for one, other in zip(made, recording.estimates, strict=True))
        return recording


def bench(
    model: inphase.Model,
    *,
    partner: Any = None,
    sensors: list[Any] | None = None,
    robot: SimulatedRobot | None = None,
    limits: Limits | None = None,
    rates: Rates | None = None,
    play: Play | None = None,
    filter: str = "bip",
    file: Path | None = None,
    clock: FakeClock | None = None,
    journal: Journal | None = None,
    sight: Any = None,
    shared_clock: tuple[str, ...] = ("partner",),
    **conduct: Any,
) -> Bench:
    """A loop of that model with stand-ins, unless told; `conduct` are further entries of `Conduct`."""
    clock = clock or FakeClock()
    partner = partner or SimulatedPartner(model, 1, rate=50.0, tempo=1.0)
    watched = Watched(robot or SimulatedRobot(JOINTS, HOME, step=0.002))
    wide = np.ones(len(watched.signals))
    obeyed = Conduct(limits or Limits(-9 * wide, 9 * wide, 9 * wide, 99 * wide), **conduct)
    journal = journal or Journal()
    if file is not None:
        journal.recorder = Recorder(file, model.channels, provenance_of(model, filter), model=model)
    sensors = [partner] if sensors is None else sensors
    names = [sensor.name for sensor in sensors]
    loop = Loop(
        model.session(filter),
        sensors,
        watched,
        clock,
        obeyed,
        rates=rates or Rates(sense=50.0, respond=25.0, command=50.0),
        play=play,
        sight=sight,
        shared_clock=[name for name in shared_clock if name in names],
        journal=journal,
    )
    watched.loop = loop
    made = Bench(model, clock, partner, watched, loop, obeyed, file)
    journal.listeners.append(made.told.append)
    return made


# -------------------------------------------------------------------------------------------------- the law of limits


def violations(bench: Bench) -> list[str]:
    """Where what was sent, by differences, broke a limit; and where a trajectory did not end at rest.

    Two sequences are told apart, both from rest: one begins where a robot stands that was lost, and one where it was
    sent last, when single points have not come for longer than it may take (a robot without a next point stands).
    """
    anew = set(bench.robot.began_anew(bench.conduct.silence))
    standing = {now: values for now, values, _ in bench.robot.stood}
    faults: list[str] = []
    path = _Path(bench.conduct.limits, bench.silence, bench.loop.actuation._period, faults)
    trajectories = bench.loop.player.play.horizon is not None
    before: Command | None = None
    for now, command, _ in bench.robot.sent:
        first = command.positions[0]
        if before is None or (now in anew and np.array_equal(first, standing[now])):
            path.begin(command.times[0], first)
            before = None
        if trajectories:
            _check_trajectory(command, before, now, faults)
            path.take(command)
        else:
            path.point(float(command.times[0]), first)
        before = command
    path.finish()
    return faults


class _Path:
    """What a robot was sent as one course, by differences."""

    def __init__(self, limits: Limits, silence: float, period: float, faults: list[str]) -> None:
        self.limits, self.silence, self.period, self.faults = limits, silence, period, faults
        self.time, self.position, self.velocity = -np.inf, np.zeros(0), np.zeros(0)
        self.planned: list[tuple[float, np.ndarray]] = []

    def begin(self, time: float, position: np.ndarray) -> None:
        self.finish()
        self.time, self.position, self.velocity = time, position, np.zeros(len(position))

    def finish(self) -> None:
        for time, position in self.planned:
            self._step(time, position)
        self.planned = []

    def take(self, command: Command) -> None:
        """What was planned for before its first point has happened; the rest is planned anew."""
        for time, position in self.planned:
            if time < command.times[0]:
                self._step(time, position)
        self.planned = [(float(t), p) for t, p in zip(command.times, command.positions, strict=True) if t > self.time]

    def point(self, time: float, position: np.ndarray) -> None:
        if time - self.time > self.silence:
            self.velocity, self.time = np.zeros(len(position)), time - self.period
        self._step(time, position)

    def _step(self, time: float, position: np.ndarray) -> None:
        dt, limits = time - self.time, self.limits
        if dt < 1e-9:
            if not np.allclose(position, self.position, rtol=0, atol=1e-9):
                self.faults.append(f"{time:.4f} s: a jump to {position} from {self.position} in no time")
            return
        velocity = (position - self.position) / dt
        outside = np.maximum(limits.low - position, position - limits.high)
        before = np.maximum(np.maximum(limits.low - self.position, self.position - limits.high), 0.0)
        if (outside > before + 1e-12).any():
            self.faults.append(f"{time:.4f} s: position {position}")
        if (np.abs(velocity) > limits.velocity * (1 + 1e-6) + 1e-9 / dt).any():
            self.faults.append(f"{time:.4f} s: velocity {velocity}")
        if (np.abs(velocity - self.velocity) > limits.acceleration * dt * (1 + 1e-6) + 1e-9 / dt).any():
            self.faults.append(f"{time:.4f} s: acceleration {(velocity - self.velocity) / dt}")
        self.time, self.position, self.velocity = time, position, velocity


def _check_trajectory(command: Command, before: Command | None, now: float, faults: list[str]) -> None:
    """It ends at rest, and goes on where the one before it is then."""
    steps = np.diff(command.positions, axis=0)
    if len(steps) and np.abs(steps[-1]).max() > 1e-12:
        faults.append(f"{now:.4f} s: a trajectory that ends at {steps[-1]} a step")
    if before is None:
        return
    for time, position in zip(command.times[:2], command.positions[:2], strict=False):
        expected = [np.interp(time, before.times, column) for column in before.positions.T]
        known = time <= before.times[-1] or np.array_equal(time, command.times[0])
        if known and not np.allclose(position, expected, rtol=0, atol=1e-9):
            faults.append(f"{now:.4f} s: goes on at {position}, where {expected} was sent")


def simulated(model: str, tempo: float, samples: int) -> str:
    """A configuration of `inphase live` with a simulated partner and robot, which records."""
    return f"""
model = "{model}"
[filter]
name = "bip"
[rates]
sense = 60
respond = 15
command = 40
[sensors.partner]
device = "simulated_partner"
tempo = {tempo}
clock = "shared"
[robot]
device = "simulated_robot"
home = {{grip = 0.8, turn = 0.0}}
[robot.limits."*"]
velocity = 2.0
acceleration = 20.0
[response]
samples = {samples}
[recording]
folder = "runs"
"""
