"""How members and particles start and move on: the phase prior, and white noise (Eq. 2.4, 2.5, 3.1)."""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Float

from inphase.phase import PhaseModel, unit_process_cov

TINY = np.finfo(float).tiny


def begin(phase: PhaseModel, count: int, rng: np.random.Generator) -> Float[np.ndarray, "E K"]:
    """(E, K) `count` draws of [φ, φ̇, …] at the start of an interaction, which lies within it."""
    start = phase.starts(rng.random(count))
    # Only the phase is cut off: the others are drawn as Gaussians given it.
    told = phase.cov[1:, 0] / max(phase.cov[0, 0], TINY)
    untold_cov = phase.cov[1:, 1:] - np.outer(told, phase.cov[0, 1:])
    others = phase.mean[1:] + np.outer(start - phase.mean[0], told)
    others += rng.standard_normal(others.shape) @ root(untold_cov).T
    return np.column_stack([phase.confine(start), others])


def advance(
    states: Float[np.ndarray, "E n"], phase: PhaseModel, dt: float, rng: np.random.Generator
) -> Float[np.ndarray, "E n"]:
    """States [φ, φ̇, …, w], one a row, dt [s] later: phase and its derivatives move, weights stay."""
    if dt == 0:
        return states
    size = len(phase.mean)
    noise = rng.standard_normal((len(states), size)) @ _unit_root(phase.order).T * phase.process_scale(dt)
    moved = states.copy()
    moved[:, :size] = states[:, :size] @ phase.transition(dt).T + noise
    moved[:, 0] = phase.confine(moved[:, 0])
    return moved


@cache
def _unit_root(order: int) -> Float[np.ndarray, "K K"]:
    return root(unit_process_cov(order))


def root(cov: Float[np.ndarray, "K K"]) -> Float[np.ndarray, "K K"]:
    """A square root of a small covariance that may be singular, such as one of no noise.

    Symmetric but for the scale: of all roots, the one that hardly moves when the covariance hardly does.
    """
    scale = np.sqrt(np.maximum(cov.diagonal(), TINY))
    value, vector = np.linalg.eigh(cov / np.outer(scale, scale))
    return np.asarray(scale[:, None] * ((vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T))
