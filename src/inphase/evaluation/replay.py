"""A recorded interaction played to a session, sample by sample, as if it were live."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from inphase.errors import DataError, listing
from inphase.metrics import MARKS, Errors, Scores, difference
from inphase.model import Model
from inphase.result import Estimate, Response
from inphase.session import Session
from inphase.trajectory import Dataset, Demonstration


@dataclass(frozen=True)
class Moment:
    """One step of a replay: the estimate, the response of two samples (now, end), and how far off it was.

    now_error, end_error: (Dc,) of the controlled channels, now and at the end of the episode, in their units.
    preview: the whole rest of the response, made at the marks only.
    """

    estimate: Estimate
    response: Response
    now_error: Float[np.ndarray, " Dc"]
    end_error: Float[np.ndarray, " Dc"]
    preview: Response | None = None


@dataclass(frozen=True)
class Replay:
    """A whole replay. spread: (Dc,) what the errors of the controlled channels are measured by."""

    name: str
    moments: tuple[Moment, ...]
    spread: Float[np.ndarray, " Dc"]

    @property
    def errors(self) -> Errors:
        """Of the controlled channels."""
        return Errors(
            now=np.array([m.now_error for m in self.moments]),
            std=np.array([m.response.std[0] for m in self.moments]),
            end=np.array([m.end_error for m in self.moments]),
            spread=self.spread,
        )

    @property
    def now(self) -> Scores:
        """The scores of the controlled channels at every sample."""
        return self.errors.scores

    def final_pose(self, share: float) -> float:
        """nMSE of the final pose, as predicted after that share of the episode."""
        return self.errors.final_pose(share)

    @property
    def log_likelihood(self) -> float:
        """Of all that was observed, in the channels' units."""
        return float(sum(m.estimate.log_likelihood for m in self.moments))


def replay(
    model: Model, demonstration: Demonstration, filter: str | None = None, seed: int = 0, **options: Any
) -> Replay:
    """Play a demonstration (columns as in `model.names`) to a new session; only the observed channels are shown."""
    moments = tuple(steps(model, demonstration, model.session(filter, seed, **options)))
    return Replay(demonstration.name, moments, model.spread[len(model.observed) :])


def steps(model: Model, demonstration: Demonstration, session: Session) -> Iterator[Moment]:
    """The moments of a replay, one at a time."""
    count = len(model.observed)
    channels, truth = model.channels[count:], demonstration.values[:, count:]
    marks = {int(mark * len(demonstration)) for mark in MARKS}
    for i, (time, row, now) in enumerate(zip(demonstration.times, demonstration.values, truth, strict=True)):
        estimate = session.observe(time, row[:count])
        response = session.respond(samples=2)
        now_error, end_error = (difference(channels, response.mean[i], to) for i, to in ((0, now), (1, truth[-1])))
        yield Moment(estimate, response, now_error, end_error, session.respond() if i in marks else None)


def fitting(model: Model, dataset: Dataset) -> list[Demonstration]:
    """The demonstrations of a data set with their columns as the model has them.

    Controlled channels that were not recorded are NaN: they are answered, but cannot be scored. Raises DataError
    naming the observed channels that are lacking.
    """
    lacking = [name for name in model.observed if name not in dataset.names]
    if lacking:
        raise DataError(
            f"{dataset[0].name}: not what the model was trained on: expected channels {listing(lacking)}; "
            f"got {listing(dataset.names)}"
        )
    recorded = [i for i, name in enumerate(model.names) if name in dataset.names]
    columns = [dataset.names.index(model.names[i]) for i in recorded]
    fitted = []
    for demonstration in dataset:
        values = np.full((len(demonstration), len(model.names)), np.nan)
        values[:, recorded] = demonstration.values[:, columns]
        fitted.append(Demonstration(demonstration.times, values, demonstration.name))
    return fitted
