"""Learning a reflex: the demonstrations' features now and a little before, at several speeds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from inphase.reflex import Reflex

LAGS = np.array([0.0, 1 / 6, 1 / 3, 2 / 3])  # [s]: position, and how it came there, within a person's reaction
SPEEDS = (0.5, 1.0, 2.0)  # at which a partner may move: a regression must not take a slow hand for another place
STRENGTH = 0.1  # of the ridge, in variances of the features: a few demonstrations say little about many lags
MOMENTS = 100  # of each demonstration
FADE = 0.3  # [s]


def learn_reflex(
    times: Sequence[Float[np.ndarray, " _"]],
    features: Sequence[Float[np.ndarray, "_ F"]],
    observed: int,
    share: float = 0.0,
) -> Reflex:
    """The reflex of demonstrations: times (T,) [s] and scaled features (T, F), NaN where not seen, one each."""
    rows = np.concatenate([_moments(t, f, observed) for t, f in zip(times, features, strict=True)])
    mean, std = rows.mean(0), np.maximum(rows.std(0), 1e-9)
    shown = len(LAGS) * observed
    off = (rows - mean) / std
    correlation = off.T @ off / len(off)
    correlation[np.arange(shown), np.arange(shown)] += STRENGTH
    return Reflex(LAGS, mean, correlation * np.outer(std, std), observed, share, FADE)


def _moments(
    times: Float[np.ndarray, " T"], features: Float[np.ndarray, "T F"], observed: int
) -> Float[np.ndarray, "_ n"]:
    """Rows of the observed features at each lag, then the controlled ones now: as many of every demonstration."""
    curves = []
    for feature in features.T:
        seen = np.isfinite(feature)
        curves.append((times[seen], feature[seen]) if seen.any() else (times[:1], np.zeros(1)))
    now = np.linspace(times[0], times[-1], MOMENTS)
    rows = []
    for speed in SPEEDS:
        at = [np.interp(now - lag * speed, *curve) for lag in LAGS for curve in curves[:observed]]
        rows.append(np.stack(at + [np.interp(now, *curve) for curve in curves[observed:]], axis=1))
    return np.concatenate(rows)
