"""One episode as it stands in its file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.errors import DataError, listing


@dataclass(frozen=True, eq=False)
class Table:
    """The columns of one recording, unchecked: times may run backwards and values may be anything.

    name: the file. columns: the names of the D channels, without the time. times: (T,) [s]. values: (T, D), NaN where
    a cell is empty. Both arrays are read-only. Raises DataError where the shapes do not fit.
    """

    name: str
    columns: tuple[str, ...]
    times: Float[np.ndarray, " T"]
    values: Float[np.ndarray, "T D"]

    def __post_init__(self) -> None:
        freeze(self, times=self.times, values=self.values)
        if self.values.shape != (len(self.times), len(self.columns)):
            raise DataError(
                f"{self.name}: expected {len(self.times)} samples of {len(self.columns)} channels, "
                f"got values of shape {self.values.shape}"
            )

    def __len__(self) -> int:
        return len(self.times)

    def pick(self, names: Sequence[str]) -> Float[np.ndarray, "T C"]:
        """(T, C) the values of these channels, in this order; raises DataError for one that is not there."""
        for name in names:
            if name not in self.columns:
                raise DataError(f"{self.name}: no channel {name!r}; the columns are {listing(self.columns)}")
        return self.values[:, [self.columns.index(name) for name in names]]
