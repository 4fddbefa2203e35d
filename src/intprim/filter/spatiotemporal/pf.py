"""The particle filter (4.2.7.1, 3.3)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase.filters import Particle, WeightedBelief
from intprim.basis.basis_model import BasisModel
from intprim.filter.spatiotemporal.enkf import EnsembleSystem


class ParticleFilter(EnsembleSystem):
    """`inphase.filters.Particle`: particles are resampled when the effective share of them is below a ratio.

    Mean and covariance are those of the weighted particles. Raises OptionError.
    """

    belief: WeightedBelief

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
        super().__init__(
            basis_model, initial_phase_mean, initial_phase_var, proc_var, initial_ensemble, time_delta, cyclical
        )
        self.filter = Particle(self.model, particles=self.ensemble_size, resample_below=num_effective_ratio)
        self.belief = self.filter.init(self._rng)

    @property
    def ensemble(self) -> Float[np.ndarray, "n E"]:
        """(K + B, E) the states of the members."""
        return self.belief.particles[:, :-1].T

    @property
    def weights(self) -> Float[np.ndarray, " E"]:
        """(E,) the probability of each particle."""
        return self.belief.weights

    def get_mean(self) -> Float[np.ndarray, " n"]:
        """(K + B,) the mean of the state."""
        return np.asarray(self.ensemble @ self.weights)

    def get_covariance(self) -> Float[np.ndarray, "n n"]:
        """(K + B, K + B) the covariance of the state."""
        off = self.ensemble - self.get_mean()[:, None]
        return np.asarray((off * self.weights) @ off.T)
