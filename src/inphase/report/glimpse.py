"""What a belief looks like: a cloud on two axes, densities of phase and tempo, and how the weights hang together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze
from inphase.filters import Belief
from inphase.filters.cloud import Cloud, cloud
from inphase.filters.resampling import systematic
from inphase.model import Model
from inphase.report.density import phase_density, tempo_density

DIRECTIONS = 12  # at most, in which the weights are looked at
VARIANCE = 0.99  # of the prior, that is enough
POINTS = 80  # of a cloud
PHASES = 80  # and tempos, at which densities are told
FASTEST = 3.0  # times the typical tempo, where the densities of tempos end
STILL = 1e-20  # of the largest variance: a feature that is certain correlates with nothing


@dataclass(frozen=True, eq=False)
class Glimpse:
    """A belief at one moment.

    points: (POINTS, 2) drawn from it, along the first two directions. phase_density: (PHASES,), tempo_density:
    (PHASES,) [s], each of integral 1 where nothing lies beyond the ends. cov: (R, R) of the coordinates.
    """

    points: Float[np.ndarray, "N 2"]
    phase_density: Float[np.ndarray, " G"]
    tempo_density: Float[np.ndarray, " G"]
    cov: Float[np.ndarray, "R R"]

    def __post_init__(self) -> None:
        freeze(
            self,
            points=self.points,
            phase_density=self.phase_density,
            tempo_density=self.tempo_density,
            cov=self.cov,
        )


@dataclass(frozen=True, eq=False)
class Lens:
    """From where beliefs of one model are looked at, always the same, so that they can be compared.

    directions: (R, B) the principal components of the prior, of unit length, as many as carry nearly all of its
    variance, at least two. shares: (R,) of the variance. phases, tempos: (PHASES,) where densities are told.
    demonstrations: (N, 2) where the demonstrations lie along the first two.
    """

    model: Model
    directions: Float[np.ndarray, "R B"]
    shares: Float[np.ndarray, " R"]
    phases: Float[np.ndarray, " G"]
    tempos: Float[np.ndarray, " G"]
    demonstrations: Float[np.ndarray, "N 2"]

    @classmethod
    def of(cls, model: Model) -> Lens:
        """The lens for a model's beliefs."""
        factor = model.prior.factor
        # Of the few rows rather than of the many weights: the components are mixtures of the rows.
        value, vector = np.linalg.eigh(factor @ factor.T)
        value, vector = np.maximum(value[::-1], 0.0), vector[:, ::-1]
        total = max(value.sum(), np.finfo(float).tiny)
        enough = int(np.searchsorted(np.cumsum(value) / total, VARIANCE)) + 1
        real = int((value > 1e-10 * value[0]).sum())
        count = min(max(enough, 2), DIRECTIONS, real)
        directions = np.zeros((max(count, 2), factor.shape[1]))
        directions[:count] = (vector[:, :count].T @ factor) / np.sqrt(value[:count, None])
        return cls(
            model,
            directions,
            np.pad(value[:count], (0, len(directions) - count)) / total,
            np.linspace(0, 1, PHASES),
            np.linspace(0, FASTEST * model.phase.nominal_velocity, PHASES),
            (model.prior.samples - model.prior.mean) @ directions[:2].T,
        )

    def look(self, belief: Belief) -> Glimpse:
        """What the belief looks like from here."""
        seen = cloud(belief, self.directions)
        return Glimpse(
            _drawn(seen),
            phase_density(seen, self.phases, self.model.phase.periodic),
            tempo_density(seen, self.tempos),
            seen.coordinate_moments[1],
        )

    def correlations(
        self, covs: Float[np.ndarray, "P R R"], phases: Float[np.ndarray, " P"], features: Int[np.ndarray, " M"]
    ) -> Float[np.ndarray, "P M M"]:
        """How features h(φ, w) hang together at phases (P,), where the coordinates of w have covariances (P, R, R)."""
        rows = self.model.layout.project_each(self.model.phase.confine(phases), self.directions, features)
        cov = rows.swapaxes(1, 2) @ covs @ rows
        var = np.einsum("pmm->pm", cov)
        moving = var > STILL * var.max(1, keepdims=True, initial=0.0)
        scale = np.where(moving, 1 / np.sqrt(np.where(moving, var, 1.0)), 0.0)
        return np.asarray(np.clip(cov * scale[:, :, None] * scale[:, None, :], -1.0, 1.0))


def _drawn(seen: Cloud) -> Float[np.ndarray, "N 2"]:
    """Points that stand for a cloud; the same draws for every moment, so that a cloud moves and does not flicker."""
    chosen = systematic(seen.weights, POINTS, 0.5)
    covs = seen.coordinate_covs[:, :2, :2]
    covs = covs if len(covs) == 1 else covs[chosen]
    value, vector = np.linalg.eigh(covs)
    roots = vector * np.sqrt(np.maximum(value, 0.0))[:, None, :] @ vector.swapaxes(1, 2)
    draws = np.random.default_rng(0).standard_normal((POINTS, 2))
    moved = np.einsum("pij,pj->pi", np.broadcast_to(roots, (POINTS, 2, 2)), draws)
    return np.asarray(seen.coordinates[chosen, :2] + moved)
