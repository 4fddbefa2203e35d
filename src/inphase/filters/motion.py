"""How members and particles start and move on: the phase prior, and white noise (Eq. 2.4, 2.5, 3.1)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from inphase.phase import PhaseModel


def begin(phase: PhaseModel, count: int, rng: np.random.Generator) -> Float[np.ndarray, "E K"]:
    """(E, K) `count` draws of [φ, φ̇, …] at the start of an interaction."""
    drawn = phase.mean + rng.standard_normal((count, len(phase.mean))) @ root(phase.cov).T
    drawn[:, 0] = phase.confine(drawn[:, 0])
    return np.asarray(drawn)


def advance(
    states: Float[np.ndarray, "E n"], phase: PhaseModel, dt: float, rng: np.random.Generator
) -> Float[np.ndarray, "E n"]:
    """States [φ, φ̇, …, w], one a row, dt [s] later: phase and its derivatives move, weights stay."""
    if dt == 0:
        return states
    size = len(phase.mean)
    noise = rng.standard_normal((len(states), size)) @ root(phase.process_cov(dt)).T
    moved = states.copy()
    moved[:, :size] = states[:, :size] @ phase.transition(dt).T + noise
    moved[:, 0] = phase.confine(moved[:, 0])
    return moved


def root(cov: Float[np.ndarray, "K K"]) -> Float[np.ndarray, "K K"]:
    """A square root of a small covariance that may be singular, such as one of no noise.

    Symmetric but for the scale: of all roots, the one that hardly moves when the covariance hardly does.
    """
    scale = np.sqrt(np.maximum(np.diag(cov), np.finfo(float).tiny))
    value, vector = np.linalg.eigh(cov / np.outer(scale, scale))
    return np.asarray(scale[:, None] * ((vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T))
