"""Densities of phase and tempo, as a belief has them: numbers to be drawn."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from inphase.errors import OptionError
from inphase.filters import PhaseMixture
from inphase.result import Estimate

NARROWEST = 0.004  # of the phase: points that all stand at one place are still to be seen


def mixture_of(estimate: Estimate) -> PhaseMixture:
    """The Gaussian of phase and tempo that an estimate tells of."""
    centre = np.array([[estimate.phase, estimate.phase_velocity]])
    return PhaseMixture(np.ones(1), centre, np.diag([estimate.phase_std**2, estimate.phase_velocity_std**2]))


def phase_density(
    mixture: PhaseMixture, grid: Float[np.ndarray, " G"], periodic: bool = False
) -> Float[np.ndarray, " G"]:
    """(G,) the density of the phase at phases (G,) from 0 to 1.

    Points are smoothed by Silverman's rule, and stay between 0 and 1; a periodic phase goes round.
    """
    points, width = mixture.centres[:, 0], _width(mixture, 0, NARROWEST)
    if periodic:
        return sum((_sum(mixture, points + turn, width, grid) for turn in range(-2, 3)), np.zeros(len(grid)))
    density = _sum(mixture, points, width, grid)
    if mixture.cov[0, 0] == 0:  # what smoothing takes beyond the ends belongs inside
        density += _sum(mixture, -points, width, grid) + _sum(mixture, 2 - points, width, grid)
    return density


def tempo_density(mixture: PhaseMixture, grid: Float[np.ndarray, " G"]) -> Float[np.ndarray, " G"]:
    """(G,) the density of the phase velocity at velocities (G,) [1/s].

    Points are smoothed as above; where none goes backwards, neither does what is drawn. Raises OptionError for a belief
    that knows no velocity.
    """
    if mixture.centres.shape[1] < 2:
        raise OptionError("expected a belief of phase and tempo, got one of the phase alone (a phase prior of order 0)")
    points, width = mixture.centres[:, 1], _width(mixture, 1, float(np.ptp(grid)) * NARROWEST)
    density = _sum(mixture, points, width, grid)
    if mixture.cov[1, 1] == 0 and points.min() >= 0:
        density = np.where(grid >= 0, density + _sum(mixture, -points, width, grid), 0.0)
    return density


def _width(mixture: PhaseMixture, column: int, least: float) -> float:
    """The standard deviation of each of the Gaussians to add up."""
    shares, points, own = mixture.shares, mixture.centres[:, column], np.sqrt(max(mixture.cov[column, column], 0.0))
    spread = np.sqrt(max(float(shares @ (points - shares @ points) ** 2), 0.0))
    effective = 1 / float(shares @ shares)
    smoothing = 0.9 * spread * effective**-0.2 if len(points) > 1 and own == 0 else 0.0
    return float(max(own, smoothing, least))


def _sum(
    mixture: PhaseMixture, points: Float[np.ndarray, " P"], width: float, grid: Float[np.ndarray, " G"]
) -> Float[np.ndarray, " G"]:
    off = (grid[:, None] - points) / width
    return np.asarray(np.exp(-0.5 * off**2) @ mixture.shares / (width * np.sqrt(2 * np.pi)))
