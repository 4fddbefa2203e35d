"""The observation noise: what the basis functions leave unexplained (Eq. 2.15)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from inphase.noise import Noise

SMALLEST_STD = 1e-4  # of a group's range: no sensor and no basis is better


def regression_noise(times: Sequence[Float[np.ndarray, " _"]], residuals: Sequence[Float[np.ndarray, "_ F"]]) -> Noise:
    """The mean squared residual of every feature (Eq. 2.15), and how long residuals stay on one side.

    times: one (T,) [s] a demonstration. residuals: (T, F), what was read less what was fitted, NaN where not seen.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        per_demonstration = np.array([np.nansum(r**2, 0) / (~np.isnan(r)).sum(0) for r in residuals])
        var = np.nansum(per_demonstration, 0) / (~np.isnan(per_demonstration)).sum(0)
    lasting = np.array([correlation_time(t, r) for t, r in zip(times, residuals, strict=True)])
    known = ~np.isnan(lasting)
    lasting = np.where(known, lasting, 0.0).sum(0) / np.maximum(known.sum(0), 1)
    return Noise(np.maximum(var, SMALLEST_STD**2), lasting)


def correlation_time(times: Float[np.ndarray, " T"], residuals: Float[np.ndarray, "T F"]) -> Float[np.ndarray, " F"]:
    """The integral of every feature's autocorrelation up to where it first falls to nothing [s]; NaN if never seen.

    For residuals that decay as exp(-t/τ) that is τ. A lone sample's width, half a step, is not counted: white noise
    has no correlation time. Lags at which no two readings were seen take after the lag before.
    """
    step = float(np.median(np.diff(times)))
    seen = (~np.isnan(residuals)).astype(np.float64)
    filled = np.nan_to_num(residuals)
    count = seen.sum(0)
    power = np.maximum((filled**2).sum(0) / np.maximum(count, 1.0), np.finfo(float).tiny)
    alive, total, last = count > 0, np.zeros(len(count)), np.ones(len(count))
    everything = bool(seen.all())
    for lag in range(1, len(filled)):
        pairs = np.full(len(count), len(filled) - float(lag)) if everything else (seen[lag:] * seen[:-lag]).sum(0)
        product = (filled[lag:] * filled[:-lag]).sum(0) / np.maximum(pairs, 1.0) / power
        # The sum over all lags would weigh the few pairs at long lags as much as the many at short ones.
        last = np.where(pairs > 0, product * (1 - lag / len(filled)), last)
        alive &= last > 2 / np.sqrt(np.maximum(count, 1.0))  # what chance alone would give
        if not alive.any():
            break
        total += np.where(alive, last, 0.0)
    return np.where(count > 0, step * total, np.nan)


def both(one: Noise, other: Noise) -> Noise:
    """The noise of two sources that know nothing of each other; the time of each counts by its variance."""
    var = one.var + other.var
    return Noise(var, (one.var * one.correlation_time + other.var * other.correlation_time) / var)
