"""What is learned and what is played, each drawn from the seed and its label."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

import inphase
from experiments.cooperation.demonstrations import distorted, recorded, without
from experiments.cooperation.methods import METHODS, OURS, WRITTEN, followed
from experiments.cooperation.sensors import OBSERVED
from experiments.study import Settings, Stored
from experiments.study.as_written import as_written
from experiments.study.models import packed, unpacked
from inphase.basis import Gaussian

BASIS = Gaussian(15)
WORN: dict[str, tuple[str, ...]] = {  # what is left at home
    "all": (),
    "skeleton": ("imu", "emg", "shoes"),
    "wearables": ("skeleton",),
}
BOTH = (WRITTEN, OURS)


def learn(
    settings: Settings, stored: Stored, place: str, worn: str, fold: int | None, kinds: Sequence[str] = BOTH
) -> Mapping[str, np.ndarray]:
    """Models of all demonstrations of a place but one; of all of them where none is named."""
    demonstrations = without(recorded(stored, place), WORN[worn])
    if fold is not None:
        demonstrations = demonstrations.without(fold)
    found = {}
    if WRITTEN in kinds:
        found[WRITTEN] = packed(as_written(demonstrations, BASIS))
    if OURS in kinds:
        found[OURS] = packed(inphase.fit(demonstrations, calibrate=not settings.quick))
    return found


def play(
    settings: Settings,
    stored: Stored,
    models: Stored,
    place: str,
    worn: str,
    fold: int,
    ratios: Sequence[float],
    methods: Sequence[str],
) -> Mapping[str, np.ndarray]:
    """{method: (ratios, MARKS, 3)} errors for the demonstration that was left out, distorted in time."""
    demonstration = recorded(stored, place)[fold]
    known = learned(models, f"{place}/{worn}/{fold}")
    found: dict[str, list[np.ndarray]] = {name: [] for name in methods}
    columns = np.array([OBSERVED.index(name) for name in next(iter(known.values())).observed])
    for ratio in ratios:
        rng = np.random.default_rng([settings.seed, 4000, place == "lift", fold, round(100 * ratio)])
        kept, times = distorted(demonstration, ratio, rng) if ratio != 1 else _whole(demonstration)
        for name in methods:
            found[name].append(followed(name, known, demonstration, kept, times, fold, columns))
    return {name: np.array(errors) for name, errors in found.items()}


def take_time(
    settings: Settings, stored: Stored, models: Stored, place: str, ratios: Sequence[float]
) -> Mapping[str, np.ndarray]:
    """{method: (ratios,)} how long it takes to take in a whole demonstration [s]; and how many samples these are."""
    demonstration, known = recorded(stored, place)[0], learned(models, f"{place}/all/0")
    found = {name: np.full(len(ratios), np.inf) for name in METHODS}
    lengths = []
    for i, ratio in enumerate(ratios):
        kept, times = distorted(demonstration, ratio, np.random.default_rng([settings.seed, 5000]))
        lengths.append(len(kept))
        for name, method in METHODS.items():
            for _ in range(1 if settings.quick else 2):
                follower = method.make(known[method.model], 0)
                began = time.perf_counter()
                for now, row in zip(times, demonstration.values[kept, : len(OBSERVED)], strict=True):
                    follower.observe(now, row)
                found[name][i] = min(found[name][i], time.perf_counter() - began)
    return found | {"samples": np.array(lengths)}


def _whole(demonstration: inphase.Demonstration) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(len(demonstration)), demonstration.times


def learned(models: Stored, label: str) -> dict[str, inphase.Model]:
    """The models of a task that has learned."""
    file = models[label]
    return {name: unpacked(file[name]) for name in BOTH if name in file}
