"""The page: its tabs, and how it looks."""

from __future__ import annotations

from importlib.resources import files

from bokeh.core.validation import silence
from bokeh.core.validation.warnings import EMPTY_LAYOUT
from bokeh.document import Document
from bokeh.layouts import column
from bokeh.themes import Theme

from inphase.studio import data_tab, export_tab, live_tab, train_tab, try_tab
from inphase.studio.desk import Desk

silence(EMPTY_LAYOUT)  # what is drawn on demand is nothing before

TABS = {"data": data_tab, "train": train_tab, "try": try_tab, "live": live_tab, "export": export_tab}
INSIDE = files("inphase.studio")


def fill(document: Document, desk: Desk) -> None:
    """Make the page of a desk."""
    document.title = f"inphase studio · {desk.folder.name}"
    document.theme = Theme(json={"attrs": {"UIElement": {"stylesheets": [_read("widgets.css")]}}})
    document.template = _read("page.html")  # type: ignore[assignment]
    document.template_variables.update(tabs=list(TABS), folder=desk.folder.name, style=_read("page.css"))
    for name, tab in TABS.items():
        document.add_root(column(tab.make_tab(desk), name=name, sizing_mode="stretch_width"))


def _read(name: str) -> str:
    return (INSIDE / name).read_text(encoding="utf-8")
