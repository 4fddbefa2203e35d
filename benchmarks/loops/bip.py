"""The extended Kalman filter over the whole state, dense."""

from __future__ import annotations

import numpy as np

import inphase
from inphase.observation import Observation
from loops.curves import Curves, within
from loops.members import Believed


class BipLoop:
    """Fig. 5 as it is printed: Eq. 2.4 to 2.10 over [φ, φ̇, …, w], dense. A state: mean and covariance."""

    def __init__(self, model: inphase.Model, members: int = 0) -> None:
        self.model, self.curves = model, Curves(model.layout)

    def init(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        phase, prior = self.model.phase, self.model.prior
        size = len(phase.mean)
        mean = np.concatenate([phase.mean, prior.mean])
        cov = np.zeros((len(mean), len(mean)))
        cov[:size, :size], cov[size:, size:] = phase.cov, prior.factor.T @ prior.factor
        return mean, cov

    def step(
        self, state: tuple[np.ndarray, np.ndarray], seen: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        (mean, cov), phase = state, self.model.phase
        size = len(phase.mean)
        transition, noise = np.eye(len(mean)), np.zeros(cov.shape)
        transition[:size, :size], noise[:size, :size] = phase.transition(dt), phase.process_cov(dt)
        mean = transition @ mean  # Eq. 2.4
        cov = transition @ cov @ transition.T + noise  # Eq. 2.5
        mean[0] = within(mean[0])
        if len(seen) == 0:
            return mean, cov
        jacobian = np.zeros((len(seen), len(mean)))  # H, Eq. 2.6
        jacobian[:, 0] = self.curves.slopes(mean[0], mean[size:], seen.features)
        jacobian[:, size:] = self.curves.dense(mean[0], seen.features)
        innovation_cov = jacobian @ cov @ jacobian.T + np.diag(seen.noise_var)  # S, Eq. 2.7
        gain = cov @ jacobian.T @ np.linalg.inv(innovation_cov)  # K, Eq. 2.8
        mean = mean + gain @ (seen.values - jacobian[:, size:] @ mean[size:])  # Eq. 2.9
        mean[0] = within(mean[0])
        return mean, cov - gain @ jacobian @ cov  # Eq. 2.10

    def believed(self, state: tuple[np.ndarray, np.ndarray]) -> Believed:
        size = len(self.model.phase.mean)
        return state[0][:size], state[1][:size, :size], state[0][size:]
