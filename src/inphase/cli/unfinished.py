"""What an interrupted evaluation left in its file, for the next one to go on with."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import inphase
from inphase.errors import DataError, OptionError
from inphase.evaluation import Row
from inphase.trajectory import Dataset

READ: dict[str, Callable[[Any], Any]] = {
    "str": str,
    "int": int,
    "float": lambda value: float("nan") if value is None else float(value),
}


def describe_settings(tasks: Mapping[str, Dataset], folds: int, seed: int, quick: bool) -> dict[str, Any]:
    """What the scores of an episode depend on, besides the filter and the condition."""
    data = {task: _fingerprint(dataset) for task, dataset in tasks.items()}
    return {"inphase": inphase.__version__, "folds": folds, "seed": seed, "quick": quick, "data": data}


def read_rows(path: Path, settings: Mapping[str, Any]) -> list[Row]:
    """The rows of a file that was written with these settings, none if there is no file.

    Raises DataError for another file, and OptionError for other settings.
    """
    if not path.exists():
        return []
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        was = {name: found[name] for name in settings}
        rows = [
            Row(**{field.name: READ[str(field.type)](row[field.name]) for field in fields(Row)})
            for row in found["episodes"]
        ]
    except (ValueError, KeyError, TypeError):
        raise DataError(f"{path}: expected the figures of `inphase evaluate --output`, got another file") from None
    for name, value in settings.items():
        if was[name] != value and name == "data":
            raise OptionError(f"{path}: cannot go on: it was written for other recordings or channels")
        if was[name] != value:
            raise OptionError(f"{path}: cannot go on: expected {name} {was[name]!r} as in the file, got {value!r}")
    return rows


def _fingerprint(dataset: Dataset) -> str:
    found = hashlib.sha256(repr(dataset.channels).encode())
    for demonstration in dataset:
        for part in (demonstration.name.encode(), demonstration.times.tobytes(), demonstration.values.tobytes()):
            found.update(b"%d:" % len(part) + part)
    return found.hexdigest()[:32]
