"""The studio's live tab."""

from __future__ import annotations

from bokeh.layouts import column
from bokeh.models import LayoutDOM

from inphase.studio.desk import Desk


def make_tab(desk: Desk) -> LayoutDOM:
    """The tab, of this desk."""
    return column(sizing_mode="stretch_width")
