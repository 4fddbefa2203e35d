"""Pictures of errors and costs, as Figs. 8 to 11 have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from experiments.study import Cell
from inphase.report.look import INK, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {
    "IP, DTW": "#9aa3ad",
    "BIP": "#d1603d",
    "eBIP": "#e9a23b",
    "particle": "#8e3b46",
    "eBIP, calibrated": "#6d5aa8",
    "promp, calibrated": "#3f8f5f",
    "rbpf": "#0b6e99",
}


def draw_errors(cells: Mapping[str, Sequence[Mapping[str, Cell]]], axis: str) -> Figure:
    """Of the stroke and of the phase, by what the labels say: means, and for two methods the standard deviation."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.4), layout="constrained")
    at = [float(label) for label in cells]
    for which, what in enumerate(("error of the rest of the stroke", "error of the phase")):
        axes = figure.add_subplot(1, 2, which + 1)
        for name, colour in COLOURS.items():
            values = [row[which][name].values for row in cells.values()]
            mean, std = np.array([v.mean() for v in values]), np.array([v.std() for v in values])
            bold = name in ("rbpf", "BIP")
            axes.plot(
                at, mean, color=colour, lw=2 if bold else 1.2, label=name if which else None, zorder=3 if bold else 2
            )
            if bold:
                axes.fill_between(at, np.maximum(mean - std, mean / 10), mean + std, color=colour, alpha=0.15, lw=0)
        axes.set(xlabel=axis, ylabel=what, yscale="log")
        if "length" in axis:
            axes.set_xscale("log", base=2)
            axes.set_xticks(at, [f"{value:g}" for value in at])
            axes.minorticks_off()
        plain(axes)
    figure.legend(loc="outside right center", frameon=False, fontsize=8, labelcolor=INK)
    return figure


def draw_costs(lengths: Sequence[int], seconds: Mapping[str, np.ndarray]) -> Figure:
    """By the length of a stroke."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 3.2), layout="constrained")
    axes = figure.add_subplot()
    for name, colour in COLOURS.items():
        axes.plot(lengths, seconds[name], color=colour, lw=2 if name in ("rbpf", "BIP") else 1.2, label=name)
    axes.set(xlabel="samples", ylabel="time to take in all of them [s]", xscale="log", yscale="log")
    axes.set_xticks(lengths, [str(length) for length in lengths])
    axes.minorticks_off()
    plain(axes)
    figure.legend(loc="outside right center", frameon=False, fontsize=8, labelcolor=INK)
    return figure
