"""How far a new interaction lies from all that the demonstrations explain, learned by leaving each one out.

The residual of the regression (Eq. 2.15) says how well basis functions describe a demonstration that was seen. A new
interaction is no combination of the old ones, and what is left of it stays on one side for a long time. Taken for the
only noise, Eq. 2.15 makes every filter trust its partner far too much (DESIGN 4, trap 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from inphase.basis import Layout
from inphase.noise import Noise
from inphase.training.noise import SMALLEST_STD, correlation_time

GRID = 200  # phases at which curves are compared
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
    seen: Bool[np.ndarray, "N F"] | None = None,
) -> HeldOut:
    """How each demonstration differs from what the others make of its observed partner.

    shown: (F,) 1 for the features of the observed partner, 0 for those of the controlled one, which are explained by
    what the observed ones say. duration: of a typical interaction [s]. seen: (N, F) whether a demonstration has the
    feature at all; curves that stand in for one prove nothing.
    """
    grid = (np.arange(GRID) + 0.5) / GRID
    curves = np.stack([layout.predict(grid, w) for w in weights])
    var = np.maximum(curves.var(0).mean(0), SMALLEST_STD**2)
    hidden, spread_var = shown == 0, var
    known = np.ones(curves.shape) if seen is None else np.broadcast_to(seen[:, None, :], curves.shape).astype(float)
    for _ in range(ROUNDS):
        target, explained = _by_the_others(curves, shown, var)
        # The factor that makes the explanation of the hidden features fit best, all demonstrations together.
        said, true = (explained * known)[..., hidden], target[..., hidden]
        agreed = float((said * true / spread_var[hidden]).sum())
        trust = float(np.clip(agreed / max(float((said**2 / spread_var[hidden]).sum()), 1e-300), 0.0, 1.0))
        left = target - np.where(hidden, trust, 1.0) * explained
        before, var = var, np.maximum((left**2 * known).sum((0, 1)) / known.sum((0, 1)), SMALLEST_STD**2)
        if (np.abs(var - before) < SETTLED * before).all():
            break
    lasting = np.array([correlation_time(duration * grid, curve) for curve in left])
    return HeldOut(Noise(var, (lasting * known[:, 0]).sum(0) / known[:, 0].sum(0)), trust)


def _by_the_others(
    curves: Float[np.ndarray, "N P F"], shown: Float[np.ndarray, " F"], noise_var: Float[np.ndarray, " F"]
) -> tuple[Float[np.ndarray, "N P F"], Float[np.ndarray, "N P F"]]:
    """Every curve less the others' mean, and the part of it that the others' directions explain.

    The fit is the filters' own at a known phase: unit priors on the directions of the others (Eq. 2.14), and noise
    that is correlated for so long that a whole curve says no more than one reading.
    """
    precision = shown / noise_var / curves.shape[1]
    target, explained = np.empty_like(curves), np.empty_like(curves)
    for i in range(len(curves)):
        others = np.delete(curves, i, axis=0)
        mean = others.mean(0)
        directions = (others - mean) / np.sqrt(max(len(others) - 1, 1))
        flat = directions.reshape(len(others), -1)
        weighted = (directions * precision).reshape(len(others), -1)
        target[i] = curves[i] - mean
        coordinates = np.linalg.solve(weighted @ flat.T + np.eye(len(others)), weighted @ target[i].ravel())
        explained[i] = (coordinates @ flat).reshape(mean.shape)
    return target, explained
