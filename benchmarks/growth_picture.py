"""The picture of growth: a panel an axis, and how much batches gain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inphase.errors import OptionError
from inphase.io.atomic import whole_file
from inphase.report.accuracy_picture import MARKERS
from inphase.report.look import COLOURS, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STYLE = dict(zip(("ebip", "bip", "particle", "rbpf"), zip(COLOURS, MARKERS, strict=False), strict=False))
LABELS = {
    "channels": "channels, half observed",
    "basis": "basis functions a channel",
    "members": "members or particles",
    "demonstrations": "demonstrations",
}
COLUMNS = 3


def draw_growth(path: str, middle: str, rows: list[dict], slopes: list[dict], batches: list[dict]) -> None:
    """Draw into a file, whole or not at all; about 1200 pixels wide. Raises OptionError for nothing to draw."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    axes_of = list(dict.fromkeys(row["axis"] for row in rows))
    sizes_of = list(dict.fromkeys(row["size"] for row in batches))
    panels: list[tuple[Any, str, Any]] = [(_draw_axis, axis, (rows, slopes)) for axis in axes_of]
    panels += [(_draw_batch, size, batches) for size in dict.fromkeys([*sizes_of[:1], *sizes_of[-1:]])]
    if not panels:
        raise OptionError("expected an axis or batches to draw, got none")
    down = -(-len(panels) // COLUMNS)
    figure = Figure(figsize=(12, 0.9 + 3.6 * down), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.1)
    grid = figure.subplots(down, COLUMNS, squeeze=False).ravel()
    for place, (draw, what, of) in zip(grid, panels, strict=False):
        draw(place, what, of)
        _plain(place)
    for place in grid[len(panels) :]:
        place.set_visible(False)
    present = [name for name in STYLE if any(row["filter"] == name for row in rows + batches)]
    entries = [Line2D([], [], color=STYLE[n][0], marker=STYLE[n][1], ms=5, lw=1.6, label=n) for n in present]
    if rows:
        entries.append(Line2D([], [], color=INK, lw=1.2, ls="--", label="ebip as in section 3.1, O(E² n)"))
    if batches:
        entries.append(Line2D([], [], color="#8a929b", lw=1.6, label="by two processes, idle cores"))
        entries.append(Line2D([], [], color="#8a929b", lw=1.6, ls=":", label="as one array, at most"))
    figure.legend(handles=entries, loc="outside lower center", ncols=len(entries), frameon=False)
    figure.suptitle(
        f"One step; what is not varied: {middle}. Beside a line: its slope over the upper half", fontsize=11
    )
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=100)


def _draw_axis(axes: Axes, axis: str, of: tuple[list[dict], list[dict]]) -> None:
    rows, slopes = of
    ends = []
    for name, (colour, marker) in STYLE.items():
        some = [row for row in rows if (row["axis"], row["filter"]) == (axis, name)]
        if not some:
            continue
        sizes = np.array([row[axis] for row in some], dtype=float)
        times = 1e3 * np.array([row["seconds"] for row in some])
        axes.plot(sizes, times, color=colour, marker=marker, ms=5, lw=1.6)
        slope = next(row for row in slopes if (row["axis"], row["filter"]) == (axis, name))
        ends.append((times[-1], sizes[-1], f"{round(slope['measured'], 1) + 0.0:.1f}", colour))
        if name == "ebip" and slope["dissertation"] is not None:
            upper = sizes[len(sizes) // 2 :]
            theory = times[-1] * (upper / upper[-1]) ** slope["dissertation"]
            axes.plot(upper, theory, color=INK, lw=1.2, ls="--", zorder=3)
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    _name_ends(axes, ends)
    axes.set_ylabel("a step [ms]")
    axes.set_xlabel(LABELS[axis])


def _name_ends(axes: Axes, ends: list[tuple[float, float, str, str]]) -> None:
    """The slopes beside the ends of their lines, no two on one another."""
    lowest = -np.inf
    for time, size, text, colour in sorted(ends):
        at = axes.transAxes.inverted().transform(axes.transData.transform((size, time)))
        height = max(at[1], lowest + 0.065)
        lowest = height
        axes.annotate(
            text, (at[0], height), (8, 0), xycoords="axes fraction", textcoords="offset points", va="center",
            color=colour, fontsize=9,
        )  # fmt: skip


def _draw_batch(axes: Axes, size: str, batches: list[dict]) -> None:
    for name, (colour, marker) in STYLE.items():
        some = [row for row in batches if (row["size"], row["filter"]) == (size, name)]
        for what, line in (("idle_workers", "-"), ("stacked", ":")):
            axes.plot(
                [row["batch"] for row in some], [row[what] for row in some], color=colour, marker=marker, ms=5, lw=1.6,
                ls=line,
            )  # fmt: skip
    axes.axhline(1.0, color=INK, lw=1, ls="-", alpha=0.5)
    axes.set_xscale("log", base=2)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_ylim(bottom=0)
    axes.set_xlabel(f"interactions at once, {size}")
    axes.set_ylabel("times faster than one after another")


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#e6e9ed", lw=0.7)
    axes.set_axisbelow(True)
    axes.minorticks_off()
