"""The face of every filter: explicit state in, explicit state out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from inphase.filters.belief import Belief
from inphase.observation import Observation

B = TypeVar("B", bound=Belief)


@dataclass(frozen=True)
class StepInfo:
    """What a step tells of itself.

    log_likelihood: of the sample given all before, in scaled units; 0 where nothing was seen. surprise: the innovation
    squared in units of its covariance, rᵀ S⁻¹ r, to be compared with the number of readings. healthy: False when the
    sample could not be used; the belief is then the predicted one.
    """

    log_likelihood: float = 0.0
    surprise: float = 0.0
    healthy: bool = True


@runtime_checkable
class Filter(Protocol[B]):
    """Inference of phase and weights; immutable, so that one may serve many sessions."""

    def init(self, rng: np.random.Generator) -> B:
        """The belief before anything is seen."""

    def predict(self, belief: B, dt: float, rng: np.random.Generator) -> B:
        """The belief dt [s] later, nothing seen."""

    def step(self, belief: B, observation: Observation, dt: float, rng: np.random.Generator) -> tuple[B, StepInfo]:
        """The belief dt [s] later, given what was then seen."""
