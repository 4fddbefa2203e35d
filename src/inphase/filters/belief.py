"""What a filter believes: a Gaussian, an ensemble or particles, all with the same read-only face."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import frozen
from inphase.model import Model


@dataclass(frozen=True, eq=False)
class Course:
    """Which phases to look at: those at share · φ + offset, φ being the phase that is believed in.

    share, offset: (S,). A share of 0 names a phase; a share that falls to 0 is the rest of the interaction from
    wherever it is now, so that doubt about the phase fades towards the end, which comes whenever it comes.
    """

    share: Float[np.ndarray, " S"]
    offset: Float[np.ndarray, " S"]


def mixed(
    weights: Float[np.ndarray, " P"], mean: Float[np.ndarray, "P S M"], var: Float[np.ndarray, "P S M"]
) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
    """Mean and variance (S, M) of a mixture of as many distributions."""
    shape, mean, var = mean.shape[1:], mean.reshape(len(weights), -1), var.reshape(len(weights), -1)
    over_all = weights @ mean
    return over_all.reshape(shape), (weights @ (var + (mean - over_all) ** 2)).reshape(shape)


def factor_of(cov: Float[np.ndarray, "R R"]) -> Float[np.ndarray, "R R"]:
    """(R, R) rows whose square is this covariance, which may be singular."""
    value, vector = np.linalg.eigh(cov)
    return np.asarray(np.sqrt(np.maximum(value, 0.0))[:, None] * vector.T)


@runtime_checkable
class Belief(Protocol):
    """A distribution over the state [φ, φ̇, …, w]."""

    @property
    def model(self) -> Model:
        """The model whose weights these are."""

    @property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        """(K,) the mean of phase and its derivatives."""

    @property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        """(K, K) their covariance."""

    @property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        """(B,) the mean of the basis weights."""

    def weights_factor(self) -> Float[np.ndarray, "N B"]:
        """(N, B) rows whose square, factorᵀ factor, is the covariance of the basis weights."""

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
        for array in (self.mean, self.cov):
            array.setflags(write=False)

    @property
    def _size(self) -> int:
        return len(self.model.phase.mean)

    @property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        return self.mean[: self._size]

    @property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        return self.cov[: self._size, : self._size]

    @cached_property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        prior = self.model.prior
        return frozen(prior.mean + self.mean[self._size :] @ prior.factor)

    def weights_factor(self) -> Float[np.ndarray, "N B"]:
        return np.asarray(factor_of(self.cov[self._size :, self._size :]) @ self.model.prior.factor)

    @property
    def state_moments(self) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n"]]:
        """(K + B,) mean and (K + B, K + B) covariance of the state [φ, φ̇, …, w]."""
        factor, size = self.model.prior.factor, self._size
        back = np.zeros((len(self.mean), size + factor.shape[1]))
        back[:size, :size], back[size:, size:] = np.eye(size), factor
        return np.concatenate([self.phase_mean, self.weights_mean]), back.T @ self.cov @ back

    @property
    def weights_cov(self) -> Float[np.ndarray, "B B"]:
        """(B, B) the covariance of the basis weights."""
        return self.state_moments[1][self._size :, self._size :]

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        layout, factor, weights = self.model.layout, self.model.prior.factor, self.weights_mean
        phases = self.model.phase.confine(course.share * self.mean[0] + course.offset)
        mean, slope = layout.predict_and_slope(phases, weights, features)
        rows = np.zeros((*mean.shape, len(self.mean)))  # the Jacobian of Eq. 2.6, in the prior's directions
        rows[..., 0] = slope * course.share[:, None]
        rows[..., self._size :] = layout.project_each(phases, factor, features).transpose(0, 2, 1)
        return mean, np.maximum(((rows @ self.cov) * rows).sum(2), 0.0)


@dataclass(frozen=True, eq=False)
class EnsembleBelief:
    """Members that are all equally likely (3.1): a state [φ, φ̇, …, w] a row.

    carried: (E, K + B), or, with `roots` (Q, Bc), (E, K + B - Bc + Q): the last Bc weights are then mixtures of the
    roots, and the last Q columns say which. What a Kalman update does to members is to mix them, so the controlled
    weights need not be touched before a response is asked for.
    """

    model: Model
    carried: Float[np.ndarray, "E n"]
    roots: Float[np.ndarray, "Q Bc"] | None = None

    def __post_init__(self) -> None:
        for array in (self.carried, self.roots):
            if array is not None:
                array.setflags(write=False)

    @cached_property
    def members(self) -> Float[np.ndarray, "E n"]:
        """(E, K + B) the states."""
        if self.roots is None:
            return self.carried
        return frozen(np.concatenate([self.carried[:, : -len(self.roots)], self._mixed], axis=1))

    @property
    def state_moments(self) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n"]]:
        """(K + B,) mean and (K + B, K + B) covariance of the state [φ, φ̇, …, w]."""
        return self.members.mean(0), np.cov(self.members, rowvar=False)

    @cached_property
    def phase_mean(self) -> Float[np.ndarray, " K"]:
        return frozen(self.carried[:, : self._size].mean(0))

    @cached_property
    def phase_cov(self) -> Float[np.ndarray, "K K"]:
        off = self.carried[:, : self._size] - self.phase_mean
        return frozen(off.T @ off / (len(off) - 1))

    @cached_property
    def weights_mean(self) -> Float[np.ndarray, " B"]:
        mean = self.carried[:, self._size :].mean(0)
        if self.roots is None:
            return frozen(mean)
        kept = len(mean) - len(self.roots)
        return frozen(np.concatenate([mean[:kept], mean[kept:] @ self.roots]))

    def weights_factor(self) -> Float[np.ndarray, "N B"]:
        return np.asarray((self.members[:, self._size :] - self.weights_mean) / np.sqrt(len(self.members) - 1))

    def readings(self, phases: Float[np.ndarray, "E S"], features: Int[np.ndarray, " M"]) -> Float[np.ndarray, "E S M"]:
        """What every member reads at phases of its own."""
        shown, layout = self.model.observed_features, self.model.layout
        if self.roots is None or len(features) == 0 or features[0] < shown <= features[-1]:
            return layout.predict_each(phases, self.members[:, self._size :], features)
        partner, own = layout.split(shown)
        if features[0] >= shown:
            return own.predict_each(phases, self._mixed, features - shown)
        return partner.predict_each(phases, self.carried[:, self._size : self._size + partner.size], features)

    def trajectory(
        self, course: Course, features: Int[np.ndarray, " M"]
    ) -> tuple[Float[np.ndarray, "S M"], Float[np.ndarray, "S M"]]:
        phases = self.model.phase.confine(self.carried[:, :1] * course.share + course.offset)
        each = self.readings(phases, features)
        mean = each.sum(0) / len(each)
        off = each - mean
        return mean, np.einsum("esm,esm->sm", off, off) / (len(each) - 1)

    @property
    def _size(self) -> int:
        return len(self.model.phase.mean)

    @cached_property
    def _mixed(self) -> Float[np.ndarray, "E Bc"]:
        """The last weights, where they are carried as mixtures."""
        roots = np.empty((0, 0)) if self.roots is None else self.roots
        return np.asarray(self.carried[:, self.carried.shape[1] - len(roots) :] @ roots)


def ensemble(model: Model, members: Float[np.ndarray, "E n"]) -> EnsembleBelief:
    """Members [φ, φ̇, …, w], carried in as few columns as they need."""
    kept = len(model.phase.mean) + model.layout.split(model.observed_features)[0].size
    if members.shape[1] - kept <= len(members):
        return EnsembleBelief(model, members)
    themselves = np.eye(len(members))
    return EnsembleBelief(model, np.concatenate([members[:, :kept], themselves], axis=1), members[:, kept:])
