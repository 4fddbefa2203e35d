"""The sizes at which speed is measured, those of the dissertation's experiments (2.5, 3.3), with models of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import inphase
from inphase.basis import Gaussian, Layout
from inphase.observation import Observation
from inphase.weight_prior import WeightPrior

DURATION = 2.0  # [s] of an interaction
MOMENTS = 60  # of a demonstration
NOISE_STD, CORRELATION_TIME = 0.02, 0.3  # of a curve that is about as wide as the scaled range, and [s]
TRUST = 0.9  # as is usual where partners have something to do with each other, and twice the rank of the prior


@dataclass(frozen=True)
class Size:
    """channels: half of them observed. basis: functions a channel. members: of an ensemble, and demonstrations."""

    channels: int
    basis: int
    members: int

    def __str__(self) -> str:
        return f"{self.channels}x{self.basis},{self.members}"


SIZES = (
    Size(2, 8, 100),
    Size(12, 7, 100),
    Size(30, 15, 108),
    Size(74, 8, 30),
    Size(62, 9, 80),
    Size(62, 9, 198),
    Size(70, 9, 121),
)


def make_model(size: Size, rng: np.random.Generator) -> inphase.Model:
    """A model of smooth random curves in scaled units.

    Its prior and noise are those the curves are made with: to find them again takes minutes at the largest sizes, and
    what a step costs does not depend on it.
    """
    phases, basis = np.linspace(0, 1, MOMENTS), Gaussian(size.basis)
    weights = 0.2 + 0.1 * rng.standard_normal((size.members, size.channels, size.basis))  # curves around 0.5
    curves = basis(phases) @ weights.swapaxes(1, 2)
    names, observed = [f"channel_{i}" for i in range(size.channels)], size.channels // 2
    dataset = inphase.Dataset.from_arrays(
        times=[DURATION * phases] * size.members,
        values=list(curves + NOISE_STD * rng.standard_normal(curves.shape)),
        observed=names[:observed],
        controlled=names[observed:],
    )
    return inphase.fit(
        dataset,
        basis=basis,
        scaling=inphase.Scaling.none(size.channels),
        prior=WeightPrior(
            weights.reshape(size.members, -1),
            trust=TRUST,
            partner=observed * size.basis,
            blocks=(size.basis,) * size.channels,
        ),
        noise=inphase.Noise(np.full(size.channels, NOISE_STD**2), np.full(size.channels, CORRELATION_TIME)),
        calibrate=False,
    )


def untouched(model: inphase.Model) -> inphase.Model:
    """The same model as nobody has used it yet: nothing that is computed once and kept is there."""
    return replace(model, layout=Layout(model.layout.bases), prior=replace(model.prior))


def partner(model: inphase.Model, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, observed) what a partner nobody has seen yet reads in the course of an interaction."""
    curves = model.predict(np.linspace(0, 1, count), model.prior.draw(1, rng)[0])[:, : len(model.observed)]
    return curves + NOISE_STD * rng.standard_normal(curves.shape)


def observations(model: inphase.Model, count: int, rng: np.random.Generator) -> list[Observation]:
    """The samples of such a partner, ready for a filter."""
    features = np.arange(len(model.observed))
    noise_var = model.noise.at(np.full(model.layout.count, DURATION / count))[features]
    return [Observation(features, values, noise_var) for values in partner(model, count, rng)]
