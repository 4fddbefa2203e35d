"""A picture of all demonstrations over each other, those that are unlike the others in colour."""

from __future__ import annotations

import math
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from inphase.channels import Role
from inphase.io.atomic import whole_file
from inphase.preprocess.coordinates import Coordinates
from inphase.report.look import PAST, check_picture, plain, with_unit
from inphase.training.quality import Quality
from inphase.trajectory import Dataset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 12  # channels, in three rows of four; more cannot be told apart
COLOURS = ("#d1603d", "#0b6e99", "#e9a23b", "#6d5aa8", "#3f8f5f", "#8e3b46")  # outliers beyond share the last


def draw_overlay(path: str | PathLike[str], dataset: Dataset, quality: Quality) -> None:
    """Draw demonstrations into a file (.png, .svg or .pdf), which is written whole or not at all.

    Raises OptionError where matplotlib is not installed, the kind of file is unknown or the folder does not exist.
    """
    check_picture(path)
    figure = make_figure(dataset, quality)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=130)


def make_figure(dataset: Dataset, quality: Quality) -> Figure:
    """A panel for each of at most twelve features, over phase: those that are named first, then those that move most.

    Angles and rotation vectors [rad] are drawn from the mean of all demonstrations.
    """
    from matplotlib.figure import Figure

    coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
    features = [coordinates.from_channels(d.values) for d in dataset]
    shown = _shown(coordinates, features, quality)
    columns = math.isqrt(len(shown) - 1) + 1  # as many as rows, or one more
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(max(6.5, 3.3 * columns), 2.3 * rows + 0.9), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, squeeze=False)
    colours = {e.name: COLOURS[min(i, len(COLOURS) - 1)] for i, e in enumerate(quality.outliers)}
    named = {e.name: {part.feature for part in e.unlike} for e in quality.outliers}
    for axes, f in zip(panels.flat, shown, strict=False):
        for demonstration, values in zip(dataset, features, strict=True):
            seen = ~np.isnan(values[:, f])
            if demonstration.name not in colours:
                style = {"color": PAST, "lw": 0.8, "alpha": 0.6, "zorder": 2}
            else:
                here = coordinates.names[f] in named[demonstration.name]
                style = {"color": colours[demonstration.name], "lw": 2.0 if here else 1.1, "zorder": 4 if here else 3}
            axes.plot(demonstration.phases[seen], values[seen, f], **style)
        channel = dataset.channels[coordinates.channel_of[f][0]]
        unit = "rad" if len(coordinates.channel_of[f]) > 1 else channel.unit
        name = with_unit(coordinates.names[f], unit)
        axes.set_title(name, fontsize=10, fontweight="bold" if channel.role is Role.CONTROLLED else "normal")
        _plain(axes)
    for axes in panels.flat[len(shown) :]:
        axes.remove()
    for column in range(columns):
        lowest = max(i for i in range(len(shown)) if i % columns == column)
        panels.flat[lowest].set_xlabel("phase")
        panels.flat[lowest].tick_params(labelbottom=True)
    _legend(figure, dataset, quality, colours, len(shown), coordinates.count)
    return figure


def _shown(coordinates: Coordinates, features: list[np.ndarray], quality: Quality) -> list[int]:
    """Which features are drawn, in their order."""
    everything = np.concatenate(features)
    low, high = (f.reduce(everything, axis=0) for f in (np.fmin, np.fmax))
    spans = np.nan_to_num(high - low)
    groups = np.array(coordinates.groups)
    relative = spans / np.array([max(spans[groups == group].max(), np.finfo(float).tiny) for group in groups])
    named = {part.feature for episode in quality.outliers for part in episode.unlike}
    order = sorted(range(coordinates.count), key=lambda f: (coordinates.names[f] not in named, -relative[f], f))
    return sorted(order[:MOST])


def _legend(
    figure: Figure, dataset: Dataset, quality: Quality, colours: dict[str, str], shown: int, features: int
) -> None:
    from matplotlib.lines import Line2D

    usual = len(dataset) - len(colours)
    handles = [Line2D([], [], color=colour, lw=2, label=name) for name, colour in list(colours.items())[: len(COLOURS)]]
    if len(colours) > len(COLOURS):
        handles[-1].set_label(f"{len(colours) - len(COLOURS) + 1} others that are unlike")
    handles.append(Line2D([], [], color=PAST, lw=1.2, label=f"{usual} {'others' if colours else 'demonstrations'}"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 4), frameon=False)
    part = f"{shown} of {features} channels, those named and those that move most; " if shown < features else ""
    if dataset.controlled:
        figure.suptitle(f"{part}controlled in bold", fontsize=10)
    elif part:
        figure.suptitle(part.rstrip("; "), fontsize=10)


def _plain(axes: Axes) -> None:
    plain(axes)
    axes.set_xlim(0, 1)
    axes.tick_params(labelsize=8)
