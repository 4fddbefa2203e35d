"""One face for all that follows an interaction, a filter or a baseline, and a recording played to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float

from inphase.arrays import FloatArray
from inphase.metrics import Errors, difference
from inphase.model import Model
from inphase.trajectory import Dataset, Demonstration

# Shown one sample, time [s] and observed channels (Do,) with NaN where not seen, it answers with the mean (2, Dc) and
# the standard deviation (2, Dc) of the controlled channels, now and at the end.
Step: TypeAlias = Callable[[float, FloatArray], tuple[FloatArray, FloatArray]]


@runtime_checkable
class Predictor(Protocol):
    """What was learned from demonstrations; it follows any number of interactions and is not changed by any."""

    def begin(self) -> Step:
        """The step of one interaction that begins, to be called with every sample in turn."""


Learner: TypeAlias = Callable[[Dataset], Predictor]


@dataclass(frozen=True, eq=False)
class Filtered:
    """The library as a user runs it: observe a sample, then respond."""

    model: Model
    filter: str
    seed: int = 0

    def begin(self) -> Step:
        """A session of its own for every interaction, with the same seed."""
        session = self.model.session(self.filter, self.seed)

        def step(time: float, values: FloatArray) -> tuple[FloatArray, FloatArray]:
            session.observe(time, values)
            response = session.respond(samples=2)
            return response.mean, response.std

        return step


def play(
    predictor: Predictor, dataset: Dataset, demonstration: Demonstration, spread: Float[np.ndarray, " Dc"]
) -> Errors:
    """Show a demonstration with the channels of the data set to a predictor, the observed ones sample by sample."""
    count, step = len(dataset.observed), predictor.begin()
    channels, truth = dataset.channels[count:], demonstration.values[:, count:]
    shown = zip(demonstration.times.tolist(), demonstration.values[:, :count], strict=True)
    answers = [step(time, values) for time, values in shown]
    mean, std = np.stack([m for m, _ in answers]), np.stack([s for _, s in answers])
    end = difference(channels, mean[:, 1], np.broadcast_to(truth[-1], truth.shape))
    return Errors(difference(channels, mean[:, 0], truth), std[:, 0], end, spread)
