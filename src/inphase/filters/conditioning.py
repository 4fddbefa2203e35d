"""Conditioning the weights on a sample at phases that are given: Eq. 2.7 to 2.10 without the phase columns of H."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.filters.gaussian import ABSURD
from inphase.model import Model
from inphase.observation import Observation


@dataclass(frozen=True, eq=False)
class Weights:
    """Gaussians over the weights in the prior's directions, w = mean + c @ factor. means: (W, R), covs: (W, R, R)."""

    means: Float[np.ndarray, "W R"]
    covs: Float[np.ndarray, "W R R"]

    def __post_init__(self) -> None:
        self.means.setflags(write=False)
        self.covs.setflags(write=False)

    @classmethod
    def prior(cls, model: Model, count: int) -> Weights:
        """`count` times what is believed before anything is seen (Eq. 2.11, 2.14)."""
        size = len(model.prior.factor)
        return cls(np.zeros((count, size)), np.tile(np.eye(size), (count, 1, 1)))


@dataclass(frozen=True, eq=False)
class Foreseen:
    """A sample beside what was expected of it at each phase (P,), by the Gaussian of that phase or the only one.

    rows: (P, R, M) Hᵀ. noise_cov: (M, M) R. innovation: (P, M). cross: (P, R, M) Σ Hᵀ. cov: (P, M, M) S of Eq. 2.7.
    log_likelihood: (P,). surprise: (P,) the innovation squared in units of S.
    """

    rows: Float[np.ndarray, "P R M"]
    noise_cov: Float[np.ndarray, "M M"]
    innovation: Float[np.ndarray, "P M"]
    cross: Float[np.ndarray, "P R M"]
    cov: Float[np.ndarray, "P M M"]
    log_likelihood: Float[np.ndarray, " P"]
    surprise: Float[np.ndarray, " P"]

    def condition(self, weights: Weights) -> Weights:
        """The weights after the sample, each Gaussian at the phase of its own."""
        gain = np.linalg.solve(self.cov, self.cross.transpose(0, 2, 1)).transpose(0, 2, 1)  # K, Eq. 2.8
        means = weights.means + (gain @ self.innovation[:, :, None])[:, :, 0]  # Eq. 2.9
        # Eq. 2.10 in Joseph form, ((I - K H) Σ) (I - K H)ᵀ + K R Kᵀ, with no product of two R × R matrices.
        back = gain.transpose(0, 2, 1)
        half = weights.covs - gain @ self.cross.transpose(0, 2, 1)
        covs = half - (half @ self.rows) @ back + gain @ self.noise_cov @ back
        return Weights(means, (covs + covs.transpose(0, 2, 1)) / 2)


def foresee(
    model: Model,
    weights: Weights,
    phases: Float[np.ndarray, " P"],
    observation: Observation,
    noise_cov: Float[np.ndarray, "M M"],
) -> Foreseen | None:
    """The sample at each phase; None where S is no covariance, or the sample so far off that it is no reading."""
    features = observation.features
    plain, rows = model.layout.predict_and_project(phases, model.prior.mean, model.prior.factor, features)
    innovation = observation.values - plain - (weights.means[:, None] @ rows)[:, 0]
    cross = weights.covs @ rows
    cov = rows.transpose(0, 2, 1) @ cross + noise_cov
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
    return Foreseen(rows, noise_cov, innovation, cross, cov, log_likelihood, surprise)
