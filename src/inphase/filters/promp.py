"""Interaction ProMP: a Kalman filter over the weights, and a phase that is found beside it.

The baseline that Bayesian Interaction Primitives are measured against (2.6, 4.2.7.2). With the phase given, the weights
are linear and Gaussian. The phase comes from one of two methods of the literature: from aligning the observations with
the expected trajectory, or from the likelihood of candidate tempos.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import frozen
from inphase.errors import OptionError, listing
from inphase.filters.alignment import WINDOW, Alignment, grid
from inphase.filters.belief import Course, factor_of, mixed
from inphase.filters.candidates import Candidates
from inphase.filters.conditioning import Foreseen, Weights, foresee
from inphase.filters.filter import StepInfo
from inphase.model import Model
from inphase.observation import Observation

METHODS = ("alignment", "candidates")
PHASES = 200  # of the reference
LEAST_NEWS = 1e-6  # of a doubt that was met a moment ago
ODD = 9.0  # squared distance of a reading, in its variance, from what is expected where it fits best


@dataclass(frozen=True, eq=False)
class PrompBelief:
    """Hypotheses of the phase, and Gaussians over the weights.

    There is one Gaussian that all open ends of an alignment share, or one for each candidate.
    """

    model: Model
    timing: Alignment | Candidates
    weights: Weights

    @cached_property
    def _moving(self) -> Float[np.ndarray, "P 2"]:
        phases = self.timing.phases
        if self.model.phase.periodic:  # within half a turn of their mean, which is one on the circle
            centre = np.angle(self.timing.weights @ np.exp(2j * np.pi * phases)) / (2 * np.pi) % 1.0
            phases = phases - np.round(phases - centre)
        return np.stack([phases, self.timing.tempos], axis=1)

    @cached_property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        return frozen(self.timing.weights @ self._moving)

    @cached_property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        off = self._moving - self.phase_mean
        return frozen((off * self.timing.weights[:, None]).T @ off + np.diag([0.0, self.timing.tempo_var]))

    @cached_property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        means = self.weights.means
        mean = means[0] if len(means) == 1 else self.timing.weights @ means
        return frozen(self.model.prior.mean + mean @ self.model.prior.factor)

    def weights_factor(self) -> Float[np.ndarray, "N B"]:
        shares, means, covs = self.timing.weights, self.weights.means, self.weights.covs
        if len(means) == 1:
            return np.asarray(factor_of(covs[0]) @ self.model.prior.factor)
        off = np.sqrt(shares)[:, None] * (means - shares @ means)
        cov = np.tensordot(shares, covs, 1) + off.T @ off
        return np.asarray(factor_of(cov) @ self.model.prior.factor)

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        layout, prior = self.model.layout, self.model.prior
        phases = self.model.phase.confine(self._moving[self.timing.nodes, :1] * course.share + course.offset)
        flat = phases.reshape(-1)
        plain, rows = layout.predict_and_project(flat, prior.mean, prior.factor, features)
        plain, rows = plain.reshape(*phases.shape, -1), rows.reshape(*phases.shape, -1, len(features))
        mean = plain + (self.weights.means[:, None, None] @ rows)[:, :, 0]
        var = np.maximum((rows * (self.weights.covs[:, None] @ rows)).sum(2), 0.0)
        return mixed(self.timing.node_weights, mean, var)


@dataclass(frozen=True)
class Promp:
    """A Kalman filter over the weights, with the phase found beside it.

    phase: "alignment" finds it by incremental open-end dynamic time warping onto the trajectory that is expected of
    this partner by now, at first that of the mean (as in 2.6); "candidates" follows `starts` · `tempos` partners, each
    with a tempo of its own that never changes, and believes them by their likelihood. Alignment is the default: it is
    quicker, and follows a partner who goes much faster or pauses; candidates are a little better where the tempo is
    steady and near to the demonstrated one. Both are deterministic: the random generator is not used. Raises
    OptionError.

    With an alignment, each sample is taken in once, at the phase that is expected when it comes. An alignment that
    changes its mind about the past does not take back what was learned there: a filter looks ahead, and what the doubt
    about the phase makes of a sample was counted as noise. What fits nowhere is believed the less the odder it is.
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

    def init(self, rng: np.random.Generator) -> PrompBelief:
        """The prior over the weights (Eq. 2.14) and over the phase."""
        if self.phase == "alignment":
            return PrompBelief(self.model, Alignment.begin(self.model), Weights.prior(self.model, 1))
        candidates = Candidates.begin(self.model.phase, self.starts, self.tempos)
        return PrompBelief(self.model, candidates, Weights.prior(self.model, self.starts * self.tempos))

    def predict(self, belief: PrompBelief, dt: float, rng: np.random.Generator) -> PrompBelief:
        """The phase moves on; nothing else does."""
        if dt == 0:
            return belief
        return PrompBelief(self.model, belief.timing.passed(dt), belief.weights)

    def step(
        self, belief: PrompBelief, observation: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[PrompBelief, StepInfo]:
        """The phase is found, then the weights are conditioned on the sample at that phase."""
        belief = self.predict(belief, dt, rng)
        if len(observation) == 0:
            return belief, StepInfo()
        timing, noise_cov = belief.timing, np.diag(observation.noise_var)
        foreseen = foresee(self.model, belief.weights, timing.phases[timing.nodes], observation, noise_cov)
        if foreseen is None:
            return belief, StepInfo(healthy=False)
        info = _told(timing.node_weights, foreseen)
        if isinstance(timing, Candidates):
            weighed = timing.weighed(foreseen.log_likelihood)
            return PrompBelief(self.model, weighed, foreseen.condition(belief.weights)), info
        aligned = timing.seen(observation, *self._reference(belief, observation))
        fitted = self._fitted(PrompBelief(self.model, aligned, belief.weights), observation, timing.unseen)
        if fitted is None:
            return belief, StepInfo(healthy=False)
        return PrompBelief(self.model, aligned, fitted.condition(belief.weights)), info

    def _reference(
        self, belief: PrompBelief, observation: Observation
    ) -> tuple[Float[np.ndarray, "P M"], Float[np.ndarray, "P M"]]:
        """What this partner is expected to read on a grid of phases, and its variance, noise included."""
        layout, prior, features = self.model.layout, self.model.prior, observation.features
        phases = grid(self.model.phase, PHASES)
        mean = layout.predict(phases, belief.weights_mean, features)
        var = layout.variance(phases, prior.factor, belief.weights.covs[0], features)
        return mean, np.maximum(var, 0.0) + self.model.noise.var[features]

    def _fitted(
        self, belief: PrompBelief, observation: Observation, unseen: Float[np.ndarray, " F"]
    ) -> Foreseen | None:
        """The sample beside what was expected of it at the phase found; what fits nowhere is believed the less."""
        phase = self.model.phase.confine(belief.phase_mean[:1])
        doubt = self._doubt(belief, phase, observation, unseen)
        noise_cov = np.diag(observation.noise_var) + np.outer(doubt, doubt)
        foreseen = foresee(self.model, belief.weights, phase, observation, noise_cov)
        if foreseen is None or foreseen.surprise[0] <= ODD * len(observation):
            return foreseen
        odd = foreseen.surprise[0] / (ODD * len(observation))
        return foresee(self.model, belief.weights, phase, observation, odd * noise_cov)

    def _doubt(
        self,
        belief: PrompBelief,
        phase: Float[np.ndarray, " 1"],
        observation: Observation,
        unseen: Float[np.ndarray, " F"],
    ) -> Float[np.ndarray, " M"]:
        """(M,) the standard deviation that doubt about the phase gives to each reading: slope times that of the phase.

        An error of the phase lasts for about a window: a reading soon after the last one meets the same again.
        """
        slope = self.model.layout.slope(phase, belief.weights_mean, observation.features)[0]
        news = np.tanh(unseen[observation.features] * self.model.phase.nominal_velocity / (2 * WINDOW))
        news = np.minimum(news, self.model.noise.var[observation.features] / observation.noise_var)
        return np.asarray(slope * np.sqrt(belief.phase_cov[0, 0] / np.maximum(news, LEAST_NEWS)))


def _told(shares: Float[np.ndarray, " P"], foreseen: Foreseen) -> StepInfo:
    """How well a mixture foresaw the sample."""
    joint = np.log(np.maximum(shares, np.finfo(float).tiny)) + foreseen.log_likelihood
    highest = joint.max()
    weights = np.exp(joint - highest)
    # Hypotheses of elsewhere are surprised without need: they count for as much as they still do.
    surprise = float(weights @ foreseen.surprise / weights.sum())
    return StepInfo(float(highest + np.log(weights.sum())), surprise)
