"""A matrix of correlations as squares: the area is how strong, the side of zero is colour and, if minus, hollow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Rect, TapTool
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import figure as Figure
from jaxtyping import Float

from inphase.studio.figures.look import FAINT, MARK, MINUS, PLUS, name_rows, new_figure, tips

SIDE = 0.94  # of a cell: the square of a correlation of one
ACROSS, DOWN = 228, 480  # [px] all cells, beside a name on a narrow page
SMALLEST, LARGEST = 4, 40  # [px] the side of one
EVERY = 5  # which cell is named where there are too many for all
MOST = 14  # cells that are all named


def draw_hinton(
    title: str, rows: Sequence[str], columns: Sequence[str], correlation: Float[np.ndarray, "R C"]
) -> Figure:
    """Squares whose areas are |r| in cells of 1 × 1, the first row on top; filled where r > 0, hollow where r < 0.

    Correlations that are not known (NaN) have no square.
    """
    cell = min(max(min(ACROSS // len(columns), DOWN // len(rows)), SMALLEST), LARGEST)
    figure = new_figure(
        title,
        height=None,
        width=None,
        frame_width=cell * len(columns),
        frame_height=cell * len(rows),
        sizing_mode=None,
        x_range=(-0.5, len(columns) - 0.5),
        y_range=(len(rows) - 0.5, -0.5),
    )
    across, down = (grid.ravel() for grid in np.meshgrid(np.arange(len(columns)), np.arange(len(rows))))
    known = np.isfinite(correlation).ravel()
    r = correlation.ravel()[known]
    side = SIDE * np.sqrt(np.abs(r))
    source = ColumnDataSource(
        {
            "row": down[known],
            "column": across[known],
            "r": r,
            "side": side,
            "colour": np.where(r < 0, MINUS, PLUS),
            "filled": np.where(r < 0, 0.12, 0.85),
            "name": [rows[i] for i in down[known]],
            "other": [columns[i] for i in across[known]],
        }
    )
    figure.rect(
        x="column",
        y="row",
        width="side",
        height="side",
        source=source,
        fill_color="colour",
        fill_alpha="filled",
        line_color="colour",
        nonselection_fill_alpha="filled",
        nonselection_line_alpha=1.0,
    )
    # The cells, so that also a small square is found by the pointer.
    cells = figure.rect(
        x="column",
        y="row",
        width=1,
        height=1,
        source=source,
        fill_alpha=0,
        line_color=FAINT,
        line_alpha=0.18,
        nonselection_fill_alpha=0,
        nonselection_line_alpha=0.18,
        selection_line_color=MARK,
        selection_line_alpha=1.0,
    )
    selected = cells.selection_glyph
    if isinstance(selected, Rect):
        selected.line_width = 2.5
    shown = {"": "name", "with": "other", "correlation": "r"}
    figure.add_tools(HoverTool(renderers=[cells], tooltips=tips(shown)), TapTool(renderers=[cells]))
    for axis, names in ((figure.xaxis[0], columns), (figure.yaxis[0], rows)):
        name_rows(axis, names, every=EVERY if len(names) > MOST else 1)
    figure.xaxis.major_label_orientation = 0.9
    figure.grid.visible = False  # a colour would be overruled by the page's
    return figure


def squares_of(figure: Figure) -> ColumnDataSource:
    """The row, column, r and side of every square, and which of them was tapped."""
    squares = figure.renderers[0]
    assert isinstance(squares, GlyphRenderer)
    assert isinstance(squares.data_source, ColumnDataSource)
    return squares.data_source
