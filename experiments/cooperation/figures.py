"""Pictures of errors and costs, as Figs. 9 to 11 have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from inphase.report.look import INK, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {
    "mean": "#c9ced3",
    "IP, DTW": "#9aa3ad",
    "BIP": "#d1603d",
    "eBIP": "#e9a23b",
    "particle": "#8e3b46",
    "BIP, calibrated": "#e58fa9",
    "eBIP, calibrated": "#6d5aa8",
    "promp, calibrated": "#3f8f5f",
    "rbpf": "#0b6e99",
}
BOLD = ("rbpf", "BIP")
TITLES = {"handover": "Experiment 2, hand-over", "lift": "Experiment 3, joint lift"}
Errors = Mapping[str, np.ndarray]  # by method: (values of the axis, trials)


def draw_errors(arm: Mapping[str, Errors], phase: Mapping[str, Errors], at: Sequence[float], axis: str) -> Figure:
    """By place: of the arm above, of the phase below; means, and for two methods the standard deviation."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    for column, place in enumerate(arm):
        for row, (errors, what) in enumerate(
            ((arm[place], "error of the arm [rad]"), (phase[place], "error of the phase"))
        ):
            axes = figure.add_subplot(2, len(arm), 1 + row * len(arm) + column)
            for name, values in errors.items():
                mean, std, bold = values.mean(1), values.std(1), name in BOLD
                label = name if row == column == 0 else None
                axes.plot(at, mean, color=COLOURS[name], lw=2 if bold else 1.2, label=label, zorder=3 if bold else 2)
                if bold:
                    axes.fill_between(at, np.maximum(mean - std, 0), mean + std, color=COLOURS[name], alpha=0.15, lw=0)
            axes.set(xlabel=axis if row else "", ylabel="" if column else what)
            axes.set_ylim(0, _top(errors))
            if row == 0:
                axes.set_title(TITLES[place], fontsize=10, color=INK, loc="left")
            if "length" in axis:
                axes.set_xscale("log", base=2)
                axes.set_xticks(at, [f"{value:g}" for value in at])
                axes.minorticks_off()
            plain(axes)
    figure.legend(loc="outside right center", frameon=False, fontsize=8, labelcolor=INK)
    return figure


def _top(errors: Errors) -> float:
    """So that what diverges leaves the picture, and all else is seen."""
    usual = [values.mean(1).max() for values in errors.values()]
    return float(1.15 * min(max(usual), 4 * np.median(usual)))


def draw_costs(samples: Mapping[str, np.ndarray], seconds: Mapping[str, Errors]) -> Figure:
    """By place and the length of an interaction."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.2), layout="constrained")
    for column, place in enumerate(seconds):
        axes = figure.add_subplot(1, len(seconds), 1 + column)
        for name, values in seconds[place].items():
            axes.plot(
                samples[place],
                values,
                color=COLOURS[name],
                lw=2 if name in BOLD else 1.2,
                label=None if column else name,
            )
        axes.set(xlabel="samples", xscale="log", yscale="log")
        axes.set_ylabel("" if column else "time to take in all of them [s]")
        axes.set_title(TITLES[place], fontsize=10, color=INK, loc="left")
        axes.set_xticks(samples[place], [str(count) for count in samples[place]])
        axes.minorticks_off()
        plain(axes)
    figure.legend(loc="outside right center", frameon=False, fontsize=8, labelcolor=INK)
    return figure


def strip(frames: Sequence[np.ndarray], columns: int = 4) -> Figure:
    """Key frames beside and below each other."""
    from matplotlib.figure import Figure

    rows = -(-len(frames) // columns)
    high, wide = frames[0].shape[:2]
    figure = Figure(figsize=(9, 9 * rows * high / (columns * wide)))
    for i, frame in enumerate(frames):
        axes = figure.add_axes((i % columns / columns, 1 - (i // columns + 1) / rows, 0.99 / columns, 0.985 / rows))
        axes.imshow(frame)
        axes.set_axis_off()
    return figure
