"""Resampling: particles that count for nothing make room for copies of those that count."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

BELOW_ONE = np.nextafter(1.0, 0.0)


def effective_size(weights: Float[np.ndarray, " P"]) -> float:
    """How many particles of equal weight say as much as these (P,), whose weights sum to 1: from 1 to P."""
    return float(1 / (weights @ weights))


def systematic(weights: Float[np.ndarray, " P"], count: int, start: float) -> Int[np.ndarray, " Q"]:
    """`count` particles in order, each as often as its weight says, give or take one.

    weights: (P,) of any sum. start: in [0, 1), the one random number of the scheme: points stand at equal distances on
    the summed weights, and those that fall on a particle copy it. What weighs nothing is never taken.
    """
    points = np.minimum((np.arange(count) + start) / count, BELOW_ONE)
    ends = np.cumsum(weights)
    return np.searchsorted(ends / ends[-1], points, side="right")
