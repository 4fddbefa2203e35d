"""Any basis for a phase that rolls over from 1 to 0 (4.2.7.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from inphase.basis import Basis


@dataclass(frozen=True)
class Cyclical:
    """The functions of `basis`, begun again at every whole phase; what a movement ends with, it need not begin with."""

    basis: Basis
    periodic: ClassVar[bool] = True

    @property
    def size(self) -> int:
        """How many functions there are."""
        return self.basis.size

    def __call__(self, phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P B"]:
        return self.basis(np.asarray(phases % 1.0))

    def with_derivative(
        self, phases: Float[np.ndarray, "*P"]
    ) -> tuple[Float[np.ndarray, "*P B"], Float[np.ndarray, "*P B"]]:
        return self.basis.with_derivative(np.asarray(phases % 1.0))

    def parameters(self) -> dict[str, Any]:
        return self.basis.parameters()
