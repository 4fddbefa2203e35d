"""The empty figures of a page: its script fills them, and gives them the colours of day or night.

No name of a channel or run goes into a figure: bokeh would read some as formulae, and ask a server for their fonts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bokeh.model import Model
    from bokeh.plotting import figure

SLOTS = 4  # channels of either partner that are drawn at a time
RUNS = 6  # that can be told apart
DASHES = ("solid", "dashed", "dotted", "dotdash", "dashdot", (8, 2, 2, 2))
HEIGHTS = {"observed": 150, "controlled": 180, "phase": 200, "tempo": 150, "likelihood": 150, "compared": 170}


def make_figures(runs: int) -> dict[str, Model]:
    """Every figure by its name; those over time share their horizontal axis."""
    from bokeh.models import Range1d

    shared = Range1d(start=0, end=1, name="across")
    figures: dict[str, Model] = {}
    for slot in range(SLOTS):
        figures[f"observed-{slot}"] = _observed(f"observed-{slot}", shared)
        figures[f"controlled-{slot}"] = _controlled(f"controlled-{slot}", shared)
        if runs > 1:
            figures[f"compared-{slot}"] = _compared(f"compared-{slot}", shared, runs)
    for name in ("phase", "tempo", "likelihood"):
        figures[name] = _over_time(name, shared, runs)
    return figures


def _empty(name: str, shared: Any) -> figure:
    from bokeh.models import BasicTicker, BoxZoomTool, PanTool, Range1d, ResetTool, WheelZoomTool
    from bokeh.plotting import figure

    tools = [PanTool(), WheelZoomTool(dimensions="width", modifiers={"ctrl": True}), BoxZoomTool(), ResetTool()]
    made = figure(
        name=name,
        height=HEIGHTS[name.split("-")[0]],
        sizing_mode="stretch_width",
        min_width=100,
        x_range=shared,
        y_range=Range1d(
            start=0, end=1
        ),  # set by the script, for all steps together: nothing jumps while one looks through them
        tools=tools,
        toolbar_location="right",
        active_drag=None,  # a finger scrolls the page
        output_backend="canvas",
    )
    made.toolbar.logo = None
    made.toolbar.autohide = True
    made.xaxis.ticker, made.yaxis.ticker = BasicTicker(desired_num_ticks=5), BasicTicker(desired_num_ticks=4)
    return made


def _source(name: str, **columns: Any) -> Any:
    from bokeh.models import ColumnDataSource

    return ColumnDataSource({column: [] for column in columns or ("x", "y")}, name=name)


def _line(made: figure, name: str, role: str, **style: Any) -> None:
    made.line("x", "y", source=_source(f"{made.name}:{name}"), name=role, **{"line_width": 1.6, **style})


def _band(made: figure, name: str, role: str) -> None:
    source = _source(f"{made.name}:{name}", x=0, low=0, high=0)
    made.varea("x", "low", "high", source=source, name=role, fill_alpha=0.25)


def _strips(made: figure, name: str, role: str, alpha: float) -> None:
    source = _source(f"{made.name}:{name}", left=0, right=0)
    made.vstrip("left", "right", source=source, name=role, line_color=None, fill_alpha=alpha)


def _observed(name: str, shared: Any) -> figure:
    made = _empty(name, shared)
    _line(made, "line", "ink")
    return made


def _controlled(name: str, shared: Any) -> figure:
    made = _empty(name, shared)
    source = _source(f"{name}:past", xs=0, ys=0)
    made.multi_line("xs", "ys", source=source, name="past", line_width=1, line_alpha=0.35)
    _band(made, "band", "now")
    _line(made, "truth", "ink", line_width=2)
    _line(made, "sent", "sent", line_dash="dashed")
    _line(made, "response", "now", line_width=2)
    return made


def _compared(name: str, shared: Any, runs: int) -> figure:
    made = _empty(name, shared)
    _line(made, "truth", "ink", line_width=2)
    for run in range(min(runs, RUNS)):
        _line(made, f"run-{run}", f"run-{run}", line_dash=DASHES[run])
    return made


def _over_time(name: str, shared: Any, runs: int) -> figure:
    made = _empty(name, shared)
    _strips(made, "pauses", "pause", 0.3)
    _strips(made, "troubles", "trouble", 0.3)
    _band(made, "band", "now")
    _line(made, "expected", "ink", line_dash="dotted")
    for run in range(min(runs, RUNS)):
        _line(made, f"run-{run}", f"run-{run}" if runs > 1 else "now", line_dash=DASHES[run])
    made.vspan("x", source=_source(f"{name}:events", x=0), name="sent", line_width=1, line_dash="dotted")
    return made
