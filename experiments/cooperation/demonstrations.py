"""Demonstrations among results, and what they are to learn from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

import inphase
from experiments.cooperation.plan import plan
from experiments.cooperation.sensors import CONTROLLED, GROUPS, OBSERVED, UNITS
from experiments.cooperation.trial import demonstrated
from experiments.cooperation.world import HANDOVER, LIFT
from experiments.study import Settings, Stored

PLACES = {"handover": HANDOVER, "lift": LIFT}
DEMONSTRATIONS = 25  # five of each person; the dissertation does not say how many
AT_ONCE = 5  # a task
TRIES = 5  # one that is not done is done anew, otherwise


def record(settings: Settings, place: str, trials: Sequence[int]) -> Mapping[str, np.ndarray]:
    """Teach the robot, some times: what was read, which share of the joints was hidden, and how many failed before."""
    found: dict[str, np.ndarray] = {}
    for trial in trials:
        for tried in range(TRIES):
            rng = np.random.default_rng([settings.seed, 3000, place == "lift", trial + 1000 * tried])
            seen = demonstrated(plan(PLACES[place], settings.seed, trial + 1000 * tried), rng)
            if seen.done:
                break
        else:
            raise RuntimeError(f"{place} {trial}: expected one of {TRIES} demonstrations to be done, got none")
        found |= {f"times{trial}": seen.times, f"values{trial}": seen.values, f"hid{trial}": seen.hid}
        found[f"tried{trial}"] = np.array(tried)
    return found


def recorded(stored: Stored, place: str) -> inphase.Dataset:
    """All demonstrations."""
    found: dict[str, np.ndarray] = {}
    for label in stored:
        if label.startswith(f"{place}/"):
            found |= stored[label]
    trials = sorted(int(name[len("times") :]) for name in found if name.startswith("times"))
    return dataset(
        [found[f"times{t}"] for t in trials], [found[f"values{t}"] for t in trials], [f"{place} {t}" for t in trials]
    )


def dataset(times: Sequence[np.ndarray], values: Sequence[np.ndarray], names: Sequence[str]) -> inphase.Dataset:
    """Rows (T, 74) with the names and units of their channels."""
    return inphase.Dataset.from_arrays(times, values, list(OBSERVED), list(CONTROLLED), units=UNITS, names=names)


def without(demonstration: inphase.Demonstration, groups: Iterable[str]) -> inphase.Demonstration:
    """The same, these modalities not worn: nothing is read of them."""
    away = [OBSERVED.index(name) for group in groups for name in GROUPS[group]]
    values = demonstration.values.copy()
    values[:, away] = np.nan
    return replace(demonstration, values=values)


def distorted(
    demonstration: inphase.Demonstration, ratio: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Which samples (T,) of a demonstration are left or doubled so that there are so many times as many, and when (T,).

    Drawn uniformly: without return where samples are deleted, with return where they are duplicated (2.5.2).
    """
    count = len(demonstration)
    target = max(round(ratio * count), 3)
    if target <= count:
        kept = np.sort(rng.choice(count, target, replace=False))
    else:
        kept = np.sort(np.concatenate([np.arange(count), rng.integers(0, count, target - count)]))
    step = demonstration.duration / (count - 1)
    return kept, step * np.arange(len(kept))
