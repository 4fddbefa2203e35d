"""How far a robot is behind what it is sent: the lookahead it needs (3.4.2), measured."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

LONGEST, STEP = 1.0, 0.002  # [s] that are tried
MOVED = 1e-9  # a robot that was sent no further than this tells no lag


def lag_of(times: Float[np.ndarray, " T"], sent: Float[np.ndarray, "T D"], measured: Float[np.ndarray, "T D"]) -> float:
    """The lag [s] at which `measured` is most like `sent` was then, in squares, each channel by its own range.

    times: (T,) [s], increasing. NaN where a robot did not stand still for it, or never moved.
    """
    span = np.ptp(sent, axis=0) if len(times) else np.zeros(0)
    moving = span > MOVED
    known = np.isfinite(measured).all(axis=1)
    late = known & (times >= times[0] + LONGEST) if len(times) else known
    if not moving.any() or late.sum() < 2:
        return float("nan")
    lags = np.arange(0.0, LONGEST, STEP)
    errors = np.zeros(len(lags))
    for channel in np.flatnonzero(moving):
        then = np.interp(times[late] - lags[:, None], times, sent[:, channel])
        errors += np.mean(((measured[late, channel] - then) / span[channel]) ** 2, axis=1)
    return float(lags[np.argmin(errors)])
