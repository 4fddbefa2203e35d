"""How members start and move on, one after the other; what they believe together."""

from __future__ import annotations

import numpy as np

import inphase
from inphase.filters import motion
from loops.curves import within

Believed = tuple[np.ndarray, np.ndarray, np.ndarray]


def drawn(model: inphase.Model, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    """The initial ensemble, a demonstration or more each."""
    moving = motion.begin(model.phase, count, rng)
    return [np.concatenate(parts) for parts in zip(moving, model.prior.resample(count, rng), strict=True)]


def moved(model: inphase.Model, members: list[np.ndarray], dt: float, rng: np.random.Generator) -> list[np.ndarray]:
    """Eq. 3.1: phase and its derivatives dt [s] later."""
    if dt == 0:
        return members
    phase, size = model.phase, len(model.phase.mean)
    transition, root, found = phase.transition(dt), motion.root(phase.process_cov(dt)), []
    for member in members:
        x = member.copy()
        x[:size] = transition @ x[:size] + root @ rng.standard_normal(size)
        x[0] = within(x[0])
        found.append(x)
    return found


def shares(log_weights: list[float]) -> list[float]:
    """Weights that sum to 1."""
    highest = max(log_weights)
    weights = [np.exp(log_weight - highest) for log_weight in log_weights]
    total = sum(weights)
    return [weight / total for weight in weights]


def systematic(weights: list[float], rng: np.random.Generator) -> list[int]:
    """As many particles as there are, each as often as its weight says, give or take one."""
    count, start, kept, i, passed = len(weights), rng.random(), [], 0, weights[0]
    for place in range(count):
        while passed <= (place + start) / count and i < count - 1:
            i += 1
            passed += weights[i]
        kept.append(i)
    return kept


def moments(states: list[np.ndarray], weights: list[float], size: int, unbiased: bool = False) -> Believed:
    """Mean and covariance of the first `size` numbers of all states, and the mean of the others."""
    mean = sum(weight * x for weight, x in zip(weights, states, strict=True))
    cov = sum(
        w * np.outer(x[:size] - mean[:size], x[:size] - mean[:size]) for w, x in zip(weights, states, strict=True)
    )
    return mean[:size], cov * (len(states) / (len(states) - 1) if unbiased else 1.0), mean[size:]
