"""Interaction ProMP: a Kalman filter over the weights, and a phase that is found beside it.

The baseline that Bayesian Interaction Primitives are measured against (2.6, 4.2.7.2). With the phase given, the weights
are linear and Gaussian, Eq. 2.7 to 2.10 without the phase columns of H. The phase comes from one of two methods of the
literature: from aligning the observations with the mean trajectory, or from the likelihood of candidate tempos.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError, listing
from inphase.filters.alignment import Alignment, Reference
from inphase.filters.belief import Course
from inphase.filters.candidates import Candidates
from inphase.filters.filter import StepInfo
from inphase.filters.gaussian import ABSURD
from inphase.model import Model
from inphase.observation import Observation

METHODS = ("alignment", "candidates")


@dataclass(frozen=True, eq=False)
class PrompBelief:
    """Hypotheses of the phase, and a Gaussian over the weights in the prior's directions: w = mean + c @ factor.

    means: (W, R), covs: (W, R, R); W is 1 where the hypotheses, open ends of an alignment, share what is believed of
    the weights, and as many as the candidates where each of them has its own.
    """

    model: Model
    timing: Alignment | Candidates
    means: Float[np.ndarray, "W R"]
    covs: Float[np.ndarray, "W R R"]

    def __post_init__(self) -> None:
        freeze(self, means=self.means, covs=self.covs)

    @cached_property
    def _moving(self) -> Float[np.ndarray, "P 2"]:
        phases = self.timing.phases
        if self.model.phase.periodic:  # within half a turn of their mean, which is one on the circle
            centre = np.angle(self.timing.weights @ np.exp(2j * np.pi * phases)) / (2 * np.pi) % 1.0
            phases = phases - np.round(phases - centre)
        return np.stack([phases, self.timing.tempos], axis=1)

    @property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        return frozen(self.timing.weights @ self._moving)

    @property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        off = self._moving - self.phase_mean
        return frozen((off * self.timing.weights[:, None]).T @ off + np.diag([0.0, self.timing.tempo_var]))

    @property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        mean = self.timing.weights @ self.means if len(self.means) > 1 else self.means[0]
        return frozen(self.model.prior.mean + mean @ self.model.prior.factor)

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        nodes, layout = self.timing.nodes, self.model.layout
        phases = self.model.phase.confine(self._moving[nodes, :1] * course.share + course.offset)
        flat, shape = phases.reshape(-1), (*phases.shape, len(features))
        rows = layout.project_each(flat, self.model.prior.factor, features).reshape(*phases.shape, -1, len(features))
        plain = layout.predict(flat, self.model.prior.mean, features).reshape(shape)
        mean = plain + (self.means[:, None, None] @ rows)[:, :, 0]
        var = (rows * (self.covs[:, None] @ rows)).sum(2)
        weights = self.timing.node_weights
        over_all = np.tensordot(weights, mean, 1)
        return over_all, np.tensordot(weights, var + (mean - over_all) ** 2, 1)


@dataclass(frozen=True, eq=False)
class Innovations:
    """What a sample tells about the weights, under each of several hypotheses of the phase."""

    rows: Float[np.ndarray, "P R M"]
    noise_cov: Float[np.ndarray, "M M"]
    innovation: Float[np.ndarray, "P M"]
    cross: Float[np.ndarray, "P R M"]
    cov: Float[np.ndarray, "P M M"]
    log_likelihood: Float[np.ndarray, " P"]
    surprise: Float[np.ndarray, " P"]


@dataclass(frozen=True)
class Promp:
    """A Kalman filter over the weights, with the phase found beside it.

    phase: "alignment" finds it by incremental open-end dynamic time warping onto the mean trajectory; "candidates"
    follows `starts` · `tempos` partners, each with a tempo of its own that never changes, and believes them by their
    likelihood. It is deterministic: the random generator is not used. Raises OptionError.

    With an alignment, each sample is taken in once, at the phase expected when it comes. An alignment that
    changes its mind about the past does not take back what was learned there: a filter looks ahead.
    """

    model: Model
    phase: str = "alignment"
    starts: int = 3
    tempos: int = 41

    def __post_init__(self) -> None:
        if self.phase not in METHODS:
            raise OptionError(f"unknown phase {self.phase!r}; one of {listing(METHODS)}")
        for name, count in (("starts", self.starts), ("tempos", self.tempos)):
            if not isinstance(count, (int, np.integer)) or count < 1:
                raise OptionError(f"expected a whole number of at least 1 of {name}, got {count!r}")
        if self.phase == "candidates" and self.model.phase.order == 0:
            raise OptionError('phase="candidates": expected a phase prior with a tempo, of order 1 or 2, got order 0')

    @cached_property
    def reference(self) -> Reference:
        """What observations are aligned with."""
        return Reference.of(self.model)

    def init(self, rng: np.random.Generator) -> PrompBelief:
        """The prior over the weights (Eq. 2.14) and over the phase."""
        timing: Alignment | Candidates
        if self.phase == "alignment":
            timing, count = Alignment.begin(self.model, self.reference), 1
        else:
            timing, count = Candidates.begin(self.model.phase, self.starts, self.tempos), self.starts * self.tempos
        size = len(self.model.prior.factor)
        return PrompBelief(self.model, timing, np.zeros((count, size)), np.tile(np.eye(size), (count, 1, 1)))

    def predict(self, belief: PrompBelief, dt: float, rng: np.random.Generator) -> PrompBelief:
        """The phase moves on; nothing else does."""
        if dt == 0:
            return belief
        return PrompBelief(self.model, belief.timing.passed(dt), belief.means, belief.covs)

    def step(
        self, belief: PrompBelief, observation: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[PrompBelief, StepInfo]:
        """The phase is found, then the weights are conditioned on the sample at that phase."""
        belief = self.predict(belief, dt, rng)
        if len(observation) == 0:
            return belief, StepInfo()
        timing = belief.timing
        phases, weights = timing.phases[timing.nodes], timing.node_weights
        foreseen = self._innovations(belief, phases, observation, np.diag(observation.noise_var))
        if foreseen is None:
            return belief, StepInfo(healthy=False)
        joint = np.log(np.maximum(weights, 1e-300)) + foreseen.log_likelihood
        highest = joint.max()
        shares = np.exp(joint - highest)
        log_likelihood = float(highest + np.log(shares.sum()))
        # Hypotheses of elsewhere are surprised without need: they count for as much as they still do.
        info = StepInfo(log_likelihood, float(shares @ foreseen.surprise / shares.sum()))
        if isinstance(timing, Candidates):
            timing = timing.weighed(foreseen.log_likelihood)
        else:
            timing = timing.seen(observation)
            foreseen = self._aligned(PrompBelief(self.model, timing, belief.means, belief.covs), observation)
            if foreseen is None:
                return belief, StepInfo(healthy=False)
        return PrompBelief(self.model, timing, *_conditioned(belief, foreseen)), info

    def _aligned(self, belief: PrompBelief, observation: Observation) -> Innovations | None:
        """The sample at the expected phase; what the doubt about the phase makes of it is one more noise.

        It lasts as long as the other noise, and is repeated as often.
        """
        phase = self.model.phase.confine(belief.phase_mean[:1])
        slope = self.model.layout.slope(phase, belief.weights_mean, observation.features)[0]
        repeats = observation.noise_var / self.model.noise.var[observation.features]
        doubt = slope * np.sqrt(belief.phase_cov[0, 0] * repeats)
        return self._innovations(belief, phase, observation, np.diag(observation.noise_var) + np.outer(doubt, doubt))

    def _innovations(
        self,
        belief: PrompBelief,
        phases: Float[np.ndarray, " P"],
        observation: Observation,
        noise_cov: Float[np.ndarray, "M M"],
    ) -> Innovations | None:
        """The sample as foreseen at each phase; None where it is no reading at any."""
        layout, features = self.model.layout, observation.features
        rows = layout.project_each(phases, self.model.prior.factor, features)  # Hᵀ
        plain = layout.predict(phases, self.model.prior.mean, features)
        innovation = observation.values - plain - (belief.means[:, None] @ rows)[:, 0]
        cross = belief.covs @ rows  # Σ Hᵀ
        cov = rows.transpose(0, 2, 1) @ cross + noise_cov  # S, Eq. 2.7
        try:
            root = np.linalg.cholesky(cov)
        except np.linalg.LinAlgError:
            return None
        white = np.linalg.solve(root, innovation[:, :, None])[:, :, 0]
        with np.errstate(over="ignore", invalid="ignore"):  # an absurd reading is caught below
            surprise = (white**2).sum(1)
        log_det = 2 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(1)
        log_likelihood = -0.5 * (surprise + log_det + len(features) * np.log(2 * np.pi))
        if not np.isfinite(log_likelihood).all() or surprise.min() > ABSURD**2 * len(features):
            return None
        return Innovations(rows, noise_cov, innovation, cross, cov, log_likelihood, surprise)


def _conditioned(
    belief: PrompBelief, foreseen: Innovations
) -> tuple[Float[np.ndarray, "W R"], Float[np.ndarray, "W R R"]]:
    """Means and covariances of the weights after the sample (Eq. 2.8 to 2.10)."""
    gain = np.linalg.solve(foreseen.cov, foreseen.cross.transpose(0, 2, 1)).transpose(0, 2, 1)  # K, Eq. 2.8
    means = belief.means + (gain @ foreseen.innovation[:, :, None])[:, :, 0]  # Eq. 2.9
    # Eq. 2.10 in Joseph form, (I - K H) Σ (I - K H)ᵀ + K R Kᵀ, without any product of two R × R matrices.
    half = belief.covs - gain @ foreseen.cross.transpose(0, 2, 1)
    covs = half - (half @ foreseen.rows) @ gain.transpose(0, 2, 1) + gain @ foreseen.noise_cov @ gain.transpose(0, 2, 1)
    return means, (covs + covs.transpose(0, 2, 1)) / 2
