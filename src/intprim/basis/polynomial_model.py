"""Polynomial basis functions (4.2.1)."""

from __future__ import annotations

from functools import partial

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import OptionError
from inphase.basis import Polynomial
from intprim.basis.basis_model import SharedBasisModel


class PolynomialModel(SharedBasisModel):
    """`degree` polynomials, up to φ to the power of degree - 1; they have no scale.

    Those of Bernstein: they fit the same as powers of the phase and are far better conditioned; for weights that the
    library of chapter 4 saved, see `convert_old_weights`. The phases are taken, as there, so that all models are made
    alike, and make no difference. Raises OptionError for a degree below 1.
    """

    def __init__(
        self,
        degree: int,
        observed_dof_names: ArrayLike,
        start_phase: float = 0.0,
        end_phase: float | None = None,
    ) -> None:
        if isinstance(degree, bool) or degree != int(degree) or degree < 1:
            raise OptionError(f"degree: expected a whole number from 1, got {degree!r}")
        super().__init__(Polynomial(int(degree) - 1), partial(_powers, count=int(degree)), None, observed_dof_names)


def _powers(phases: Float[np.ndarray, " T"], count: int) -> Float[np.ndarray, "T Bd"]:
    return np.vander(2 * phases - 1, count, increasing=True)
