"""The tasks of the study: demonstrations, models, tests against static trajectories, tests in which partners lead."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import inphase
from experiments.handshake.demonstrations import dataset, static, taught
from experiments.handshake.encounter import Told
from experiments.handshake.trajectories import TESTING, training
from experiments.handshake.trial import PAUSE, SPEEDS, leading, led, stacked
from experiments.study.as_written import as_written
from experiments.study.stored import Stored
from inphase.basis import Gaussian

FUNCTIONS = 15  # a channel in the dissertation: 450 weights
MODELS = {"bip": "written", "ebip": "calibrated", "rbpf": "calibrated"}


def teach(person: int, first: int, count: int, repetitions: int, seed: int) -> Mapping[str, Any]:
    """Some trajectories of one trainer, all repetitions: times (N, T), read (N, T, 30), truth (N, T, 6)."""
    found = [taught(person, which, repetitions, seed) for which in range(first, min(first + count, len(training())))]
    return {name: np.concatenate([f[name] for f in found]) for name in found[0]}


def learn(which: str, lessons: Stored, quick: bool) -> Mapping[str, Any]:
    """A model as a file in an array, and where hands were shaken (N, 3) [m]. which: "written" or "calibrated"."""
    told = [lessons[label] for label in lessons]
    data = dataset(np.concatenate([t["times"] for t in told]), np.concatenate([t["read"] for t in told]))
    written = which == "written"
    model = as_written(data, Gaussian(FUNCTIONS)) if written else inphase.fit(data, calibrate=not quick)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.inphase"
        model.save(path)
        made = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    return {"model": made, "ends": np.concatenate([t["truth"][:, -1, 3:] for t in told])}


@lru_cache(maxsize=2)
def learned(models: Stored, which: str) -> tuple[inphase.Model, np.ndarray]:
    """That model again, and the places."""
    found = models[which]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.inphase"
        path.write_bytes(found["model"].tobytes())
        return inphase.Model.load(path), found["ends"]


def against_static(person: int, repetitions: int, seed: int) -> Mapping[str, Any]:
    """Scenario after scenario, so many times each."""
    trials: list[tuple[Any, Told, None]] = []
    for which in range(len(TESTING)):
        trials += [(*static(person, which, again, seed), None) for again in range(repetitions)]
    return stacked(trials)


def against_method(method: str, person: int, repetitions: int, models: Stored, seed: int) -> Mapping[str, Any]:
    """Fast, normal, slow and still, so many times each, and once normal after a pause."""
    model, ends = learned(models, MODELS[method])
    trials = []
    for speed, pause in (*((speed, 0.0) for speed in SPEEDS), ("normal", PAUSE)):
        for again in range(repetitions):
            who = leading(person, speed, again, ends, seed, pause)
            told, found = led(method, model, who, seed)
            trials.append((who[0], told, found))
    return stacked(trials)
