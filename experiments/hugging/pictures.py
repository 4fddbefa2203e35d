"""Figures of the study, in the form of Figs. 31, 32, 33 and 35."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.hugging.demonstrations import CONTROLLED
from experiments.hugging.hug import OBSERVED
from experiments.hugging.pads import ARMS, NAMES, SENSORS, largest
from experiments.hugging.table4 import LOOKAHEADS
from experiments.study import Found
from inphase.report.look import COLOURS, INK, PAST, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Arrays = Mapping[str, Any]
REGIONS = ("#d1603d", "#3f8f5f", "#0b6e99")  # before, with, and after


def looking_ahead(fold: Arrays, method: str) -> Figure:
    """Fig. 32: a joint and a force of either arm, done and predicted."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    said, then, times = fold[f"said {method}"], fold["then"], fold["times"]
    for row, side in enumerate(("left", "right")):
        for column, (name, what) in enumerate(
            ((f"joint_{side}_1", f"{side} shoulder pitch [rad]"), (f"force_{side}_wrist", f"{side} wrist force [raw]"))
        ):
            axis, i = axes[row, column], CONTROLLED.index(name)
            axis.plot(times, then[:, 0, i], "--", color=PAST, label="done")
            for k, ahead in enumerate(LOOKAHEADS):
                axis.plot(times, said[:, k, i], color=COLOURS[(1, 3, 0)[k]], lw=1.2, label=f"look-ahead {ahead:.2f}")
            axis.set_ylabel(what)
            plain(axis)
    axes[0, 0].legend(frameon=False, fontsize=8)
    for axis in axes[1]:
        axis.set_xlabel("time [s]")
    return figure


def edge_cases(found: Found) -> Figure:
    """Fig. 33: where the partner's shoulder is in the picture, and what is believed of phase and velocity then."""
    from matplotlib.figure import Figure

    cases = {"long": "long hug", "late": "delay before hugging", "apart": "no contact"}
    present = {k: v for k, v in cases.items() if any(f"/{k}/" in label for label in found)}
    figure = Figure(figsize=(3.4 * max(len(present), 2), 6.0), layout="constrained")
    axes = figure.subplots(3, len(present), squeeze=False)
    for column, (kind, title) in enumerate(present.items()):
        one = next((f for label, f in found.items() if f"/{kind}/" in label and np.all(f["so"])), None)
        one = one if one is not None else next(f for label, f in found.items() if f"/{kind}/" in label)
        times, marks = one["times"], one["marks"]
        ends = (marks[0], marks[4], times[-1])
        axis = axes[0, column]
        shoulder = one["read"][:, OBSERVED.index("pose_right_shoulder_y")]
        axis.plot(times, shoulder, color=INK, lw=1.2)
        axis.set(title=title, xlabel="time [s]")
        for i, (start, end) in enumerate(zip((0.0, *ends[:2]), ends, strict=True)):
            axis.axvspan(start, end, color=REGIONS[i], alpha=0.15, lw=0)
            at = min(int(np.searchsorted(times, end)), len(times) - 1)
            phase, phase_std, velocity, velocity_std = one["beliefs"][at, :4]
            _density(axes[1, column], np.linspace(0, 1, 400), phase, phase_std, REGIONS[i])
            _density(axes[2, column], np.linspace(-0.1, 0.4, 400), velocity, velocity_std, REGIONS[i])
        axes[1, column].set_xlabel("phase")
        axes[2, column].set_xlabel("phase velocity [1/s]")
        for axis in axes[:, column]:
            plain(axis)
    for axis, label in zip(axes[:, 0], ("right shoulder y [px]", "relative density", "relative density"), strict=True):
        axis.set_ylabel(label)
    return figure


def _density(axis: Any, at: np.ndarray, mean: float, std: float, colour: str) -> None:
    """A Gaussian of what is believed, as high as 1: they are of very different width."""
    height = np.exp(-0.5 * ((at - mean) / max(std, 0.004)) ** 2)
    axis.fill_between(at, 0, height, color=colour, alpha=0.35, lw=0)
    axis.plot(at, height, color=colour, lw=1)


def forces(found: Found) -> Figure:
    """Fig. 35: of a hug of either of two people, the force of the left hand, wanted and felt, and one on the back."""
    from matplotlib.figure import Figure

    long = {label.split("/")[1]: label for label in reversed(found) if "/long/" in label}  # the first of every person
    labels = [long[who] for who in ("trained", "novel-1", "novel-2") if who in long][:2]
    figure = Figure(figsize=(8.4, 2.3 * max(len(labels), 1)), layout="constrained")
    axes = figure.subplots(max(len(labels), 1), 2, squeeze=False, sharex="row")
    for row, label in enumerate(labels):
        one = found[label]
        touch = one["read"][:, -len(NAMES) :]
        arms = np.array([largest(line) for line in touch])
        back = [NAMES.index(name) for group in SENSORS if group.startswith("back") for name in SENSORS[group]]
        hand = ARMS.index("left_hand")
        axes[row, 0].plot(one["times"], arms[:, hand], "--", color=PAST, label="felt")
        axes[row, 0].plot(one["times"], one["wanted"][:, hand], color=COLOURS[1], label="wanted")
        axes[row, 1].plot(one["times"], touch[:, back].max(1), color=INK, lw=1.2)
        axes[row, 0].set_ylabel("left hand [raw]")
        axes[row, 1].set_ylabel("back [raw]")
        axes[row, 0].set_title(f"partner: {label.replace('-', ' ').split('/')[1]}", fontsize=9, loc="left")
        for axis in axes[row]:
            plain(axis)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    axes[0, 0].legend(frameon=False, fontsize=8)
    return figure


def strip(frames: np.ndarray, times: np.ndarray, marks: np.ndarray) -> Figure:
    """Fig. 31: six frames, from standing there to parting."""
    from matplotlib.figure import Figure

    starts, raises, wraps, holds, withdraws, _ = marks
    moments = (0.5 * starts, raises + 0.8, wraps + 0.2, holds + 1.5, withdraws + 0.8, withdraws + 2.4)
    names = ("waits", "raises arms", "arrives", "holds", "lets go", "parts")
    figure = Figure(figsize=(12.6, 1.7), layout="constrained")
    for axis, moment, name in zip(figure.subplots(1, len(moments)), moments, names, strict=True):
        axis.imshow(frames[min(int(np.searchsorted(times, moment)), len(frames) - 1)])
        axis.set_axis_off()
        axis.set_title(f"{name}, {moment:.1f} s", fontsize=8)
    return figure
