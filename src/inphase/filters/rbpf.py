"""Rao-Blackwellised filter: particles over the phase, each with an exact Kalman filter over the weights.

Given the path of the phase, the weights are linear and Gaussian (Eq. 2.7 to 2.10 without the phase columns of H). So
only phase and tempo are sampled (DESIGN 4, trap 8), and what makes an extended Kalman filter fail, a phase that is
uncertain while the movement is curved, is not linearised at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError
from inphase.filters.belief import Course, factor_of, mixed
from inphase.filters.filter import StepInfo
from inphase.filters.gaussian import ABSURD, forward
from inphase.filters.resampling import effective_size, systematic
from inphase.filters.tempo import Motion, advance, begin
from inphase.model import Model
from inphase.observation import Observation

VARIANCE_KEPT = 0.999  # by the directions that are filtered; the rest is added to the noise
MOST_DIRECTIONS = 24  # for the time a step takes
RESAMPLE_BELOW = 0.5  # of the particles, their effective number
PHASES = 100  # at which the rest of the variance is tabulated
AT_ONCE = 8  # readings that are taken in together
LOOKED_AT = 2000  # phases in a response, particles times samples; fewer particles speak for all when there are more


@dataclass(frozen=True, eq=False)
class Directions:
    """The few directions of the prior in which weights are filtered, and what they leave of its variance.

    turn: (_, R) orthonormal. rows: (R, B) turnᵀ @ the prior's factor, w = mean + c @ rows. rest: (PHASES, F) variance
    by phase.
    """

    turn: Float[np.ndarray, "_ R"]
    rows: Float[np.ndarray, "R B"]
    rest: Float[np.ndarray, "_ F"]

    def __post_init__(self) -> None:
        freeze(self, turn=self.turn, rows=self.rows, rest=self.rest)

    def rest_at(self, phases: Float[np.ndarray, " P"], features: Int[np.ndarray, " M"]) -> Float[np.ndarray, "P M"]:
        """(P, M) the variance that is left over at each phase."""
        nearest = ((phases % 1.0 if phases.max() > 1 or phases.min() < 0 else phases) * (len(self.rest) - 1)).round()
        return np.asarray(self.rest[nearest.astype(np.int64)[:, None], features])


@dataclass(frozen=True, eq=False)
class ParticleBelief:
    """Particles of phase and tempo, each with a Gaussian over the weights in the filter's directions.

    log_weights: (P,). means: (P, R), covs: (P, R, R).
    """

    model: Model
    directions: Directions
    log_weights: Float[np.ndarray, " P"]
    motion: Motion
    means: Float[np.ndarray, "P R"]
    covs: Float[np.ndarray, "P R R"]

    def __post_init__(self) -> None:
        for array in (self.log_weights, self.means, self.covs):
            array.setflags(write=False)

    @cached_property
    def weights(self) -> Float[np.ndarray, " P"]:
        """(P,) the probability of each particle."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        return frozen(weights / weights.sum())

    @cached_property
    def _moving(self) -> Float[np.ndarray, "P K"]:
        return np.stack([self.motion.phase, self.motion.tempo(self.model.phase)], axis=1)

    @cached_property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        return frozen(self.weights @ self._moving)

    @cached_property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        off = self._moving - self.phase_mean
        return frozen((off * self.weights[:, None]).T @ off)

    @cached_property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        return frozen(self.model.prior.mean + self.weights @ self.means @ self.directions.rows)

    def weights_factor(self) -> Float[np.ndarray, "N B"]:
        factor, directions = self.model.prior.factor, self.directions
        off = np.sqrt(self.weights)[:, None] * (self.means - self.weights @ self.means)
        cov = np.tensordot(self.weights, self.covs, 1) + off.T @ off
        # What is not filtered is believed as before.
        rest = factor - directions.turn @ directions.rows
        return np.concatenate([factor_of(cov) @ directions.rows, rest])

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        most = max(LOOKED_AT // len(course.share), 20)
        weights, standing, means, covs = self.weights, self.motion.phase, self.means, self.covs
        if len(weights) > most:
            order = np.argsort(standing)  # so that those who speak stand where all of them stand
            speaking = order[systematic(weights[order], most, 0.5)]
            weights, standing = np.full(most, 1 / most), standing[speaking]
            means, covs = means[speaking], covs[speaking]
        confined = self.model.phase.confine(standing[:, None] * course.share + course.offset)
        phases = confined.reshape(-1)
        plain, rows = self.model.layout.predict_and_project(
            phases, self.model.prior.mean, self.directions.rows, features
        )
        plain, rows = plain.reshape(*confined.shape, -1), rows.reshape(*confined.shape, -1, len(features))
        mean = plain + (means[:, None, None] @ rows)[:, :, 0]
        var = np.einsum("psrm,psrm->psm", rows, covs[:, None] @ rows)
        var += self.directions.rest_at(phases, features).reshape(var.shape)
        return mixed(weights, mean, var)


@dataclass(frozen=True)
class Rbpf:
    """Particles over phase and tempo, exact over the weights.

    particles: P, at least 10. Its tempo is positive and may pause, whatever the order of the model's phase prior.
    Raises OptionError.
    """

    model: Model
    particles: int = 200

    def __post_init__(self) -> None:
        if not isinstance(self.particles, (int, np.integer)) or self.particles < 10:
            raise OptionError(f"expected a whole number of at least 10 particles, got {self.particles!r}")

    @cached_property
    def directions(self) -> Directions:
        """As many directions of the prior, the widest first, as carry nearly all of its variance."""
        layout, factor = self.model.layout, self.model.prior.factor
        grid = np.linspace(0, 1, PHASES)
        curves = layout.project_each(grid, factor)  # (PHASES, R, F)
        # Widest as a movement, not as weights: bases overlap.
        flat = curves.transpose(1, 0, 2).reshape(len(factor), -1)
        turn, size, _ = np.linalg.svd(flat, full_matrices=False)
        share = np.cumsum(size**2) / max(float(np.sum(size**2)), np.finfo(float).tiny)
        kept = min(int(np.searchsorted(share, VARIANCE_KEPT)) + 1, MOST_DIRECTIONS, len(factor))
        turn = turn[:, :kept]
        rows = turn.T @ factor
        rest = (curves**2).sum(1) - (layout.project_each(grid, rows) ** 2).sum(1)
        return Directions(turn, rows, np.maximum(rest, 0.0))

    def init(self, rng: np.random.Generator) -> ParticleBelief:
        """The prior: every particle knows as little of the weights as the others."""
        size = len(self.directions.rows)
        motion, log_weights = begin(self.model.phase, self.model.tempo, self.particles, rng)
        return ParticleBelief(
            self.model,
            self.directions,
            log_weights,
            motion,
            np.zeros((self.particles, size)),
            np.tile(np.eye(size), (self.particles, 1, 1)),
        )

    def predict(self, belief: ParticleBelief, dt: float, rng: np.random.Generator) -> ParticleBelief:
        """The particles move on; nothing else does."""
        if dt == 0:
            return belief
        motion = advance(belief.motion, self.model.phase, self.model.tempo, dt, rng)
        return ParticleBelief(self.model, belief.directions, belief.log_weights, motion, belief.means, belief.covs)

    def step(
        self, belief: ParticleBelief, observation: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[ParticleBelief, StepInfo]:
        """A Kalman update of every particle's weights (Eq. 2.7 to 2.10); particles count by how well they foresaw."""
        belief = self.predict(belief, dt, rng)
        if len(observation) == 0:
            return belief, StepInfo()
        layout, phases, features = self.model.layout, belief.motion.phase, observation.features
        # What the mean movement reads, and Hᵀ, (P, R, M).
        plain, rows = layout.predict_and_project(phases, self.model.prior.mean, belief.directions.rows, features)
        # The variance that is not filtered lasts as long as the noise does, and is repeated as often.
        repeats = observation.noise_var / self.model.noise.var[features]
        noise_var = observation.noise_var + belief.directions.rest_at(phases, features) * repeats
        with np.errstate(over="ignore", invalid="ignore"):  # an absurd reading is found out at the end
            conditioned = _conditioned(belief, rows, observation.values - plain, noise_var)
        if conditioned is None:
            return belief, StepInfo(healthy=False)
        means, covs, log_likelihood, surprise = conditioned
        log_weights = np.log(np.maximum(belief.weights, 1e-300)) + log_likelihood
        highest = log_weights.max()
        updated = ParticleBelief(self.model, belief.directions, log_weights - highest, belief.motion, means, covs)
        # Particles that were somewhere else are surprised without need: it counts for as much as they still do.
        info = StepInfo(float(highest + np.log(np.exp(log_weights - highest).sum())), float(updated.weights @ surprise))
        return _resampled(updated, rng), info


def _conditioned(
    belief: ParticleBelief,
    rows: Float[np.ndarray, "P R M"],
    readings: Float[np.ndarray, "P M"],
    noise_var: Float[np.ndarray, "P M"],
) -> (
    tuple[Float[np.ndarray, "P R"], Float[np.ndarray, "P R R"], Float[np.ndarray, " P"], Float[np.ndarray, " P"]] | None
):
    """Means, covariances, log-likelihood and squared surprise of every particle after a sample; None for an absurd one.

    readings: less those of the mean movement. A few at a time, one lot after the other: their noise is independent,
    and several small systems are less work than a large one.
    """
    means, covs = belief.means, belief.covs
    count, readable = len(means), readings.shape[1]
    log_likelihood, surprise = np.full(count, -0.5 * readable * np.log(2 * np.pi)), np.zeros(count)
    for first in range(0, readable, AT_ONCE):
        lot = slice(first, first + AT_ONCE)
        across = rows[:, :, lot].transpose(0, 2, 1)  # H
        innovation = readings[:, lot] - (across @ means[:, :, None])[:, :, 0]
        cross = across @ covs  # H Σ
        innovation_cov = cross @ rows[:, :, lot]  # S, Eq. 2.7
        diagonal = np.arange(innovation.shape[1])
        innovation_cov[:, diagonal, diagonal] += noise_var[:, lot]
        try:
            root = np.linalg.cholesky(innovation_cov)
        except np.linalg.LinAlgError:
            return None
        white = forward(root, np.concatenate([innovation[:, :, None], cross], axis=2))
        gain = white[:, :, 1:].transpose(0, 2, 1)
        means = means + (gain @ white[:, :, :1])[:, :, 0]  # Eq. 2.9
        covs = covs - gain @ white[:, :, 1:]  # Eq. 2.10, symmetric by construction
        surprise += (white[:, :, 0] ** 2).sum(1)
        log_likelihood -= np.log(root[:, diagonal, diagonal]).sum(1)
    log_likelihood -= 0.5 * surprise
    if not np.isfinite(log_likelihood).all() or surprise.min() > ABSURD**2 * readable:
        return None
    return means, covs, log_likelihood, surprise


def _resampled(belief: ParticleBelief, rng: np.random.Generator) -> ParticleBelief:
    """The belief itself, or, when few particles carry it, as many new ones that weigh the same."""
    count = len(belief.weights)
    if effective_size(belief.weights) >= RESAMPLE_BELOW * count:
        return belief
    kept = systematic(belief.weights, count, float(rng.random()))
    return ParticleBelief(
        belief.model,
        belief.directions,
        np.zeros(count),
        belief.motion.pick(kept),
        belief.means[kept],
        belief.covs[kept],
    )
