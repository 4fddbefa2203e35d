"""Synthetic interactions: a partner who reaches and lifts, a robot that grips and turns; and models of chance."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from jaxtyping import config

import inphase
from inphase.basis import Basis, Gaussian, Layout, Periodic, Polynomial, Sigmoid
from inphase.channels import make_channels
from inphase.noise import Noise
from inphase.phase import PhaseModel
from inphase.preprocess.coordinates import Coordinates
from inphase.training import reflex as learning
from inphase.weight_prior import WeightPrior

OBSERVED, CONTROLLED = ("reach", "lift"), ("grip", "turn")  # no two of one group: each is scaled for itself
NOISE_STD = 0.01  # [m], in curves that are about 1 m long
DURATION = 2.0  # [s], about


@contextmanager
def shapes_unchecked() -> Iterator[None]:
    """As users run the library: wrong shapes get as far as the library's own checks."""
    config.update("jaxtyping_disable", True)
    try:
        yield
    finally:
        config.update("jaxtyping_disable", False)


def taught(demos: inphase.Dataset, **options: Any) -> inphase.Model:
    """A model of all that is learned without playing held-out demonstrations, whose responses are the filter's own.

    Its reflex is one of few moments, and nothing of it is chosen: it has no weight, and to learn it well takes longer
    than all the rest.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(learning, "MOMENTS", 2)
        for name in ("SPEEDS", "WIDTHS", "TRENDS", "RIDGES"):
            patch.setattr(learning, name, (1.0,))
        model = inphase.fit(demos, calibrate=False, **options)
    assert model.reflex is not None
    return replace(model, reflex=replace(model.reflex, weight=0.0))


def curves(phases: np.ndarray, style: np.ndarray) -> np.ndarray:
    """(P, 4) all channels at phases (P,), for an interaction in a style (2,): how far and how high it goes."""
    smooth = phases**3 * (10 - 15 * phases + 6 * phases**2)  # the minimum-jerk profile
    far, high = style
    reach = (1 + 0.2 * far) * smooth
    lift = (0.6 + 0.1 * high) * np.sin(np.pi * phases)
    grip = 0.8 - (0.5 + 0.1 * far) * smooth + 0.1 * high * phases
    turn = 0.4 * np.sin(2 * np.pi * phases) + 0.1 * (far - high) * phases
    return np.stack([reach, lift, grip, turn], axis=1)


def wobble(times: np.ndarray, count: int, std: float, correlation_time: float, rng: np.random.Generator) -> np.ndarray:
    """(T, count) stationary noise whose autocorrelation is exp(-t / correlation_time); white for 0."""
    white = rng.standard_normal((len(times), count))
    if correlation_time == 0:
        return std * white
    keep = np.exp(-np.diff(times) / correlation_time)
    for i in range(1, len(times)):
        white[i] = keep[i - 1] * white[i - 1] + np.sqrt(1 - keep[i - 1] ** 2) * white[i]
    return std * white


def recording(
    rng: np.random.Generator, *, duration: float = DURATION, rate: float = 50.0, correlation_time: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) [s] and values (T, 4) of one interaction in a style of its own."""
    times = np.arange(round(duration * rate) + 1) / rate
    clean = curves(times / times[-1], rng.standard_normal(2))
    return times, clean + wobble(times, 4, NOISE_STD, correlation_time, rng)


def dataset(
    rng: np.random.Generator,
    *,
    count: int = 8,
    duration: float = DURATION,
    rate: float = 50.0,
    correlation_time: float = 0.0,
) -> inphase.Dataset:
    """`count` recordings, some a little slower than others."""
    durations = duration * np.exp(0.1 * rng.standard_normal(count))
    made = [recording(rng, duration=d, rate=rate, correlation_time=correlation_time) for d in durations]
    return inphase.Dataset.from_arrays([t for t, _ in made], [v for _, v in made], OBSERVED, CONTROLLED)


def waves(rng: np.random.Generator, *, count: int = 8, rate: float = 40.0, cycles: int = 1) -> tuple[np.ndarray, list]:
    """Times (T,) [s] and `count` arrays of values (T, 4) of interactions that repeat themselves every second."""
    times = np.arange(round(cycles * rate) + (cycles == 1)) / rate
    angle, values = 2 * np.pi * times, []
    for _ in range(count):
        height, lag = 1 + 0.1 * rng.standard_normal(), 0.1 * rng.standard_normal()
        clean = [np.sin(angle), np.cos(angle) + 0.3 * np.sin(2 * angle), np.sin(angle + 1 + lag), np.cos(angle - lag)]
        values.append(height * np.stack(clean, axis=1) + 0.02 * rng.standard_normal((len(times), 4)))
    return times, values


def phase_model(order: int = 1, periodic: bool = False) -> PhaseModel:
    """A phase prior with correlations between phase and tempo, of interactions that take about a second."""
    root = np.array([[0.02, 0.0, 0.0], [0.03, 0.2, 0.0], [0.01, 0.02, 0.1]])[: order + 1, : order + 1]
    mean = np.array([0.05, 0.8, 0.05])[: order + 1]
    return PhaseModel(mean, root @ root.T, diffusion=0.05, nominal_velocity=0.8, periodic=periodic)


def known_phase(velocity: float = 0.8, start: float = 0.1) -> PhaseModel:
    """A phase that is known and moves with a known velocity."""
    return PhaseModel(np.array([start, velocity]), np.zeros((2, 2)), diffusion=0.0, nominal_velocity=velocity)


def chance_model(
    rng: np.random.Generator, phase: PhaseModel, *, demonstrations: int = 6, shrinkage: float = 0.0, white: bool = True
) -> inphase.Model:
    """A model of two observed and two controlled channels with several bases and weights of chance."""
    bases: tuple[Basis, ...] = (Gaussian(5), Sigmoid(4), Gaussian(5), Polynomial(3))
    if phase.periodic:
        bases = (Periodic(5), Periodic(4), Periodic(5), Periodic(3))
    layout = Layout(bases)
    channels = make_channels(OBSERVED, CONTROLLED)
    low = rng.uniform(-1, 1, 4)
    return inphase.Model(
        channels=channels,
        coordinates=Coordinates(channels, np.zeros(4)),
        scaling=inphase.Scaling(low, low + rng.uniform(0.5, 2, 4)),
        layout=layout,
        prior=WeightPrior(
            rng.normal(size=layout.size) + 0.3 * rng.normal(size=(demonstrations, layout.size)), shrinkage
        ),
        noise=Noise(rng.uniform(0.01, 0.03, 4), np.zeros(4) if white else rng.uniform(0.02, 0.1, 4)),
        phase=phase,
        spread=np.ones(4),
    )


def wide_model(count: int, *, functions: int = 8, shrinkage: float = 0.0, trust: float = 1.0) -> inphase.Model:
    """A model of `count` channels, half of them observed, with weights of chance: nothing was learned."""
    half = count // 2
    channels = make_channels([f"a{i}" for i in range(half)], [f"b{i}" for i in range(count - half)])
    layout, rng = Layout((Gaussian(functions),) * count), np.random.default_rng(count)
    blocks, samples = (functions,) * count, rng.normal(size=(8, layout.size))
    return inphase.Model(
        channels=channels,
        coordinates=Coordinates(channels, np.zeros(count)),
        scaling=inphase.Scaling.none(count),
        layout=layout,
        prior=WeightPrior(samples, shrinkage, trust, half * functions, blocks),
        noise=Noise(np.full(count, 0.01), np.zeros(count)),
        phase=phase_model(),
        spread=np.ones(count),
    )
