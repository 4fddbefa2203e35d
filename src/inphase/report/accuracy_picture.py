"""A picture of an evaluation: how far off filters and baselines are by condition, and how honest about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.errors import OptionError
from inphase.io.atomic import whole_file
from inphase.report.look import COLOURS, INK, LINE, check_picture, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WANTED = 0.9  # of the readings inside a 90 % band
GREYS = ("#8a929b", "#4a525b")  # baselines
MARKERS, HOLLOW = "osD^vP", "sDo^"
TOGETHER = 0.7  # of a condition's place is taken by its points
LOWEST = 1e-6  # errors are drawn on a logarithmic scale


@dataclass(frozen=True, eq=False)
class AccuracySeries:
    """What is drawn of one filter or baseline, one figure a condition (C,), NaN where there is none.

    now: the squared error, 1 for always answering the mean. cover: 0 … 1, the share inside the 90 % band. *_error:
    their standard errors.
    """

    name: str
    now: Float[np.ndarray, " C"]
    now_error: Float[np.ndarray, " C"]
    cover: Float[np.ndarray, " C"]
    cover_error: Float[np.ndarray, " C"]
    baseline: bool = False

    def __post_init__(self) -> None:
        freeze(self, now=self.now, now_error=self.now_error, cover=self.cover, cover_error=self.cover_error)


def draw_accuracy(
    path: str | PathLike[str], title: str, conditions: Sequence[str], series: Sequence[AccuracySeries]
) -> None:
    """Draw an evaluation into a file (.png, .svg or .pdf), which is written whole or not at all.

    Raises OptionError where matplotlib is not installed, the kind of file is unknown, the folder does not exist or
    there is nothing to draw.
    """
    check_picture(path)
    figure = make_figure(title, conditions, series)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=130)


def make_figure(title: str, conditions: Sequence[str], series: Sequence[AccuracySeries]) -> Figure:
    """The errors by condition, above the shares inside the 90 % band; a point with its standard error each."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, PercentFormatter, StrMethodFormatter

    if not conditions or not series:
        raise OptionError(f"expected conditions and series to draw, got {len(conditions)} and {len(series)}")
    for one in series:
        if len(one.now) != len(conditions):
            raise OptionError(f"{one.name}: expected {len(conditions)} figures, one a condition, got {len(one.now)}")
    figure = Figure(figsize=(max(5.5, 2.0 + 1.5 * len(conditions)), 6.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    above.set_yscale("log", nonpositive="clip")
    for i, one in enumerate(series):
        rank = sum(other.baseline == one.baseline for other in series[:i])
        places = np.arange(len(conditions)) + TOGETHER * ((i + 0.5) / len(series) - 0.5)
        _points(above, places, np.maximum(one.now, LOWEST), one.now_error, one, rank)
        _points(below, places, one.cover, one.cover_error, one, rank)
    above.axhline(1.0, color=INK, lw=1, ls=":")
    above.annotate(
        "always the mean", (0.005, 1.0), (0, 2), xycoords=("axes fraction", "data"), textcoords="offset points"
    )
    above.set_ylabel("squared error now / variance")
    low, high = above.get_ylim()
    subs = (1, 2, 3, 5, 7) if high < 100 * low else (1, 3) if high < 1e4 * low else (1,)
    above.yaxis.set_major_locator(LogLocator(subs=subs))
    above.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    above.yaxis.set_minor_locator(LogLocator(subs=()))
    below.axhline(WANTED, color=INK, lw=1, ls=":")
    below.set_ylabel("inside the 90 % band")
    below.set_ylim(min(0.5, *(float(np.nanmin([1.0, *one.cover])) - 0.05 for one in series)), 1.02)
    below.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
    below.set_xticks(range(len(conditions)), conditions)
    below.set_xlim(-0.5, len(conditions) - 0.5)
    for axes in (above, below):
        _plain(axes, len(conditions))
    above.set_title(title, fontsize=11)
    figure.align_ylabels([above, below])
    handles, labels = above.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(series), 4), frameon=False)
    return figure


def _points(
    axes: Axes,
    places: Float[np.ndarray, " C"],
    values: Float[np.ndarray, " C"],
    errors: Float[np.ndarray, " C"],
    one: AccuracySeries,
    rank: int,
) -> None:
    colours, markers = (GREYS, HOLLOW) if one.baseline else (COLOURS, MARKERS)
    colour = colours[rank % len(colours)]
    axes.errorbar(
        places,
        values,
        np.nan_to_num(errors),  # of a single episode none is known
        fmt=markers[rank % len(markers)],
        color=colour,
        markerfacecolor="white" if one.baseline else colour,
        markersize=6,
        elinewidth=1.4,
        label=one.name,
    )


def _plain(axes: Axes, conditions: int) -> None:
    plain(axes, "y")
    axes.tick_params(axis="x", length=0)
    for border in range(conditions - 1):
        axes.axvline(border + 0.5, color=LINE, lw=1)
