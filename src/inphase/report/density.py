"""Densities of phase and tempo, as a belief or an estimate has them: numbers to be drawn."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from inphase.filters import Belief
from inphase.filters.cloud import Cloud, cloud
from inphase.result import Estimate

NARROWEST = 0.8  # of the distance between two places on the grid: what is less wide could fall between them


def cloud_of(moment: Belief | Estimate) -> Cloud:
    """Phase and tempo of a belief, all of it; of an estimate the Gaussian that it tells of. No weights."""
    if not isinstance(moment, Estimate):
        return cloud(moment, np.empty((0, moment.model.layout.size)))
    mean = np.array([[moment.phase, moment.phase_velocity]])
    var = np.array([[moment.phase_std, moment.phase_velocity_std]]) ** 2
    return Cloud(np.ones(1), mean, var, np.empty((1, 0)), np.empty((1, 0, 0)))


def phase_density(seen: Cloud, grid: Float[np.ndarray, " G"], periodic: bool = False) -> Float[np.ndarray, " G"]:
    """(G,) the density of the phase at phases (G,) from 0 to 1.

    Points are smoothed by Silverman's rule, and stay between 0 and 1; a periodic phase goes round.
    """
    points = seen.moving[:, 0]
    if periodic:  # the circle is cut opposite to where they are
        centre = np.angle(seen.weights @ np.exp(2j * np.pi * points)) / (2 * np.pi) % 1.0
        points = points - np.round(points - centre)
        width = _width(seen, points, 0, grid)
        return sum((_sum(seen, points + turn, width, grid) for turn in range(-2, 3)), np.zeros(len(grid)))
    width = _width(seen, points, 0, grid)
    density = _sum(seen, points, width, grid)
    if not seen.moving_var[:, 0].any():  # what smoothing takes beyond the ends belongs inside
        density += _sum(seen, -points, width, grid) + _sum(seen, 2 - points, width, grid)
    return density


def tempo_density(seen: Cloud, grid: Float[np.ndarray, " G"]) -> Float[np.ndarray, " G"]:
    """(G,) the density of the phase velocity at velocities (G,) [1/s].

    Points are smoothed as above; where none goes backwards, neither does what is drawn.
    """
    points = seen.moving[:, 1]
    width = _width(seen, points, 1, grid)
    density = _sum(seen, points, width, grid)
    if not seen.moving_var[:, 1].any() and points.min() >= 0:
        density = np.where(grid >= 0, density + _sum(seen, -points, width, grid), 0.0)
    return density


def _width(
    seen: Cloud, points: Float[np.ndarray, " P"], column: int, grid: Float[np.ndarray, " G"]
) -> Float[np.ndarray, " P"]:
    """(P,) the standard deviation of each of the Gaussians to add up."""
    shares, own = seen.weights, np.sqrt(seen.moving_var[:, column])
    spread = np.sqrt(max(float(shares @ (points - shares @ points) ** 2), 0.0))
    smoothing = 0.9 * spread * (1 / float(shares @ shares)) ** -0.2 if len(points) > 1 and not own.any() else 0.0
    return np.asarray(np.maximum(own, max(smoothing, NARROWEST * float(np.diff(grid).max()))))


def _sum(
    seen: Cloud, points: Float[np.ndarray, " P"], width: Float[np.ndarray, " P"], grid: Float[np.ndarray, " G"]
) -> Float[np.ndarray, " G"]:
    off = (grid[:, None] - points) / width
    return np.asarray(np.exp(-0.5 * off**2) @ (seen.weights / width) / np.sqrt(2 * np.pi))
