"""People who hug: how somebody does it, and how they do it this time (3.3.2.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.hugging.person import Body

SHIRTS = (
    "0.80 0.40 0.27 1",
    "0.36 0.56 0.42 1",
    "0.80 0.62 0.24 1",
    "0.47 0.40 0.62 1",
    "0.70 0.35 0.42 1",
    "0.42 0.52 0.66 1",
)


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


def _smooth(share: float) -> float:
    """Minimum jerk from 0 to 1."""
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)
