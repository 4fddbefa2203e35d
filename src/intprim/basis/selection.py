"""Which basis suits the demonstrations, and how far they stray from it (4.2.2, 4.2.4)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import DataError, OptionError, Scaling
from intprim.basis.basis_model import BasisModel, Numbers, SharedBasisModel, dofs_of, names_of
from intprim.basis.gaussian_model import GaussianModel
from intprim.basis.polynomial_model import PolynomialModel
from intprim.basis.sigmoidal_model import SigmoidalModel


class Selection:
    """A search over basis functions and their parameters; the grid is in attributes, to be changed before the search.

    scaling_groups: lists of DoFs; over all demonstrations, the lowest value of a group becomes 0 and the highest 1. A
    DoF in no group stays as it is. error_std: the standard deviation of the noise that the likelihood assumes.
    Raises OptionError for groups of DoFs that do not exist or are in two groups.
    """

    def __init__(self, dof_names: ArrayLike, scaling_groups: Sequence[Sequence[int]] | None = None) -> None:
        self.dof_names = names_of(dof_names, "dof_names")
        self.scaling_groups = scaling_groups
        self.demonstration_list: list[Float[np.ndarray, "D T"]] = []
        self.models: list[SharedBasisModel] = []
        self.error_std = 0.05
        self.addtl_model_penalty = 1.0
        self.min_degree, self.max_degree, self.degree_step = 5, 14, 2
        self.min_scale, self.max_scale, self.scale_step = 0.01, 0.2, 0.03
        group_scaling(scaling_groups, [np.empty((len(self.dof_names), 0))])  # a mistake in the groups is told here

    def add_demonstration(self, data: ArrayLike) -> None:
        """Take a trajectory (D, T) into account; raises DataError for another shape, or values that are not finite."""
        values = np.array(data, dtype=np.float64)
        if values.ndim != 2 or len(values) != len(self.dof_names) or values.shape[1] < 2:
            raise DataError(f"data: expected (D, T) = ({len(self.dof_names)}, T > 1), got {values.shape}")
        if not np.isfinite(values).all():
            raise DataError("data: expected finite values, got NaN or infinity")
        self.demonstration_list.append(values)

    def create_models(self, dofs: Numbers, start_phase: float, end_phase: float) -> list[SharedBasisModel]:
        """The models of the grid for some DoFs."""
        names = self.dof_names[dofs_of(dofs, len(self.dof_names), "dofs")].tolist()
        degrees = range(self.min_degree, self.max_degree, self.degree_step)
        scales = np.arange(self.min_scale, self.max_scale, self.scale_step).round(12).tolist()
        models: list[SharedBasisModel] = [PolynomialModel(degree, names) for degree in degrees]
        for family in (GaussianModel, SigmoidalModel):
            models += [family(degree, scale, names, start_phase, end_phase) for degree in degrees for scale in scales]
        return models

    def get_model_mse(
        self, model: BasisModel, dofs: Numbers, sample_start_phase: float = 0.0, sample_end_phase: float = 1.0
    ) -> Float[np.ndarray, " M"]:
        """(M,) the mean squared error of the regression for each of the DoFs: the diagonal of the noise (Eq. 2.15).

        Of each demonstration first, then their mean; of scaled values where there are scaling groups.
        """
        residuals = self._residuals(model, self._samples(dofs, sample_start_phase, sample_end_phase))
        return np.asarray(np.mean([np.mean(residual**2, axis=0) for residual in residuals], axis=0))

    def get_information_criteria(
        self,
        dofs: Numbers,
        basis_start_phase: float = 0.0,
        basis_end_phase: float = 1.0,
        sample_start_phase: float = 0.0,
        sample_end_phase: float = 1.0,
    ) -> tuple[list[float], list[float]]:
        """Akaike's and the Bayesian criterion of every model of the grid, the mean over the demonstrations.

        The models are then in `models`; `get_best_model` takes the two lists.
        """
        self.models = self.create_models(dofs, basis_start_phase, basis_end_phase)
        samples = list(self._samples(dofs, sample_start_phase, sample_end_phase))
        aic, bic = [], []
        for model in self.models:
            count = self.addtl_model_penalty * model.layout.size
            fits = [(len(r), self._log_likelihood(r)) for r in self._residuals(model, samples)]
            aic.append(float(np.mean([2.0 * count - 2.0 * likelihood for _, likelihood in fits])))
            bic.append(float(np.mean([math.log(n) * count - 2.0 * likelihood for n, likelihood in fits])))
        return aic, bic

    def get_best_model(self, aic: Sequence[float], bic: Sequence[float]) -> tuple[SharedBasisModel, SharedBasisModel]:
        """The models of least AIC and of least BIC, which are printed too; OptionError for lists of another search."""
        if not self.models or not len(aic) == len(bic) == len(self.models):
            raise OptionError(
                f"expected what get_information_criteria returned, two lists of {len(self.models)}, "
                f"got {len(aic)} and {len(bic)}"
            )
        best = self.models[int(np.argmin(aic))], self.models[int(np.argmin(bic))]
        for name, values, model in zip(("AIC", "BIC"), (aic, bic), best, strict=True):
            print(
                f"Best model according to {name}: Value: {min(values):.6g}. Model: {type(model).__name__}. "
                f"Degree: {model._degree}. Scale: {model.scale}"
            )
        return best

    def _samples(
        self, dofs: Numbers, start: float, end: float
    ) -> Iterator[tuple[Float[np.ndarray, " T"], Float[np.ndarray, "T M"]]]:
        """The phases (T,) and scaled values (T, M) of every demonstration from phase `start` to `end`."""
        if not self.demonstration_list:
            raise DataError("expected demonstrations, got none: call add_demonstration first")
        wanted = dofs_of(dofs, len(self.dof_names), "dofs")
        scaling = group_scaling(self.scaling_groups, self.demonstration_list)
        for values in self.demonstration_list:
            phases = np.linspace(0.0, 1.0, values.shape[1])
            inside = (phases >= start) & (phases <= end)
            if not inside.any():
                raise DataError(f"expected samples between phase {start} and {end}, got none in a demonstration")
            yield phases[inside], scaling.scale(values.T)[inside][:, wanted]

    @staticmethod
    def _residuals(
        model: BasisModel, samples: Iterable[tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ M"]]]
    ) -> Iterator[Float[np.ndarray, "_ M"]]:
        for phases, values in samples:
            weights = model.fit_basis_functions_linear_closed_form(phases, values)
            yield values - model.apply_coefficients(phases, weights).T

    def _log_likelihood(self, residual: Float[np.ndarray, "T M"]) -> float:
        var = self.error_std**2
        return float(-0.5 * (np.sum(residual**2) / var + residual.size * math.log(2 * math.pi * var)))


def group_scaling(
    groups: Sequence[Sequence[int]] | None, demonstrations: Sequence[Float[np.ndarray, "D _"]]
) -> Scaling:
    """The scaling (4.2.5) of trajectories (D, T) under which the lowest value of each group is 0 and the highest 1.

    A DoF in no group is left as it is. Raises OptionError for groups of DoFs that do not exist or are in two groups.
    """
    low, high = np.zeros(len(demonstrations[0])), np.ones(len(demonstrations[0]))
    members = [dofs_of(group, len(low), "scaling_groups") for group in groups or []]
    if len(together := np.concatenate([np.empty(0, dtype=np.int64), *members])) != len(set(together.tolist())):
        raise OptionError(f"scaling_groups: expected every DoF in one group at most, got {groups!r}")
    everything = np.concatenate(demonstrations, axis=1)
    for own in members:
        if everything.shape[1] and len(own):
            low[own], high[own] = everything[own].min(), everything[own].max()
    return Scaling(low, high)
