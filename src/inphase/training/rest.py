"""The rest of a channel: the level it holds the longest, and how much it trembles there."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

HALF_INSIDE = 2 * 0.6744898  # standard deviations: the stretch that holds half of a Gaussian


def rest(readings: Float[np.ndarray, " n"]) -> tuple[float, float]:
    """The level of rest and the standard deviation of the noise there, in the unit of the readings; NaN is passed over.

    Of the shortest stretch that holds half of all readings (Rousseeuw's shorth) the middle is the level, and the
    length tells the noise: what the other half does, a contact say, makes no difference. A channel that moves for more
    than half of the time has no such rest; it gets the level near which it stays the longest, and a wide noise.
    Raises ValueError where there is no reading.
    """
    ordered = np.sort(readings[~np.isnan(readings)])
    if not len(ordered):
        raise ValueError("expected readings, got none")
    half = len(ordered) // 2 + 1
    lengths = ordered[half - 1 :] - ordered[: len(ordered) - half + 1]
    first = int(lengths.argmin())
    return float(ordered[first : first + half].mean()), float(lengths[first] / HALF_INSIDE)
