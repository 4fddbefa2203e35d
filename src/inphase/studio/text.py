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


def as_html(*paragraphs: object) -> str:
    """Paragraphs for the `text` of a Div, of which nothing is taken for markup."""
    return "".join(f"<p>{escape(str(paragraph))}</p>" for paragraph in paragraphs)


def plain(name: str) -> Any:
    """A title or the label of an axis, of which nothing is taken for mathematics."""
    return PlainText(text=name)
