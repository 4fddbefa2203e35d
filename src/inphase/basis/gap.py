"""Gaps: stretches of the phase in which a feature was not seen."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

GRID = 100  # phases that are looked at
NEAR = 0.02  # of the phase: a reading speaks for what lies that close


def unseen(
    phases: Float[np.ndarray, " T"], periodic: bool, grid: Float[np.ndarray, " P"] | None = None
) -> Float[np.ndarray, " G"]:
    """(G,) those of a grid, a hundred phases uniform on [0, 1] unless told, that have no reading nearby.

    phases: (T,) where there were readings. Nearby is within 0.02, or two usual steps between readings if those are
    longer; around the circle when `periodic`.
    """
    grid = (np.arange(GRID) + 0.5) / GRID if grid is None else grid
    if not len(phases):
        return grid
    seen = np.sort(phases % 1.0 if periodic else np.clip(phases, 0.0, 1.0))
    near = max(NEAR, 2 * float(np.median(np.diff(seen)))) if len(seen) > 1 else NEAR
    seen = np.concatenate([seen[-1:] - 1, seen, seen[:1] + 1]) if periodic else seen
    after = np.searchsorted(seen, grid)
    distance = np.minimum(
        np.abs(grid - seen[np.maximum(after - 1, 0)]), np.abs(grid - seen[np.minimum(after, len(seen) - 1)])
    )
    return np.asarray(grid[distance > near])
