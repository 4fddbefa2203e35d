"""A picture of replays: what the controlled partner really did, what was answered, and how far it had come."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from inphase.errors import OptionError
from inphase.io.atomic import whole_file
from inphase.model import Model
from inphase.report.look import BAND, INK, NINETY, NOW, check_picture, plain, with_unit
from inphase.result import Estimate, Response

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CHANNELS = 4  # of a single replay
ACROSS = 4  # columns; at most so many, or nothing can be read
PREVIEWS = ("#e9a23b", "#d1603d", "#8e3b46")


@dataclass(frozen=True)
class ReplayPanel:
    """One replay to draw.

    times: (T,) [s] from the first sample. phases: (T,) how far it really was. truth: (T, Dc) what the controlled
    channels really read, NaN where that is not known. estimates, responses: T each, a response of at least one sample.
    previews: whole responses by the share of the replay, 0 … 1, after which they were made.
    """

    title: str
    model: Model
    times: Float[np.ndarray, " T"]
    phases: Float[np.ndarray, " T"]
    truth: Float[np.ndarray, "T Dc"]
    estimates: Sequence[Estimate]
    responses: Sequence[Response]
    previews: Mapping[float, Response]


def draw_replays(path: str | PathLike[str], panels: Sequence[ReplayPanel]) -> None:
    """Draw replays into a file (.png, .svg or .pdf), which is written whole or not at all.

    Raises OptionError where matplotlib is not installed, the kind of file is unknown, the folder does not exist or
    there is no replay.
    """
    check_picture(path)
    if not panels:
        raise OptionError("expected at least one replay to draw, got none")
    figure = make_figure(panels)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=130)


def make_figure(panels: Sequence[ReplayPanel]) -> Figure:
    """The busiest controlled channel of every replay above its phase; of a single replay the four busiest."""
    from matplotlib.figure import Figure

    alone = len(panels) == 1
    drawn = [(panel, channel) for panel in panels for channel in busiest(panel.model, CHANNELS if alone else 1)]
    rows = -(-len(drawn) // ACROSS)
    columns = -(-len(drawn) // rows)
    figure = Figure(figsize=(max(7.7, 0.6 + 3.1 * columns), 0.6 + 5.0 * rows), layout="constrained")
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[3, 2] * rows)
    for i, (panel, channel) in enumerate(drawn):
        row, column = divmod(i, columns)
        axes = figure.add_subplot(grid[2 * row, column])
        _draw_response(axes, panel, channel)
        axes.set_title("" if alone else panel.title, fontsize=11)
        if i == 0 or not alone:  # channels of one replay share its phase
            below = figure.add_subplot(grid[2 * row + 1, :] if alone else grid[2 * row + 1, column], sharex=axes)
            _draw_phase(below, panel)
            below.set_ylabel("phase" if column == 0 else "")
    figure.suptitle(panels[0].title if alone else "", fontsize=11)
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        entries |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    across = len(entries) if columns == ACROSS else 3
    figure.legend([*entries.values()], [*entries], loc="outside lower center", ncols=across, frameon=False)
    return figure


def busiest(model: Model, most: int) -> list[int]:
    """The controlled channels whose mean moves most, in units of their spread; in the order of the model."""
    count = len(model.observed)
    mean = model.predict(np.linspace(0, 1, 100))[:, count:]
    ranks = np.argsort(-np.ptp(mean, axis=0) / model.spread[count:], kind="stable")
    return sorted(ranks[:most].tolist())


def _draw_response(axes: Axes, panel: ReplayPanel, channel: int) -> None:
    name, unit = panel.model.controlled[channel], panel.model.channels[len(panel.model.observed) + channel].unit
    times, truth = panel.times, panel.truth[:, channel]
    mean, std = np.array([[r.mean[0, channel], r.std[0, channel]] for r in panel.responses]).T
    if np.isfinite(truth).any():
        axes.plot(times, truth, color=INK, lw=1.9, label="as recorded")
    _band(axes, times, mean, std, "response now, with 90 % band")
    begun = panel.estimates[0].time
    for (share, response), colour in zip(panel.previews.items(), PREVIEWS, strict=False):
        at = response.times - begun
        label = f"rest, foreseen at {100 * share:.0f} %"
        axes.plot(at, response.mean[:, channel], color=colour, lw=1.6, ls="--", label=label)
        axes.plot(at[0], response.mean[0, channel], "o", color=colour, ms=5)
    axes.set_ylabel(with_unit(name, unit))
    axes.set_xlim(0, 1.15 * times[-1])
    plain(axes)


def _draw_phase(axes: Axes, panel: ReplayPanel) -> None:
    phases, stds = np.array([[e.phase, e.phase_std] for e in panel.estimates]).T
    axes.plot(panel.times, panel.phases, color=INK, lw=1.9)
    _band(axes, panel.times, phases, stds, None)
    axes.set_ylim(-0.05, 1.05)
    axes.set_xlabel("time [s]")
    plain(axes)


def _band(axes: Axes, times: Any, mean: Any, std: Any, label: str | None) -> None:
    axes.fill_between(times, mean - NINETY * std, mean + NINETY * std, color=NOW, alpha=BAND, lw=0)
    axes.plot(times, mean, color=NOW, lw=1.6, label=label)
