"""How far a new interaction lies from all that the demonstrations explain, learned by leaving each one out.

The residual of the regression (Eq. 2.15) says how well basis functions describe a demonstration that was seen. A new
interaction is no combination of the old ones, and what is left of it stays on one side for a long time. Taken for the
only noise, Eq. 2.15 makes every filter trust its partner far too much (DESIGN 4, trap 5).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from inphase.basis import Layout
from inphase.noise import Noise
from inphase.training.noise import SMALLEST_STD, correlation_time

GRID = 200  # phases at which curves are compared
ROUNDS = 50  # at most: the noise decides how far the others are bent, which decides the noise …
SETTLED = 0.01  # … until it moves by less than this share


def held_out_noise(
    layout: Layout, weights: Float[np.ndarray, "N B"], shown: Float[np.ndarray, " F"], duration: float
) -> Noise:
    """The variance and the correlation time of what is left of each demonstration when the others explain it.

    shown: (F,) 1 for the features of the observed partner, 0 for those of the controlled one, which are explained by
    what the observed ones say. duration: of a typical interaction [s].
    """
    grid = (np.arange(GRID) + 0.5) / GRID
    curves = np.stack([layout.predict(grid, w) for w in weights])
    var = np.maximum(curves.var(0).mean(0), SMALLEST_STD**2)
    for _ in range(ROUNDS):
        left = _left_out(curves, shown, var)
        before, var = var, np.maximum((left**2).mean((0, 1)), SMALLEST_STD**2)
        if (np.abs(var - before) < SETTLED * before).all():
            break
    times = np.mean([correlation_time(duration * grid, curve) for curve in left], axis=0)
    return Noise(var, times)


def _left_out(
    curves: Float[np.ndarray, "N P F"], shown: Float[np.ndarray, " F"], noise_var: Float[np.ndarray, " F"]
) -> Float[np.ndarray, "N P F"]:
    """Every curve less the others' mean and directions, fitted to what is shown of it.

    The fit is the filters' own at a known phase: unit priors on the directions of the others (Eq. 2.14), and noise
    that is correlated for so long that a whole curve says no more than one reading.
    """
    precision = shown / noise_var / curves.shape[1]
    left = np.empty_like(curves)
    for i in range(len(curves)):
        others = np.delete(curves, i, axis=0)
        mean = others.mean(0)
        directions = (others - mean) / np.sqrt(max(len(others) - 1, 1))
        flat = directions.reshape(len(others), -1)
        weighted = (directions * precision).reshape(len(others), -1)
        target = (curves[i] - mean).ravel()
        coordinates = np.linalg.solve(weighted @ flat.T + np.eye(len(others)), weighted @ target)
        left[i] = (target - coordinates @ flat).reshape(mean.shape)
    return left
