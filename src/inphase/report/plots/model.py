"""What a model believes of every channel over a whole interaction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inphase.model import Model
from inphase.report.look import NOW, PAST, plain
from inphase.report.plots.panels import Axes, chosen, draw_band, finish, label_x, make_panels, note_on, title_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CURVES = 40  # demonstrations at most, evenly picked; more are one grey
PHASES = 200


def plot_model(
    model: Model, *, channels: Sequence[str] | str | None = None, demonstrations: bool = True, axes: Axes = None
) -> Figure:
    """The mean of each channel over phase, with the band in which 90 % of new readings are expected.

    channels: names or patterns; None is all, or the first of many. demonstrations: draw behind them what the basis
    functions make of each. axes: matplotlib's, one a channel, to draw in a figure of your own; its legend is yours to
    ask for. Raises ChannelError, and OptionError where matplotlib is missing, or channels are too many for a figure.
    """
    shown = chosen(model.channels, channels)
    figure, panels = make_panels(len(shown), axes)
    phases = np.linspace(0, 1, PHASES)
    mean, std = model.distribution(phases)
    samples = model.prior.samples if demonstrations else model.prior.samples[:0]
    picked = np.unique(np.linspace(0, len(samples) - 1, min(len(samples), CURVES)).round().astype(int))
    curves = [model.predict(phases, weights)[:, shown] for weights in samples[picked]]
    for place, (column, panel) in enumerate(zip(shown, panels, strict=True)):
        for i, curve in enumerate(curves):
            label = "demonstrations, approximated" if i == 0 else "_nolegend_"
            panel.plot(phases, curve[:, place], color=PAST, lw=0.9, alpha=0.9, label=label)
        draw_band(panel, phases, mean[:, column], std[:, column], NOW)
        title_of(panel, model.channels[column])
        panel.set_xlim(0, 1)
        plain(panel)
    label_x(panels, "phase")
    if axes is None:
        finish(figure, panels, note_on(shown, model.channels, channels is not None))
    return figure
