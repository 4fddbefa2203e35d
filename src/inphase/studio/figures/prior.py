"""What a model expects of one channel before a partner is seen: mean ± standard deviation, demonstrations behind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.plotting import figure as Figure
from jaxtyping import Float

from inphase.model import Model
from inphase.studio.figures.look import FAINT, MEAN, labelled, new_figure, short, tips

PHASES = 101
MOST = 30  # demonstrations behind: more would be a grey block


@dataclass(frozen=True)
class Movements:
    """All channels over phase: mean and std (P, D), and what the bases make of N demonstrations, behind (N, P, D)."""

    phases: Float[np.ndarray, " P"]
    mean: Float[np.ndarray, "P D"]
    std: Float[np.ndarray, "P D"]
    behind: Float[np.ndarray, "N P D"]


def movements_of(model: Model) -> Movements:
    """What a model expects, with its demonstrations, evenly picked where there are many."""
    phases, samples = np.linspace(0, 1, PHASES), model.prior.samples
    chosen = np.unique(np.linspace(0, len(samples) - 1, MOST).round().astype(int))
    behind = np.stack([model.predict(phases, samples[i]) for i in chosen])
    return Movements(phases, *model.distribution(phases), behind)


def draw_prior(model: Model, movements: Movements, channel: int) -> Figure:
    """Mean and mean ± one standard deviation of a channel over phase, and its demonstrations."""
    shown = model.channels[channel]
    title = f"{labelled(short(shown.name), shown.unit)} · {shown.role.value}"
    figure = new_figure(title, "phase", height=210, x_range=(0, 1))
    phases, mean, std = movements.phases, movements.mean[:, channel], movements.std[:, channel]
    behind = movements.behind[:, :, channel]
    figure.multi_line([phases.tolist()] * len(behind), behind.tolist(), color=FAINT, alpha=0.5, line_width=1)
    figure.varea(phases, mean - std, mean + std, color=MEAN, alpha=0.25)
    source = ColumnDataSource({"phase": phases, "mean": mean, "std": std})
    line = figure.line("phase", "mean", source=source, color=MEAN, line_width=2.5)
    shown_there = {"phase": "phase", "mean": "mean", "standard deviation": "std"}
    figure.add_tools(HoverTool(renderers=[line], mode="vline", tooltips=tips(shown_there)))
    return figure
