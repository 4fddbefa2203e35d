"""The ensemble filter, member by member."""

from __future__ import annotations

import numpy as np

import inphase
from inphase.observation import Observation
from loops.curves import Curves, within
from loops.members import Believed, drawn, moments, moved


class EbipLoop:
    """Fig. 23 member by member. A state: members [φ, φ̇, …, w]."""

    def __init__(self, model: inphase.Model, members: int) -> None:
        self.model, self.members, self.curves = model, members, Curves(model.layout)

    def init(self, rng: np.random.Generator) -> list[np.ndarray]:
        return drawn(self.model, self.members, rng)

    def step(
        self, members: list[np.ndarray], seen: Observation, dt: float, rng: np.random.Generator
    ) -> list[np.ndarray]:
        members = moved(self.model, members, dt, rng)
        if len(seen) == 0:
            return members
        size, count, std = len(self.model.phase.mean), len(members), np.sqrt(seen.noise_var)
        readings = [self.curves.readings(x[0], x[size:], seen.features) for x in members]  # HX, Eq. 3.2
        mean, mean_reading = sum(members) / count, sum(readings) / count
        around = np.array([x - mean for x in members]).T  # A, Eq. 3.5
        deviations = np.array([reading - mean_reading for reading in readings]).T  # HA, Eq. 3.3
        innovation_cov = deviations @ deviations.T / (count - 1) + np.diag(seen.noise_var)  # S, Eq. 3.4
        gain = around @ deviations.T @ np.linalg.inv(innovation_cov) / (count - 1)  # K, Eq. 3.6
        updated = []
        for x, reading in zip(members, readings, strict=True):  # Eq. 3.7
            x = x + gain @ (seen.values + std * rng.standard_normal(len(seen)) - reading)
            x[0] = within(x[0])
            updated.append(x)
        return updated

    def believed(self, members: list[np.ndarray]) -> Believed:
        return moments(members, [1 / len(members)] * len(members), len(self.model.phase.mean), unbiased=True)
