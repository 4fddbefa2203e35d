"""Filters that find phase and weights together (4.2.7.1): those of `inphase`, with the arguments of chapter 4."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import OptionError, WeightPrior
from intprim.basis.basis_model import BasisModel
from intprim.checks import numbers
from intprim.filter.system import System, gaussian_prior, phase_model


class ExtendedKalmanFilter(System):
    """Bayesian Interaction Primitives (chapter 2), `inphase.filters.Bip`; OptionError for arguments of other shapes."""

    def __init__(
        self,
        basis_model: BasisModel,
        initial_phase_mean: ArrayLike,
        initial_phase_var: ArrayLike,
        proc_var: float | int,
        mean_basis_weights: ArrayLike,
        cov_basis_weights: ArrayLike | None,
        time_delta: float | int = 1.0,
        cyclical: bool = False,
    ) -> None:
        phase = phase_model(initial_phase_mean, initial_phase_var, proc_var, time_delta, cyclical)
        prior = gaussian_prior(basis_model, mean_basis_weights, cov_basis_weights)
        super().__init__(basis_model, phase, prior, "bip", time_delta)


class _EnsembleSystem(System):
    """A filter whose belief is made of members."""

    @property
    def ensemble_size(self) -> int:
        """How many members there are."""
        return len(self.model.prior.samples)

    @property
    def ensemble(self) -> Float[np.ndarray, "n E"]:
        """(K + B, E) the states of the members."""
        return np.asarray(self.belief.members[:, :-1].T)

    def get_ensemble_mean(self, ensemble: Float[np.ndarray, "n E"] | None = None) -> Float[np.ndarray, " n"]:
        """(K + B,) the mean of the state, or of other members that all count the same."""
        return self.get_mean() if ensemble is None else np.asarray(ensemble).mean(1)

    def get_ensemble_covariance(self, ensemble: Float[np.ndarray, "n E"] | None = None) -> Float[np.ndarray, "n n"]:
        """(K + B, K + B) the covariance of the state, or of other members that all count the same."""
        return self.get_covariance() if ensemble is None else np.cov(ensemble)


class EnsembleKalmanFilter(_EnsembleSystem):
    """Ensemble Bayesian Interaction Primitives (chapter 3), `inphase.filters.Ebip`.

    initial_ensemble: (E, B) weights, E at least 2. Raises OptionError for arguments of other shapes.
    """

    def __init__(
        self,
        basis_model: BasisModel,
        initial_phase_mean: ArrayLike,
        initial_phase_var: ArrayLike,
        proc_var: float | int,
        initial_ensemble: ArrayLike,
        time_delta: float | int = 1.0,
        cyclical: bool = False,
    ) -> None:
        phase = phase_model(initial_phase_mean, initial_phase_var, proc_var, time_delta, cyclical)
        prior = _prior_of(basis_model, initial_ensemble)
        super().__init__(basis_model, phase, prior, "ebip", time_delta, members=len(prior.samples))


class ParticleFilter(_EnsembleSystem):
    """Particles (3.3), `inphase.filters.Particle`: resampled when the effective share of them is below a ratio.

    initial_ensemble: (E, B) weights, E at least 2. Raises OptionError for arguments of other shapes.
    """

    def __init__(
        self,
        basis_model: BasisModel,
        initial_phase_mean: ArrayLike,
        initial_phase_var: ArrayLike,
        proc_var: float | int,
        initial_ensemble: ArrayLike,
        num_effective_ratio: float | int = 0.5,
        time_delta: float | int = 1.0,
        cyclical: bool = False,
    ) -> None:
        phase = phase_model(initial_phase_mean, initial_phase_var, proc_var, time_delta, cyclical)
        prior = _prior_of(basis_model, initial_ensemble)
        options = {"particles": len(prior.samples), "resample_below": num_effective_ratio}
        super().__init__(basis_model, phase, prior, "particle", time_delta, **options)

    @property
    def ensemble(self) -> Float[np.ndarray, "n E"]:
        """(K + B, E) the states of the particles."""
        return np.asarray(self.belief.particles[:, :-1].T)


def _prior_of(basis_model: BasisModel, initial_ensemble: ArrayLike) -> WeightPrior:
    size = basis_model.layout.size
    return WeightPrior(numbers("initial_ensemble", initial_ensemble, "E B", error=OptionError, B=size))
