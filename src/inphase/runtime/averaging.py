"""Several readings in a row as one: for a session that observes more seldom than its sensors read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from inphase.arrays import FloatArray
from inphase.channels import Channel, Kind, quaternions

TURN = 2 * np.pi  # [rad]


def averaged(
    readings: Sequence[tuple[float, FloatArray]], channels: Sequence[Channel]
) -> tuple[float, Float[np.ndarray, " D"]]:
    """The mean of times [s] and that of (D,) values, each channel over the readings in which it was seen.

    What moves steadily reads that mean at that time; noise becomes less. Angles are averaged the shorter way round,
    quaternions on their sphere. Expects at least one reading.
    """
    values = np.stack([row for _, row in readings])
    time = float(np.mean([time for time, _ in readings]))
    seen = np.isfinite(values)
    newest = values[_last(seen), np.arange(values.shape[1])]
    for i, channel in enumerate(channels):
        if channel.kind is Kind.ANGLE:
            values[:, i] -= TURN * np.round((values[:, i] - newest[i]) / TURN)
    turns = [list(parts) for parts in quaternions(channels)]
    for parts in turns:
        values[:, parts] *= np.where(values[:, parts] @ newest[parts] < 0, -1.0, 1.0)[:, None]
    mean = np.where(seen, values, 0.0).sum(axis=0) / np.where(seen.any(axis=0), seen.sum(axis=0), np.nan)
    for parts in turns:
        mean[parts] *= np.linalg.norm(newest[parts]) / np.linalg.norm(mean[parts])
    return time, mean


def _last(seen: np.ndarray) -> np.ndarray:
    """The last row in which each column was seen; the last of all where in none."""
    return np.asarray(len(seen) - 1 - np.argmax(seen[::-1], axis=0))
