"""A primitive: demonstrations become basis weights, and a filter turns what is observed into a response (4.2.5-8)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, SupportsFloat

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import DataError, ModelFileError, OptionError, Scaling
from inphase.io import read_bip, whole_file
from intprim.basis.basis_model import BasisModel
from intprim.basis.selection import group_scaling
from intprim.checks import numbers
from intprim.constants import DEFAULT_NUM_SAMPLES


class BayesianInteractionPrimitive:
    """Basis weights of demonstrations, the scaling they were made with, and a filter.

    basis_weights: (N, B). scaling_groups: lists of DoFs that are scaled together, so that the lowest value becomes 0
    and the highest 1; a DoF in no group stays as it is. Trajectories are (D, T). Raises OptionError for groups of DoFs
    that do not exist.
    """

    def __init__(self, basis_model: BasisModel, scaling_groups: Sequence[Sequence[int]] | None = None) -> None:
        self.basis_model, self.scaling_groups = basis_model, scaling_groups
        self.filter: Any = None
        self.basis_weights = np.empty((0, basis_model.layout.size))
        self._range = np.empty((basis_model.num_observed_dof, 0))  # the lowest and the highest value, once known
        self.scaling = group_scaling(scaling_groups, self._range)

    def compute_standardization(self, trajectory: ArrayLike) -> None:
        """Widen the scaling by a demonstration (D, T); all of them, before the first is added (4.2.5).

        Raises OptionError after that, DataError and TypeError for what is no such matrix.
        """
        seen = np.concatenate([self._range, self._trajectory(trajectory)], axis=1)
        if self.scaling_groups:
            if len(self.basis_weights):
                raise OptionError("expected compute_standardization for all demonstrations before the first is added")
            self._range = np.stack([seen.min(1), seen.max(1)], axis=1)
            self.scaling = group_scaling(self.scaling_groups, self._range)

    def add_demonstration(self, trajectory: ArrayLike) -> None:
        """Learn the weights of a demonstration (D, T). Raises as `compute_standardization`, and without a scaling."""
        self.basis_weights = np.concatenate([self.basis_weights, self.basis_transform(trajectory)[None]])

    def basis_transform(self, trajectory: ArrayLike) -> Float[np.ndarray, " B"]:
        """(B,) the weights of a trajectory (D, T)."""
        scaled = self._known_scaling().scale(self._trajectory(trajectory).T)
        return self.basis_model.fit_basis_functions_linear_closed_form(np.linspace(0.0, 1.0, len(scaled)), scaled)

    def basis_inverse_transform(
        self, x: ArrayLike, weights: ArrayLike, deriv: bool = False
    ) -> Float[np.ndarray, "D T"]:
        """(D, T) the trajectory of weights (B,) at phases x (T,), in the units of the DoFs; `deriv`: its slopes."""
        scaling = self._known_scaling()
        read = self.basis_model.apply_coefficients(np.atleast_1d(np.asarray(x)), weights, deriv).T
        return np.asarray((read * scaling.span if deriv else scaling.unscale(read)).T)

    def get_basis_weight_parameters(self) -> tuple[Float[np.ndarray, " B"], Float[np.ndarray, "B B"] | None]:
        """(B,) mean and (B, B) covariance of the weights; None where there is but one demonstration."""
        weights = self._demonstrated(1)
        return weights.mean(0), np.cov(weights, rowvar=False) if len(weights) > 1 else None

    def get_mean_trajectory(self, num_samples: SupportsFloat = DEFAULT_NUM_SAMPLES) -> Float[np.ndarray, "D T"]:
        """(D, num_samples) the trajectory of the mean weights."""
        return self.basis_inverse_transform(_domain(num_samples), self._demonstrated(1).mean(0))

    def get_approximate_trajectory(
        self, trajectory: ArrayLike, num_samples: SupportsFloat = DEFAULT_NUM_SAMPLES, deriv: bool = False
    ) -> Float[np.ndarray, "D T"]:
        """(D, num_samples) what the basis makes of a trajectory (D, T); `deriv`: its slopes over the phase."""
        return self.basis_inverse_transform(_domain(num_samples), self.basis_transform(trajectory), deriv)

    def get_approximate_trajectory_derivative(
        self, trajectory: ArrayLike, num_samples: SupportsFloat = DEFAULT_NUM_SAMPLES
    ) -> Float[np.ndarray, "D T"]:
        """(D, num_samples) the slopes of what the basis makes of a trajectory (D, T)."""
        return self.get_approximate_trajectory(trajectory, num_samples, deriv=True)

    def get_probability_distribution(
        self, num_samples: SupportsFloat = DEFAULT_NUM_SAMPLES
    ) -> tuple[Float[np.ndarray, "D T"], Float[np.ndarray, "D T"], Float[np.ndarray, "D T"]]:
        """(D, num_samples) the demonstrations' mean, and a standard deviation above and below. DataError below two."""
        domain = _domain(num_samples)
        curves = np.stack([self.basis_inverse_transform(domain, weights) for weights in self._demonstrated(2)])
        mean, std = curves.mean(0), curves.std(0, ddof=1)
        return mean, mean + std, mean - std

    def set_filter(self, filter: Any) -> None:
        """Follow the next interaction with this filter; it remembers what it sees, so set a deep copy.

        Raises OptionError for a filter of another basis, or what is no filter.
        """
        if not hasattr(filter, "localize"):
            raise OptionError(f"filter: expected one of intprim.filter, got a {type(filter).__name__}")
        ours, theirs = self.basis_model.layout, getattr(filter, "basis_model", self.basis_model).layout
        if theirs != ours:
            wanted, got = ([f"{type(b).__name__}({b.size})" for b in layout.bases] for layout in (ours, theirs))
            same = ", but with other widths or centres" if wanted == got else ""
            raise OptionError(f"filter: expected one of the primitive's basis model {wanted}, got one of {got}{same}")
        self.filter = filter

    def generate_probable_trajectory_recursive(
        self,
        trajectory: ArrayLike,
        observation_noise: ArrayLike,
        active_dofs: ArrayLike,
        num_samples: SupportsFloat = DEFAULT_NUM_SAMPLES,
        starting_phase: float | int | None = None,
        return_variance: bool = False,
        phase_lookahead: float | int | None = 0.0,
    ) -> tuple[Float[np.ndarray, "D T"], float, Float[np.ndarray, " n"], Float[np.ndarray, "n n"]]:
        """Take in new samples (D, T), and say what comes: trajectory (D, num_samples), phase, mean and covariance.

        observation_noise: (D, D), diagonal, scaled. active_dofs: the DoFs that are observed; the rest is not looked
        at, and NaN was not seen. The trajectory goes from `starting_phase`, or the phase and the lookahead, to 1.
        return_variance: mean and covariance also of phase and derivatives, (K + B,), else of the weights, (B,).
        Raises OptionError without a filter or for an option that is not allowed, DataError, TypeError.
        """
        if self.filter is None:
            raise OptionError("expected a filter, got none: call set_filter first")
        for name, value in (("starting_phase", starting_phase), ("phase_lookahead", phase_lookahead)):
            if value is not None and not 0 <= value <= 1:
                raise OptionError(f"{name}: expected a phase between 0 and 1, got {value}")
        scaled = self._known_scaling().scale(self._trajectory(trajectory, live=True).T)
        domain = _domain(num_samples)
        phase, mean, cov = self.filter.localize(scaled, observation_noise, active_dofs, return_variance)
        start = min(phase + (phase_lookahead or 0.0), 1.0) if starting_phase is None else starting_phase
        weights = mean[-self.basis_model.layout.size :]
        return self.basis_inverse_transform(start + (1.0 - start) * domain, weights), phase, mean, cov

    def export_data(self, file_name: str | PathLike[str]) -> None:
        """Write weights and scaling to a file, whole or not at all: a .npz whatever its name, no pickle (4.2.6.1)."""
        groups = None if self.scaling_groups is None else [[int(dof) for dof in g] for g in self.scaling_groups]
        with whole_file(file_name) as part, part.open("wb") as file:
            np.savez(file, basis_weights=self.basis_weights, range=self._range, scaling_groups=json.dumps(groups))

    def import_data(self, file_name: str | PathLike[str]) -> None:
        """Read such a file, or a .bip of the old library (4.2.6.2).

        Raises ModelFileError for any other, and for one of another basis or other DoFs.
        """
        dofs, size = self.basis_model.num_observed_dof, self.basis_model.layout.size
        weights, ends, groups, old = _read(file_name, dofs)
        if weights.ndim != 2 or weights.shape[1] != size or len(ends) != dofs or not np.isfinite(weights).all():
            raise ModelFileError(
                f"{file_name}: expected {dofs} DoFs with weights (N, {size}), got {len(ends)} and {weights.shape}"
            )
        try:
            scaling = group_scaling(groups, ends)
        except (ValueError, IndexError, TypeError) as error:
            raise ModelFileError(f"{file_name}: {error}") from None
        self.basis_weights = self.basis_model.convert_old_weights(weights) if old else weights
        self._range, self.scaling_groups, self.scaling = ends, groups, scaling

    def _trajectory(self, trajectory: ArrayLike, live: bool = False) -> Float[np.ndarray, "D T"]:
        if not isinstance(trajectory, np.ndarray):
            raise TypeError(f"trajectory: expected a numpy array (D, T), got a {type(trajectory).__name__}")
        values = numbers("trajectory", trajectory, "D T", finite=not live, D=self.basis_model.num_observed_dof)
        if values.shape[1] < 2 and not live:
            raise DataError(f"trajectory: expected (D, T) of at least 2 samples, got {values.shape}")
        return values

    def _known_scaling(self) -> Scaling:
        if self.scaling_groups and not self._range.shape[1]:
            raise OptionError("scaling_groups: expected compute_standardization with all demonstrations first")
        return self.scaling

    def _demonstrated(self, least: int) -> Float[np.ndarray, "N B"]:
        if len(self.basis_weights) < least:
            raise DataError(f"expected at least {least} demonstrations added, got {len(self.basis_weights)}")
        return self.basis_weights


def _domain(num_samples: SupportsFloat) -> Float[np.ndarray, " T"]:
    count = int(float(num_samples))  # the tutorial divides, and counts on what Python 2 made of that
    if count < 1:
        raise OptionError(f"num_samples: expected at least 1, got {num_samples}")
    return np.linspace(0.0, 1.0, count)


def _read(
    path: str | PathLike[str], dofs: int
) -> tuple[Float[np.ndarray, ...], Float[np.ndarray, "D _"], list[list[int]] | None, bool]:
    """Weights, the range of every DoF, the scaling groups, and whether it is a file of the old library."""
    try:
        content = Path(path).read_bytes()
        if content[:2] == b"PK":
            with np.load(BytesIO(content), allow_pickle=False) as file:
                return file["basis_weights"], file["range"], json.loads(str(file["scaling_groups"])), False
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001 - a damaged file may break any step
        raise ModelFileError(f"{path}: expected a file of export_data, got {' '.join(str(error).split())}") from None
    old = read_bip(path)
    ends = np.zeros((dofs, 2 if old.scaling_groups else 0))
    for group, low, high in zip(old.scaling_groups or (), old.low, old.high, strict=True):
        if max(group) >= dofs:
            raise ModelFileError(f"{path}: expected scaling groups of {dofs} DoFs, got DoF {max(group)}")
        ends[list(group)] = low, high
    return old.basis_weights, ends, None if old.scaling_groups is None else [list(g) for g in old.scaling_groups], True
