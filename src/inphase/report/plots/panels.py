"""Panels side by side, one a channel: which channels, where, and the legend below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, Role, match
from inphase.errors import OptionError, listing
from inphase.report.look import BAND, NINETY, check_matplotlib, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes as AnyAxes
    from matplotlib.figure import Figure

Axes: TypeAlias = "AnyAxes | Sequence[AnyAxes] | np.ndarray | None"  # what a caller may give

UNASKED = 12  # channels in three rows of four; who wants more names them
MOST = 60  # panels: beyond, nothing can be read
KEY_WIDTH, LETTER_WIDTH = 0.6, 0.095  # [in] of an entry in the legend


def chosen(channels: Sequence[Channel], wanted: Sequence[str] | str | None) -> list[int]:
    """The channels to draw, by names or patterns; None is all, or of many the first of each partner.

    Raises ChannelError for a pattern that fits nothing, OptionError for more channels than can be read.
    """
    if wanted is None:
        return first_of_each(channels, UNASKED)
    columns = match(wanted, [channel.name for channel in channels])
    if len(columns) > MOST:
        names = listing(channels[i].name for i in columns)
        raise OptionError(f"expected at most {MOST} channels in a figure, got {len(columns)}: {names}")
    return columns


def first_of_each(channels: Sequence[Channel], most: int) -> list[int]:
    """All channels, or of many `most`: the first of each partner, as many of one as of the other where there are."""
    observed = [i for i, channel in enumerate(channels) if channel.role is Role.OBSERVED]
    controlled = [i for i, channel in enumerate(channels) if channel.role is Role.CONTROLLED]
    observed = observed[: max(most // 2, most - len(controlled))]
    return observed + controlled[: most - len(observed)]


def make_panels(count: int, axes: Axes) -> tuple[Figure, list[AnyAxes]]:
    """A figure with as many panels, or the caller's own axes; raises OptionError where those are too few or many."""
    check_matplotlib()
    if axes is not None:
        own: list[Any] = np.ravel(np.array(axes, dtype=object)).tolist()
        if len(own) != count:
            raise OptionError(f"expected {count} axes, one a panel, got {len(own)}")
        return own[0].get_figure(root=True), own
    from inphase.report.plots.figure import ShownFigure

    columns = max(1, math.isqrt(max(count - 1, 0)) + 1)  # as many as rows, or one more
    rows = -(-count // columns)
    size = (5.4, 3.8) if count == 1 else (max(6.5, 3.3 * columns), 2.3 * rows + 0.9)
    figure = ShownFigure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for spare in grid.flat[count:]:
        spare.remove()
    return figure, list(grid.flat[:count])


def label_x(panels: Sequence[AnyAxes], text: str) -> None:
    """The label of the horizontal axis, below the lowest panel of each column."""
    for i, axes in enumerate(panels):
        place = axes.get_subplotspec()
        if place is None or i + place.get_gridspec().ncols >= len(panels):
            axes.set_xlabel(text)


def title_of(axes: AnyAxes, channel: Channel) -> None:
    """The name of a channel above its panel, in bold where it is a controlled one."""
    weight = "bold" if channel.role is Role.CONTROLLED else "normal"
    axes.set_title(with_unit(channel.name, channel.unit), fontsize=10, fontweight=weight)


def draw_band(
    axes: AnyAxes,
    at: Float[np.ndarray, " S"],
    mean: Float[np.ndarray, " S"],
    std: Float[np.ndarray, " S"],
    colour: str,
    label: str = "mean, with 90 % band",
) -> None:
    """A mean with its 90 % band; of a single sample a point with a bar."""
    if len(at) == 1:
        axes.errorbar(at, mean, NINETY * std, fmt="o", color=colour, capsize=3, label=label)
        return
    axes.fill_between(at, mean - NINETY * std, mean + NINETY * std, color=colour, alpha=BAND, lw=0)
    axes.plot(at, mean, color=colour, lw=1.8, label=label)


def finish(figure: Figure, panels: Sequence[AnyAxes], note: str = "") -> None:
    """One legend below all panels, and a note above; for figures that are our own."""
    entries: dict[str, Any] = {}
    for axes in panels:
        entries |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    if entries:
        longest = max(len(label) for label in entries)
        columns = int(figure.get_figwidth() / (KEY_WIDTH + LETTER_WIDTH * longest))
        columns = max(1, min(columns, len(entries), 4))
        figure.legend([*entries.values()], [*entries], loc="outside lower center", ncols=columns, frameon=False)
    if note:
        figure.suptitle(note, fontsize=10)


def note_on(shown: Sequence[int], channels: Sequence[Channel], named: bool) -> str:
    """What the reader has to know of the panels: how many that nobody left out are not there, and what bold means."""
    part = f"{len(shown)} of {len(channels):,} channels" if len(shown) < len(channels) and not named else ""
    roles = {channels[i].role for i in shown}
    return "; ".join(text for text in (part, "controlled in bold" if len(roles) > 1 else "") if text)
