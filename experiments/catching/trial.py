"""One throw at the robot, led by inphase's live loop: sensors, session, responses, limits, commands, all as in life."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import inphase
from experiments.bodies.arm import JOINTS, VELOCITY
from experiments.catching.demonstrations import TESTED, thrown
from experiments.catching.expert import LAG, demonstrate, plan
from experiments.catching.flight import crossing
from experiments.catching.sensors import MODALITIES, watches
from experiments.catching.thrower import AIM_AT, Throw
from experiments.catching.world import World
from experiments.study.leading import lead
from inphase.runtime import (
    Clock,
    Command,
    Conduct,
    FakeClock,
    Journal,
    Limits,
    Loop,
    Play,
    Rates,
    Sample,
    Sight,
    Signal,
    State,
)

RATE = 60.0  # [1/s] of all that the loop does, as in 3.4.1
FALLS, SETTLES = 1.7, 0.5  # [s] after its release a ball lies somewhere, and stays there
ACCELERATION = 60.0  # [rad/s²] the loop may ask of a joint
LATEST = 0.03  # [s] the slowest sensor's readings are late
REACH = 2 * np.pi

CONDITIONS = {
    "all modalities": {},
    "ball alone": {name: {"silent": 0.0} for name in MODALITIES if name != "ball"},
    "shoes and IMU lost in mid-throw": {"shoes": {"silent": -1.0}, "imu": {"silent": -1.0}},
    "ball hidden until 60 % of its flight": {"ball": {"hidden": 0.6}},
}
LOST_AT = 0.6  # of the wind-up, where a modality is lost


class Arm:
    """The arm as a robot of the loop. A command's last point that is due is where it is sent."""

    def __init__(self, world: World) -> None:
        self.name, self.signals = "arm", tuple(Signal(name, "rad") for name in JOINTS)
        self._world, self._clock = world, FakeClock()

    def start(self, clock: Clock) -> None:
        """Stand where it is."""
        self._clock = clock

    def state(self) -> Sample:
        """Where the joints are, now."""
        self._world.to(self._clock.now())
        return Sample(self._world.joints, self._world.time, self._clock.now())

    def command(self, command: Command) -> None:
        """Go there from now on."""
        self._world.to(self._clock.now())
        self._world.target = np.array(command.positions[0])

    def stop(self) -> None:
        """Stay where it was sent."""


@dataclass(frozen=True)
class Outcome:
    """What came of a throw.

    caught: whether the ball was in the box in the end. reachable: whether who knows the throw would catch it. missed:
    [m] from the ball to the middle of the opening, at the nearest. phase: where the loop believed to be then. held:
    whether safety held the robot before that.
    """

    world: World
    caught: bool
    reachable: bool
    missed: float
    phase: float
    held: bool


def options(condition: str, throw: Throw) -> dict[str, dict[str, float]]:
    """What the sensors are told, by modality, for that throw."""
    chosen = {name: dict(told) for name, told in CONDITIONS[condition].items()}
    if condition == "shoes and IMU lost in mid-throw":
        chosen = {name: {"silent": LOST_AT * throw.release} for name in chosen}
    if "hidden" in chosen.get("ball", {}):
        chosen["ball"]["hidden"] = throw.release + chosen["ball"]["hidden"] * passes(throw)
    return chosen


def played(
    session: inphase.Session, number: int, condition: str, seed: int, *, purpose: int = TESTED, seen: bool = False,
    watching: Any = None,
) -> Outcome:  # fmt: skip
    """That throw, under that condition, with a loop of its own. watching: is told world and loop 60 times a second."""
    happens, rng = thrown(seed, number, purpose)
    world, clock = World(happens, seen=seen), FakeClock()
    journal = Journal()
    loop = Loop(
        session,
        watches(world, [seed, purpose, number], **options(condition, happens)),
        Arm(world),
        clock,
        Conduct(Limits(-REACH * np.ones(6), REACH * np.ones(6), VELOCITY * np.ones(6), ACCELERATION * np.ones(6))),
        rates=Rates(sense=RATE, observe=RATE, respond=RATE, command=RATE),
        play=Play(control_lag=LAG),
        sight=Sight(delay=LATEST),
        shared_clock=MODALITIES,
        journal=journal,
    )
    session.reset(number)
    session.observe(0.0, np.full(len(session.model.observed), np.nan))  # the interaction begins, seen or not
    falls = happens.release + FALLS
    phase = [0.0]

    def look() -> None:
        if loop.estimate is not None and world.entered is None:
            phase[0] = loop.estimate.phase
        if watching is not None:
            world.to(clock.now())
            watching(world, loop)
        clock.at(clock.now() + 1 / RATE, look)

    clock.at(0.0, look)
    lead(loop, clock, falls)
    clock.wait_until(max(falls, (world.entered or 0.0) + SETTLES))
    world.to(clock.now())
    planned = plan(happens, rng)
    reachable = planned is not None and demonstrate(happens, planned).inside
    held = held_before(world.entered or happens.release + passes(happens), journal)
    return Outcome(world, world.inside, reachable, world.nearest, phase[0], held)


def held_before(time: float, journal: Journal) -> bool:
    """Whether safety held the robot before that time [s]."""
    return any(e.kind == "safety" and e.after == State.HOLDING.name and e.time < time for e in journal.events)


def passes(happens: Throw) -> float:
    """[s] from its release until the ball comes to where the robot catches."""
    came = crossing(happens.position, happens.velocity, lambda place: float(place[0]) - AIM_AT)
    return 1.0 if came is None else came[0]


def unmoved(numbers: range, seed: int) -> dict[str, Any]:
    """The same throws at a robot that never moves: how many balls fall into the box where it waits."""
    caught = []
    for number in numbers:
        happens, _ = thrown(seed, number, TESTED)
        world = World(happens)
        world.to(happens.release + FALLS + SETTLES)
        caught.append(world.inside)
    return {"caught": np.array(caught)}


def tried(model: inphase.Model, condition: str, numbers: range, seed: int, purpose: int = TESTED) -> dict[str, Any]:
    """Several throws: whether each was caught, could be caught, and by how much the box was off."""
    session = model.session(seed=seed)
    outcomes = [played(session, number, condition, seed, purpose=purpose) for number in numbers]
    return {
        "caught": np.array([o.caught for o in outcomes]),
        "reachable": np.array([o.reachable for o in outcomes]),
        "missed": np.array([o.missed for o in outcomes]),
        "phase": np.array([o.phase for o in outcomes]),
        "held": np.array([o.held for o in outcomes]),
    }
