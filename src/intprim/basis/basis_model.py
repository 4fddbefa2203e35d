"""What all basis models of IntPrim offer: fitting, applying and plotting weights (4.2.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from inphase import DataError, OptionError
from inphase.basis import Basis, Layout

Numbers = ArrayLike | float | int  # as ArrayLike means it: some who check types tell 1 from 1.0 and a complex
Functions = Callable[[Any], Any]  # of the phases (T,): (T, degree)
_DOMAIN = np.linspace(0.0, 1.0, 100)  # what the plots show


class BasisModel:
    """One basis a degree of freedom, over `inphase.basis.Layout`; the weights are DoF after DoF.

    layout: what `inphase` knows this model as; old_bases: the functions that the library of chapter 4 had instead.
    `_degree` is how many functions a DoF has; of a mixture, all of them. Outside [0, 1] a movement stands still, as in
    `inphase`. Raises OptionError where names and bases do not fit.
    """

    def __init__(self, bases: Sequence[Basis], old_bases: Sequence[Functions], observed_dof_names: ArrayLike) -> None:
        self.layout, self._old_bases = Layout(tuple(bases)), tuple(old_bases)
        self.observed_dof_names: list[str] = names_of(observed_dof_names, "observed_dof_names").tolist()
        self.num_observed_dof = self._num_blocks = self.layout.count
        self._degree = self.layout.size

    def fit_basis_functions_linear_closed_form(self, x: Numbers, y: ArrayLike) -> Float[np.ndarray, " B"]:
        """(B,) the weights that fit a trajectory best: plain least squares, as in 2.3.1.

        x: (T,) the phases; y: (T, D) the trajectory, time first, or (T,) of a single DoF. Raises DataError otherwise.
        """
        phases, values = phases_of(x, ndim=1), np.asarray(y, dtype=np.float64)
        values = values[:, None] if values.ndim == 1 else values
        if values.shape != (len(phases), self.num_observed_dof):
            raise DataError(f"y: expected (T, D) = ({len(phases)}, {self.num_observed_dof}), got {values.shape}")
        if not np.isfinite(values).all():
            raise DataError("y: expected finite values, got NaN or infinity")
        alike: dict[Basis, list[int]] = {}
        for dof, basis in enumerate(self.layout.bases):
            alike.setdefault(basis, []).append(dof)
        weights = np.empty(self.layout.size)
        for basis, dofs in alike.items():
            solution = np.linalg.lstsq(basis(phases), values[:, dofs], rcond=None)[0]
            weights[self.observed_to_state_indices(dofs)] = solution.T.ravel()
        return weights

    def apply_coefficients(
        self, x: Numbers, coefficients: Numbers, deriv: bool = False
    ) -> Float[np.ndarray, " D"] | Float[np.ndarray, "D T"]:
        """(D,) what the DoFs read at a phase, or (D, T) at T of them; `deriv` gives the slopes instead.

        x: a phase or (T,); coefficients: the B weights, in any shape. Raises DataError for others.
        """
        phases, weights = phases_of(x), np.asarray(coefficients, dtype=np.float64).ravel()
        if len(weights) != self.layout.size:
            raise DataError(f"coefficients: expected {self.layout.size} weights, got {np.shape(coefficients)}")
        read = self.layout.slope if deriv else self.layout.predict
        return np.asarray(read(np.atleast_1d(phases), weights).T.reshape(-1, *phases.shape))

    def get_block_diagonal_basis_matrix(self, x: Numbers) -> Float[np.ndarray, "B D"]:
        """(B, D) the functions of every DoF at a phase, in a column of its own: y = matrixᵀ w."""
        return self.layout.project(float(phases_of(x, ndim=0)), np.eye(self.layout.size))

    def observed_to_state_indices(self, observed_indices: Numbers) -> Int[np.ndarray, " _"]:
        """(m,) where the weights of some DoFs are; raises OptionError for a DoF that does not exist."""
        wanted = dofs_of(observed_indices, self.num_observed_dof, "observed_indices")
        places = [np.arange(self.layout.size)[self.layout.slices[dof]] for dof in wanted]
        return np.concatenate([np.empty(0, dtype=np.int64), *places])

    def convert_old_weights(self, weights: Numbers) -> Float[np.ndarray, "N B"]:
        """(N, B) the weights that move as the given ones (N, B) did in the library of chapter 4, by least squares.

        There, the centres that no `end_phase` was named for ended at 1.01, and polynomials were powers of 2φ - 1. It is
        exact for polynomials and where an `end_phase` is named, otherwise to about a thousandth of the movement.
        Raises DataError for another number of weights.
        """
        given, grid = np.atleast_2d(np.asarray(weights, dtype=np.float64)), np.linspace(0.0, 1.0, 200)
        if given.ndim != 2 or given.shape[1] != self.layout.size:
            raise DataError(f"weights: expected (N, {self.layout.size}), got {given.shape}")
        converted = np.empty_like(given)
        for basis, old, own in zip(self.layout.bases, self._old_bases, self.layout.slices, strict=True):
            converted[:, own] = np.linalg.lstsq(basis(grid), old(grid) @ given[:, own].T, rcond=None)[0].T
        return converted


class SharedBasisModel(BasisModel):
    """A model whose DoFs all have the same basis.

    scale: the width as IntPrim counts it, None where there is none. Raises OptionError without DoF names.
    """

    def __init__(self, basis: Basis, old_basis: Functions, scale: float | None, observed_dof_names: ArrayLike) -> None:
        count = len(names_of(observed_dof_names, "observed_dof_names"))
        super().__init__([basis] * count, [old_basis] * count, observed_dof_names)
        self.basis, self.scale, self._degree = basis, scale, basis.size

    def get_basis_functions(self, x: Numbers) -> Float[np.ndarray, " Bd"] | Float[np.ndarray, "Bd T"]:
        """(degree,) the values of the functions at a phase, or (degree, T) at T of them."""
        return self.basis(phases_of(x)).T

    def get_basis_function_derivatives(self, x: Numbers) -> Float[np.ndarray, " Bd"] | Float[np.ndarray, "Bd T"]:
        """(degree,) the slopes of the functions at a phase, or (degree, T) at T of them."""
        return self.basis.with_derivative(phases_of(x))[1].T

    def plot(self) -> None:
        """Show the functions over the phase."""
        _show("Basis Functions", self.basis(_DOMAIN), block=False)

    def plot_derivative(self) -> None:
        """Show the slopes of the functions over the phase."""
        _show("Basis Function Derivatives", self.basis.with_derivative(_DOMAIN)[1])

    def plot_weighted(self, coefficients: Numbers, coefficient_names: ArrayLike) -> None:
        """Show the functions times their weights (D, degree), a figure for every DoF; DataError for another shape."""
        weights, names = np.asarray(coefficients, dtype=np.float64), names_of(coefficient_names, "coefficient_names")
        wanted = (len(names), self._degree)
        if weights.shape != wanted:
            raise DataError(f"coefficients: expected (D, degree) = {wanted}, got {weights.shape}")
        for name, own in zip(names, weights, strict=True):
            _show(f"Basis Functions For Dimension {name}", self.basis(_DOMAIN) * own)


def names_of(names: ArrayLike, argument: str) -> np.ndarray:
    """(D,) the names of DoFs; raises OptionError for none, or what is no list of them."""
    array = np.asarray(names)
    if array.ndim != 1 or not len(array):
        raise OptionError(f"{argument}: expected a name for every DoF, got {names!r}")
    return array


def phases_of(x: Numbers, ndim: int | None = None) -> Float[np.ndarray, "*T"]:
    """Finite phases () or (T,), or of `ndim` dimensions only; raises DataError for others."""
    phases = np.asarray(x, dtype=np.float64)
    wanted = {None: "a phase or (T,) phases", 0: "a phase", 1: "(T,) phases"}[ndim]
    if phases.ndim > 1 or (ndim is not None and phases.ndim != ndim) or not np.isfinite(phases).all():
        raise DataError(f"x: expected {wanted}, all finite, got shape {phases.shape}")
    return phases


def dofs_of(indices: Numbers, count: int, name: str) -> Int[np.ndarray, " M"]:
    """(M,) indices of DoFs, one or several given; raises OptionError for one that does not exist."""
    wanted = np.atleast_1d(np.asarray(indices))
    if wanted.ndim > 1 or wanted.dtype.kind not in "iuf" or not np.isin(wanted, np.arange(count)).all():
        raise OptionError(f"{name}: expected indices of DoFs from 0 to {count - 1}, got {np.asarray(indices).tolist()}")
    return wanted.astype(np.int64)


def _show(title: str, curves: Float[np.ndarray, "T Bd"], block: bool = True) -> None:
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots()
    axes.plot(_DOMAIN, curves)
    figure.suptitle(title)
    plt.show(block=block)
