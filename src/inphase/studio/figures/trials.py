"""What calibration tried: the error, the coverage or the likelihood of every candidate, from before to after."""

from __future__ import annotations

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.models.annotations import Span
from bokeh.plotting import figure as Figure

from inphase.evidence import Evidence
from inphase.studio.figures.look import FAINT, MARK, MEAN, name_rows, new_figure, tips

LONGEST = 31  # characters of what a trial is called
ROW, EDGE = 20, 75  # [px] high: a trial, and what stands above and below
WHAT = {
    "error": ("error over the variance", "less is better"),
    "coverage": ("inside the 90 % band", "0.9 is right"),
    "nll": ("negative log likelihood", "less is better"),
}


def trial_names(evidence: Evidence) -> list[str]:
    """What each trial is called: what was chosen, and which candidate; the last is the model as it is."""
    names = [f"{trial.choice}: {trial.value}" for trial in evidence.trials]
    return [*names[:-1], f"after, {names[-1]}"]


def row_names(evidence: Evidence) -> list[str]:
    """The same beside an axis: a choice is named once, above its candidates."""
    names, before = trial_names(evidence), ""
    for i, trial in enumerate(evidence.trials[:-1]):
        names[i] = f"· {trial.value}" if trial.choice == before else names[i]
        before = trial.choice
    return names


def draw_trials(evidence: Evidence, what: str) -> Figure:
    """`what` of every trial ("error", "coverage" or "nll"), in their order downward; filled is what the model has.

    Dashed lines join before and after with the axis; the dotted one is what is aimed at (coverage), or what playing the
    mean movement by the clock scores (error). Trials whose figure is not finite have no dot.
    """
    title, unit = WHAT[what]
    names = trial_names(evidence)
    values = np.array([getattr(trial, what) for trial in evidence.trials])
    chosen = np.array([trial.chosen for trial in evidence.trials])
    figure = new_figure(title, unit, height=ROW * len(names) + EDGE, y_range=(len(names) - 0.4, -0.6))
    known = np.isfinite(values)
    rows = np.arange(len(names))
    source = ColumnDataSource(
        {
            "row": rows[known],
            "value": values[known],
            "filled": np.where(chosen, 1.0, 0.0)[known],
            "name": [name for name, there in zip(names, known, strict=True) if there],
        }
    )
    if what == "error":
        doubt = np.array([trial.error_std for trial in evidence.trials])
        figure.segment((values - doubt)[known], rows[known], (values + doubt)[known], rows[known], color=FAINT)
    ends = rows[known][[0, -1]] if known.any() else []
    for row in ends:
        figure.add_layout(
            Span(location=values[row], dimension="height", line_color=MEAN, line_dash="dashed", line_alpha=0.6)
        )
    aim = {"coverage": 0.9, "error": evidence.by_the_clock}.get(what)
    if aim is not None and np.isfinite(aim):
        figure.add_layout(Span(location=aim, dimension="height", line_color=MARK, line_dash="dotted", line_width=2))
    dots = figure.scatter(
        "value", "row", source=source, size=9, color=MEAN, fill_alpha="filled", line_width=1.5, line_color=MEAN
    )
    figure.add_tools(HoverTool(renderers=[dots], tooltips=tips({"": "name", title: "value"})))
    name_rows(figure.yaxis[0], row_names(evidence), LONGEST)
    return figure
