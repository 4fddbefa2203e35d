"""Figures beside each other where there is room, below each other where there is not."""

from __future__ import annotations

from collections.abc import Sequence

from bokeh.models import Column, InlineStyleSheet, LayoutDOM


def grid(children: Sequence[LayoutDOM] = (), narrowest: int = 300) -> Column:
    """A grid of columns that are all as wide, and no narrower than that [px] unless the page is."""
    style = (
        ":host { display: grid !important; gap: 8px 16px; align-items: start; "
        f"grid-template-columns: repeat(auto-fit, minmax(min(100%, {narrowest}px), 1fr)); }}"
    )
    return Column(children=list(children), sizing_mode="stretch_width", stylesheets=[InlineStyleSheet(css=style)])
