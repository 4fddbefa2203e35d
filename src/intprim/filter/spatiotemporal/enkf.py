"""Ensemble Bayesian Interaction Primitives: the ensemble Kalman filter (4.2.7.1, chapter 3)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase.filters import Ebip, EnsembleBelief
from intprim.basis.basis_model import BasisModel
from intprim.filter.system import System, phase_model, weights_of


class EnsembleSystem(System):
    """A filter whose belief is made of members. Their weights start as `initial_ensemble` (E, B), E at least 2."""

    def __init__(
        self,
        basis_model: BasisModel,
        initial_phase_mean: ArrayLike,
        initial_phase_var: ArrayLike,
        proc_var: float | int,
        initial_ensemble: ArrayLike,
        time_delta: float | int,
        cyclical: bool,
    ) -> None:
        weights = weights_of("initial_ensemble", initial_ensemble, (None, basis_model.layout.size))
        phase = phase_model(initial_phase_mean, initial_phase_var, proc_var, time_delta, cyclical)
        super().__init__(basis_model, phase, weights)
        self.time_delta, self.cyclical, self.ensemble_size = time_delta, cyclical, len(weights)

    @property
    def ensemble(self) -> Float[np.ndarray, "n E"]:
        """(K + B, E) the states of the members."""
        raise NotImplementedError

    def get_ensemble_mean(self, ensemble: Float[np.ndarray, "n E"] | None = None) -> Float[np.ndarray, " n"]:
        """(K + B,) the mean of the state, or of other members that all count the same."""
        return self.get_mean() if ensemble is None else np.asarray(ensemble).mean(1)

    def get_ensemble_covariance(self, ensemble: Float[np.ndarray, "n E"] | None = None) -> Float[np.ndarray, "n n"]:
        """(K + B, K + B) the covariance of the state, or of other members that all count the same."""
        return self.get_covariance() if ensemble is None else np.cov(ensemble)


class EnsembleKalmanFilter(EnsembleSystem):
    """`inphase.filters.Ebip`; raises OptionError for arguments of other shapes."""

    belief: EnsembleBelief

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
        super().__init__(
            basis_model, initial_phase_mean, initial_phase_var, proc_var, initial_ensemble, time_delta, cyclical
        )
        self.filter = Ebip(self.model, members=self.ensemble_size)
        self.belief = self.filter.init(self._rng)

    @property
    def ensemble(self) -> Float[np.ndarray, "n E"]:
        """(K + B, E) the states of the members."""
        return self.belief.members[:, :-1].T

    def get_mean(self) -> Float[np.ndarray, " n"]:
        """(K + B,) the mean of the state."""
        return np.asarray(self.ensemble.mean(1))

    def get_covariance(self) -> Float[np.ndarray, "n n"]:
        """(K + B, K + B) the covariance of the state."""
        return np.cov(self.ensemble)
