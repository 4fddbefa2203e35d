"""Models of chance, of any extent at once, and readings of a partner to go with them.

`sizes.make_model` learns from demonstrations; with 2,000 channels that would take too long.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from sizes import DURATION, NOISE_STD

import inphase
from inphase.basis import Gaussian, Layout
from inphase.channels import make_channels
from inphase.observation import Observation
from inphase.preprocess.coordinates import Coordinates

USUAL, DIFFERENCE = 0.2, 0.1  # weight, which makes curves of about 0.5, and how far one demonstration is off
STEP = 0.01  # of an interaction: the time between two samples


@dataclass(frozen=True)
class Extent:
    """channels, half of them observed; basis functions a channel; members or particles; demonstrations."""

    channels: int
    basis: int
    members: int
    demonstrations: int

    @property
    def observed(self) -> int:
        return self.channels // 2

    @property
    def weights(self) -> int:
        return self.channels * self.basis


def make_model(extent: Extent, rng: np.random.Generator) -> inphase.Model:
    """A model whose demonstrations differ in every weight for itself: as many directions as there can be."""
    names = [f"channel_{i}" for i in range(extent.channels)]
    channels = make_channels(names[: extent.observed], names[extent.observed :])
    tempo = 1 / DURATION
    drawn = USUAL + DIFFERENCE * rng.standard_normal((extent.demonstrations, extent.weights))
    return inphase.Model(
        channels=channels,
        coordinates=Coordinates(channels, np.zeros(extent.channels)),
        scaling=inphase.Scaling.none(extent.channels),
        layout=Layout((Gaussian(extent.basis),) * extent.channels),
        prior=inphase.WeightPrior(drawn, blocks=(extent.basis,) * extent.channels),
        noise=inphase.Noise(np.full(extent.channels, NOISE_STD**2), np.zeros(extent.channels)),
        phase=inphase.PhaseModel(np.array([0.0, tempo]), np.diag([1e-4, 0.04 * tempo**2]), 0.09 * tempo**3, tempo),
        spread=np.ones(extent.channels),
    )


def observations(model: inphase.Model, count: int, rng: np.random.Generator) -> Iterator[Observation]:
    """What a new partner reads, sample by sample from the start: `STEP` of an interaction from one to the next."""
    shown = np.arange(len(model.observed))
    weights = model.prior.draw(1, rng)[0]
    for k in range(count):
        curve = model.layout.predict(np.array([k * STEP % 1.0]), weights, shown)[0]
        yield Observation(shown, curve + NOISE_STD * rng.standard_normal(len(shown)), model.noise.var[shown])
