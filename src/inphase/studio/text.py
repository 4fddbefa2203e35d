"""Names and messages as text: whatever they hold, the page never takes it for markup or mathematics."""

from __future__ import annotations

from html import escape
from typing import Any

from bokeh.models import PlainText
from bokeh.models.widgets import Div


def text(*paragraphs: object, kind: str = "") -> Div:
    """A piece of text, a paragraph each.

    kind: how it looks, some of `error`, `quiet`, `fine`, `heading`, `mono`.
    """
    return Div(
        text=as_html(*paragraphs), disable_math=True, css_classes=["said", *kind.split()], sizing_mode="stretch_width"
    )


def heading(title: str) -> Div:
    """The title of a part of the page."""
    return Div(text=f"<h2>{escape(title)}</h2>", disable_math=True, css_classes=["said"], sizing_mode="stretch_width")


def as_html(*paragraphs: object) -> str:
    """Paragraphs for the `text` of a Div, of which nothing is taken for markup."""
    return "".join(f"<p>{escape(str(paragraph))}</p>" for paragraph in paragraphs)


def typed(line: str) -> str:
    """A command line for the `text` of a Div, broken between its words alone."""
    return "<code>" + " ".join(f"<span>{escape(word)}</span>" for word in line.split(" ")) + "</code>"


def plain(name: str) -> Any:
    """A title or the label of an axis, of which nothing is taken for mathematics."""
    return PlainText(text=name)
