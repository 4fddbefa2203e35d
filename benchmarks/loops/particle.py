"""The bootstrap filter, particle by particle."""

from __future__ import annotations

import numpy as np

import inphase
from inphase.observation import Observation
from loops.curves import Curves
from loops.members import Believed, drawn, moments, moved, shares, systematic


class ParticleLoop:
    """A bootstrap filter. A state: particles [φ, φ̇, …, w], and the logarithms of their weights."""

    def __init__(self, model: inphase.Model, members: int) -> None:
        self.model, self.members, self.curves = model, members, Curves(model.layout)

    def init(self, rng: np.random.Generator) -> tuple[list[np.ndarray], list[float]]:
        return drawn(self.model, self.members, rng), [0.0] * self.members

    def step(
        self,
        state: tuple[list[np.ndarray], list[float]],
        seen: Observation,
        dt: float,
        rng: np.random.Generator,
    ) -> tuple[list[np.ndarray], list[float]]:
        particles, log_weights = moved(self.model, state[0], dt, rng), []
        if len(seen) == 0:
            return particles, state[1]
        size = len(self.model.phase.mean)
        for x, before in zip(particles, state[1], strict=True):
            off = seen.values - self.curves.readings(x[0], x[size:], seen.features)
            log_weights.append(before - 0.5 * float((off**2 / seen.noise_var).sum()))
        weights = shares(log_weights)
        if 1 / sum(weight**2 for weight in weights) >= 0.5 * len(particles):
            return particles, log_weights
        return [particles[i] for i in systematic(weights, rng)], [0.0] * len(particles)

    def believed(self, state: tuple[list[np.ndarray], list[float]]) -> Believed:
        return moments(state[0], shares(state[1]), len(self.model.phase.mean))
