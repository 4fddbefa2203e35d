"""Pressures by hand: 12 open-loop trajectories for training and 4 others for the tests, as in 2.5.3.

An experimenter tunes end pressures until the arm ends where it should. Here that is done by statics: a posture with the
palm at the place, and pressures near a co-contraction that hold it there, rounded to what one would type. Friction,
contact and rounding decide where the arm really ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from experiments.handshake.anatomy import MUSCLES, RANGES, STILL
from experiments.handshake.robot import Arm, pull, torques

DELAY, RAMP = 0.4, 2.2  # [s] until the pressures begin to change, and while they do
LEAST, MOST = 0.03, 0.60  # [MPa]
TYPED = 0.02  # [MPa] to which pressures are rounded
HANGING = np.deg2rad([0, 0, 5, 0, 8, 5, 35, 0, 0, 0])
READY = np.deg2rad([0, 5, 5, 30, 10, 10, 70, 0, 0, 0])
ABOUT = 1 / np.deg2rad([4, 8, 4, 40, 15, 20, 40, 3, 3, 3]) ** 2  # how readily a joint leaves that
# [m] of the palm: near and far, low to high, right to left.
TRAINING = tuple((x, y, z) for x in (0.40, 0.56) for z in (0.92, 1.10, 1.28) for y in (-0.20, 0.02))
TESTING = ((0.47, -0.10, 0.98), (0.44, -0.03, 1.20), (0.52, -0.16, 1.14), (0.49, 0.00, 1.05))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Pressures (27,) [MPa] from `start` to `end`, linear in between, as all of them were made."""

    start: np.ndarray
    end: np.ndarray

    def at(self, time: float) -> np.ndarray:
        """(27,) [MPa] at a time [s]."""
        return np.asarray(self.start + (self.end - self.start) * np.clip((time - DELAY) / RAMP, 0.0, 1.0))


@cache
def training() -> tuple[Trajectory, ...]:
    """Twelve, whose ends cover the range of the robot."""
    return tuple(_made(place, i) for i, place in enumerate(TRAINING))


@cache
def testing() -> tuple[Trajectory, ...]:
    """Four with other ends."""
    return tuple(_made(place, 100 + i) for i, place in enumerate(TESTING))


@cache
def start() -> np.ndarray:
    """(27,) [MPa] with which the arm hangs."""
    return holding(HANGING, np.full(len(MUSCLES), 0.26), free=np.ones(len(MUSCLES), dtype=bool))


def _made(place: tuple[float, float, float], number: int) -> Trajectory:
    rng = np.random.default_rng([12, number])
    stiffer = rng.uniform(0.9, 1.25)  # nobody tunes two trajectories alike
    near = start() * np.where(STILL, 1.0, stiffer)
    return Trajectory(start(), holding(posture(place), near, free=~STILL))


@cache
def posture(place: tuple[float, float, float]) -> np.ndarray:
    """(10,) angles [rad] with the palm there, as near to an easy posture as may be, the wrist left alone."""
    from scipy.optimize import least_squares

    arm = Arm(np.full(len(MUSCLES), 0.2))

    def off(angles: np.ndarray) -> np.ndarray:
        torques(arm.model, arm.data, angles)
        return np.concatenate([50 * (arm.hand - place), 0.1 * np.sqrt(ABOUT) * (angles - READY)])

    return np.asarray(least_squares(off, READY, bounds=(RANGES[:, 0], RANGES[:, 1])).x)


def holding(angles: np.ndarray, near: np.ndarray, free: np.ndarray) -> np.ndarray:
    """(27,) [MPa] that hold the arm at these angles, as near to others as may be; only those `free` may differ."""
    from scipy.optimize import lsq_linear

    arm = Arm(near)
    turns, weight = pull(angles), torques(arm.model, arm.data, angles)
    matrix = np.concatenate([turns[:, free], 2.0 * np.eye(int(free.sum()))])
    target = np.concatenate([weight - turns[:, ~free] @ near[~free], 2.0 * near[free]])
    found = near.copy()
    found[free] = lsq_linear(matrix, target, bounds=(LEAST, MOST)).x
    return np.asarray(np.where(free, np.round(found / TYPED) * TYPED, found))
