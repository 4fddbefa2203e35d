"""Several readings in a row as one: for a session that observes more seldom than its sensors read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from inphase.arrays import FloatArray
from inphase.channels import Channel, Kind, quaternions

TURN = 2 * np.pi  # [rad]


class Averaging:
    """The mean of times [s] and that of (D,) readings, each channel over those in which it was seen.

    What moves steadily reads that mean at that time; noise becomes less. Angles are averaged the shorter way round,
    quaternions on their sphere.
    """

    def __init__(self, channels: Sequence[Channel]) -> None:
        self._angles = [i for i, channel in enumerate(channels) if channel.kind is Kind.ANGLE]
        self._turns = [list(parts) for parts in quaternions(channels)]

    def __call__(self, readings: Sequence[tuple[float, FloatArray]]) -> tuple[float, Float[np.ndarray, " D"]]:
        """Of at least one reading."""
        values = np.array([row for _, row in readings])
        time = sum(time for time, _ in readings) / len(readings)
        if self._angles or self._turns:
            self._align(values)
        mean = values.sum(axis=0) / len(values)
        if np.isnan(mean).any():
            seen = np.isfinite(values)
            mean = np.where(seen, values, 0.0).sum(axis=0) / np.where(seen.any(axis=0), seen.sum(axis=0), np.nan)
        for parts in self._turns:
            mean[parts] /= np.linalg.norm(mean[parts])
        return time, mean

    def _align(self, values: Float[np.ndarray, "R D"]) -> None:
        """Bring angles and quaternions to the branch of the newest reading, in place."""
        seen = np.isfinite(values)
        last = len(seen) - 1 - np.argmax(seen[::-1], axis=0)  # in which each channel was seen
        newest = values[last, np.arange(values.shape[1])]
        for i in self._angles:
            values[:, i] -= TURN * np.round((values[:, i] - newest[i]) / TURN)
        for parts in self._turns:
            values[:, parts] *= np.where(values[:, parts] @ newest[parts] < 0, -1.0, 1.0)[:, None]
