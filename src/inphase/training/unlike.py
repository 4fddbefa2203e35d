"""Which demonstrations are unlike the others, and where: a test with a stated error rate, and names for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.training.likelihood import one_left_out

ERROR_RATE = 0.05  # of data sets with nothing wrong in them, at most: those in which something is marked
DRAWN_RATE = 0.01  # of drawn data sets: with variances estimated from few, and a shrinkage chosen, it is more in others
DRAWS = 400  # data sets of …
LARGEST = 100  # … demonstrations at most: the tails hardly change beyond
NORMAL = 1.4826  # times the median absolute deviation: the standard deviation of a Gaussian
SHARE = 0.5  # of the largest deviation: what is named beside it, and where a stretch ends
NAMED = 3  # channels at most
LATEST = 0.3  # of the phase: how much earlier or later than the others is looked at …
EXPLAINED = 0.5  # … and the share of the squared deviation that it has to explain


@dataclass(frozen=True)
class Unlike:
    """A feature that is unlike that of the others, between two phases.

    deviation: at the phase `at`, in standard deviations of the others.
    """

    feature: str
    start: float
    end: float
    at: float
    deviation: float

    def __str__(self) -> str:
        return f"{self.feature} around phase {self.at:.2g}"


def threshold(variances: Float[np.ndarray, " N"], shrinkage: float, readings: int) -> float:
    """The score that the highest of N demonstrations that are all alike exceeds in 1 of 20 data sets at most.

    How far the tails of a leave-one-out distance reach depends on how many demonstrations there are, in how many
    directions they differ and how much of that is shrunk. So as many Gaussian ones with the same `variances` are drawn,
    many times over, and left out in the same way. The draws are always the same.
    """
    count = min(len(variances), LARGEST)
    draws = np.random.default_rng(0).standard_normal((DRAWS, count, count)) * np.sqrt(variances[:count])
    draws -= draws.mean(axis=1, keepdims=True)
    squares, _ = one_left_out(draws @ draws.swapaxes(1, 2), (1 - shrinkage) / (count - 2))
    drawn = scores(np.sqrt(squares / readings), readings)
    return float(np.quantile(drawn, 1 - DRAWN_RATE / len(variances)))


def scores(distance: Float[np.ndarray, "*S N"], readings: int) -> Float[np.ndarray, "*S N"]:
    """(N,) how many robust standard deviations each squared distance lies above the median of all.

    It is the one part of the log-likelihood that grows without end. Median and median absolute deviation stay what they
    are when a few demonstrations are bad. The spread is taken for no less than that of `readings` independent ones:
    where demonstrations hardly differ, any would be far off otherwise.
    """
    squares = distance**2
    usual = np.median(squares, axis=-1, keepdims=True)
    spread = NORMAL * np.median(np.abs(squares - usual), axis=-1, keepdims=True)
    least = np.maximum(usual * np.sqrt(2 / readings), np.finfo(float).tiny)
    return np.asarray((squares - usual) / np.maximum(spread, least))


def where_unlike(
    features: Sequence[str], phases: Float[np.ndarray, " P"], deviations: Float[np.ndarray, "P F"]
) -> tuple[Unlike, ...]:
    """The features that deviate most, the furthest first, and the stretch of phase in which each does."""
    sizes = np.sqrt((deviations**2).mean(axis=0))
    found = []
    for f in np.argsort(-sizes, kind="stable")[:NAMED]:
        if sizes[f] < SHARE * sizes.max():
            break
        off = np.abs(deviations[:, f])
        peak = int(np.argmax(off))
        less = np.flatnonzero(off < SHARE * off[peak])
        first = max((int(i) + 1 for i in less if i < peak), default=0)
        last = min((int(i) - 1 for i in less if i > peak), default=len(off) - 1)
        half = (phases[1] - phases[0]) / 2
        # A stretch of even deviation has its peak anywhere: what is named is its middle, weighed by the deviation.
        at = float(np.average(phases[first : last + 1], weights=off[first : last + 1] ** 2))
        stretch = float(phases[first] - half), float(phases[last] + half)
        found.append(Unlike(features[f], *stretch, at, float(deviations[peak, f])))
    return tuple(found)


def lateness(
    curve: Float[np.ndarray, "P F"], mean: Float[np.ndarray, "P F"], std: Float[np.ndarray, "P F"]
) -> float | None:
    """By how much of the phase a curve comes later than the mean of the others, negative if it is earlier.

    None where coming later, or earlier, explains less than half of the squared deviation.
    """
    points = len(curve)
    steps = np.arange(-round(LATEST * points), round(LATEST * points) + 1)
    at = np.clip(np.arange(points) - steps[:, None], 0, points - 1)
    left = (((curve - mean[at]) / std) ** 2).sum(axis=(1, 2))
    best = int(np.argmin(left))
    if steps[best] == 0 or left[best] > (1 - EXPLAINED) * left[steps == 0][0]:
        return None
    return float(steps[best] / points)
