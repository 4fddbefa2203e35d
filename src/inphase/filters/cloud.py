"""Any belief as weighted Gaussians over phase, tempo and a few directions of the basis weights: to be looked at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze
from inphase.errors import OptionError
from inphase.filters.belief import Belief, EnsembleBelief, GaussianBelief
from inphase.filters.particle import WeightedBelief
from inphase.filters.promp import PrompBelief
from inphase.filters.rbpf import ParticleBelief
from inphase.model import Model


@dataclass(frozen=True, eq=False)
class Cloud:
    """A mixture of P Gaussians, each of which is a point where nothing is said of its spread.

    weights: (P,), of sum 1. moving: (P, 2) phase and tempo [1/s]; moving_var: (P, 2) their variances. coordinates:
    (P, R) along the directions that were asked for; coordinate_covs: (P, R, R), or (1, R, R) where all share theirs.
    """

    weights: Float[np.ndarray, " P"]
    moving: Float[np.ndarray, "P 2"]
    moving_var: Float[np.ndarray, "P 2"]
    coordinates: Float[np.ndarray, "P R"]
    coordinate_covs: Float[np.ndarray, "C R R"]

    def __post_init__(self) -> None:
        freeze(
            self,
            weights=self.weights,
            moving=self.moving,
            moving_var=self.moving_var,
            coordinates=self.coordinates,
            coordinate_covs=self.coordinate_covs,
        )

    @property
    def coordinate_moments(self) -> tuple[Float[np.ndarray, " R"], Float[np.ndarray, "R R"]]:
        """(R,) mean and (R, R) covariance of the coordinates."""
        mean = self.weights @ self.coordinates
        off = self.coordinates - mean
        shared = len(self.coordinate_covs) == 1
        within = self.coordinate_covs[0] if shared else np.tensordot(self.weights, self.coordinate_covs, 1)
        return mean, (off * self.weights[:, None]).T @ off + within


def cloud(belief: Belief, directions: Float[np.ndarray, "R B"]) -> Cloud:
    """What a belief says of phase, tempo and the coordinates (w - prior mean) @ directionsᵀ, rows of unit length.

    Raises OptionError for a belief of no known filter.
    """
    return _cloud(belief, directions)


@singledispatch
def _cloud(belief: object, directions: Float[np.ndarray, "R B"]) -> Cloud:
    raise OptionError(f"expected the belief of one of the filters, got {type(belief).__name__}")


@_cloud.register
def _gaussian(belief: GaussianBelief, directions: Float[np.ndarray, "R B"]) -> Cloud:
    size = len(belief.phase_mean)
    back = belief.model.prior.factor @ directions.T
    cov = back.T @ belief.cov[size:, size:] @ back
    return Cloud(
        np.ones(1),
        _with_tempo(belief.model, belief.phase_mean[None]),
        _first_two(np.maximum(np.diag(belief.phase_cov), 0.0))[None],
        (belief.mean[size:] @ back)[None],
        cov[None],
    )


@_cloud.register
def _ensemble(belief: EnsembleBelief, directions: Float[np.ndarray, "R B"]) -> Cloud:
    members, size = belief.members, len(belief.phase_mean)
    weights = np.full(len(members), 1 / len(members))
    return _points(belief.model, weights, members[:, :size], members[:, size:], directions)


@_cloud.register
def _weighted(belief: WeightedBelief, directions: Float[np.ndarray, "R B"]) -> Cloud:
    return _points(belief.model, belief.weights, belief.moving, belief.drawn, directions, belief.origin)


@_cloud.register
def _particles(belief: ParticleBelief, directions: Float[np.ndarray, "R B"]) -> Cloud:
    back = belief.directions.rows @ directions.T
    moving = np.stack([belief.motion.phase, belief.motion.tempo(belief.model.phase)], axis=1)
    covs = back.T @ belief.covs @ back
    return Cloud(belief.weights, moving, np.zeros_like(moving), belief.means @ back, covs)


@_cloud.register
def _promp(belief: PrompBelief, directions: Float[np.ndarray, "R B"]) -> Cloud:
    back = belief.model.prior.factor @ directions.T
    timing = belief.timing
    moving = np.stack([timing.phases, timing.tempos], axis=1)
    means = np.broadcast_to(belief.weights.means @ back, (len(moving), len(directions)))
    spread = np.broadcast_to([0.0, timing.tempo_var], moving.shape)
    return Cloud(timing.weights, moving, spread, means, back.T @ belief.weights.covs @ back)


def _points(
    model: Model,
    weights: Float[np.ndarray, " P"],
    moving: Float[np.ndarray, "P K"],
    drawn: Float[np.ndarray, "Q B"],
    directions: Float[np.ndarray, "R B"],
    origin: Int[np.ndarray, " P"] | None = None,
) -> Cloud:
    """Points without a spread; origin: which of the weights each has."""
    each = (drawn - model.prior.mean) @ directions.T
    moving = _with_tempo(model, moving)
    none = np.zeros((1, len(directions), len(directions)))
    return Cloud(weights, moving, np.zeros_like(moving), each if origin is None else each[origin], none)


def _with_tempo(model: Model, moving: Float[np.ndarray, "P K"]) -> Float[np.ndarray, "P 2"]:
    """Phase and tempo; a phase model without a tempo has that of the demonstrations."""
    if moving.shape[1] > 1:
        return moving[:, :2]
    return np.concatenate([moving, np.full_like(moving, model.phase.nominal_velocity)], axis=1)


def _first_two(var: Float[np.ndarray, " K"]) -> Float[np.ndarray, " 2"]:
    return var[:2] if len(var) > 1 else np.array([var[0], 0.0])
