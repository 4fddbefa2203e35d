"""What all figures share: colours that hold on light and dark pages, and text that is text whatever it says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bokeh.models import FixedTicker
from bokeh.models.annotations import Title
from bokeh.plotting import figure as Figure

from inphase.studio.text import plain

# Of middle lightness: each stands out on white as on black. Nothing is told by colour alone.
MEAN, FAINT, PLUS, MINUS, MARK = "#2b86b3", "#8a929b", "#d2691e", "#2b86b3", "#c2446b"
FAMILIES = ("#2b86b3", "#d2691e", "#5d9a3c", "#9a62c7")
LINES = ("solid", "dashed", "dotted", "dotdash")
LONGEST = 22  # characters of a name beside an axis
LEGEND = "#717b86"  # text whose colour no page can change


def new_figure(title: str, x: str = "", y: str = "", *, height: int | None = 240, **options: Any) -> Figure:
    """An empty figure as wide as there is room, with nothing in it that could be taken for data."""
    found = Figure(
        title=Title(text=plain(title), text_font_size="13px", text_font_style="bold"),
        x_axis_label=plain(x),
        y_axis_label=plain(y),
        height=height,
        toolbar_location=None,
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        **({"tools": "", "sizing_mode": "stretch_width"} | options),
    )
    for axis in found.axis:
        axis.minor_tick_line_color, axis.major_tick_line_color = None, None
        axis.axis_line_alpha, axis.axis_label_text_font_style = 0.4, "normal"
    return found


def short(name: str, longest: int = LONGEST) -> str:
    """A name that fits beside an axis: of a long one start and end."""
    half = longest // 2
    return name if len(name) <= longest else f"{name[: half - 1]}…{name[-half:]}"


def name_rows(axis: Any, names: Sequence[str], longest: int = LONGEST, every: int = 1) -> None:
    """Names, which may be long or hold anything, at 0, 1, 2, … of an axis; every: how many share one that is shown."""
    axis.ticker = FixedTicker(ticks=[i for i in range(len(names)) if (i + 1) % every == 0])
    axis.major_label_overrides = {i: plain(short(name, longest)) for i, name in enumerate(names)}


def labelled(name: str, unit: str) -> str:
    """`x [m]`, or `x` where no unit is known."""
    return f"{name} [{unit}]" if unit else name


def tips(of: Mapping[str, str]) -> list[tuple[str, str]]:
    """Lines of a hover: what stands in a column is shown as text, never as markup."""
    return [(label, f"@{{{column}}}") for label, column in of.items()]
