"""The observation noise: what the basis functions leave unexplained (Eq. 2.15)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from inphase.noise import Noise

SMALLEST_STD = 1e-4  # of a channel's range: no sensor and no basis is better


def learn_noise(times: Sequence[Float[np.ndarray, " _"]], residuals: Sequence[Float[np.ndarray, "_ F"]]) -> Noise:
    """The mean squared residual of every feature (Eq. 2.15), and how long residuals stay on one side.

    times: one (T,) [s] a demonstration. residuals: (T, F), what was read less what was fitted, NaN where not seen.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        per_demonstration = np.array([np.nansum(r**2, 0) / (~np.isnan(r)).sum(0) for r in residuals])
        var = np.nansum(per_demonstration, 0) / (~np.isnan(per_demonstration)).sum(0)
    correlation_time = np.mean([_correlation_time(t, r) for t, r in zip(times, residuals, strict=True)], axis=0)
    return Noise(np.maximum(var, SMALLEST_STD**2), correlation_time)


def _correlation_time(times: Float[np.ndarray, " T"], residuals: Float[np.ndarray, "T F"]) -> Float[np.ndarray, " F"]:
    """The integral of every feature's autocorrelation up to where it first falls to zero [s].

    For residuals that decay as exp(-t/τ) that is τ. A lone sample's width, half a step, is not counted: white noise
    has no correlation time.
    """
    step = float(np.median(np.diff(times)))
    filled = np.nan_to_num(residuals)
    power = (filled**2).sum(0)
    alive = np.ones(filled.shape[1], dtype=bool)
    total = np.zeros(filled.shape[1])
    for lag in range(1, len(filled)):
        product = (filled[lag:] * filled[:-lag]).sum(0) / np.maximum(power, np.finfo(float).tiny)
        alive &= product > 2 / np.sqrt(len(filled))  # what chance alone would give
        if not alive.any():
            break
        total += np.where(alive, product, 0.0)
    return step * total
