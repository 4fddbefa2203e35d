"""Which basis suits the demonstrations, and how far they stray from it (4.2.2, 4.2.4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import DataError, OptionError, Scaling
from intprim.basis.basis_model import BasisModel, SharedBasisModel
from intprim.basis.families import GaussianModel, PolynomialModel, SigmoidalModel
from intprim.checks import Numbers, dofs_of, names_of, numbers


class Selection:
    """A search over basis functions and their parameters; the grid is in attributes, to be changed before the search.

    scaling_groups: lists of DoFs; over all demonstrations, the lowest value of a group becomes 0 and the highest 1. A
    DoF in no group stays as it is. error_std: the standard deviation of the noise that the likelihood assumes.
    Raises OptionError for groups of DoFs that do not exist or are in two groups.
    """

    def __init__(self, dof_names: ArrayLike, scaling_groups: Sequence[Sequence[int]] | None = None) -> None:
        self.dof_names, self.scaling_groups = names_of(dof_names, "dof_names"), scaling_groups
        self.demonstration_list: list[Float[np.ndarray, "D T"]] = []
        self.models: list[SharedBasisModel] = []
        self.error_std, self.addtl_model_penalty = 0.05, 1.0
        self.min_degree, self.max_degree, self.degree_step = 5, 14, 2
        self.min_scale, self.max_scale, self.scale_step = 0.01, 0.2, 0.03
        group_scaling(scaling_groups, np.empty((len(self.dof_names), 0)))  # a mistake in the groups is told here

    def add_demonstration(self, data: ArrayLike) -> None:
        """Take a trajectory (D, T) into account; raises DataError for another shape, or values that are not finite."""
        values = numbers("data", data, "D T", D=len(self.dof_names))
        if values.shape[1] < 2:
            raise DataError(f"data: expected (D, T) with T > 1, got {values.shape}")
        self.demonstration_list.append(values)

    def create_models(self, dofs: Numbers, start_phase: float, end_phase: float) -> list[SharedBasisModel]:
        """The models of the grid for some DoFs."""
        names = [self.dof_names[dof] for dof in dofs_of(dofs, len(self.dof_names), "dofs")]
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
        residuals = _residuals(model, self._samples(dofs, sample_start_phase, sample_end_phase))
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
        samples, var = self._samples(dofs, sample_start_phase, sample_end_phase), self.error_std**2
        aic, bic = [], []
        for model in self.models:
            count = self.addtl_model_penalty * model.layout.size
            residuals = _residuals(model, samples)
            misfit = np.mean([(r**2).sum() / var + r.size * np.log(2 * np.pi * var) for r in residuals])  # -2 log L
            aic.append(float(2.0 * count + misfit))
            bic.append(float(np.mean([np.log(len(r)) for r in residuals]) * count + misfit))
        return aic, bic

    def get_best_model(self, aic: Sequence[float], bic: Sequence[float]) -> tuple[SharedBasisModel, SharedBasisModel]:
        """The models of least AIC and of least BIC, which are printed too; OptionError for lists of another search."""
        if not self.models or not len(aic) == len(bic) == len(self.models):
            raise OptionError(
                f"aic, bic: expected what get_information_criteria returned, two lists of {len(self.models)}, "
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
    ) -> list[tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ M"]]]:
        """The phases (T,) and scaled values (T, M) of every demonstration from phase `start` to `end`."""
        if not self.demonstration_list:
            raise DataError("expected demonstrations, got none: call add_demonstration first")
        wanted, samples = dofs_of(dofs, len(self.dof_names), "dofs"), []
        scaling = group_scaling(self.scaling_groups, np.concatenate(self.demonstration_list, axis=1))
        for values in self.demonstration_list:
            phases = np.linspace(0.0, 1.0, values.shape[1])
            inside = (phases >= start) & (phases <= end)
            if not inside.any():
                raise DataError(f"expected samples between phase {start} and {end}, got none in a demonstration")
            samples.append((phases[inside], scaling.scale(values.T)[inside][:, wanted]))
        return samples


def _residuals(
    model: BasisModel, samples: Sequence[tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ M"]]]
) -> list[Float[np.ndarray, "_ M"]]:
    fit, read = model.fit_basis_functions_linear_closed_form, model.apply_coefficients
    return [values - read(phases, fit(phases, values)).T for phases, values in samples]


def group_scaling(groups: Sequence[Sequence[int]] | None, values: Float[np.ndarray, "D T"]) -> Scaling:
    """The scaling (4.2.5) under which the lowest of the values of each group is 0 and the highest 1.

    A DoF in no group is left as it is. Raises OptionError for groups of DoFs that do not exist or are in two groups.
    """
    low, high = np.zeros(len(values)), np.ones(len(values))
    members = [dofs_of(group, len(values), "scaling_groups") for group in groups or []]
    together = [dof for own in members for dof in own]
    if len(together) != len(set(together)):
        raise OptionError(f"scaling_groups: expected every DoF in one group at most, got {groups!r}")
    for own in members if values.size else ():
        low[own], high[own] = values[own].min(initial=np.inf), values[own].max(initial=-np.inf)
    return Scaling(low, high)
