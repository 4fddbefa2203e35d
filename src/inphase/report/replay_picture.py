"""A picture of replays: what the partner's counterpart really did, what was answered, and how far it had come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from inphase.errors import OptionError
from inphase.model import Model
from inphase.result import Estimate, Response
from inphase.trajectory import Demonstration

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NINETY = 1.6449  # standard deviations on either side that hold 90 % of a Gaussian
INK, NOW, PAST = "#22272e", "#0b6e99", "#9aa5b1"
PREVIEWS = ("#e9a23b", "#d1603d", "#8e3b46")


@dataclass(frozen=True)
class ReplayPanel:
    """One replay to draw. now: a response of at least one sample for every estimate. previews: whole responses."""

    title: str
    model: Model
    demonstration: Demonstration
    estimates: Sequence[Estimate]
    now: Sequence[Response]
    previews: Sequence[Response]


def draw_replays(path: str | PathLike[str], panels: Sequence[ReplayPanel]) -> None:
    """Draw replays side by side into a file (.png, .svg, .pdf): the busiest controlled channel, and the phase.

    Raises OptionError where matplotlib is not installed or the kind of file is unknown.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise OptionError("pictures need matplotlib: pip install 'inphase[plot]'") from None
    figure = Figure(figsize=(1.2 + 3.6 * len(panels), 6.0), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    if str(path).rsplit(".", 1)[-1] not in canvas.get_supported_filetypes():
        raise OptionError(
            f"unknown kind of picture {path}; one of {', '.join(sorted(canvas.get_supported_filetypes()))}"
        )
    axes = figure.subplots(2, len(panels), squeeze=False, sharex="col", gridspec_kw={"height_ratios": [3, 2]})
    for column, panel in enumerate(panels):
        _draw_response(axes[0, column], panel)
        _draw_phase(axes[1, column], panel, first=column == 0)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    figure.savefig(path, dpi=130)


def _draw_response(axes: Axes, panel: ReplayPanel) -> None:
    model, count = panel.model, len(panel.model.observed)
    mean, _ = model.distribution(np.linspace(0, 1, 100))
    channel = int(np.argmax(np.ptp(mean[:, count:], axis=0) / model.spread[count:]))
    name, unit = model.controlled[channel], model.channels[count + channel].unit
    times = panel.demonstration.times - panel.demonstration.times[0]
    origin = panel.demonstration.times[0]
    now = np.array([[r.mean[0, channel], r.std[0, channel]] for r in panel.now])
    axes.plot(times, panel.demonstration.values[:, count + channel], color=INK, lw=2.2, label=f"what {name} really did")
    _band(axes, times, now[:, 0], now[:, 1], NOW, "response now, with its 90 % band")
    for response, colour in zip(panel.previews, PREVIEWS, strict=False):
        share = (response.times[0] - origin) / times[-1]
        at = response.times - origin
        label = f"rest, as foreseen at {100 * share:.0f} %"
        axes.plot(at, response.mean[:, channel], color=colour, lw=1.6, ls="--", label=label)
        axes.plot(at[0], response.mean[0, channel], "o", color=colour, ms=5)
    axes.set_title(panel.title, fontsize=11)
    axes.set_ylabel(f"{name} [{unit}]" if unit else name)
    axes.set_xlim(0, 1.15 * times[-1])
    _plain(axes)


def _draw_phase(axes: Axes, panel: ReplayPanel, first: bool) -> None:
    times = panel.demonstration.times - panel.demonstration.times[0]
    phases, stds = np.array([[e.phase, e.phase_std] for e in panel.estimates]).T
    axes.plot(times, panel.demonstration.phases, color=INK, lw=2.2)
    _band(axes, times, phases, stds, NOW, None)
    axes.set_ylim(-0.05, 1.05)
    axes.set_xlabel("time [s]")
    if first:
        axes.set_ylabel("phase")
    _plain(axes)


def _band(axes: Axes, times: Any, mean: Any, std: Any, colour: str, label: str | None) -> None:
    axes.fill_between(times, mean - NINETY * std, mean + NINETY * std, color=colour, alpha=0.22, lw=0)
    axes.plot(times, mean, color=colour, lw=1.6, label=label)


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#e6e9ed", lw=0.7)
    axes.set_axisbelow(True)
