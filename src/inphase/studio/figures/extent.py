"""How far an axis goes: as far as what is drawn, and somewhere where nothing is."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from bokeh.models import Range1d

MARGIN = 0.05  # of the extent, on either side


def extent(values: Iterable[np.ndarray], margin: float = MARGIN) -> Range1d:
    """A range that holds all finite values; 0 to 1 where there are none."""
    finite = [array[np.isfinite(array)] for array in values]
    some = [array for array in finite if len(array)]
    if not some:
        return Range1d(start=0, end=1)
    low, high = float(min(map(np.min, some))), float(max(map(np.max, some)))
    wide = high - low if high > low else max(abs(high), 1.0)
    return Range1d(start=low - margin * wide, end=high + margin * wide)
