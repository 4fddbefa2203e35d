"""Learning a reflex: the demonstrations' features now and a little before, at several speeds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from inphase.reflex import Reflex, kernel, place

LAGS = np.array([0.0, 0.2])  # [s]: where the partner is, and how he came there, within a person's reaction
SPEEDS = (0.5, 1.0, 2.0)  # at which a partner may move: a regression must not take a slow hand for another place
PLACES = 1500  # at most, of all demonstrations: as many as a step has time for
MOMENTS = 25  # at most, of a demonstration at each speed: more of them say the same
CHOOSING = 300  # places by which the kernel is chosen
WIDTHS, TRENDS, RIDGES = (0.5, 1.0), (0.3, 3.0), (0.1, 0.3, 1.0, 3.0, 10.0)
FADE = 0.3  # [s]


def learn_reflex(
    times: Sequence[Float[np.ndarray, " _"]],
    features: Sequence[Float[np.ndarray, "_ F"]],
    observed: int,
    weight: float = 1.0,
) -> Reflex:
    """The reflex of demonstrations: times (T,) [s] and scaled features (T, F), NaN where not seen, one each.

    The kernel and its ridge are those that foretell demonstrations best from the others.
    """
    usual = np.nanmean(np.concatenate(features), axis=0)
    per_demonstration = int(np.clip(PLACES // (len(times) * len(SPEEDS)), 1, MOMENTS))
    parts = [_moments(t, f, observed, usual, per_demonstration) for t, f in zip(times, features, strict=True)]
    of = np.repeat(np.arange(len(parts)), [len(moments) for moments, _ in parts])
    kept = np.unique(np.linspace(0, len(of) - 1, min(PLACES, len(of))).round().astype(np.int64))
    moments, answers = (np.concatenate(part)[kept] for part in zip(*parts, strict=True))
    of = of[kept]
    centre, scale = np.zeros((len(LAGS), observed)), np.ones(len(LAGS))
    raw = place(moments, centre, scale).reshape(len(of), len(LAGS), observed) * np.sqrt(centre.size)
    centre, scale = raw.mean(0), np.maximum(np.sqrt(raw.var(0).mean(1)), 1e-9)
    places, mean = place(moments, centre, scale), answers.mean(0)
    off = answers - mean
    width, trend, ridge = _chosen(places, off, of)
    inverse = _inverse(places, width, trend, ridge)
    return Reflex(
        LAGS,
        centre,
        scale,
        places,
        gains=inverse @ off,
        mean=mean,
        error_var=_held_out(inverse, off, of) ** 2,
        width=width,
        trend=trend,
        weight=weight,
        fade=FADE,
    )


def _moments(
    times: Float[np.ndarray, " T"],
    features: Float[np.ndarray, "T F"],
    observed: int,
    usual: Float[np.ndarray, " F"],
    count: int,
) -> tuple[Float[np.ndarray, "n L Fo"], Float[np.ndarray, "n Fc"]]:
    """The observed features at each lag, and the controlled ones: `count` at each speed, none at one time."""
    curves = []
    for feature, mean in zip(features.T, usual, strict=True):
        seen = np.isfinite(feature)
        curves.append((times[seen], feature[seen]) if seen.any() else (times[:1], np.full(1, mean)))
    moments, answers = [], []
    for k, speed in enumerate(SPEEDS):
        share = (np.arange(count) + (k + 0.5) / len(SPEEDS)) / count
        now = times[0] + share * (times[-1] - times[0])
        at = [[np.interp(now - lag * speed, *curve) for curve in curves[:observed]] for lag in LAGS]
        moments.append(np.moveaxis(np.array(at), 2, 0))
        answers.append(np.stack([np.interp(now, *curve) for curve in curves[observed:]], axis=1))
    return np.concatenate(moments), np.concatenate(answers)


def _chosen(
    places: Float[np.ndarray, "n P"], off: Float[np.ndarray, "n Fc"], of: Int[np.ndarray, " n"]
) -> tuple[float, float, float]:
    """Width, trend and ridge by which demonstrations are foretold best from the others; every feature counts alike."""
    of_each = np.bincount(of).max()
    some = np.flatnonzero(np.arange(len(of)) % of_each % -(-len(of) // CHOOSING) == 0)  # the same of each demonstration
    places, of = places[some], of[some]
    off = off[some] / np.maximum(off.std(0), 1e-9)

    def error(choice: tuple[float, float, float]) -> float:
        return float((_held_out(_inverse(places, *choice), off, of) ** 2).sum())

    return min(((width, trend, ridge) for width in WIDTHS for trend in TRENDS for ridge in RIDGES), key=error)


def _inverse(places: Float[np.ndarray, "n P"], width: float, trend: float, ridge: float) -> Float[np.ndarray, "n n"]:
    inner = places @ places.T
    lengths = inner.diagonal()
    alike = kernel(lengths[:, None] + lengths - 2 * inner, width) + trend * inner
    return np.linalg.inv(alike + ridge * np.eye(len(alike)))


def _held_out(
    inverse: Float[np.ndarray, "n n"], off: Float[np.ndarray, "n Fc"], of: Int[np.ndarray, " n"]
) -> Float[np.ndarray, "n Fc"]:
    """(n, Fc) the error at each place of a regression that has not seen its demonstration.

    Exactly, without learning anew: a part of the data is held out by the inverse of its block of the inverse.
    """
    gains, error = inverse @ off, np.empty_like(off)
    for one in np.unique(of):
        rows = np.flatnonzero(of == one)
        error[rows] = np.linalg.solve(inverse[np.ix_(rows, rows)], gains[rows])
    return error
