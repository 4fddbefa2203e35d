"""What is learned and what is played, each drawn from the seed and its label."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

import inphase
from experiments.cooperation.demonstrations import distorted, recorded, without
from experiments.cooperation.methods import METHODS, followed
from experiments.cooperation.sensors import OBSERVED
from experiments.study import Settings, Stored
from experiments.study.as_written import as_written
from experiments.study.follower import WRITTEN
from experiments.study.models import packed, unpacked
from inphase.basis import Gaussian

BASIS = Gaussian(15)
WORN: dict[str, tuple[str, ...]] = {  # what is left at home
    "all": (),
    "skeleton": ("imu", "emg", "shoes"),
    "wearables": ("skeleton",),
}


def learn(settings: Settings, stored: Stored, place: str, kind: str, out: Sequence[int]) -> Mapping[str, np.ndarray]:
    """The dissertation's model, or ours, of all demonstrations of a place but those that are left out."""
    demonstrations = recorded(stored, place)
    demonstrations = demonstrations.subset([i for i in range(len(demonstrations)) if i not in out])
    if kind == WRITTEN:
        return {"model": packed(as_written(demonstrations, BASIS))}
    return {"model": packed(inphase.fit(demonstrations, calibrate=not settings.quick))}


def play(
    settings: Settings,
    stored: Stored,
    models: Stored,
    labels: Mapping[str, str],
    place: str,
    worn: str,
    fold: int,
    ratios: Sequence[float],
    methods: Sequence[str],
) -> Mapping[str, np.ndarray]:
    """{method: (ratios, MARKS, 3)} errors for a demonstration that was left out, distorted in time.

    labels: of the models, by their kind; they know all modalities, whatever is worn.
    """
    demonstration = without(recorded(stored, place)[fold], WORN[worn])
    known = learned(models, labels)
    found: dict[str, list[np.ndarray]] = {name: [] for name in methods}
    for ratio in ratios:
        rng = np.random.default_rng([settings.seed, 4000, place == "lift", fold, round(100 * ratio)])
        kept, times = distorted(demonstration, ratio, rng) if ratio != 1 else _whole(demonstration)
        for name in methods:
            found[name].append(followed(name, known, demonstration, kept, times, fold))
    return {name: np.array(errors) for name, errors in found.items()}


def take_time(
    settings: Settings, stored: Stored, models: Stored, labels: Mapping[str, str], place: str, ratios: Sequence[float]
) -> Mapping[str, np.ndarray]:
    """{method: (ratios,)} what it takes to take in a whole demonstration [s of one processor]; {samples: how many}."""
    demonstration, known = recorded(stored, place)[0], learned(models, labels)
    found = {name: np.full(len(ratios), np.inf) for name in METHODS}
    lengths = []
    for i, ratio in enumerate(ratios):
        kept, times = distorted(demonstration, ratio, np.random.default_rng([settings.seed, 5000]))
        lengths.append(len(kept))
        for name, method in METHODS.items():
            for _ in range(1 if settings.quick else 2):
                follower = method.make(known[method.model], 0)
                began = time.process_time()
                for now, row in zip(times, demonstration.values[kept, : len(OBSERVED)], strict=True):
                    follower.observe(now, row)
                found[name][i] = min(found[name][i], time.process_time() - began)
    return found | {"samples": np.array(lengths)}


def _whole(demonstration: inphase.Demonstration) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(len(demonstration)), demonstration.times


def learned(models: Stored, labels: Mapping[str, str]) -> dict[str, inphase.Model]:
    """Models by their kind, which are results by these labels."""
    return {kind: unpacked(models[label]["model"]) for kind, label in labels.items()}
