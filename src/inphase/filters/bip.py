"""Bayesian Interaction Primitives: an extended Kalman filter over phase and weights (chapter 2, Fig. 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inphase.filters.belief import GaussianBelief
from inphase.filters.filter import StepInfo
from inphase.filters.gaussian import innovation_score
from inphase.model import Model
from inphase.observation import Observation


@dataclass(frozen=True)
class Bip:
    """The exact filter, but for the observation function, which is linearised at the predicted mean (Eq. 2.6).

    It is deterministic: the random generator is not used.
    """

    model: Model

    def init(self, rng: np.random.Generator) -> GaussianBelief:
        """The prior N(μ₀, Σ₀) of Eq. 2.13 and 2.14."""
        import scipy.linalg  # noqa: F401 - here, so that the first live sample need not wait for it

        phase, directions = self.model.phase, len(self.model.prior.factor)
        size = len(phase.mean)
        cov = np.eye(size + directions)
        cov[:size, :size] = phase.cov
        return GaussianBelief(self.model, np.concatenate([phase.mean, np.zeros(directions)]), cov)

    def predict(self, belief: GaussianBelief, dt: float, rng: np.random.Generator) -> GaussianBelief:
        """Eq. 2.4 and 2.5; only the phase block moves."""
        if dt == 0:
            return belief
        phase = self.model.phase
        size = len(phase.mean)
        transition = phase.transition(dt)
        mean, cov = belief.mean.copy(), belief.cov.copy()
        mean[:size] = transition @ mean[:size]
        mean[:1] = phase.confine(mean[:1])
        cov[:size, size:] = transition @ cov[:size, size:]
        cov[size:, :size] = cov[:size, size:].T
        moved = transition @ cov[:size, :size] @ transition.T + phase.process_cov(dt)
        cov[:size, :size] = (moved + moved.T) / 2
        return GaussianBelief(self.model, mean, cov)

    def step(
        self, belief: GaussianBelief, observation: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[GaussianBelief, StepInfo]:
        """Eq. 2.4 to 2.10, over the rows that were seen."""
        predicted = self.predict(belief, dt, rng)
        if len(observation) == 0:
            return predicted, StepInfo()
        model, size, features = self.model, len(self.model.phase.mean), observation.features
        mean, cov = predicted.mean, predicted.cov
        phase, weights = mean[:1], predicted.weights_mean
        jacobian = np.empty((len(features), len(mean)))  # H of Eq. 2.6, in the prior's directions
        (plain,), (jacobian[:, 0],) = model.layout.predict_and_slope(phase, weights, features)
        jacobian[:, 1:size] = 0.0
        jacobian[:, size:] = model.layout.project(float(phase[0]), model.prior.factor, features).T
        innovation = observation.values - plain
        cross = cov @ jacobian.T
        innovation_cov = jacobian @ cross  # S, Eq. 2.7
        innovation_cov.flat[:: len(features) + 1] += observation.noise_var
        score = innovation_score(innovation, innovation_cov)
        if score is None:
            return predicted, StepInfo(healthy=False)
        gain = score.solve(cross.T).T  # K, Eq. 2.8
        mean = mean + gain @ innovation  # Eq. 2.9
        mean[:1] = model.phase.confine(mean[:1])
        # Eq. 2.10 in Joseph form, (I - K H) Σ (I - K H)ᵀ + K R Kᵀ, multiplied out: no product of two matrices of the
        # size of Σ is left, and what is symmetric stays so.
        half = gain @ (cross - 0.5 * (gain @ innovation_cov)).T
        return GaussianBelief(model, mean, cov - (half + half.T)), StepInfo(score.log_likelihood, score.surprise)
