"""What all basis models of IntPrim offer: fitting, applying and plotting weights (4.2.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from inphase import DataError
from inphase.basis import Basis, Layout
from intprim.checks import Numbers, dofs_of, names_of, numbers
from intprim.util.visualization import plot_functions

Functions = Callable[[Any], Any]  # of phases (T,): (T, degree)


class BasisModel:
    """One basis a degree of freedom, over `inphase.basis.Layout`; the weights are DoF after DoF.

    layout: what `inphase` knows this model as. old_bases: the functions of the library of chapter 4, where they were
    others. Outside [0, 1] a movement stands still. Raises OptionError where names and bases do not fit.
    """

    def __init__(self, bases: Sequence[Basis], old_bases: Sequence[Functions], observed_dof_names: ArrayLike) -> None:
        self.layout, self._old_bases = Layout(tuple(bases)), tuple(old_bases)
        self.observed_dof_names = names_of(observed_dof_names, "observed_dof_names")
        self.num_observed_dof, self._degree = self.layout.count, self.layout.size

    def fit_basis_functions_linear_closed_form(self, x: Numbers, y: ArrayLike) -> Float[np.ndarray, " B"]:
        """(B,) the weights of plain least squares (2.3.1), for phases x (T,) and values y (T, D), or (T,) of one DoF.

        Raises DataError.
        """
        phases = numbers("x", x, "T")
        values = np.asarray(y)[:, None] if np.ndim(y) == 1 else y
        values = numbers("y", values, "T D", T=len(phases), D=self.num_observed_dof)
        weights = np.empty(self.layout.size)
        for basis in set(self.layout.bases):
            dofs = [dof for dof, other in enumerate(self.layout.bases) if other == basis]
            solution = np.linalg.lstsq(basis(phases), values[:, dofs], rcond=None)[0]
            weights[self.observed_to_state_indices(dofs)] = solution.T.ravel()
        return weights

    def apply_coefficients(
        self, x: Numbers, coefficients: Numbers, deriv: bool = False
    ) -> Float[np.ndarray, " D"] | Float[np.ndarray, "D T"]:
        """(D,) what the DoFs read at a phase, or (D, T) at T of them, for B weights in any shape; `deriv`: the slopes.

        Raises DataError for other weights or phases.
        """
        weights = numbers("coefficients", np.ravel(coefficients), "B", B=self.layout.size)
        phases = _phases(x)
        read = self.layout.slope if deriv else self.layout.predict
        return np.asarray(read(np.atleast_1d(phases), weights).T.reshape(-1, *phases.shape))

    def get_block_diagonal_basis_matrix(self, x: float | int) -> Float[np.ndarray, "B D"]:
        """(B, D) the functions of every DoF at a phase, in a column of its own: y = matrixᵀ w."""
        return self.layout.project(float(numbers("x", x, "")), np.eye(self.layout.size))

    def observed_to_state_indices(self, observed_indices: Numbers) -> Int[np.ndarray, " _"]:
        """(m,) where the weights of some DoFs are; raises OptionError for a DoF that does not exist."""
        places, wanted = np.arange(self.layout.size), dofs_of(observed_indices, self.layout.count, "observed_indices")
        return np.concatenate([places[:0], *(places[self.layout.slices[dof]] for dof in wanted)])

    def convert_old_weights(self, weights: Numbers) -> Float[np.ndarray, "N B"]:
        """(N, B) the weights that move as the given ones (N, B) did in the library of chapter 4, by least squares.

        Exact for polynomials and where an `end_phase` is named, otherwise to about a thousandth of the movement.
        """
        given, grid = numbers("weights", weights, "N B", B=self.layout.size), np.linspace(0.0, 1.0, 200)
        converted = np.empty_like(given)
        for basis, old, own in zip(self.layout.bases, self._old_bases, self.layout.slices, strict=True):
            converted[:, own] = np.linalg.lstsq(basis(grid), old(grid) @ given[:, own].T, rcond=None)[0].T
        return converted


class SharedBasisModel(BasisModel):
    """A model whose DoFs all have the same basis. scale: its width as IntPrim counts it, None where there is none."""

    def __init__(self, basis: Basis, old_basis: Functions, scale: float | None, observed_dof_names: ArrayLike) -> None:
        count = len(names_of(observed_dof_names, "observed_dof_names"))
        super().__init__([basis] * count, [old_basis] * count, observed_dof_names)
        self.basis, self.scale, self._degree = basis, scale, basis.size

    def get_basis_functions(self, x: Numbers) -> Float[np.ndarray, " Bd"] | Float[np.ndarray, "Bd T"]:
        """(degree,) the values of the functions at a phase, or (degree, T) at T of them."""
        return self.basis(_phases(x)).T

    def get_basis_function_derivatives(self, x: Numbers) -> Float[np.ndarray, " Bd"] | Float[np.ndarray, "Bd T"]:
        """(degree,) the slopes of the functions at a phase, or (degree, T) at T of them."""
        return self.basis.with_derivative(_phases(x))[1].T

    def plot(self) -> Any:
        """Show the functions over the phase."""
        return plot_functions("Basis Functions", self.basis)

    def plot_derivative(self) -> Any:
        """Show the slopes of the functions over the phase."""
        return plot_functions("Basis Function Derivatives", lambda phases: self.basis.with_derivative(phases)[1])

    def plot_weighted(self, coefficients: Numbers, coefficient_names: ArrayLike) -> None:
        """Show the functions times their weights (D, degree), a figure for every DoF; DataError for another shape."""
        names = names_of(coefficient_names, "coefficient_names")
        weights = numbers("coefficients", coefficients, "D degree", D=len(names), degree=self._degree)
        for name, own in zip(names, weights, strict=True):
            plot_functions(f"Basis Functions For Dimension {name}", self.basis, own)


def _phases(x: Numbers) -> Float[np.ndarray, "*T"]:
    phases = np.asarray(x, dtype=np.float64)
    if phases.ndim > 1 or not np.isfinite(phases).all():
        raise DataError(f"x: expected a phase or (T,) phases, all finite, got shape {phases.shape}")
    return phases
