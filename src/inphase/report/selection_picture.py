"""A picture of a basis selection: the criteria by size and family, and what the best basis makes of demonstrations."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from inphase.basis import Basis
from inphase.errors import OptionError
from inphase.io.atomic import whole_file
from inphase.report.look import COLOURS, INK, check_picture, plain, with_unit
from inphase.training.selection import CRITERIA, BasisSelection
from inphase.trajectory import Dataset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 4  # channels
CURVES = 3  # demonstrations in each
TITLES = {"aic": "AIC", "bic": "BIC", "held-out": "held out"}


def draw_selection(
    path: str | PathLike[str], dataset: Dataset, selection: BasisSelection, criterion: str = "held-out"
) -> None:
    """Draw a selection into a file (.png, .svg or .pdf), which is written whole or not at all.

    Raises OptionError where matplotlib is not installed, the kind of file is unknown or the folder does not exist.
    """
    check_picture(path)
    figure = make_figure(dataset, selection, criterion)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=130)


def make_figure(dataset: Dataset, selection: BasisSelection, criterion: str = "held-out") -> Figure:
    """The criteria of the first unit above, fitted curves of up to four channels below."""
    from matplotlib.figure import Figure

    channels = [name for names in selection.members for name in names[: max(1, SHOWN // len(selection.units))]][:SHOWN]
    if not channels:
        raise OptionError("expected a selection with channels to draw, got none")
    figure = Figure(figsize=(9.5, 6.4), layout="constrained")
    upper, lower = figure.subfigures(2, 1, squeeze=False)[:, 0]
    above = upper.subplots(1, len(CRITERIA), squeeze=False)[0]
    for axes, name in zip(above, CRITERIA, strict=True):
        _criterion(axes, selection, name)
    above[0].set_ylabel("a reading; lower is better")
    handles, labels = above[0].get_legend_handles_labels()
    upper.legend(handles, labels, loc="outside upper right", ncols=len(labels), frameon=False)
    upper.suptitle(f"Basis functions for {selection.units[0]}", x=0.01, ha="left", fontsize=11)
    best = selection.best(criterion)
    for axes, name in zip(lower.subplots(1, len(channels), squeeze=False)[0], channels, strict=True):
        _curves(axes, dataset, name, best[name])
    return figure


def _criterion(axes: Axes, selection: BasisSelection, name: str) -> None:
    """The least value of each family by size, over its widths."""
    values = selection.values(name)[0]
    families = list(dict.fromkeys(type(basis).__name__ for basis in selection.candidates))
    for family, colour in zip(families, COLOURS, strict=False):
        of = [i for i, basis in enumerate(selection.candidates) if type(basis).__name__ == family]
        sizes = np.array([selection.candidates[i].size for i in of])
        least = {size: values[of][sizes == size].min() for size in np.unique(sizes)}
        known = {size: value for size, value in least.items() if np.isfinite(value)}
        axes.plot(list(known), list(known.values()), "o-", ms=3.5, lw=1.2, color=colour, label=family.lower())
    at = selection.chosen(name)[0]
    axes.plot(selection.candidates[at].size, values[at], "o", ms=10, mfc="none", mec=INK)
    finite = values[np.isfinite(values)]
    low, high = finite.min(), np.quantile(finite, 0.7)
    margin = 0.06 * max(high - low, 1e-9)
    axes.set_ylim(low - margin, high + margin)  # what is far too small or too large may leave the picture
    axes.set_title(TITLES[name], fontsize=10)
    axes.set_xlabel("functions")
    plain(axes, "y")


def _curves(axes: Axes, dataset: Dataset, name: str, basis: Basis) -> None:
    """A few demonstrations of a channel, and what the basis makes of each."""
    column, phases = dataset.names.index(name), np.linspace(0, 1, 200)
    for i in np.unique(np.linspace(0, len(dataset) - 1, CURVES).round().astype(int)).tolist():
        values = dataset[i].values[:, column]
        seen = np.isfinite(values)
        if not seen.any():
            continue
        at, readings = dataset[i].phases[seen], values[seen]
        weights = np.linalg.lstsq(basis(at), readings, rcond=None)[0]
        axes.plot(at, readings, ".", ms=2.5, color="#b4bac1")
        axes.plot(phases, basis(phases) @ weights, lw=1.3, color=COLOURS[0])
    unit = dataset.channels[column].unit
    axes.set_title(with_unit(name, unit), fontsize=10)
    axes.set_xlabel("phase")
    plain(axes, "y")
