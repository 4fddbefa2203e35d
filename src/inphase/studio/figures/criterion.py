"""One criterion of a basis selection by size and family, from what `inphase select --json` prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.plotting import figure as Figure

from inphase.studio.figures.look import FAMILIES, LEGEND, LINES, MARK, new_figure, tips

TITLES = {"held-out": "held out", "aic": "AIC", "bic": "BIC"}
SEEN = 0.7  # of the values lie inside the picture: what is far too small or too large may leave it


def size_of(candidate: Mapping[str, Any]) -> int:
    """How many functions a candidate has."""
    return int(candidate["degree"]) + 1 if "degree" in candidate else int(candidate["size"])


def least(candidates: Sequence[Mapping[str, Any]], criterion: str) -> dict[str, dict[int, float]]:
    """By family and size the least value of the first unit, over the widths; without those that are not known."""
    found: dict[str, dict[int, float]] = {}
    for candidate in candidates:
        value, of = candidate[criterion][0], found.setdefault(candidate["family"], {})
        if value is not None:
            of[size_of(candidate)] = min(value, of.get(size_of(candidate), np.inf))
    return found


def draw_criterion(
    candidates: Sequence[Mapping[str, Any]], criterion: str, chosen: tuple[str, int] | None = None
) -> Figure:
    """The least value of each family by size, lower is better; round `chosen`, a family and a size, a ring."""
    everything = [candidate[criterion][0] for candidate in candidates if candidate[criterion][0] is not None]
    low, high = (min(everything), float(np.quantile(everything, SEEN))) if everything else (0.0, 1.0)
    margin = 0.06 * max(high - low, 1e-9)
    title, seen = TITLES.get(criterion, criterion), (low - margin, high + margin)
    figure = new_figure(title, "functions", "a reading, less is better", height=270, y_range=seen)
    families = least(candidates, criterion)
    for (family, values), colour, dash in zip(families.items(), FAMILIES, LINES, strict=False):
        sizes = sorted(values)
        column = {"size": sizes, "value": [values[size] for size in sizes], "family": [family] * len(sizes)}
        source = ColumnDataSource(column)
        figure.line("size", "value", source=source, color=colour, line_dash=dash, legend_label=family)
        dots = figure.scatter("size", "value", source=source, color=colour, size=6, legend_label=family)
        shown = {"family": "family", "functions": "size", "value": "value"}
        figure.add_tools(HoverTool(renderers=[dots], tooltips=tips(shown)))
    if chosen is not None and chosen[1] in families.get(chosen[0], {}):
        at = families[chosen[0]][chosen[1]]
        figure.scatter([chosen[1]], [at], size=15, fill_alpha=0, line_color=MARK, line_width=2.5)
    if families:
        legend = figure.legend[0]
        legend.orientation, legend.label_text_color, legend.label_text_font_size = "horizontal", LEGEND, "11px"
        legend.background_fill_alpha, legend.border_line_alpha = 0.0, 0.0
        legend.glyph_width, legend.spacing, legend.margin = 16, 6, 0
        figure.add_layout(legend, "above")
    return figure
