"""Interaction ProMP over all weights, dense; the warping is the filter's own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import inphase
from inphase.filters.alignment import WINDOW, Alignment, grid
from inphase.filters.promp import LEAST_NEWS, ODD, PHASES
from inphase.observation import Observation
from loops.curves import Curves, within
from loops.members import Believed


@dataclass(frozen=True)
class Aligned:
    """A phase that is found beside the weights, and a Gaussian over these."""

    timing: Alignment
    mean: np.ndarray
    cov: np.ndarray


class PrompLoop:
    """A dense Kalman filter over all weights; the warping is the filter's own. A state: Aligned."""

    def __init__(self, model: inphase.Model, members: int = 0) -> None:
        self.model, self.curves = model, Curves(model.layout)
        everything = np.arange(model.layout.count)
        self.reference = [self.curves.values(phase, everything) for phase in grid(model.phase, PHASES)]

    def init(self, rng: np.random.Generator) -> Aligned:
        factor = self.model.prior.factor
        return Aligned(Alignment.begin(self.model), self.model.prior.mean, factor.T @ factor)

    def step(self, state: Aligned, seen: Observation, dt: float, rng: np.random.Generator) -> Aligned:
        timing = state.timing.passed(dt) if dt > 0 else state.timing
        if len(seen) == 0:
            return replace(state, timing=timing)
        aligned = timing.seen(seen, *self._expected(state, seen.features))
        phase_mean, phase_cov = phases_of(aligned)
        phase = within(phase_mean[0])
        doubt = self._doubt(state.mean, phase, phase_cov[0, 0], seen, timing.unseen[seen.features])
        noise_cov = np.diag(seen.noise_var) + np.outer(doubt, doubt)
        jacobian = self.curves.dense(phase, seen.features)
        innovation = seen.values - jacobian @ state.mean
        innovation_cov = jacobian @ state.cov @ jacobian.T + noise_cov  # S, Eq. 2.7
        odd = innovation @ np.linalg.inv(innovation_cov) @ innovation / (ODD * len(seen))
        if odd > 1:  # what fits nowhere is believed the less
            innovation_cov = innovation_cov + (odd - 1) * noise_cov
        gain = state.cov @ jacobian.T @ np.linalg.inv(innovation_cov)  # K, Eq. 2.8
        mean = state.mean + gain @ innovation  # Eq. 2.9
        return Aligned(aligned, mean, state.cov - gain @ jacobian @ state.cov)  # Eq. 2.10

    def _expected(self, state: Aligned, features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(PHASES, M) what the features are expected to read along the interaction, and its variance."""
        blocks = [(feature, self.curves.places[feature]) for feature in features]
        means, covs = [state.mean[place] for _, place in blocks], [state.cov[place, place] for _, place in blocks]
        mean, var = np.zeros((2, len(self.reference), len(features)))
        for row, values in enumerate(self.reference):
            for column, (feature, _) in enumerate(blocks):
                mean[row, column] = values[feature] @ means[column]
                var[row, column] = values[feature] @ covs[column] @ values[feature]
        return mean, np.maximum(var, 0.0) + self.model.noise.var[features]

    def _doubt(
        self, weights: np.ndarray, phase: float, phase_var: float, seen: Observation, unseen: np.ndarray
    ) -> np.ndarray:
        """(M,) how far the doubt about the phase carries each reading."""
        slopes = self.curves.slopes(phase, weights, seen.features)
        news = np.tanh(unseen * self.model.phase.nominal_velocity / (2 * WINDOW))
        news = np.minimum(news, self.model.noise.var[seen.features] / seen.noise_var)
        return slopes * np.sqrt(phase_var / np.maximum(news, LEAST_NEWS))

    def believed(self, state: Aligned) -> Believed:
        return *phases_of(state.timing), state.mean


def phases_of(timing: Alignment) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of phase and tempo over the open ends."""
    moving = np.stack([timing.phases, timing.tempos], axis=1)
    mean = timing.weights @ moving
    off = moving - mean
    return mean, (off * timing.weights[:, None]).T @ off + np.diag([0.0, timing.tempo_var])
