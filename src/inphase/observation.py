"""One sample, ready for a filter: what was seen, what it read, how noisy it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, eq=False)
class Observation:
    """The rows of one sample that were seen; the others do not exist for a filter (DESIGN 4, trap 1).

    features: (M,) which features of the layout, increasing. values: (M,) their scaled readings.
    noise_var: (M,) the variance of each reading, the diagonal of R in Eq. 2.7.
    """

    features: Int[np.ndarray, " M"]
    values: Float[np.ndarray, " M"]
    noise_var: Float[np.ndarray, " M"]

    def __len__(self) -> int:
        return len(self.features)


NOTHING = Observation(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))
