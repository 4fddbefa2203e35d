"""A response: what the channels should read from now on, with the doubt about it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inphase.channels import Channel, Role
from inphase.report.look import NOW, plain, verbatim
from inphase.report.plots.panels import Axes, chosen, draw_band, finish, label_x, make_panels, note_on
from inphase.result import Response

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_response(
    response: Response,
    *,
    channels: Sequence[str] | str | None = None,
    phase: bool = False,
    colour: str = NOW,
    axes: Axes = None,
) -> Figure:
    """The mean of each channel with its 90 % band, over time [s] or over phase.

    colour: any of matplotlib's, to tell responses drawn into the same axes apart. channels, axes: as in `plot_model`.
    Raises ChannelError, OptionError.
    """
    known = [Channel(name, Role.CONTROLLED) for name in response.channels]
    shown = chosen(known, channels)
    figure, panels = make_panels(len(shown), axes)
    at = response.phases if phase else response.times
    turns = np.flatnonzero(np.diff(at) < 0) + 1  # where a periodic phase rolls over
    for column, panel in zip(shown, panels, strict=True):
        parts = zip(*(np.split(part, turns) for part in (at, response.mean, response.std)), strict=True)
        for i, (x, mean, std) in enumerate(parts):
            label = "_nolegend_" if i else "mean, with 90 % band"
            draw_band(panel, x, mean[:, column], std[:, column], colour, label)
        panel.set_title(verbatim(known[column].name), fontsize=10)
        plain(panel)
    label_x(panels, "phase" if phase else "time [s]")
    if axes is None:
        finish(figure, panels, note_on(shown, known, channels is not None))
    return figure
