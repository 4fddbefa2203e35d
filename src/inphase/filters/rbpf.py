"""Rao-Blackwellised filter: particles over the phase, each with an exact Kalman filter over the weights.

Given the path of the phase, the weights are linear and Gaussian (Eq. 2.7 to 2.10 without the phase columns of H). So
only phase and tempo are sampled (DESIGN 4, trap 8), and what makes an extended Kalman filter fail, a phase that is
uncertain while the movement is curved, is not linearised at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError
from inphase.filters.belief import Course, factor_of, mixed
from inphase.filters.filter import StepInfo
from inphase.filters.gaussian import ABSURD, backward, forward
from inphase.filters.resampling import effective_size, systematic
from inphase.filters.tempo import Motion, advance, begin
from inphase.model import Model
from inphase.observation import Observation

FREE_DIRECTIONS = 24  # are filtered in any case: they take hardly more time than fewer would
VARIANCE_KEPT = 0.99  # by the directions that are filtered; the rest is added to the noise
MOST_DIRECTIONS = 63  # for the time a step takes: with the readings 64 rows, which LAPACK likes
RESAMPLE_BELOW = 0.5  # of the particles, their effective number
ROUNDING = 1e-9  # directions so much smaller than the widest are none
PHASES = 100  # at which the rest of the variance is tabulated
LOOKED_AT = 2000  # phases in a response, particles times samples; fewer particles speak for all when there are more
LOOKED_INTO = 60  # for the variance within particles, which have much in common


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

    log_weights: (P,). information: (P, R + 1, R + 1) per particle what was learned of the weights, R of them, and what
    was read, in the last row. roots: their lower triangular roots.
    """

    model: Model
    directions: Directions
    log_weights: Float[np.ndarray, " P"]
    motion: Motion
    information: Float[np.ndarray, "P n n"]
    roots: Float[np.ndarray, "P n n"]

    def __post_init__(self) -> None:
        for array in (self.log_weights, self.information, self.roots):
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
    def means(self) -> Float[np.ndarray, "P R"]:
        """(P, R) the means of the coordinates."""
        return frozen(backward(self.roots[:, :-1, :-1], self.roots[:, -1, :-1]))

    @property
    def covs(self) -> Float[np.ndarray, "P R R"]:
        """(P, R, R) their covariances."""
        size = self.roots.shape[1] - 1
        inverse = forward(self.roots[:, :-1, :-1], np.tile(np.eye(size), (len(self.roots), 1, 1)))
        return np.asarray(inverse.transpose(0, 2, 1) @ inverse)

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
        samples, model, everyone = len(course.share), self.model, np.arange(len(self.weights))
        # Sorted by phase, so that those who speak stand where all of them stand.
        most = LOOKED_AT // samples
        order = everyone if len(everyone) <= most else np.argsort(self.motion.phase)
        many, shares = _speaking(self.weights, order, max(most, 20))
        phases = model.phase.confine(self.motion.phase[many, None] * course.share + course.offset)
        plain, rows = model.layout.predict_and_project(
            phases.reshape(-1), model.prior.mean, self.directions.rows, features
        )
        plain, rows = (part.reshape(*phases.shape, *part.shape[1:]) for part in (plain, rows))
        mean = plain + (self.means[many][:, None, None] @ rows)[:, :, 0]
        mean, between = mixed(shares, mean, np.zeros_like(mean))
        few, shares = _speaking(shares, np.arange(len(many)), max(LOOKED_INTO // samples, 10))
        across = rows[few].transpose(0, 2, 1, 3).reshape(len(few), rows.shape[2], plain[0].size)
        white = forward(self.roots[many[few], :-1, :-1], across)
        within = (white**2).sum(1) + self.directions.rest_at(phases[few].reshape(-1), features).reshape(len(few), -1)
        return mean, between + (shares @ within).reshape(mean.shape)


def _speaking(
    weights: Float[np.ndarray, " P"], order: Int[np.ndarray, " P"], count: int
) -> tuple[Int[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
    """At most so many particles that speak for all, evenly chosen in some order, and their shares."""
    if len(weights) <= count:
        return order, weights[order]
    return order[systematic(weights[order], count, 0.5)], np.full(count, 1 / count)


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
        enough = max(int(np.searchsorted(share, VARIANCE_KEPT)) + 1, FREE_DIRECTIONS)
        kept = min(enough, MOST_DIRECTIONS, int(np.count_nonzero(size > ROUNDING * size[0])))
        turn = turn[:, :kept]
        rows = turn.T @ factor
        rest = (curves**2).sum(1) - (layout.project_each(grid, rows) ** 2).sum(1)
        return Directions(turn, rows, np.maximum(rest, 0.0))

    def init(self, rng: np.random.Generator) -> ParticleBelief:
        """The prior: every particle knows as little of the weights as the others."""
        motion, log_weights = begin(self.model.phase, self.model.tempo, self.particles, rng)
        nothing = np.tile(np.eye(len(self.directions.rows) + 1), (self.particles, 1, 1))
        return ParticleBelief(self.model, self.directions, log_weights, motion, nothing, nothing)

    def predict(self, belief: ParticleBelief, dt: float, rng: np.random.Generator) -> ParticleBelief:
        """The particles move on; nothing else does."""
        if dt == 0:
            return belief
        motion = advance(belief.motion, self.model.phase, self.model.tempo, dt, rng)
        return replace(belief, motion=motion)

    def step(
        self, belief: ParticleBelief, observation: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[ParticleBelief, StepInfo]:
        """Every particle learns of its weights (Eq. 2.7 to 2.10), and counts by how well it foresaw the sample."""
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
            learned = _learned(belief, rows, observation.values - plain, noise_var)
        if learned is None:
            return belief, StepInfo(healthy=False)
        information, roots, log_likelihood, surprise = learned
        # A misfit is one of the phase, not of the moment: who stands reads the same again, and learns nothing of it.
        waiting = belief.motion.waiting
        information[waiting], roots[waiting] = belief.information[waiting], belief.roots[waiting]
        log_weights = np.log(np.maximum(belief.weights, 1e-300)) + log_likelihood
        highest = log_weights.max()
        updated = replace(belief, log_weights=log_weights - highest, information=information, roots=roots)
        # Particles that were somewhere else are surprised without need: it counts for as much as they still do.
        info = StepInfo(float(highest + np.log(np.exp(log_weights - highest).sum())), float(updated.weights @ surprise))
        return _resampled(updated, rng), info


def _learned(
    belief: ParticleBelief,
    rows: Float[np.ndarray, "P R M"],
    readings: Float[np.ndarray, "P M"],
    noise_var: Float[np.ndarray, "P M"],
) -> (
    tuple[Float[np.ndarray, "P n n"], Float[np.ndarray, "P n n"], Float[np.ndarray, " P"], Float[np.ndarray, " P"]]
    | None
):
    """Information, roots, log-likelihood and squared surprise of every particle after a sample; None for an absurd one.

    readings: less those of the mean movement. Kalman's update in the form that adds up, [Hᵀ; y] R⁻¹ [H y]: its cost
    hardly hangs on how many readings there are. The corner of the root is what the readings are off, given all that
    was learned, so one factorisation says all; what it says is taken off, and what was read long ago is not carried on.
    """
    readable = readings.shape[1]
    scaled = np.concatenate([rows, readings[:, None]], axis=1)
    scaled /= np.sqrt(noise_var)[:, None]
    information = scaled @ scaled.transpose(0, 2, 1)
    information += belief.information
    try:
        roots = np.linalg.cholesky(information)
    except np.linalg.LinAlgError:
        return None
    surprise = np.maximum(roots[:, -1, -1] ** 2 - 1, 0.0)
    information[:, -1, -1] -= surprise
    roots[:, -1, -1] = 1.0
    log_det = 2 * (_log_det(roots) - _log_det(belief.roots)) + np.log(2 * np.pi * noise_var).sum(1)  # of S, Eq. 2.7
    log_likelihood = -0.5 * (surprise + log_det)
    if not np.isfinite(log_likelihood).all() or surprise.min() > ABSURD**2 * readable:
        return None
    return information, roots, log_likelihood, surprise


def _log_det(roots: Float[np.ndarray, "P n n"]) -> Float[np.ndarray, " P"]:
    """(P,) the logarithms of the determinants of roots."""
    return np.asarray(np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(1))


def _resampled(belief: ParticleBelief, rng: np.random.Generator) -> ParticleBelief:
    """The belief itself, or, when few particles carry it, as many new ones that weigh the same."""
    count = len(belief.weights)
    if effective_size(belief.weights) >= RESAMPLE_BELOW * count:
        return belief
    kept = systematic(belief.weights, count, float(rng.random()))
    return replace(
        belief,
        log_weights=np.zeros(count),
        motion=belief.motion.pick(kept),
        information=belief.information[kept],
        roots=belief.roots[kept],
    )
