"""Bayesian Interaction Primitives: the extended Kalman filter (4.2.7.1, chapter 2)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase.filters import Bip, GaussianBelief
from intprim.basis.basis_model import BasisModel
from intprim.filter.system import System, phase_model, samples_of, weights_of


class GaussianSystem(System):
    """A filter whose belief is a Gaussian. Weights start with mean (B,) and covariance (B, B)."""

    belief: GaussianBelief

    def get_mean(self) -> Float[np.ndarray, " n"]:
        """(K + B,) the mean of the state."""
        return np.concatenate([self.belief.phase_mean, self.belief.weights_mean[:-1]])

    def get_covariance(self) -> Float[np.ndarray, "n n"]:
        """(K + B, K + B) the covariance of the state."""
        size, factor = self.system_size, self.model.prior.factor[:, :-1]
        back = np.zeros((size + len(factor), size + factor.shape[1]))
        back[:size, :size], back[size:, size:] = np.eye(size), factor
        return np.asarray(back.T @ self.belief.cov @ back)


class ExtendedKalmanFilter(GaussianSystem):
    """`inphase.filters.Bip`; raises OptionError for arguments of other shapes."""

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
        size = basis_model.layout.size
        mean = weights_of("mean_basis_weights", mean_basis_weights, (size,))
        cov = weights_of("cov_basis_weights", cov_basis_weights, (size, size))
        phase = phase_model(initial_phase_mean, initial_phase_var, proc_var, time_delta, cyclical)
        super().__init__(basis_model, phase, samples_of(mean, cov))
        self.time_delta, self.cyclical = time_delta, cyclical
        self.filter = Bip(self.model)
        self.belief = self.filter.init(self._rng)
