"""Particle filter over the full state [φ, φ̇, …, w], the dissertation's comparison (3.3, 4.2.7.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import frozen
from inphase.errors import OptionError, listing
from inphase.filters.belief import Course
from inphase.filters.filter import StepInfo
from inphase.filters.gaussian import spread_score
from inphase.filters.motion import advance, begin
from inphase.filters.resampling import effective_size, systematic
from inphase.model import Model
from inphase.observation import Observation

PRIORS = ("demonstrations", "gaussian")


@dataclass(frozen=True, eq=False)
class WeightedBelief:
    """Particles that are more or less likely.

    moving: (P, K) their phases and derivatives. drawn: (Q, B) the basis weights that were drawn at the start, and
    origin: (P,) which of them each particle has: nothing moves them. log_weights: (P,), of weights that sum to 1.
    """

    model: Model
    moving: Float[np.ndarray, "P K"]
    drawn: Float[np.ndarray, "Q B"]
    origin: Int[np.ndarray, " P"]
    log_weights: Float[np.ndarray, " P"]

    def __post_init__(self) -> None:
        for array in (self.moving, self.drawn, self.origin, self.log_weights):
            array.setflags(write=False)

    @property
    def particles(self) -> Float[np.ndarray, "P n"]:
        """(P, K + B) the states [φ, φ̇, …, w]."""
        return frozen(np.concatenate([self.moving, self.drawn[self.origin]], axis=1))

    @property
    def state_moments(self) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n"]]:
        """(K + B,) mean and (K + B, K + B) covariance of the state [φ, φ̇, …, w]."""
        states = np.concatenate([self._moving, self.drawn[self.origin]], axis=1)
        return self.weights @ states, np.cov(states, rowvar=False, ddof=0, aweights=self.weights)

    @cached_property
    def weights(self) -> Float[np.ndarray, " P"]:
        """(P,) the probability of each particle."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        return frozen(weights / weights.sum())

    @cached_property
    def _moving(self) -> Float[np.ndarray, "P K"]:
        """Phase and derivatives; a circle of phases is cut opposite to where they are likely, not where they are."""
        moving = self.moving
        if self.model.phase.periodic:
            moving, phases = moving.copy(), moving[:, 0]
            centre = np.angle(self.weights @ np.exp(2j * np.pi * phases)) / (2 * np.pi)
            moving[:, 0] = phases - np.round(phases - centre)
        return moving

    @cached_property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        mean = self.weights @ self._moving
        mean[:1] = self.model.phase.confine(mean[:1])
        return frozen(mean)

    @cached_property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        off = self._moving - self.weights @ self._moving
        return frozen((off * self.weights[:, None]).T @ off)

    @cached_property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        return frozen(np.bincount(self.origin, self.weights, minlength=len(self.drawn)) @ self.drawn)

    def weights_factor(self) -> Float[np.ndarray, "N B"]:
        shares = np.bincount(self.origin, self.weights, minlength=len(self.drawn))
        return np.asarray(np.sqrt(shares)[:, None] * (self.drawn - self.weights_mean))

    def readings(self, phases: Float[np.ndarray, "P S"], features: Int[np.ndarray, " M"]) -> Float[np.ndarray, "P S M"]:
        """What every particle reads at phases of its own."""
        return self.model.layout.predict_each(phases, self.drawn, features, self.origin)

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        phases = self.model.phase.confine(self.moving[:, :1] * course.share + course.offset)
        each = self.readings(phases, features).reshape(len(phases), -1)
        mean = self.weights @ each
        var = self.weights @ (each - mean) ** 2
        return mean.reshape(-1, len(features)), var.reshape(-1, len(features))


@dataclass(frozen=True)
class Particle:
    """Bootstrap filter: particles move by the phase model alone, and are weighed by what they foresaw.

    particles: P, at least 2. prior: "demonstrations" starts every particle with the weights of one of them, "gaussian"
    draws from their mean and covariance. resample_below: 0 (never) to 1 (always), the effective share of the particles
    below which those that count for little are replaced by copies of the others. Raises OptionError.

    Nothing moves a particle's weights w: resampling chooses among those that were drawn at the start, and fewer are
    left each time. From few demonstrations, a partner between two of them is answered with a mean of the two at best,
    one outside of them with the nearest; once a single one is left, the band holds no doubt about w at all. From the
    Gaussian, any w can be drawn, but the number of particles that are needed for one near the partner's grows
    exponentially with the number of directions in which demonstrations differ. `rbpf` has neither trouble.
    """

    model: Model
    particles: int = 1000
    prior: str = "demonstrations"
    resample_below: float = 0.5

    def __post_init__(self) -> None:
        if not isinstance(self.particles, (int, np.integer)) or self.particles < 2:
            raise OptionError(f"expected a whole number of at least 2 particles, got {self.particles!r}")
        if self.prior not in PRIORS:
            raise OptionError(f"unknown prior {self.prior!r}; one of {listing(PRIORS)}")
        if not isinstance(self.resample_below, (int, float, np.number)) or not 0 <= self.resample_below <= 1:
            raise OptionError(f"expected resample_below between 0 and 1, got {self.resample_below!r}")

    def init(self, rng: np.random.Generator) -> WeightedBelief:
        """The prior, in particles of equal weight."""
        import scipy.linalg  # noqa: F401 - here, so that the first live sample need not wait for it

        prior, count = self.model.prior, int(self.particles)
        moving = begin(self.model.phase, count, rng)
        weights = prior.draw(count, rng) if self.prior == "gaussian" else prior.resample(count, rng)
        drawn, origin = np.unique(weights, axis=0, return_inverse=True)
        return WeightedBelief(self.model, moving, drawn, origin.reshape(-1), even(count))

    def predict(self, belief: WeightedBelief, dt: float, rng: np.random.Generator) -> WeightedBelief:
        """Eq. 3.1 for every particle; only the phase and its derivatives move."""
        if dt == 0:
            return belief
        return replace(belief, moving=advance(belief.moving, self.model.phase, dt, rng))

    def step(
        self, belief: WeightedBelief, observation: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[WeightedBelief, StepInfo]:
        """The particles move on and are weighed by the density of the rows that were seen; then perhaps resampled."""
        belief = self.predict(belief, dt, rng)
        if len(observation) == 0:
            return belief, StepInfo()
        weights, noise_var = belief.weights, observation.noise_var
        readings = belief.readings(belief.moving[:, :1], observation.features)[:, 0]
        mean = weights @ readings
        off = readings - mean
        score = spread_score(observation.values - mean, off * np.sqrt(weights)[:, None], noise_var)
        with np.errstate(over="ignore"):  # an absurd reading is caught below
            squared = (observation.values - readings) ** 2 @ (1 / noise_var)
        log_weights = belief.log_weights - 0.5 * (squared + np.log(2 * np.pi * noise_var).sum())
        highest = float(log_weights.max())
        if score is None or not np.isfinite(highest):
            return belief, StepInfo(healthy=False)
        log_likelihood = highest + float(np.log(np.exp(log_weights - highest).sum()))
        weighed = replace(belief, log_weights=log_weights - log_likelihood)
        return self._resampled(weighed, rng), StepInfo(log_likelihood, score.surprise)

    def _resampled(self, belief: WeightedBelief, rng: np.random.Generator) -> WeightedBelief:
        """The belief itself, or, when few particles carry it, as many new ones that weigh the same."""
        count = len(belief.weights)
        if effective_size(belief.weights) >= self.resample_below * count:
            return belief
        kept = systematic(belief.weights, count, float(rng.random()))
        return replace(belief, moving=belief.moving[kept], origin=belief.origin[kept], log_weights=even(count))


def even(count: int) -> Float[np.ndarray, " P"]:
    """(P,) the logarithms of equal weights."""
    return np.full(count, -np.log(count))
