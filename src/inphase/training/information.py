"""Mutual information of two quantities, given a third, from as many draws of each: binned, or by nearest neighbours.

Quantities are looked at by their ranks alone, so that neither units nor any monotone scale make a difference. All
answers are in nats; what is independent gives 0 on average, and so does what never changes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int

Estimator: TypeAlias = Callable[
    [Float[np.ndarray, "C N"], Float[np.ndarray, "K N"], Float[np.ndarray, " N"] | None], Float[np.ndarray, "C K"]
]

A_CELL = 3  # draws in a cell of three quantities: so many leave a histogram more signal than bias
NEIGHBOURS = 4  # Kraskov et al. recommend 2 to 4: more smooth, fewer are nearer to the truth
ROUNDING = 1e-12
SEED = 0  # of the order of what is equal


def binned(
    these: Float[np.ndarray, "C N"], those: Float[np.ndarray, "K N"], given: Float[np.ndarray, " N"] | None = None
) -> Float[np.ndarray, "C K"]:
    """(C, K) what each of these says of each of those: I(x; y | z) of histograms.

    Bins hold equally many draws, and are as many as leave three draws to a cell of x, y and z. What a histogram shows
    of quantities that are independent given z, Σ_z (X_z - 1) (Y_z - 1) / 2N on average, is taken off: X_z and Y_z are
    the bins of x and y in which there is anything where z is (the degrees of freedom of the G test). Up to 0.03 nat of
    it stay, where cells are the emptiest.
    """
    count = these.shape[1]
    bins = max(round((count / A_CELL) ** (1 / 3)), 2)
    x, y = _bins(these, bins), _bins(those, bins)
    z = np.zeros(count, dtype=np.int64) if given is None else _bins(given[None], bins)[0]
    left, right = _counted(z * bins + x, bins**2), _counted(z * bins + y, bins**2)
    joint = _counted((z * bins + x)[:, None] * bins + y, bins**3)  # (C, K, cells)
    says = _entropy(left)[:, None] + _entropy(right) - _entropy(joint) - _entropy(_counted(z, bins))
    free_x, free_y = (np.maximum((n.reshape(-1, bins, bins) > 0).sum(2) - 1, 0) for n in (left, right))
    return np.asarray(says - free_x @ free_y.T / (2 * count))


def _bins(values: Float[np.ndarray, "m N"], bins: int) -> Int[np.ndarray, "m N"]:
    """(m, N) which of so many equally full bins each value is in; equal values are in the same."""
    edges = np.quantile(values, np.arange(1, bins) / bins, axis=1)  # (bins - 1, m)
    return np.asarray((values[None] >= edges[:, :, None]).sum(0), dtype=np.int64)


def _counted(codes: Int[np.ndarray, "*m N"], cells: int) -> Int[np.ndarray, "*m cells"]:
    """How often each code from 0 to cells - 1 is in every row."""
    flat = codes.reshape(-1, codes.shape[-1])
    places = (flat + cells * np.arange(len(flat))[:, None]).ravel()
    return np.bincount(places, minlength=cells * len(flat)).reshape(*codes.shape[:-1], cells)


def _entropy(counts: Int[np.ndarray, "*m cells"]) -> Float[np.ndarray, "*m"]:
    """The entropy of histograms, as they are."""
    shares = counts / counts.sum(-1, keepdims=True)
    return np.asarray(-(shares * np.log(np.where(counts > 0, shares, 1.0))).sum(-1))


def neighbours(
    these: Float[np.ndarray, "C N"], those: Float[np.ndarray, "K N"], given: Float[np.ndarray, " N"] | None = None
) -> Float[np.ndarray, "C K"]:
    """(C, K) what each of these says of each of those: I(x; y | z) by the four nearest neighbours.

    Kraskov, Stögbauer and Grassberger 2004, Eq. 8; with z Frenzel and Pompe 2007, Eq. 15. On normal scores, the ranks
    as quantiles of a Gaussian, which no unit changes.
    """
    x, y = _normal_scores(these), _normal_scores(those)
    z = None if given is None else _normal_scores(given[None])[0]
    found = np.zeros((len(these), len(those)))
    for c in np.flatnonzero(np.ptp(these, axis=1) > 0):
        for k in np.flatnonzero(np.ptp(those, axis=1) > 0):
            found[c, k] = _nearby(x[c], y[k], z)
    return found


def _nearby(x: Float[np.ndarray, " N"], y: Float[np.ndarray, " N"], z: Float[np.ndarray, " N"] | None) -> float:
    from scipy.spatial import cKDTree
    from scipy.special import digamma

    count, k = len(x), min(NEIGHBOURS, len(x) - 1)
    third = [] if z is None else [z]
    joint = np.stack([x, y, *third], axis=1)
    distance = cKDTree(joint).query(joint, k + 1, p=np.inf)[0][:, -1]
    within = distance * (1 - ROUNDING)  # nearer, oneself included

    def mean_digamma(*parts: Float[np.ndarray, " N"]) -> float:
        points = np.stack(parts, axis=1)
        near = cKDTree(points).query_ball_point(points, within, p=np.inf, return_length=True)
        return float(digamma(np.maximum(near, 1)).mean())

    alone = float(digamma(count)) if z is None else mean_digamma(z)
    return float(digamma(k)) + alone - mean_digamma(x, *third) - mean_digamma(y, *third)


def _normal_scores(values: Float[np.ndarray, "m N"]) -> Float[np.ndarray, "m N"]:
    """(m, N) quantiles of a Gaussian in the order of the values; equal ones in an order of chance, always the same."""
    from scipy.special import ndtri

    count = values.shape[1]
    chance = np.random.default_rng(SEED).permutation(count)
    order = np.lexsort((np.broadcast_to(chance, values.shape), values), axis=1)
    scores = np.empty(values.shape)
    np.put_along_axis(scores, order, np.broadcast_to(ndtri((np.arange(count) + 0.5) / count), values.shape), axis=1)
    return scores


ESTIMATORS: dict[str, Estimator] = {"binned": binned, "neighbours": neighbours}
