"""The Rao-Blackwellised filter, particle by particle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

import inphase
from inphase.filters import tempo
from inphase.filters.rbpf import RESAMPLE_BELOW, Rbpf
from inphase.observation import Observation
from loops.curves import Curves, within
from loops.members import Believed, moments, shares, systematic


@dataclass(frozen=True)
class PhaseParticle:
    """One of rbpf's: where it is, how it moves, and its Gaussian over the directions of the prior."""

    phase: float
    own: float
    momentary: float
    waiting: bool
    log_weight: float
    mean: np.ndarray
    cov: np.ndarray


class RbpfLoop:
    """A Kalman filter for each particle of phase and tempo. A state: the particles."""

    def __init__(self, model: inphase.Model, members: int) -> None:
        self.model, self.members, self.curves = model, members, Curves(model.layout)
        self.directions = Rbpf(model).directions

    def init(self, rng: np.random.Generator) -> list[PhaseParticle]:
        begun, log_weights = tempo.begin(self.model.phase, self.model.tempo, self.members, rng)
        size = len(self.directions.rows)
        moving = zip(begun.phase, begun.own, begun.momentary, begun.waiting, log_weights, strict=True)
        return [PhaseParticle(*one, np.zeros(size), np.eye(size)) for one in moving]

    def step(
        self, particles: list[PhaseParticle], seen: Observation, dt: float, rng: np.random.Generator
    ) -> list[PhaseParticle]:
        typical = self.model.phase.nominal_velocity * dt
        steps = min(int(np.ceil(typical / tempo.LONGEST_STEP)), tempo.MOST_STEPS)
        for _ in range(steps):
            particles = self._moved(particles, dt / steps, rng)
        if len(seen) == 0:
            return particles
        particles = [self._updated(one, seen) for one in particles]
        weights = shares([one.log_weight for one in particles])
        if 1 / sum(weight**2 for weight in weights) >= RESAMPLE_BELOW * len(particles):
            return particles
        return [replace(particles[i], log_weight=0.0) for i in systematic(weights, rng)]

    def _moved(self, particles: list[PhaseParticle], dt: float, rng: np.random.Generator) -> list[PhaseParticle]:
        """The particles dt [s] later: each may take on another tempo, for good or for a stretch, stop, go or leap."""
        count, kinds = len(particles), self.model.tempo
        typical = self.model.phase.nominal_velocity * dt
        change, stretch, stop, go, leap = (
            rng.random(count) < 1 - np.exp(-rate * typical)
            for rate in (kinds.change_rate, kinds.stretch_rate, kinds.stop_rate, kinds.go_rate, kinds.leap_rate)
        )
        # The order of the draws: a share of its own for each, then which kind of tempo it is.
        own_share, own_kind = (rng.permutation(count) + rng.random(count)) / count, rng.random(count)
        new_share, new_kind = (rng.permutation(count) + rng.random(count)) / count, rng.random(count)
        jitter = tempo.PHASE_JITTER * np.sqrt(typical) * rng.standard_normal(count)
        leapt = np.where(leap, kinds.leap * rng.random(count), 0.0)
        found = []
        for i, one in enumerate(particles):
            own, momentary = one.own, one.momentary
            if change[i]:
                own = (kinds.usual_std if own_kind[i] < kinds.usual else kinds.other_std) * ndtri(own_share[i])
            if stretch[i]:
                momentary = (kinds.momentary_std if new_kind[i] < kinds.steady else kinds.other_std) * ndtri(
                    new_share[i]
                )
            one = replace(one, own=own, momentary=momentary, waiting=not go[i] if one.waiting else bool(stop[i]))
            found.append(replace(one, phase=within(one.phase + self._tempo(one) * dt + jitter[i] + leapt[i])))
        return found

    def _updated(self, one: PhaseParticle, seen: Observation) -> PhaseParticle:
        """Eq. 2.7 to 2.10 without the phase columns of H; the weight is that of how well it foresaw."""
        prior, (rows, rest) = self.model.prior, (self.directions.rows, self.directions.rest)
        left = rest[int(np.round(one.phase * (len(rest) - 1)))][seen.features]
        noise_var = seen.noise_var + left * seen.noise_var / self.model.noise.var[seen.features]
        values, places = self.curves.values(one.phase, seen.features), self.curves.places
        jacobian = np.array([rows[:, places[f]] @ v for f, v in zip(seen.features, values, strict=True)])
        expected = self.curves.readings(one.phase, prior.mean, seen.features) + jacobian @ one.mean
        innovation = seen.values - expected
        innovation_cov = jacobian @ one.cov @ jacobian.T + np.diag(noise_var)
        inverse = np.linalg.inv(innovation_cov)
        gain = one.cov @ jacobian.T @ inverse
        log_density = -0.5 * (innovation @ inverse @ innovation + np.linalg.slogdet(innovation_cov)[1])
        return replace(
            one,
            log_weight=one.log_weight + float(log_density),
            mean=one.mean if one.waiting else one.mean + gain @ innovation,
            cov=one.cov if one.waiting else one.cov - gain @ jacobian @ one.cov,
        )

    def _tempo(self, one: PhaseParticle) -> float:
        return 0.0 if one.waiting else self.model.phase.nominal_velocity * float(np.exp(one.own + one.momentary))

    def believed(self, particles: list[PhaseParticle]) -> Believed:
        weights = shares([one.log_weight for one in particles])
        moving = [np.append([one.phase, self._tempo(one)], one.mean) for one in particles]
        mean, cov, directions = moments(moving, weights, 2)
        return mean, cov, self.model.prior.mean + directions @ self.directions.rows
