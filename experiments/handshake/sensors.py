"""What a model sees: the pressures of the muscles and the partner's hand by camera, both at 30 Hz, late and noisy."""

from __future__ import annotations

from collections import deque

import numpy as np

from experiments.handshake.anatomy import NAMES

RATE = 30.0  # [1/s]
HAND = ("hand_x", "hand_y", "hand_z")  # [m] forward, left and up from the robot
PRESSURES = tuple(f"pressure_{name}" for name in NAMES)  # [MPa] over that of the air
CAMERA_LATE = 0.06  # [s] from light to skeleton
SKELETON, WANDERS, FOR = 0.004, 0.006, 0.5  # [m] white noise, [m] and [s] of what lasts: the joint found on the sleeve
OFF = 0.008  # [m] of the joint found on another person's hand, for all of an encounter
LOST, LOST_FOR = 0.08, 0.25  # [1/s] how often the skeleton is lost, [s] for how long
GAUGE, BITS = 0.0015, 1.0 / 4096  # [MPa] noise of a pressure sensor, and what its converter tells apart


class Camera:
    """Skeleton tracking of one hand: late, noisy, and now and then lost."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._off = OFF * rng.standard_normal(3)
        self._wander = WANDERS * rng.standard_normal(3)
        self._past: deque[np.ndarray] = deque(maxlen=round(CAMERA_LATE / 0.01) + 1)
        self._lost = 0.0

    def watch(self, hand: np.ndarray) -> None:
        """Where the hand is, every 10 ms."""
        self._past.append(hand)

    def read(self) -> np.ndarray:
        """(3,) [m], NaN where the skeleton is lost; every 1/30 s."""
        rng, keep = self._rng, np.exp(-1 / (RATE * FOR))
        self._wander = keep * self._wander + WANDERS * np.sqrt(1 - keep**2) * rng.standard_normal(3)
        white, loses, lost = SKELETON * rng.standard_normal(3), rng.random(), rng.exponential(LOST_FOR)
        self._lost = max(self._lost - 1 / RATE, lost if loses < LOST / RATE else 0.0)
        place = self._past[0] + self._off + self._wander + white
        return np.where(self._lost > 0, np.nan, place)


def gauge(pressures: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(27,) [MPa] as the sensors read them."""
    return np.asarray(np.round((pressures + GAUGE * rng.standard_normal(len(pressures))) / BITS) * BITS)
