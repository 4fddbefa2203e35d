"""People who hug: how somebody does it, how they do it this time, and what their body does then (3.3.2.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.hugging.person import ARM_JOINTS, FROM, TRUNK, Body
from experiments.hugging.reach import reach
from experiments.hugging.world import PERIOD, World

SHIRTS = (
    "0.80 0.40 0.27 1",
    "0.36 0.56 0.42 1",
    "0.80 0.62 0.24 1",
    "0.47 0.40 0.62 1",
    "0.70 0.35 0.42 1",
    "0.42 0.52 0.66 1",
)
CHEST = 0.095  # [m] where the robot's chest is
DOWN = {"swing": 0.05, "spread": 0.10, "twist": 0.0, "bend": 0.15}


@dataclass(frozen=True)
class Partner:
    """Somebody. pace: of all they do; strength: of their hug; over: how often an arm goes over the robot's.

    hold: [s] how long they like to hug; ahead: [s] by how much their arms go up before they arrive.
    """

    body: Body
    pace: float
    strength: float
    over: tuple[float, float]
    hold: float
    ahead: float

    @classmethod
    def meet(cls, rng: np.random.Generator, shirt: str = SHIRTS[0]) -> Partner:
        """Anybody."""
        body = Body(float(np.clip(rng.normal(1.71, 0.085), 1.55, 1.90)), float(np.exp(0.09 * rng.normal())), shirt)
        prefers = rng.choice([0.05, 0.95], size=2, p=[0.5, 0.5])
        return cls(
            body,
            float(np.exp(0.12 * rng.normal())),
            float(np.exp(0.25 * rng.normal())),
            (float(prefers[0]), float(prefers[1])),
            3.0 * float(np.exp(0.20 * rng.normal())),
            float(rng.uniform(0.5, 1.1)),
        )

    def once(self, rng: np.random.Generator, kind: str = "usual") -> Visit:
        """How they do it this time."""
        pace = self.pace * float(np.exp(0.09 * rng.normal()))
        hold = {"long": rng.uniform(5.5, 7.5), "short": rng.uniform(1.2, 1.8)}.get(kind, self.hold)
        hold *= float(np.exp(0.18 * rng.normal()))
        waits = float(rng.uniform(0.3, 1.3)) + (rng.uniform(4.0, 6.0) if kind == "late" else 0.0)
        walk = 1.9 / pace
        raised = waits + max(0.1, walk - self.ahead * float(np.exp(0.15 * rng.normal())) - 0.9)
        if kind == "raised":  # the arms go up before the first step, and stay there
            raised, waits = waits, waits + 1.0 + float(rng.uniform(3.0, 4.5))
        return Visit(
            kind=kind,
            body=self.body,
            starts=waits,
            walk=walk,
            raises=raised,
            raising=0.9 / pace,
            wraps=waits + walk + float(rng.uniform(-0.25, 0.15)),
            wrapping=0.75 / pace,
            hold=float(hold),
            releasing=0.6 / pace,
            leaves=float(rng.uniform(0.8, 1.3)),
            pressed=0.020 * self.strength * float(np.exp(0.2 * rng.normal())),
            squeezed=0.07 * self.strength * float(np.exp(0.2 * rng.normal())),
            over=(bool(rng.random() < self.over[0]), bool(rng.random() < self.over[1])),
            aside=0.025 * float(rng.normal()),
            turned=0.05 * float(rng.normal()),
            lean=float(np.clip(0.03 + 0.02 * rng.normal(), 0.0, 0.08)),
            hands=(0.03 * float(rng.normal()), 0.03 * float(rng.normal())),
        )


@dataclass(frozen=True)
class Visit:
    """One hug of one person: when they do what [s], and how.

    pressed, squeezed: [m] how far chest and hands want to get into the robot. over: the left and the right arm.
    """

    kind: str
    body: Body
    starts: float
    walk: float
    raises: float
    raising: float
    wraps: float
    wrapping: float
    hold: float
    releasing: float
    leaves: float
    pressed: float
    squeezed: float
    over: tuple[bool, bool]
    aside: float
    turned: float
    lean: float
    hands: tuple[float, float]

    @property
    def hugs(self) -> bool:
        """Whether there is a hug to be answered."""
        return self.kind not in ("nothing", "air", "apart")

    @property
    def holds_from(self) -> float:
        """[s] when their arms are around the robot."""
        return self.wraps + self.wrapping

    @property
    def withdraws(self) -> float:
        """[s] when they begin to let go."""
        return self.holds_from + self.hold

    @property
    def gone(self) -> float:
        """[s] when they are back where they came from."""
        return self.withdraws + self.leaves + self.walk

    @property
    def over_at(self) -> float:
        """[s] when it is over."""
        return self.starts + 9.0 if self.kind == "nothing" else self.gone + 0.5

    def at(self, time: float) -> tuple[float, float, float]:
        """How far they have come, how far the arms are up, and how far they are around: 0 … 1 each."""
        if self.kind == "nothing":
            return 0.0, 0.0, 0.0
        came = _smooth((time - self.starts) / self.walk) - _smooth((time - self.withdraws - self.leaves) / self.walk)
        clear = self.withdraws + (self.leaves + 0.35 * self.walk if self.kind != "air" else 0.3)  # of the robot's arms
        down = _smooth((time - clear) / (1.2 * self.raising))
        up = _smooth((time - self.raises) / self.raising) - down
        around = _smooth((time - self.wraps) / self.wrapping) - _smooth((time - self.withdraws) / self.releasing)
        return came if self.kind != "air" else 0.0, max(up, 0.0), around

    def stilled(self, **changed: Any) -> Visit:
        """The same with something changed."""
        return replace(self, **changed)


class Person:
    """Moves a person's springs as a visit says; matches the strength with which they are held, if asked to."""

    def __init__(self, world: World, visit: Visit, rng: np.random.Generator, matches: bool) -> None:
        model = world.model
        self.visit, self.rng, self.matches = visit, rng, matches
        self.held = 1.0
        self.wanders = np.zeros(6)
        self.trunk = [model.actuator(f"person_{name}").id for name in TRUNK]
        self.arms = {s: [model.actuator(f"person_{s}_{j}").id for j in ARM_JOINTS] for s in ("left", "right")}
        self.legs = {s: [model.actuator(f"person_{s}_{j}").id for j in ("hip", "knee")] for s in ("left", "right")}
        touching = CHEST + visit.body.thick + 0.005
        self.near = FROM - touching + (visit.pressed if visit.kind != "apart" else -0.16)
        self.postures = {s: self._postures(world, s) for s in ("left", "right")}
        self.stride = 0.0

    def _postures(self, world: World, side: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The angles of an arm that hangs, is up, is around the robot, and what more of it squeezes."""
        index, sign = (0, -1) if side == "left" else (1, 1)
        over, shoulder = self.visit.over[index], self.visit.body.shoulder
        data = world.begin()
        apart = 0.0 if self.visit.kind != "apart" else 0.16
        data.joint("person_forward").qpos = self.near - (0.0 if apart else self.visit.pressed)
        here = FROM - self.near
        names = [f"person_{side}_{j}" for j in ARM_JOINTS]

        def arm(elbow: tuple[float, float, float], hand: tuple[float, float, float], first: tuple[float, ...]) -> Any:
            for name, angle in zip(names, first, strict=True):
                data.joint(name).qpos = angle
            places = {f"person_{side}_elbow": (elbow[0], sign * elbow[1], elbow[2])}
            places[f"person_{side}_hand"] = (hand[0], sign * hand[1], hand[2])
            return reach(world.model, data, names, places, {f"person_{side}_elbow": 0.4})

        if over:
            high = max(1.37, shoulder - 0.02)
            up = arm((here - 0.22, 0.34, high), (here - 0.47, 0.34, high + 0.06), (1.3, 0.3, 0.0, 0.4))
            first = (1.4, 0.3, 0.6, 0.9)
            elbow, hand = (0.06, 0.28, high + 0.03), (-0.135, 0.04, 1.36 + self.visit.hands[index])
        else:
            up = arm((here - 0.16, 0.34, shoulder - 0.20), (here - 0.42, 0.32, shoulder - 0.25), (0.7, 0.3, 0.0, 0.7))
            first = (0.8, 0.3, 0.6, 1.0)
            elbow, hand = (0.17, 0.30, shoulder - 0.24), (-0.135, 0.11, 1.03 + self.visit.hands[index])
        hand = (hand[0] + apart * 1.0, hand[1] + 0.8 * apart, hand[2])
        elbow = (elbow[0] + 0.6 * apart, elbow[1], elbow[2])
        around = arm(elbow, hand, first)
        tight = arm(elbow, (hand[0] + 0.10, hand[1], hand[2]), tuple(around))
        return np.array([DOWN[j] for j in ARM_JOINTS]), up, around, (tight - around) / 0.10

    def act(self, time: float, data: Any, held_with: float) -> None:
        """Set the springs. held_with: [N] how hard the robot's arms press."""
        visit = self.visit
        came, up, around = visit.at(time)
        if self.matches and around > 0.9:
            self.held += PERIOD / 1.0 * (np.clip(0.6 + held_with / 100.0, 0.6, 1.5) - self.held)
        self.wanders += PERIOD / 0.6 * -self.wanders + np.sqrt(2 * PERIOD / 0.6) * self.rng.standard_normal(6)
        pressing = around * self.held
        forward = came * (self.near - visit.pressed * (1 - pressing) * (visit.kind != "apart"))
        for actuator, value in zip(
            self.trunk,
            (
                forward + 0.004 * self.wanders[0],
                came * visit.aside + 0.006 * self.wanders[1],
                came * visit.turned + 0.02 * self.wanders[2],
                visit.lean * around + 0.01 * self.wanders[3],
            ),
            strict=True,
        ):
            data.ctrl[actuator] = value
        squeezing = visit.squeezed * around * self.held if visit.hugs else 0.0
        for i, (side, actuators) in enumerate(self.arms.items()):
            down, raised, closed, tighter = self.postures[side]
            posture = down + up * (raised - down) + around * (closed - raised) + squeezing * tighter
            posture = posture + 0.02 * self.wanders[4 + i]
            for actuator, angle in zip(actuators, posture, strict=True):
                data.ctrl[actuator] = angle
        self._walk(data)

    def _walk(self, data: Any) -> None:
        """Legs that fit how fast they go; they carry nothing."""
        speed = float(data.joint("person_forward").qvel[0])
        self.stride += PERIOD * 2 * np.pi * np.clip(abs(speed) / 0.65, 0.0, 1.6) * np.sign(speed)
        for side, turn in (("left", 0.0), ("right", np.pi)):
            much = np.clip(abs(speed) / 0.8, 0.0, 1.0)
            swing = np.sin(self.stride + turn)
            hip, knee = self.legs[side]
            data.ctrl[hip] = 0.38 * much * swing + 0.06 * much
            data.ctrl[knee] = 0.55 * much * max(0.0, np.cos(self.stride + turn)) + 0.05


def _smooth(share: float) -> float:
    """Minimum jerk from 0 to 1."""
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)
