"""A person who shakes hands: how somebody reaches, with a style of their own, never twice the same, and what they see.

They see the robot's hand late and not quite where it is. Who follows meets it: they wait until it moves, guess where it
will end, and mend that guess on the way. Who leads has an end point of their own, and waits there. Reaches are of least
jerk (Flash and Hogan 1985), mended by going on from where the hand is, as fast as it is.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

REST = np.array([0.98, 0.20, 0.88])  # [m] of somebody's hand who waits
SEEING = 0.2  # [s] between what they see and what they do about it
THINKING = 10  # steps from one correction to the next
STEP = 0.01  # [s]
MOVES = 0.010  # [m] by which the robot has to have moved for somebody to see that it does
LAST = 0.35  # [s] that a correction takes, at least
NEAR, CLOSING, LETS_GO = 0.04, 0.15, 0.10  # [m] and [s] until a hand closes around the other, [m] when it slips
SPEEDS = {"fast": 0.6, "normal": 1.0, "slow": 1.8}  # of the time a reach takes, give or take each person's own idea
SURE = 0.2  # more of the robot's way ahead is guessed right by who has met it 36 times


@dataclass(frozen=True)
class Style:
    """What is somebody's own. delay: [s] until they begin. reach: [s] it takes. ahead: 0 … 1, how far they see ahead.

    tremor: [m]. sway: [m] of the body. rest: (3,) [m]. shake: [m] up and down. tempi: their idea of fast, normal, slow.
    grip: [N]. place: (3,) where they like to shake hands, among all the places, in standard deviations.
    """

    delay: float
    reach: float
    ahead: float
    tremor: float
    sway: float
    rest: np.ndarray
    shake: float
    grip: float
    tempi: dict[str, float]
    place: np.ndarray

    @classmethod
    def of(cls, person: int, seed: int, familiar: bool) -> Style:
        """Of the person with that number."""
        rng = np.random.default_rng([seed, 1, person])
        return cls(
            delay=float(0.28 * np.exp(0.25 * rng.standard_normal())),
            reach=float(1.7 * np.exp(0.12 * rng.standard_normal())),
            ahead=float(np.clip(0.45 + 0.15 * rng.standard_normal(), 0.1, 0.8)) + SURE * familiar,
            tremor=float(0.0015 * np.exp(0.3 * rng.standard_normal())),
            sway=float(0.004 * np.exp(0.3 * rng.standard_normal())),
            rest=REST + np.array([0.03, 0.03, 0.04]) * rng.standard_normal(3),
            shake=float(rng.uniform(0.010, 0.022)),
            grip=float(rng.uniform(6.0, 14.0)),
            tempi={name: share * float(np.exp(0.1 * rng.standard_normal())) for name, share in SPEEDS.items()},
            place=0.4 * rng.standard_normal(3),
        )

    def once(self, rng: np.random.Generator) -> Style:
        """This time."""
        return replace(
            self,
            delay=self.delay * float(np.exp(0.2 * rng.standard_normal())),
            reach=self.reach * float(np.exp(0.08 * rng.standard_normal())),
            rest=self.rest + np.array([0.01, 0.01, 0.015]) * rng.standard_normal(3),
            shake=self.shake * float(rng.uniform(0.8, 1.2)),
        )


class Partner:
    """Somebody in one encounter. goal: (3,) their own end point; None for who follows. speed: a share of their tempo.

    still: they never move. pause: [s] that they wait longer. `force` (3,) [N] is that of their fingers on the robot,
    `began`, `arrives` and `clasped` say when [s] they did what they did.
    """

    def __init__(
        self,
        style: Style,
        rng: np.random.Generator,
        goal: np.ndarray | None = None,
        speed: float = 1.0,
        still: bool = False,
        pause: float = 0.0,
    ) -> None:
        self.style, self._rng, self._goal, self._still = style, rng, goal, still
        self._takes = style.reach * speed
        self._begins = pause + style.delay + 0.5 * rng.random() if goal is not None else np.inf
        self.began = self.arrives = self.clasped = np.inf
        self.force = np.zeros(3)
        self._course = np.stack([style.rest, np.zeros(3), np.zeros(3)])  # position, velocity, acceleration
        self._target = style.rest
        self._sway, self._tremor = style.sway * rng.standard_normal(3), np.zeros(3)
        self._near_since = np.inf
        self._robot: deque[np.ndarray] = deque(maxlen=round(SEEING / STEP) + THINKING)
        self._at_first: np.ndarray | None = None

    def step(self, time: float, robot: np.ndarray, hand: np.ndarray) -> np.ndarray:
        """(3,) where they want their hand to be. robot, hand: (3,) where both hands are."""
        self._robot.append(robot)
        self._at_first = robot if self._at_first is None else self._at_first
        if not self._still and len(self._robot) == self._robot.maxlen and round(time / STEP) % THINKING == 0:
            self._think(time, self._robot[THINKING], (self._robot[THINKING] - self._robot[0]) / (THINKING * STEP))
        self._move(time)
        self._clasp(time, robot, hand)
        rng, style = self._rng, self.style
        self._sway = _wander(self._sway, style.sway, 2.0, rng)
        self._tremor = _wander(self._tremor, style.tremor, 0.03, rng)
        shaken = np.array([0.0, 0.0, style.shake * _swing(time - self.clasped - 0.2)])
        return np.asarray(self._course[0] + self._sway + self._tremor + shaken)

    def _think(self, time: float, robot: np.ndarray, speed: np.ndarray) -> None:
        """Look, and decide where to reach: to where the robot is seen, and some of the way it seems to go on."""
        if self._begins == np.inf and np.linalg.norm(robot - self._at_first) > MOVES:
            self._begins = time + self.style.delay
        if time >= self._begins and self.began == np.inf:
            self.began, self.arrives = time, time + self._takes
        if self.clasped < np.inf:
            return  # they have met: nobody chases a hand that they hold
        if self._goal is None:
            left = min(max(self.arrives - time, 0.0) + SEEING, 1.2) if self.began < np.inf else 0.0
            slip = 0.02 * min(float(np.linalg.norm(speed)) / 0.2, 1.0) * self._rng.standard_normal(3)
            self._target = robot + self.style.ahead * speed * left + slip
        else:
            self._target = self._goal

    def _move(self, time: float) -> None:
        """Along the way of least jerk that is left to the target, from here, as fast as now."""
        if self.began == np.inf:
            return
        position, velocity, acceleration = self._course
        left = max(self.arrives - time, LAST if self._goal is None else 0.0)
        if left < STEP:
            self._course = np.stack([self._target, np.zeros(3), np.zeros(3)])
            return
        jerk = (60 * (self._target - position) - 36 * velocity * left - 9 * acceleration * left**2) / left**3
        self._course = np.stack(
            [
                position + velocity * STEP + acceleration * STEP**2 / 2 + jerk * STEP**3 / 6,
                velocity + acceleration * STEP + jerk * STEP**2 / 2,
                acceleration + jerk * STEP,
            ]
        )

    def _clasp(self, time: float, robot: np.ndarray, hand: np.ndarray) -> None:
        """Fingers close when the hands have met, and pull them together as hard as a hand pulls."""
        apart = hand - robot
        distance = float(np.linalg.norm(apart))
        self._near_since = min(self._near_since, time) if distance < NEAR else np.inf
        if self.clasped == np.inf and time >= self._near_since + CLOSING:
            self.clasped = time
        if distance > LETS_GO:
            self.clasped = np.inf
        held = self.clasped < np.inf
        self.force = self.style.grip * np.tanh(distance / 0.03) * apart / max(distance, 1e-6) if held else np.zeros(3)


def _wander(place: np.ndarray, size: float, seconds: float, rng: np.random.Generator) -> np.ndarray:
    """(3,) a step on, around 0 with that standard deviation, forgotten after so long."""
    keep = np.exp(-STEP / seconds)
    return np.asarray(keep * place + size * np.sqrt(1 - keep**2) * rng.standard_normal(3))


def _swing(since: float) -> float:
    """Of a shaken hand, -1 … 1: two swings of 0.45 s."""
    return float(np.sin(2 * np.pi * since / 0.45) * np.sin(np.pi * since / 0.9)) if 0 < since < 0.9 else 0.0
