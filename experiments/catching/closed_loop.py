"""The robot catches: a model of all demonstrations, and throws that nobody learned from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import inphase
from experiments.catching.demonstrations import STRANGER, gathered
from experiments.catching.trial import tried
from experiments.study import Found


def learned(found: Found, calibrate: bool = True) -> dict[str, Any]:
    """The bytes of the model of all demonstrations, with nothing set by hand, and what calibration chose."""
    model = inphase.fit(gathered(found), calibrate=calibrate)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "catching.inphase"
        model.save(path)
        content = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    trials = model.evidence.trials if model.evidence else ()
    chosen = [f"{t.choice}: {t.value}" for t in trials if t.chosen and t.choice != "before" and t.value != "as it is"]
    return {"model": content, "chosen": np.array("; ".join(chosen)), "weights": model.layout.slices[-1].stop}


def loaded(models: Found) -> inphase.Model:
    """That model again."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "catching.inphase"
        path.write_bytes(models["all"]["model"].tobytes())
        return inphase.Model.load(path)


def in_the_loop(models: Found, condition: str, numbers: range, seed: int) -> Mapping[str, Any]:
    """Throws of those from whom it learned."""
    return tried(loaded(models), condition, numbers, seed)


def strangers(models: Found, numbers: range, seed: int) -> Mapping[str, Any]:
    """Throws of people who are not in the demonstrations, all modalities there."""
    return tried(loaded(models), "all modalities", numbers, seed, STRANGER)
