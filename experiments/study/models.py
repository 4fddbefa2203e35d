"""Models among the results of a part, so that one is learned once and played by many tasks."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import inphase


def packed(model: inphase.Model) -> np.ndarray:
    """The model file, byte by byte."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "packed.inphase"
        model.save(path)
        return np.frombuffer(path.read_bytes(), dtype=np.uint8)


def unpacked(file: np.ndarray) -> inphase.Model:
    """The model of a file that was packed."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "packed.inphase"
        path.write_bytes(file.tobytes())
        return inphase.Model.load(path)
