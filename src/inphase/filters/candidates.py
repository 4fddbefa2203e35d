"""Candidate tempos: a partner who goes at one of finitely many, and nobody knows at which."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze, frozen
from inphase.phase import PhaseModel

REACH = 5.0  # standard deviations of the prior: twice the tempo is 5 of a prior as narrow as `learn_phase` makes it


@dataclass(frozen=True, eq=False)
class Candidates:
    """Hypotheses of a start and a tempo that never changes (Ewerton et al. 2015; Maeda et al. 2017).

    phases: (P,) where they have come to. tempos: (P,) [1/s]. log_weights: (P,).
    """

    phases: Float[np.ndarray, " P"]
    tempos: Float[np.ndarray, " P"]
    log_weights: Float[np.ndarray, " P"]
    periodic: bool

    def __post_init__(self) -> None:
        freeze(self, phases=self.phases, tempos=self.tempos, log_weights=self.log_weights)

    @classmethod
    def begin(cls, phase: PhaseModel, starts: int, tempos: int) -> Candidates:
        """Quantiles of the phase prior, evenly spaced out to 5 standard deviations; a tempo is not negative.

        Each is as likely as the prior makes its surroundings. The tempos are those of N(tempo | start). Nobody starts
        outside of 0 … 1.
        """
        from scipy.special import ndtr

        start_std = float(np.sqrt(phase.cov[0, 0]))
        ends = (np.array([0.0, 1.0]) - phase.mean[0]) / max(start_std, np.finfo(float).tiny)
        within = (-REACH, REACH) if phase.periodic else np.clip(ends, -REACH, REACH)
        grids, shares = [], []
        for count, (low, high) in ((starts, within), (tempos, (-REACH, REACH))):
            edges = np.linspace(low, high, count + 1)
            grids.append((edges[:-1] + edges[1:]) / 2)
            shares.append(np.diff(ndtr(edges)))
        first, second = (grid.ravel() for grid in np.meshgrid(*grids, indexing="ij"))
        shared = phase.cov[0, 1] / start_std if start_std > 0 else 0.0
        own = float(np.sqrt(max(phase.cov[1, 1] - shared**2, 0.0)))
        begun = phase.mean[0] + start_std * first
        rates = np.maximum(phase.mean[1] + shared * first + own * second, 0.0)
        log_weights = np.log(np.outer(*shares).ravel())
        return cls(_within(begun, phase.periodic), rates, log_weights, phase.periodic)

    @cached_property
    def weights(self) -> Float[np.ndarray, " P"]:
        """(P,) the probability of each candidate."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        return frozen(weights / weights.sum())

    @property
    def nodes(self) -> Int[np.ndarray, " P"]:
        """(P,) those that speak for all: all."""
        return np.arange(len(self.phases))

    @property
    def node_weights(self) -> Float[np.ndarray, " P"]:
        """(P,) the probability of each."""
        return self.weights

    @property
    def tempo_var(self) -> float:
        """[1/s²] doubt about the tempo of a candidate: none."""
        return 0.0

    def passed(self, dt: float) -> Candidates:
        """The candidates dt [s] later."""
        phases = _within(self.phases + self.tempos * dt, self.periodic)
        return Candidates(phases, self.tempos, self.log_weights, self.periodic)

    def weighed(self, log_likelihood: Float[np.ndarray, " P"]) -> Candidates:
        """Bayes' rule, after a sample of that log-density under each candidate."""
        log_weights = self.log_weights + log_likelihood
        return Candidates(self.phases, self.tempos, log_weights - log_weights.max(), self.periodic)


def _within(phases: Float[np.ndarray, " P"], periodic: bool) -> Float[np.ndarray, " P"]:
    return phases % 1.0 if periodic else np.clip(phases, 0.0, 1.0)
