"""One recording as it was read: every reading, every gap, and what is cut off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models.annotations import BoxAnnotation, Legend, LegendItem
from bokeh.plotting import figure as Figure
from jaxtyping import Float

from inphase.channels import group_of
from inphase.io import Table
from inphase.preprocess.checks.clock import GAP
from inphase.studio.figures.extent import extent
from inphase.studio.figures.look import FAINT, LEGEND, LINES, new_figure, short

COLOURS = ("#2b86b3", "#d2691e", "#5d9a3c", "#9a62c7", "#c2446b", "#a07c1f")
BUCKETS = 1500  # stretches of time of which the least and the greatest reading are drawn
MARKED = 60  # gaps that are shaded


def groups(names: Sequence[str]) -> dict[str, list[str]]:
    """The channels that are drawn together, at most six: those of a group."""
    found: dict[str, list[str]] = {}
    for name in names:
        group, i = group_of(name), 2
        while len(found.get(group, ())) == len(COLOURS):
            group, i = f"{group_of(name)} ({i})", i + 1
        found.setdefault(group, []).append(name)
    return found


def draw_episode(
    table: Table, names: Sequence[str], title: str, cut: tuple[float | None, float | None] = (None, None)
) -> Figure:
    """Channels over time [s] in the recording's own clock, gaps shaded, and what is cut off hatched.

    cut: from when until when [s] it is used, None for as far as it goes.
    """
    times, values = table.times, table.pick(names)
    if not np.isfinite(values).any():
        title += ": nothing was seen"
    figure = new_figure(title, "time [s]", height=190, tools="xpan,xwheel_zoom,reset")
    figure.x_range, figure.y_range = extent([times], margin=0.02), extent([values])
    lines: list[LegendItem] = []
    for i, name in enumerate(names):
        at = thinned(times, values[:, i])
        drawn_times, drawn = broken(times, values[:, i], at)
        colour, dash = COLOURS[i % len(COLOURS)], LINES[i // 3 % len(LINES)]
        line = figure.line(drawn_times, drawn, color=colour, line_width=1.6, line_dash=dash)
        alone = isolated(drawn)
        figure.scatter(drawn_times[alone], drawn[alone], color=colour, size=3)
        lines.append(LegendItem(label={"value": short(name)}, renderers=[line]))  # type: ignore[list-item]
    for start, end in gaps(times)[:MARKED]:
        figure.add_layout(BoxAnnotation(left=start, right=end, fill_color=FAINT, fill_alpha=0.25, line_color=None))
    off: dict[str, Any] = {
        "fill_color": FAINT,
        "fill_alpha": 0.35,
        "hatch_pattern": "/",
        "hatch_alpha": 0.4,
        "line_color": FAINT,
    }
    if cut[0] is not None:
        figure.add_layout(BoxAnnotation(right=cut[0], **off))
    if cut[1] is not None:
        figure.add_layout(BoxAnnotation(left=cut[1], **off))
    if len(lines) > 1 or not title.startswith(names[0]):
        figure.add_layout(_legend(lines), "below")
    return figure


def _legend(items: Sequence[LegendItem]) -> Legend:
    return Legend(
        items=list(items),
        orientation="horizontal",
        ncols=3,
        background_fill_alpha=0,
        border_line_color=None,
        label_text_font_size="11px",
        label_text_color=LEGEND,
        margin=2,
    )


def gaps(times: Float[np.ndarray, " T"]) -> list[tuple[float, float]]:
    """From when until when [s] nothing at all was recorded."""
    steps = np.diff(times)
    usual = steps[steps > 0]
    if not len(usual):
        return []
    long = np.flatnonzero(steps > GAP * np.median(usual))
    return [(float(times[i]), float(times[i + 1])) for i in long]


def thinned(times: Float[np.ndarray, " T"], values: Float[np.ndarray, " T"]) -> np.ndarray:
    """Which samples are drawn: of a long recording the least, the greatest and a missing one of every stretch."""
    count = len(times)
    if count <= 2 * BUCKETS:
        return np.arange(count)
    kept = [0, count - 1]
    for part in np.array_split(np.arange(count), BUCKETS):
        here = values[part]
        missing = np.flatnonzero(~np.isfinite(here))
        kept += [int(part[i]) for i in missing[:1]]
        if len(missing) < len(part):
            kept += [int(part[np.nanargmin(here)]), int(part[np.nanargmax(here)])]
    return np.unique(kept)


def isolated(values: Float[np.ndarray, " S"]) -> np.ndarray:
    """Which readings have none beside them, so that no line shows them."""
    seen = np.concatenate([[False], np.isfinite(values), [False]])
    return np.flatnonzero(seen[1:-1] & ~seen[:-2] & ~seen[2:])


def broken(
    times: Float[np.ndarray, " T"], values: Float[np.ndarray, " T"], at: np.ndarray
) -> tuple[Float[np.ndarray, " S"], Float[np.ndarray, " S"]]:
    """These samples, with a missing one in every gap: a line must not bridge it."""
    ends = np.array([start for start, _ in gaps(times)])
    if not len(ends):
        return times[at], values[at]
    all_times = np.concatenate([times[at], np.nextafter(ends, np.inf)])
    all_values = np.concatenate([values[at], np.full(len(ends), np.nan)])
    order = np.argsort(all_times, kind="stable")
    return all_times[order], all_values[order]
