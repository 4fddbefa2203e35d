"""Who the partners are: what stays the same about a person, and how nobody ever does the same twice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PEOPLE = 5
SHIRTS = (
    (0.80, 0.33, 0.25, 1),
    (0.25, 0.47, 0.42, 1),
    (0.44, 0.35, 0.60, 1),
    (0.83, 0.58, 0.20, 1),
    (0.27, 0.42, 0.66, 1),
)


@dataclass(frozen=True, eq=False)
class Someone:
    """A person, and how the sensors sit on them.

    height [m]. weight [kg]. pace: of their own, 1 is usual. back: from 0, who bends the knees, to 1, who bends the
    back. hold: where they like to take things (3,) [m], from what is usual. mounts: (2, 3, 3) how each forearm's IMU
    is turned. electrodes: (2, 4, 3) what each hears of each muscle. soles: (2, 4) gains of the cells of each shoe.
    """

    height: float
    weight: float
    pace: float
    back: float
    hold: np.ndarray
    mounts: np.ndarray
    electrodes: np.ndarray
    soles: np.ndarray


def someone(seed: int, which: int) -> Someone:
    """One of them."""
    rng = np.random.default_rng([seed, 1000, which])
    height = float(np.clip(rng.normal(1.74, 0.08), 1.58, 1.92))
    near = np.array([[0.9, 0.2, 0.1], [0.6, 0.1, 0.4], [0.15, 0.9, 0.2], [0.2, 0.4, 0.8]])  # what lies below each
    return Someone(
        height=height,
        weight=float(23.5 * height**2 * np.exp(0.1 * rng.standard_normal())),
        pace=float(np.exp(0.12 * rng.standard_normal())),
        back=float(rng.uniform(0.3, 0.9)),
        hold=rng.normal(0.0, [0.03, 0.05, 0.03]),
        mounts=np.stack([turned(0.15 * rng.standard_normal(3)) for _ in range(2)]),
        electrodes=near * np.exp(0.35 * rng.standard_normal((2, 4, 3))),
        soles=np.exp(0.15 * rng.standard_normal((2, 4))),
    )


def turned(by: np.ndarray) -> np.ndarray:
    """(3, 3) the rotation by a vector [rad] (Rodrigues)."""
    angle = max(float(np.linalg.norm(by)), 1e-12)
    x, y, z = by / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Track:
    """A smooth way through points (K, D) at times (K,) [s]: from one to the next with the least jerk (Flash, Hogan)."""

    def __init__(self, times: np.ndarray | list[float], points: np.ndarray | list[object]) -> None:
        self.times, self.points = np.asarray(times, dtype=np.float64), np.asarray(points, dtype=np.float64)
        if (np.diff(self.times) <= 0).any():
            raise ValueError(f"expected times that increase, got {self.times}")

    def __call__(self, time: float) -> np.ndarray:
        """(D,) where it is then."""
        i = int(np.clip(np.searchsorted(self.times, time, "right") - 1, 0, len(self.times) - 2))
        share = np.clip((time - self.times[i]) / (self.times[i + 1] - self.times[i]), 0.0, 1.0)
        share = share**3 * (10 - 15 * share + 6 * share**2)
        return np.asarray((1 - share) * self.points[i] + share * self.points[i + 1])


class Sway:
    """The small slow movement of a body that nobody keeps still. sizes: (D,) standard deviations [m]."""

    def __init__(
        self, sizes: list[float], rng: np.random.Generator, slowest: float = 0.1, fastest: float = 1.0
    ) -> None:
        waves = 6
        self._rates = 2 * np.pi * np.exp(rng.uniform(np.log(slowest), np.log(fastest), (waves, 1)))
        self._sines = np.asarray(sizes) * rng.standard_normal((waves, len(sizes))) / np.sqrt(waves)
        self._cosines = np.asarray(sizes) * rng.standard_normal((waves, len(sizes))) / np.sqrt(waves)

    def __call__(self, time: float) -> np.ndarray:
        """(D,) how far off it is then."""
        angle = self._rates * time
        return np.asarray((np.sin(angle) * self._sines + np.cos(angle) * self._cosines).sum(axis=0))
