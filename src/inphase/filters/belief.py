"""What a filter believes: a Gaussian, an ensemble or particles, all with the same read-only face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze, frozen
from inphase.model import Model


@dataclass(frozen=True, eq=False)
class Course:
    """Which phases to look at: those at share · φ + offset, φ being the phase that is believed in.

    share, offset: (S,). A share of 0 names a phase; a share that falls to 0 is the rest of the interaction from
    wherever it is now, so that doubt about the phase fades towards the end, which comes whenever it comes.
    """

    share: Float[np.ndarray, " S"]
    offset: Float[np.ndarray, " S"]


@runtime_checkable
class Belief(Protocol):
    """A distribution over the state [φ, φ̇, …, w]."""

    @property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        """(K,) the mean of phase and its derivatives."""

    @property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        """(K, K) their covariance."""

    @property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        """(B,) the mean of the basis weights."""

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        """Mean and variance (S, M) of h(φ, w) along a course, in scaled units, less the observation noise."""


@dataclass(frozen=True, eq=False)
class GaussianBelief:
    """A Gaussian over phase and the coordinates c of the weights in the prior's directions: w = mean + c @ factor.

    mean: (K + R,), cov: (K + R, K + R). The weights never leave the span of the prior, because nothing but the phase
    is driven by noise (Eq. 2.4, 2.5): this is Σ of the dissertation, exactly, in as few numbers as it has.
    """

    model: Model
    mean: Float[np.ndarray, " n"]
    cov: Float[np.ndarray, "n n"]

    def __post_init__(self) -> None:
        freeze(self, mean=self.mean, cov=self.cov)

    @property
    def _size(self) -> int:
        return len(self.model.phase.mean)

    @property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        return self.mean[: self._size]

    @property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        return self.cov[: self._size, : self._size]

    @property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        prior = self.model.prior
        return frozen(prior.mean + self.mean[self._size :] @ prior.factor)

    @property
    def weights_cov(self) -> Float[np.ndarray, "B B"]:
        """(B, B) the covariance of the basis weights."""
        factor = self.model.prior.factor
        return np.asarray(factor.T @ self.cov[self._size :, self._size :] @ factor)

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        layout, factor, weights = self.model.layout, self.model.prior.factor, self.weights_mean
        phases = self.model.phase.confine(course.share * self.mean[0] + course.offset)
        mean = layout.predict(phases, weights, features)
        slope = layout.slope(phases, weights, features) * course.share[:, None]
        rows = np.zeros((*mean.shape, len(self.mean)))  # the Jacobian of Eq. 2.6, in the prior's directions
        rows[..., 0] = slope
        rows[..., self._size :] = layout.project_each(phases, factor, features).transpose(0, 2, 1)
        return mean, np.maximum(((rows @ self.cov) * rows).sum(2), 0.0)


@dataclass(frozen=True, eq=False)
class EnsembleBelief:
    """Members that are all equally likely (3.1). members: (E, K + B), a state [φ, φ̇, …, w] a row."""

    model: Model
    members: Float[np.ndarray, "E n"]

    def __post_init__(self) -> None:
        freeze(self, members=self.members)

    @property
    def _size(self) -> int:
        return len(self.model.phase.mean)

    @property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        return frozen(self.members[:, : self._size].mean(0))

    @property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        size = self._size
        return frozen(np.cov(self.members[:, :size], rowvar=False).reshape(size, size))

    @property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        return frozen(self.members[:, self._size :].mean(0))

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        phases = self.model.phase.confine(self.members[:, :1] * course.share + course.offset)
        each = self.model.layout.predict_each(phases, self.members[:, self._size :], features)
        return np.asarray(each.mean(0)), np.asarray(each.var(0, ddof=1))
