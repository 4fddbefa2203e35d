"""The families of basis functions: Gaussians, logistic steps, polynomials, and several of them for different DoFs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inphase import OptionError
from inphase.basis import Basis, Gaussian, Polynomial, Sigmoid
from intprim.basis.basis_model import BasisModel, SharedBasisModel


class _PlacedModel(SharedBasisModel):
    """Functions with a width, their centres uniform from one phase to another."""

    family: Callable[[int, float, Any], Basis]

    def __init__(
        self,
        degree: int,
        scale: float,
        observed_dof_names: ArrayLike,
        start_phase: float = 0.0,
        end_phase: float | None = None,
    ) -> None:
        end, old_end = (1.0, 1.01) if end_phase is None else (end_phase, end_phase)
        if not isinstance(degree, (int, np.integer)) or degree < 2:
            raise OptionError(f"degree: expected a whole number from 2, got {degree!r}")
        if isinstance(scale, bool) or not 0 < scale < math.inf:
            raise OptionError(f"scale: expected a positive number, got {scale!r}")
        if not -math.inf < start_phase < end < math.inf:
            raise OptionError(f"expected start_phase < end_phase, got {start_phase!r} and {end!r}")
        self.centers = np.linspace(start_phase, end, degree)
        old_centers = np.linspace(start_phase, old_end, degree)
        basis, old_basis = (self.family(degree, scale, at.tolist()) for at in (self.centers, old_centers))
        super().__init__(basis, old_basis, float(scale), observed_dof_names)


class GaussianModel(_PlacedModel):
    """`degree` Gaussians exp(-(φ - c)² / (2 scale)), their centres c uniform from `start_phase` to `end_phase`.

    scale: the variance [phase²]. end_phase: 1.0 where none is given, as in the text of chapter 4; its library took
    1.01, so that the weights it saved are for other functions. Raises OptionError.
    """

    @staticmethod
    def family(degree: int, scale: float, centers: Sequence[float]) -> Basis:
        """The functions of `inphase`, which counts the standard deviation."""
        return Gaussian(degree, math.sqrt(scale), centres=centers)


class SigmoidalModel(_PlacedModel):
    """`degree` steps 1 / (1 + exp(-(φ - c) / scale)), their centres c uniform from `start_phase` to `end_phase`.

    scale: the width of a step [phase]. end_phase: 1.0 where none is given, see `GaussianModel`. Raises OptionError.
    """

    family = Sigmoid


class PolynomialModel(SharedBasisModel):
    """`degree` polynomials, up to φ to the power of degree - 1; they have no scale.

    Those of Bernstein: they fit the same as powers of the phase and are far better conditioned. The phases are taken so
    that all models are made alike, and make no difference. Raises OptionError for a degree below 1.
    """

    def __init__(
        self, degree: int, observed_dof_names: ArrayLike, start_phase: float = 0.0, end_phase: float | None = None
    ) -> None:
        if not isinstance(degree, (int, np.integer)) or degree < 1:
            raise OptionError(f"degree: expected a whole number from 1, got {degree!r}")
        self.powers = np.arange(degree)
        super().__init__(Polynomial(degree - 1), self._old_functions, None, observed_dof_names)

    def _old_functions(self, phases: Any) -> Any:
        return (2 * phases[:, None] - 1) ** self.powers


class MixtureModel(BasisModel):
    """The DoFs of the models in their order, each with its own basis. Not a mixture of densities."""

    def __init__(self, basis_models: Sequence[BasisModel]) -> None:
        kinds = [type(model).__name__ for model in basis_models if not isinstance(model, SharedBasisModel)]
        if kinds or not len(basis_models):
            got = f"a {kinds[0]}" if kinds else "none"
            raise OptionError(f"basis_models: expected Gaussian-, Sigmoidal- or PolynomialModels, got {got}")
        self.basis_models = list(basis_models)
        super().__init__(
            [basis for model in self.basis_models for basis in model.layout.bases],
            [basis for model in self.basis_models for basis in model._old_bases],
            [name for model in self.basis_models for name in model.observed_dof_names],
        )
