"""Ensemble Bayesian Interaction Primitives: an ensemble Kalman filter over phase and weights (3.1, Fig. 23)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.errors import OptionError, listing
from inphase.filters.belief import EnsembleBelief
from inphase.filters.filter import StepInfo
from inphase.filters.gaussian import innovation_score
from inphase.model import Model
from inphase.observation import Observation

PRIORS = ("demonstrations", "gaussian")


@dataclass(frozen=True)
class Ebip:
    """Members drawn from the prior, each moved by the part of the innovation that the ensemble explains.

    members: E, at least 2; by default all demonstrations, or 100 where there are fewer. prior: "demonstrations" starts
    every member as one of them (Fig. 23), "gaussian" draws from their mean and covariance. Raises OptionError.
    """

    model: Model
    members: int | None = None
    prior: str = "demonstrations"

    def __post_init__(self) -> None:
        if self.members is not None and (not isinstance(self.members, (int, np.integer)) or self.members < 2):
            raise OptionError(f"expected a whole number of at least 2 members, got {self.members!r}")
        if self.prior not in PRIORS:
            raise OptionError(f"unknown prior {self.prior!r}; one of {listing(PRIORS)}")

    def init(self, rng: np.random.Generator) -> EnsembleBelief:
        """The initial ensemble X₀ of Fig. 23; phase and tempo are drawn from their prior."""
        import scipy.linalg  # noqa: F401 - here, so that the first live sample need not wait for it

        phase, prior = self.model.phase, self.model.prior
        count = self.members if self.members is not None else max(100, len(prior.samples))
        moving = phase.mean + rng.standard_normal((count, len(phase.mean))) @ _root(phase.cov).T
        moving[:, 0] = phase.confine(moving[:, 0])
        weights = prior.draw(count, rng) if self.prior == "gaussian" else prior.resample(count, rng)
        return EnsembleBelief(self.model, np.concatenate([moving, weights], axis=1))

    def predict(self, belief: EnsembleBelief, dt: float, rng: np.random.Generator) -> EnsembleBelief:
        """Eq. 3.1; only the phase and its derivatives move."""
        if dt == 0:
            return belief
        return EnsembleBelief(self.model, self._moved(belief.members, dt, rng))

    def step(
        self, belief: EnsembleBelief, observation: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[EnsembleBelief, StepInfo]:
        """Eq. 3.1 to 3.7, over the rows that were seen."""
        if len(observation) == 0:
            return self.predict(belief, dt, rng), StepInfo()
        layout, size = self.model.layout, len(self.model.phase.mean)
        members = self._moved(belief.members, dt, rng)
        count = len(members)
        readings = layout.predict_each(members[:, :1], members[:, size:], observation.features)[:, 0]  # HX, Eq. 3.2
        mean = readings.mean(0)
        deviations = readings - mean  # HA, Eq. 3.3
        innovation_cov = deviations.T @ deviations / (count - 1) + np.diag(observation.noise_var)  # S, Eq. 3.4
        score = innovation_score(observation.values - mean, innovation_cov)
        if score is None:
            return EnsembleBelief(self.model, members), StepInfo(healthy=False)
        # Eq. 3.7. The perturbation has standard deviation √R: R is a variance.
        noise = rng.standard_normal(readings.shape) * np.sqrt(observation.noise_var)
        innovations = observation.values + noise - readings
        gain = score.solve(deviations.T @ (members - members.mean(0)) / (count - 1))  # Kᵀ, Eq. 3.5 and 3.6
        members = members + innovations @ gain
        members[:, 0] = self.model.phase.confine(members[:, 0])
        return EnsembleBelief(self.model, members), StepInfo(score.log_likelihood, score.surprise)

    def _moved(
        self, members: Float[np.ndarray, "E n"], dt: float, rng: np.random.Generator
    ) -> Float[np.ndarray, "E n"]:
        if dt == 0:
            return members
        phase = self.model.phase
        size = len(phase.mean)
        noise = rng.standard_normal((len(members), size)) @ _root(phase.process_cov(dt)).T
        moved = members.copy()
        moved[:, :size] = members[:, :size] @ phase.transition(dt).T + noise
        moved[:, 0] = phase.confine(moved[:, 0])
        return moved


def _root(cov: Float[np.ndarray, "K K"]) -> Float[np.ndarray, "K K"]:
    """A square root of a small covariance that may be singular, such as one of no noise."""
    scale = np.sqrt(np.maximum(np.diag(cov), np.finfo(float).tiny))
    value, vector = np.linalg.eigh(cov / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vector * np.sqrt(np.maximum(value, 0.0)))
