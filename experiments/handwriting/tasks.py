"""What is learned and what is played, each drawn from the seed and its label."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

import inphase
from experiments.handwriting.methods import METHODS, followed
from experiments.handwriting.strokes import (
    NOISE,
    SAMPLES,
    SHIFT,
    Stroke,
    made,
    moved,
    resampled,
    stroke,
    taught,
    written,
)
from experiments.study import Settings, Stored
from experiments.study.as_written import as_written
from experiments.study.follower import OURS, WRITTEN
from experiments.study.models import packed, unpacked
from inphase.basis import Gaussian

BASIS = Gaussian(15)
LEARN, PLAY = 0, 1  # so that no stroke is played that was learned
TREMOR = 0.02  # of a robot that draws along what people wrote, in sixths of its size
COPIES = 5  # of what was written, each elsewhere


def shifts(a: int | None, count: int, rng: np.random.Generator) -> np.ndarray:
    """(N, 2) where strokes are: U(-a, a) where a is named, N(0, 5) where not."""
    return rng.uniform(-a, a, (count, 2)) if a else SHIFT * rng.standard_normal((count, 2))


def learn(settings: Settings, a: int | None) -> Mapping[str, np.ndarray]:
    """Both models of strokes that are moved about."""
    rng = np.random.default_rng([settings.seed, LEARN, a or 0])
    count = 6 if settings.quick else 50
    strokes = [made(stroke() + shift, SAMPLES, NOISE, rng) for shift in shifts(a, count, rng)]
    return _both(taught(strokes, NOISE, rng))


def learn_written(settings: Settings, shape: str, a: int | None) -> Mapping[str, np.ndarray]:
    """Both models of what people wrote of a shape, all but the last time; where a is named, each moved about."""
    rng = np.random.default_rng([settings.seed, LEARN, a or 0, *shape.encode()])
    strokes = written(shape)[:-1] * (COPIES if a else 1)
    if a:
        strokes = moved(strokes, shifts(a, len(strokes), rng))
    return _both(taught(strokes, TREMOR, rng))


def _both(demonstrations: inphase.Dataset) -> Mapping[str, np.ndarray]:
    return {
        WRITTEN: packed(as_written(demonstrations, BASIS)),
        OURS: packed(inphase.fit(demonstrations)),
    }


def play(
    settings: Settings, models: Stored, label: str, a: int | None, length: int, count: int
) -> Mapping[str, np.ndarray]:
    """{method: (count, MARKS, 2)} errors for strokes that are new."""
    rng = np.random.default_rng([settings.seed, PLAY, a or 0, length])
    strokes = [made(stroke() + shift, length, NOISE, rng) for shift in shifts(a, count, rng)]
    return _played(models, label, strokes)


def play_written(
    settings: Settings, models: Stored, label: str, shape: str, a: int | None, ratio: float
) -> Mapping[str, np.ndarray]:
    """{method: (1, MARKS, 2)} errors for the last time that somebody wrote a shape."""
    rng = np.random.default_rng([settings.seed, PLAY, a or 0, *shape.encode()])
    last = written(shape)[-1:]
    last = moved(last, shifts(a, 1, rng)) if a else last
    return _played(models, label, [resampled(s, round(ratio * len(s.times))) for s in last])


def _played(models: Stored, label: str, strokes: Sequence[Stroke]) -> Mapping[str, np.ndarray]:
    learned = _learned(models, label)
    return {
        name: np.array([followed(name, learned, each, seed) for seed, each in enumerate(strokes)]) for name in METHODS
    }


def take_time(settings: Settings, models: Stored, label: str, lengths: Sequence[int]) -> Mapping[str, np.ndarray]:
    """{method: (L,)} how long it takes to take in a whole stroke [s], the shortest of three times."""
    learned, rng = _learned(models, label), np.random.default_rng([settings.seed, PLAY])
    strokes = [made(stroke() + shifts(None, 1, rng)[0], length, NOISE, rng) for length in lengths]
    found = {name: np.full(len(lengths), np.inf) for name in METHODS}
    for _ in range(1 if settings.quick else 3):
        for i, each in enumerate(strokes):
            for name, method in METHODS.items():
                follower = method.make(learned[method.model], 0)
                began = time.perf_counter()
                for now, row in zip(each.times, each.read, strict=True):
                    follower.observe(now, row)
                found[name][i] = min(found[name][i], time.perf_counter() - began)
    return found


def _learned(models: Stored, label: str) -> dict[str, inphase.Model]:
    file = models[label]
    return {name: unpacked(file[name]) for name in (WRITTEN, OURS)}
