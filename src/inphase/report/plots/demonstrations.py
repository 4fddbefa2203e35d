"""All demonstrations of a data set over each other, as they were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inphase.report.look import COLOURS, INK, NOW, plain, verbatim
from inphase.report.plots.panels import Axes, chosen, finish, label_x, make_panels, note_on, title_of
from inphase.report.steady import steady_together
from inphase.trajectory import Dataset

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_demonstrations(
    dataset: Dataset, *, channels: Sequence[str] | str | None = None, phase: bool = True, axes: Axes = None
) -> Figure:
    """What each channel read in every demonstration, over phase, or over the time since its first sample [s].

    Samples in which a channel was not seen are passed over. Angles are drawn without jumps, and quaternions with norm 1
    and one sign. channels, axes: as in `plot_model`. Raises ChannelError, OptionError.
    """
    shown = chosen(dataset.channels, channels)
    figure, panels = make_panels(len(shown), axes)
    named = len(dataset) <= len(COLOURS)
    many = f"{len(dataset)} demonstrations"
    values = steady_together(dataset.channels, [demonstration.values for demonstration in dataset])
    for column, panel in zip(shown, panels, strict=True):
        for i, (demonstration, readings) in enumerate(zip(dataset, values, strict=True)):
            seen = np.isfinite(readings[:, column])
            at = demonstration.phases if phase else demonstration.times - demonstration.times[0]
            panel.plot(
                at[seen],
                readings[seen, column],
                color=COLOURS[i] if named else NOW,
                lw=1.2 if named else 0.8,
                alpha=1.0 if named else max(0.15, min(0.7, 8 / len(dataset))),
                label=_entry(demonstration.name) if named else many if i == 0 else "_nolegend_",
            )
        if not any(np.isfinite(readings[:, column]).any() for readings in values):
            panel.text(0.5, 0.5, "never seen", transform=panel.transAxes, ha="center", color=INK)
        title_of(panel, dataset.channels[column])
        if phase:
            panel.set_xlim(0, 1)
        plain(panel)
    label_x(panels, "phase" if phase else "time [s]")
    if axes is None:
        finish(figure, panels, note_on(shown, dataset.channels, channels is not None))
    return figure


def _entry(name: str) -> str:
    """A name for the legend, which leaves out what begins with an underscore."""
    return verbatim(f" {name}" if name.startswith("_") else name)
