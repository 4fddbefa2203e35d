"""Probabilistic Movement Primitives: a Kalman filter over the weights, and an alignment beside it (4.2.7.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import OptionError, PhaseModel
from intprim.basis.basis_model import BasisModel
from intprim.checks import dofs_of
from intprim.filter.align import dtw
from intprim.filter.system import State, System, gaussian_prior


class KalmanFilter(System):
    """`inphase.filters.Bip` with a phase that is told to it.

    align_func: observed (T, M) and predicted (N, M) of the active DoFs -> the index in the latter that the former has
    come to. iterative_alignment: of the new samples alone, from the last phase on, instead of all samples, from 0.
    Raises OptionError for arguments of other shapes.
    """

    def __init__(
        self,
        basis_model: BasisModel,
        mean_basis_weights: ArrayLike,
        cov_basis_weights: ArrayLike | None,
        align_func: Callable[[Float[np.ndarray, "T M"], Float[np.ndarray, "N M"]], int] = dtw.fastdtw,
        iterative_alignment: bool = False,
        num_align_samples: int = 100,
    ) -> None:
        if num_align_samples < 2:
            raise OptionError(f"num_align_samples: expected at least 2, got {num_align_samples}")
        told = PhaseModel(np.zeros(1), np.zeros((1, 1)), diffusion=0.0, nominal_velocity=1.0)
        super().__init__(basis_model, told, gaussian_prior(basis_model, mean_basis_weights, cov_basis_weights), "bip")
        self.align_func, self.iterative_alignment = align_func, iterative_alignment
        self.num_align_samples, self.last_phase_estimate = num_align_samples, 0.0
        self.previous_observations = np.empty((0, basis_model.num_observed_dof))

    def localize(
        self,
        measurement: ArrayLike,
        measurement_noise: ArrayLike,
        active_dofs: ArrayLike,
        return_phase_variance: bool = False,
    ) -> State:
        """Find the phase of the last sample, then take all in at phases evenly spaced up to it; see `System`.

        The phase is taken for certain: with `return_phase_variance`, its variance is 0.
        """
        samples = self._samples(measurement, measurement_noise, active_dofs)
        begun, self.last_phase_estimate = self.last_phase_estimate, self._aligned(measurement, active_dofs)
        phases = np.linspace(begun, self.last_phase_estimate, len(samples) + 1)[1:]
        for sample, phase in zip(samples, phases, strict=True):
            mean = np.concatenate([[phase], self.belief.mean[1:]])
            self.belief, _ = self.filter.step(replace(self.belief, mean=mean), sample, 0.0, self._rng)
        return self._state(return_phase_variance)

    def _aligned(self, measurement: ArrayLike, active_dofs: ArrayLike) -> float:
        active = np.unique(dofs_of(active_dofs, self.basis_model.num_observed_dof, "active_dofs"))
        observed, begun = np.asarray(measurement, dtype=np.float64), self.last_phase_estimate
        if not self.iterative_alignment:
            observed = self.previous_observations = np.concatenate([self.previous_observations, observed])
            begun = 0.0
        observed = observed[:, active]
        observed = observed[np.isfinite(observed).all(1)]
        if not observed.size:
            return self.last_phase_estimate
        domain = np.linspace(begun, 1.0, self.num_align_samples)
        predicted = self.basis_model.layout.predict(domain, self.get_mean()[1:])[:, active]
        index = self.align_func(observed, predicted)
        if not 0 <= index < len(domain):
            raise OptionError(f"align_func: expected an index from 0 to {len(domain) - 1}, got {index!r}")
        return float(domain[int(index)])
