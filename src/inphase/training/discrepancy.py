"""How far a new interaction lies from all that the demonstrations explain, learned by leaving each one out.

The residual of the regression (Eq. 2.15) says how well basis functions describe a demonstration that was seen. A new
interaction is no combination of the old ones, and what is left of it stays on one side for a long time. Taken for the
only noise, Eq. 2.15 makes every filter trust its partner far too much (DESIGN 4, trap 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from inphase.arrays import frozen
from inphase.basis import Layout
from inphase.basis.gap import unseen
from inphase.noise import Noise
from inphase.training.noise import SMALLEST_STD, correlation_time

GRID = 200  # phases at which curves are compared
GRID_PHASES = frozen((np.arange(GRID) + 0.5) / GRID)
ROUNDS = 50  # at most: the noise decides how far the others are bent, which decides the noise …
SETTLED = 0.01  # … until it moves by less than this share


@dataclass(frozen=True, eq=False)
class HeldOut:
    """What leaving each demonstration out tells: the noise of new interactions, and the trust their partners deserve.

    trust: 0 … 1, the share of what the observed partner says of the controlled one that turns out to be so.
    """

    noise: Noise
    trust: float


def leave_one_out(
    layout: Layout,
    weights: Float[np.ndarray, "N B"],
    shown: Float[np.ndarray, " F"],
    duration: float,
    seen: Bool[np.ndarray, "N P F"] | None = None,
) -> HeldOut:
    """How each demonstration differs from what the others make of its observed partner.

    shown: (F,) 1 for the features of the observed partner, 0 for those of the controlled one, which are explained by
    what the observed ones say. duration: of a typical interaction [s]. seen: whether a demonstration had readings of
    the feature around each phase of `GRID_PHASES`; curves that stand in for readings prove nothing.
    """
    curves = np.stack([layout.predict(GRID_PHASES, w) for w in weights])
    known = np.ones(curves.shape, dtype=bool) if seen is None else seen
    count = np.maximum(known.sum((0, 1)), 1)
    off = (curves - (curves * known).sum(0) / np.maximum(known.sum(0), 1)) * known
    var = np.maximum((off**2).sum((0, 1)) / count, SMALLEST_STD**2)
    hidden, spread_var = shown == 0, var
    for _ in range(ROUNDS):
        target, explained = _by_the_others(curves, shown, var, known)
        # The factor that makes the explanation of the hidden features fit best, all demonstrations together.
        said, true = (explained * known)[..., hidden], target[..., hidden]
        agreed = float((said * true / spread_var[hidden]).sum())
        trust = float(np.clip(agreed / max(float((said**2 / spread_var[hidden]).sum()), 1e-300), 0.0, 1.0))
        left = target - np.where(hidden, trust, 1.0) * explained
        before, var = var, np.maximum((left**2 * known).sum((0, 1)) / count, SMALLEST_STD**2)
        if (np.abs(var - before) < SETTLED * before).all():
            break
    times = duration * GRID_PHASES
    lasting = np.array(
        [correlation_time(times, np.where(k, curve, np.nan)) for k, curve in zip(known, left, strict=True)]
    )
    whole = np.maximum((~np.isnan(lasting)).sum(0), 1)
    return HeldOut(Noise(var, np.nansum(lasting, 0) / whole), trust)


def seen_around(
    phases: Sequence[Float[np.ndarray, " _"]], values: Sequence[Float[np.ndarray, "_ F"]], periodic: bool
) -> Bool[np.ndarray, "N P F"]:
    """(N, P, F) whether each demonstration has readings of a feature around each phase of `GRID_PHASES`."""
    found = np.ones((len(values), GRID, values[0].shape[1]), dtype=bool)
    for around, p, v in zip(found, phases, values, strict=True):
        missing = np.isnan(v)
        for feature in np.flatnonzero(missing.any(0)):
            around[:, feature] = ~np.isin(GRID_PHASES, unseen(p[~missing[:, feature]], periodic, GRID_PHASES))
    return found


def _by_the_others(
    curves: Float[np.ndarray, "N P F"],
    shown: Float[np.ndarray, " F"],
    noise_var: Float[np.ndarray, " F"],
    known: Bool[np.ndarray, "N P F"],
) -> tuple[Float[np.ndarray, "N P F"], Float[np.ndarray, "N P F"]]:
    """Every curve less the others' mean, and the part of it that the others' directions explain.

    The fit is the filters' own at a known phase: unit priors on the directions of the others (Eq. 2.14), and noise
    that is correlated for so long that a whole curve says no more than one reading. All of it is in products of one
    curve with another, which are taken once for what most saw; where a demonstration saw more or less is added to them.
    """
    count, size = len(curves), max(len(curves) - 2, 1)
    flat = (curves - curves.mean(0)).reshape(count, -1)
    precision = np.broadcast_to(shown / noise_var / curves.shape[1], curves.shape[1:]).ravel()
    usual = known.mean(0).ravel() > 0.5
    products = (flat * (precision * usual)) @ flat.T
    shares = np.zeros((count, count))  # of every curve in the explanation of another
    for i in range(count):
        others = np.arange(count) != i
        more = known[i].ravel().astype(np.float64) - usual
        unlike = np.flatnonzero(more * precision)
        own = products + (flat[:, unlike] * (more * precision)[unlike]) @ flat[:, unlike].T
        among, towards = own[np.ix_(others, others)], own[others, i]
        mean = among.mean(0)
        towards = towards - mean - towards.mean() + mean.mean()  # of deviations from the others' mean
        among = (among - mean - mean[:, None] + mean.mean()) / size
        coordinates = np.linalg.solve(among + np.eye(count - 1), towards) / size
        shares[i, others] = coordinates - coordinates.mean()
    target = count / max(count - 1, 1) * flat  # less the mean of the others: the mean of all is zero
    return target.reshape(curves.shape), (shares @ flat).reshape(curves.shape)
