"""The one who moves the robot while it is taught: sees what the partner does, a little late, and answers (3.3.2.2).

Both of the operator's hands hug a mannequin that is always the same: their joints say where the arms go, and eight
sensors how hard they press. What the robot has to be changed by for a real body is left to the retargeting.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from experiments.hugging.pads import ARMS, LARGEST
from experiments.hugging.reach import reach
from experiments.hugging.world import COMMANDED, PERIOD, SIDES, World

FIRM = {"hand": 80.0, "wrist": 65.0, "fore": 40.0, "upper": 15.0}  # [raw] of a usual hug on the mannequin
SOFTER_RIGHT = 0.6
START = {"left": (0.3, 1.4, -1.2, -1.2, 0.0, 1.6, 0.8), "right": (-0.3, 1.4, 1.2, -1.2, 0.0, 1.6, -0.8)}


@dataclass
class Follower:
    """Goes to its target without overshoot. quick: [1/s]."""

    quick: float
    value: float = 0.0
    speed: float = 0.0

    def step(self, target: float) -> float:
        """A period later."""
        self.speed += PERIOD * self.quick * (self.quick * (target - self.value) - 2 * self.speed)
        self.value += PERIOD * self.speed
        return self.value


@dataclass
class Teleoperator:
    """One hug of the operator's. Everything is drawn when they begin; `answer` is asked every period."""

    world: World
    shoulder: float  # [m] of the partner, whom they see
    rng: np.random.Generator
    seen: deque[tuple[float, float, float]] = field(default_factory=deque)

    def __post_init__(self) -> None:
        rng = self.rng
        self.late = max(1, round((0.20 + 0.10 * rng.random()) / PERIOD))
        self.raising = Follower(float(rng.uniform(3.8, 5.2)))
        self.closing = Follower(float(rng.uniform(4.5, 6.5)))
        self.strength = float(np.exp(0.18 * rng.normal()))
        self.each = np.exp(0.12 * rng.standard_normal(len(ARMS)))
        self.tremble = np.zeros(len(ARMS) + 2)
        self.up, self.around, self.held, self.over = False, False, False, False
        high = 1.20 + 0.45 * (self.shoulder - 1.40) + 0.03 * float(rng.normal())
        low = 1.07 + 0.20 * (self.shoulder - 1.40) + 0.03 * float(rng.normal())
        wide = 0.48 + 0.02 * float(rng.normal())
        self.open = self._posture((0.28, wide + 0.04, low), (0.62, 0.42, high), 0.0)
        self.closed = self._posture((0.25, wide - 0.02, low + 0.01), (0.42, 0.03, high), 0.08)

    def _posture(self, elbow: tuple[float, ...], hand: tuple[float, ...], apart: float) -> np.ndarray:
        """(12,) the joints of both arms. apart: [m] the left hand above, the right one below."""
        found = []
        for side, sign in zip(SIDES, (1, -1), strict=True):
            data = self.world.begin()
            names = [f"{side}_{i}" for i in range(1, 8)]
            for name, angle in zip(names, START[side], strict=True):
                data.joint(name).qpos = angle
            places = {
                f"{side}_elbow": (elbow[0], sign * elbow[1], elbow[2]),
                f"{side}_hand": (hand[0], sign * hand[1], hand[2] + sign * apart),
            }
            found.append(reach(self.world.model, data, names, places, {f"{side}_elbow": 0.5})[:COMMANDED])
        return np.concatenate(found)

    def answer(self, time: float, row: Any, look: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
        """(12,) where the joints should go [rad] and (8,) how hard the arms should press [raw].

        look: the partner's distance [m], how far their arms are up and around, as the operator sees them.
        """
        self.seen.append(look)
        distance, up, around = self.seen.popleft() if len(self.seen) > self.late else (2.0, 0.0, 0.0)
        was = self.held
        self.up = up > 0.10 or distance < 0.8 if not self.up else up > 0.35 or distance < 0.7
        self.around = around > (0.85 if self.held else 0.15) and distance < 0.6 and not self.over
        self.held = self.around and (self.held or around > 0.95)
        self.over = distance < 0.8 and (self.over or (was and not self.around))
        tremble = np.sqrt(2 * PERIOD / 0.4) * self.rng.standard_normal(len(self.tremble))
        self.tremble += -PERIOD / 0.4 * self.tremble + tremble
        raised = self.raising.step(1.0 if self.up else 0.0)
        closed = self.closing.step(1.0 if self.around else 0.0)
        rest = self.world.resting
        joints = rest + raised * (self.open - rest) + closed * (self.closed - self.open)
        joints = joints + 0.006 * (self.tremble[-2] + self.tremble[-1] * np.sin(np.arange(len(joints))))
        firm = np.array([FIRM[name.split("_")[1]] * (SOFTER_RIGHT if "right" in name else 1.0) for name in ARMS])
        press = self.strength * self.each * firm * max(closed, 0.0) ** 6 * np.exp(0.08 * self.tremble[: len(ARMS)])
        return joints, np.clip(press, 0.0, LARGEST)
