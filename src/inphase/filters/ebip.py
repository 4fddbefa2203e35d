"""Ensemble Bayesian Interaction Primitives: an ensemble Kalman filter over phase and weights (3.1, Fig. 23)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import numpy as np
from jaxtyping import Float

from inphase.errors import OptionError, listing
from inphase.filters.belief import EnsembleBelief, ensemble
from inphase.filters.filter import StepInfo
from inphase.filters.gaussian import spread_score
from inphase.filters.motion import advance, begin
from inphase.mixture import Mixture
from inphase.model import Model
from inphase.observation import Observation

PRIORS = ("demonstrations", "gaussian", "mixture")
UPDATES = ("stochastic", "square-root")


@dataclass(frozen=True)
class Ebip:
    """Members drawn from the prior, each moved by the part of the innovation that the ensemble explains.

    members: E, at least 2; by default all demonstrations, or 100 where there are fewer. prior: "demonstrations" starts
    every member as one of them (Fig. 23), "gaussian" draws from their mean and covariance, "mixture" from a mixture of
    Gaussians (eBIP⁻). update: "stochastic" perturbs the readings for every member (Eq. 3.7); "square-root" moves the
    mean and shrinks the ensemble around it, without chance, to the covariance that Eq. 3.7 has on average.
    Raises OptionError.
    """

    model: Model
    members: int | None = None
    prior: str = "demonstrations"
    update: str = "stochastic"

    def __post_init__(self) -> None:
        if self.members is not None and (not isinstance(self.members, (int, np.integer)) or self.members < 2):
            raise OptionError(f"expected a whole number of at least 2 members, got {self.members!r}")
        for what, got, known in (("prior", self.prior, PRIORS), ("update", self.update, UPDATES)):
            if got not in known:
                raise OptionError(f"unknown {what} {got!r}; one of {listing(known)}")

    @cached_property
    def _mixture(self) -> Mixture:
        return Mixture.learn(self.model.prior.samples)

    def init(self, rng: np.random.Generator) -> EnsembleBelief:
        """The initial ensemble X₀ of Fig. 23; phase and tempo are drawn from their prior."""
        import scipy.linalg  # noqa: F401 - here, so that the first live sample need not wait for it

        prior = self.model.prior
        count = self.members if self.members is not None else max(100, len(prior.samples))
        moving = begin(self.model.phase, count, rng)
        if self.prior == "gaussian":
            weights = prior.draw(count, rng)
        elif self.prior == "mixture":
            weights = prior.as_believed(self._mixture.draw(count, rng), rng)
        else:
            weights = prior.resample(count, rng)
        return ensemble(self.model, np.concatenate([moving, weights], axis=1))

    def predict(self, belief: EnsembleBelief, dt: float, rng: np.random.Generator) -> EnsembleBelief:
        """Eq. 3.1; only the phase and its derivatives move."""
        if dt == 0:
            return belief
        return EnsembleBelief(self.model, advance(belief.carried, self.model.phase, dt, rng), belief.roots)

    def step(
        self, belief: EnsembleBelief, observation: Observation, dt: float, rng: np.random.Generator
    ) -> tuple[EnsembleBelief, StepInfo]:
        """Eq. 3.1 to 3.7, over the rows that were seen."""
        if len(observation) == 0:
            return self.predict(belief, dt, rng), StepInfo()
        belief = self.predict(belief, dt, rng)
        members, values = belief.carried, observation.values
        count, stds = len(members), np.sqrt(observation.noise_var)
        readings = belief.readings(members[:, :1], observation.features)[:, 0]  # HX, Eq. 3.2
        mean = readings.sum(0) / count
        deviations = readings - mean  # HA, Eq. 3.3
        deviations -= deviations.sum(0) / count  # of their rounding, so that members need not be centred below
        score = spread_score(values - mean, deviations / sqrt(count - 1), observation.noise_var)  # S, Eq. 3.4
        if score is None:
            return belief, StepInfo(healthy=False)
        if self.update == "square-root":
            centre = members.mean(0)
            around = members - centre  # A, Eq. 3.3
            moved = score.solve(values - mean) @ (deviations.T @ around / (count - 1))
            members = centre + moved + _contracted(around, deviations / stds / np.sqrt(count - 1))
        else:
            # Eq. 3.6, 3.7. The perturbation has standard deviation √R: R is a variance.
            noise = rng.standard_normal(readings.shape) * stds
            shares = score.solve((values + noise - readings).T).T / (count - 1)
            moved = np.linalg.multi_dot([shares, deviations.T, members])  # in the order that is less work
            members = np.add(moved, members, out=moved)
        members[:, 0] = self.model.phase.confine(members[:, 0])
        return EnsembleBelief(self.model, members, belief.roots), StepInfo(score.log_likelihood, score.surprise)


def _contracted(around: Float[np.ndarray, "E n"], deviations: Float[np.ndarray, "E M"]) -> Float[np.ndarray, "E n"]:
    """(I + Z Zᵀ)^(-1/2) A: deviations A from the mean, less what readings with deviations Z tell of them.

    The symmetric root moves the members least, and keeps their mean (Wang, Bishop and Julier 2004; Hunt, Kostelich and
    Szunyogh 2007). Z is HA in units of the noise, over √(E - 1). Its singular vectors say the same as the eigenvectors
    of Z Zᵀ, and lose nothing where precise readings stand beside poor ones.
    """
    directions, size, _ = np.linalg.svd(deviations, full_matrices=False)
    left = around - directions @ ((1 - 1 / np.hypot(1, size))[:, None] * (directions.T @ around))
    return np.asarray(left - left.mean(0))
