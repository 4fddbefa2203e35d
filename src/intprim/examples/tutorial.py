"""Synthetic handwriting in two dimensions (4.2.1), and what the tutorial computes from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from inphase import DataError, OptionError
from inphase.basis import Gaussian

SHORTEST = 2  # samples: lengths are drawn, and may come out as none


def create_2d_handwriting_data(
    num_trajectories: int,
    translation_mean: float | int,
    translation_std: float | int,
    noise_std: float | int,
    length_mean: float | int,
    length_std: float | int,
) -> list[Float[np.ndarray, "2 _"]]:
    """Trajectories (2, T) of one stroke with a loop: of other lengths, moved by as much in x as in y, with noise.

    The stroke is one of 8 Gaussians with variance 0.1. Numbers come from `np.random`. Raises OptionError for a
    negative number of trajectories or standard deviation.
    """
    if num_trajectories < 0 or min(translation_std, noise_std, length_std) < 0:
        given = (num_trajectories, translation_std, noise_std, length_std)
        raise OptionError(f"expected a number of trajectories and standard deviations >= 0, got {given}")
    basis = Gaussian(8, math.sqrt(0.1), margin=0.0)
    phases = np.linspace(0.0, 1.0, 100)
    x = 2.5 + 3.5 * phases + 1.2 * np.sin(3 * np.pi * phases) + 0.15 * np.sin(6 * np.pi * phases)
    y = 5.5 - 2.7 * np.cos(2 * np.pi * phases) + 0.5 * np.sin(4 * np.pi * phases)
    weights = np.linalg.lstsq(basis(phases), np.stack([x, y], axis=1), rcond=None)[0]
    normal = np.random.normal
    trajectories = []
    for _ in range(num_trajectories):
        length = max(round(normal(length_mean, length_std)), SHORTEST)
        stroke = (basis(np.linspace(0.0, 1.0, length)) @ weights).T + normal(translation_mean, translation_std)
        trajectories.append(normal(stroke, noise_std))
    return trajectories


def get_phase_stats(training_trajectories: Sequence[Float[np.ndarray, "D _"]]) -> tuple[float, float]:
    """Mean and variance of the phase velocities 1 / T of trajectories (D, T), per sample (Eq. 2.12).

    The variance is that of these trajectories, over N. Raises DataError where there are none.
    """
    if not len(training_trajectories):
        raise DataError("training_trajectories: expected at least one (D, T), got none")
    velocities = [1.0 / trajectory.shape[1] for trajectory in training_trajectories]
    return float(np.mean(velocities)), float(np.var(velocities))


def train_model(primitive: Any, training_trajectories: Sequence[Float[np.ndarray, "D _"]]) -> Any:
    """Teach a primitive all trajectories (D, T), the scaling first (4.2.5), and give it back."""
    for trajectory in training_trajectories:
        primitive.compute_standardization(trajectory)
    for trajectory in training_trajectories:
        primitive.add_demonstration(trajectory)
    return primitive
