"""Rehearsals: held-out demonstrations played to a session, as recorded and as a partner might vary them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from inphase.errors import DataError
from inphase.metrics import Errors, Scores, difference
from inphase.model import Model
from inphase.session import Session
from inphase.trajectory import Dataset, Demonstration

# A demonstration, its number of observed channels, and where something happens, as another partner might move.
Vary: TypeAlias = Callable[[Demonstration, int, float], Demonstration]

FOLDS = 8  # at most: models that are learned without some of the demonstrations
PLAYED = 10  # demonstrations at most, evenly from all
SAMPLES = 40  # of a demonstration as it is played: noise lasts for longer than they lie apart
PARTICLES = 100
PAUSE = 0.3  # of a demonstration
GAP = 0.3  # of a demonstration, out of sight
EARLIEST, LATEST = 0.1, 0.6  # of a demonstration: where a pause or a gap may begin
GOLDEN = 0.618  # steps of this size, round a circle, fill it evenly


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """A model that was learned without a demonstration, and that demonstration under every condition."""

    model: Model
    variations: tuple[Demonstration, ...]


def rehearsals(dataset: Dataset, learn: Callable[[Dataset], Model]) -> list[Rehearsal]:
    """The demonstrations that are held out and played, each with a model of those in other folds."""
    count = len(dataset)
    folds = min(count, FOLDS)
    played = np.unique(np.linspace(0, count - 1, min(count, PLAYED)).round().astype(int)).tolist()
    models: dict[int, Model | None] = {}
    for fold in dict.fromkeys(i % folds for i in played):
        try:
            models[fold] = learn(dataset.subset([i for i in range(count) if i % folds != fold]))
        except DataError:  # a channel that only those demonstrations have: they cannot be held out
            models[fold] = None
    return [
        Rehearsal(model, tuple(vary(dataset[i], len(dataset.observed), place) for vary in CONDITIONS.values()))
        for i, place in zip(played, _places(len(played)), strict=True)
        if (model := models[i % folds]) is not None
    ]


def _places(count: int) -> list[float]:
    """Where each demonstration pauses or is out of sight: not all at the same place."""
    return [EARLIEST + (LATEST - EARLIEST) * (GOLDEN * i % 1.0) for i in range(1, count + 1)]


def play(model: Model, demonstration: Demonstration) -> Errors:
    """The errors of the answers for now, the partner being shown sample by sample; `end` is left out."""
    shown = len(model.observed)
    session = Session(model, particles=PARTICLES)
    channels, truth = model.channels[shown:], demonstration.values[:, shown:]
    mean, std = np.empty(truth.shape), np.empty(truth.shape)
    for i, (time, row) in enumerate(zip(demonstration.times, demonstration.values, strict=True)):
        session.observe(time, row[:shown])
        response = session.respond(samples=1)
        mean[i], std[i] = response.mean[0], response.std[0]
    error = difference(channels, mean, truth)
    return Errors(error, std, np.full_like(error, np.nan), model.spread[shown:])


def by_the_clock(model: Model, demonstration: Demonstration) -> Scores:
    """The scores of playing the mean movement at its mean tempo."""
    shown = len(model.observed)
    phases = np.minimum((demonstration.times - demonstration.times[0]) * model.phase.nominal_velocity, 1.0)
    mean, std = model.distribution(phases)
    error = difference(model.channels[shown:], mean[:, shown:], demonstration.values[:, shown:])
    return Scores.of(error, std[:, shown:], model.spread[shown:])


def _thinned(demonstration: Demonstration) -> Demonstration:
    """About as many samples as SAMPLES, evenly in time; a phase of rest is as long as it was."""
    kept = np.unique(
        np.searchsorted(
            demonstration.times,
            np.linspace(demonstration.times[0], demonstration.times[-1], SAMPLES),
        ).clip(0, len(demonstration) - 1)
    )
    return Demonstration(demonstration.times[kept], demonstration.values[kept], demonstration.name)


def _at_speed(factor: float) -> Vary:
    def vary(demonstration: Demonstration, shown: int, place: float) -> Demonstration:
        thin = _thinned(demonstration)
        return Demonstration(thin.times[0] + (thin.times - thin.times[0]) / factor, thin.values, thin.name)

    return vary


def _with_pause(demonstration: Demonstration, shown: int, place: float) -> Demonstration:
    """Both stand still for a while."""
    thin = _thinned(demonstration)
    begins, pause = round(place * (len(thin) - 1)), PAUSE * thin.duration
    count = max(round(PAUSE * len(thin)), 1)
    still = thin.times[begins] + pause * np.arange(1, count + 1) / count
    times = np.concatenate([thin.times[: begins + 1], still, thin.times[begins + 1 :] + pause])
    values = np.concatenate(
        [thin.values[: begins + 1], np.tile(thin.values[begins], (count, 1)), thin.values[begins + 1 :]]
    )
    return Demonstration(times, values, thin.name)


def _out_of_sight(demonstration: Demonstration, shown: int, place: float) -> Demonstration:
    thin = _thinned(demonstration)
    share = (thin.times - thin.times[0]) / thin.duration
    values = thin.values.copy()
    values[np.ix_((share >= place) & (share < place + GAP), np.arange(shown))] = np.nan
    return Demonstration(thin.times, values, thin.name)


CONDITIONS: dict[str, Vary] = {
    "as recorded": _at_speed(1.0),
    "half speed": _at_speed(0.5),
    "double speed": _at_speed(2.0),
    "a pause": _with_pause,
    "out of sight": _out_of_sight,
}


def scores(errors: Sequence[Errors], band: float = 1.0) -> Scores:
    """The scores of several plays, each of which counts as much as any other."""
    each = [Scores.of(e.now, band * e.std, e.spread) for e in errors]
    return Scores(
        float(np.mean([s.nmse for s in each])),
        float(np.mean([s.coverage for s in each])),
        float(np.mean([s.nll for s in each])),
    )


def relative(errors: Sequence[Errors]) -> Float[np.ndarray, " n"]:
    """All errors in units of their predicted standard deviations, NaN left out."""
    flat = np.concatenate([(e.now / np.maximum(e.std, 1e-12)).ravel() for e in errors])
    return np.asarray(flat[np.isfinite(flat)])
