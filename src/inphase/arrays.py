"""Read-only float arrays: what every value of the library is made of."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def frozen(values: ArrayLike) -> FloatArray:
    """A float64 copy of `values` that cannot be written to."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def freeze(owner: Any, **arrays: ArrayLike) -> None:
    """Set fields of a frozen dataclass to read-only copies; for use in `__post_init__`."""
    for name, values in arrays.items():
        object.__setattr__(owner, name, frozen(values))
