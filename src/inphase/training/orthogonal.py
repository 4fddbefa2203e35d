"""Orthogonal least squares: of a dense dictionary of bumps those that, one after the other, explain the most.

Chen, Cowan and Grant, Orthogonal least squares learning algorithm for radial basis function networks, IEEE Transactions
on Neural Networks 2(2), 1991.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.basis import Gaussian

BINS = 500  # of the phase, into which samples are gathered: far finer than the narrowest width
SPACING = 0.25  # of a width, between two centres of the dictionary
CLOSEST = 0.01  # [phase], the least spacing
BEYOND = 2.0  # widths that centres may lie outside the phase
NEWS = 1e-3  # of its square, what must be left of a function less those before it: else weights grow that fit no better
FEWEST = 2  # functions of a Gaussian basis


@dataclass(frozen=True, eq=False)
class Curves:
    """One or more signals a demonstration, gathered into bins of the phase; S signals in all.

    counts: (S, BINS) samples that were seen. sums: (S, BINS) of their readings. power: (S,) of their squares.
    """

    counts: Float[np.ndarray, "S G"]
    sums: Float[np.ndarray, "S G"]
    power: Float[np.ndarray, " S"]

    @classmethod
    def gather(cls, phases: Sequence[Float[np.ndarray, " _"]], values: Sequence[Float[np.ndarray, "_ M"]]) -> Curves:
        """Those of demonstrations: phases (T,), values (T, M), NaN where not seen."""
        everything, signals = np.concatenate(values), values[0].shape[1]
        which = np.repeat(np.arange(len(values)), [len(v) for v in values])
        bins = np.minimum((np.clip(np.concatenate(phases), 0.0, 1.0) * BINS).astype(np.int64), BINS - 1)
        places = (which[:, None] * signals + np.arange(signals)) * BINS + bins[:, None]
        shape, seen = (len(values) * signals, BINS), ~np.isnan(everything)
        at, readings = places[seen], everything[seen]
        counts, sums = (np.bincount(at, w, shape[0] * BINS).reshape(shape) for w in (None, readings))
        power = np.bincount(at // BINS, readings**2, shape[0])
        return cls(counts.astype(np.float64), sums, power)


@dataclass(frozen=True)
class Chosen:
    """A basis of one width, and what it leaves. unexplained: share of the power. bic: by this it stopped, perhaps."""

    centres: tuple[float, ...]
    width: float
    unexplained: float
    bic: float

    @property
    def basis(self) -> Gaussian:
        """As functions of the phase."""
        return Gaussian(len(self.centres), self.width, centres=self.centres)


def choose(curves: Curves, width: float, unexplained: float, by_bic: bool, most: int) -> Chosen:
    """The centres for one width.

    Gram-Schmidt on inner products: of every candidate is kept how long it still is, and how much of the signal lies
    along it, once those that were chosen have been taken out (a pivoted Cholesky factorisation a demonstration).
    """
    grid = (np.arange(BINS) + 0.5) / BINS
    inner = np.arange(-BEYOND * width, 1 + BEYOND * width, max(SPACING * width, CLOSEST))
    centres = inner + (1 - inner[0] - inner[-1]) / 2  # as far beyond one end as beyond the other
    functions = np.exp(-0.5 * ((grid[:, None] - centres) / width) ** 2)
    length, along = curves.counts @ functions**2, curves.sums @ functions
    whole_length = np.maximum(length, np.finfo(float).tiny)
    total, samples, signals = float(curves.power.sum()), float(curves.counts.sum()), len(curves.power)
    left = [1.0]
    criteria = [_bic(1.0, 0, samples, signals)]
    taken: list[int] = []
    factors: list[Float[np.ndarray, "S m"]] = []
    while len(taken) < min(most, len(centres)):
        usable = length > NEWS * whole_length
        gains = np.where(usable, along**2 / np.where(usable, length, 1.0), 0.0)
        ratio = gains.sum(0) / total  # the error reduction ratio (Chen et al., Eq. 19), over all demonstrations
        best = int(ratio.argmax())
        if not ratio[best] > 0:
            break
        column = curves.counts @ (functions * functions[:, best : best + 1])
        column -= sum((factor * factor[:, best : best + 1] for factor in factors), np.zeros_like(column))
        root = np.sqrt(np.where(usable[:, best], length[:, best], np.inf))
        factor = column / root[:, None]
        along = along - factor * (along[:, best] / root)[:, None]
        length = length - factor**2
        length[:, best] = 0.0
        factors.append(factor)
        taken.append(best)
        left.append(max(left[-1] - float(ratio[best]), 0.0))
        criteria.append(_bic(left[-1], len(taken), samples, signals))
        if len(taken) >= FEWEST and left[-1] <= unexplained:
            break
        if len(taken) > FEWEST and by_bic and criteria[-1] > criteria[-2]:
            del taken[-1], left[-1], criteria[-1]
            break
    places = centres[taken].tolist()
    if len(places) < FEWEST:  # a single sample, or so: a neighbour that adds nothing
        places = [*places, places[0] + width][:FEWEST]
    order = sorted(places)
    return Chosen(tuple(order), width, left[-1], criteria[-1])


def _bic(left: float, count: int, samples: float, signals: int) -> float:
    return float(samples * np.log(max(left, np.finfo(float).tiny)) + count * signals * np.log(samples))
