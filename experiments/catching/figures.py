"""The pictures of the study."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from experiments.catching.film import AT
from experiments.catching.trade_off import LENGTHS
from experiments.study import Found
from inphase.report.look import BAND, COLOURS, INK, NINETY, NOW, PAST, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def course(phases: np.ndarray, errors: Mapping[str, np.ndarray]) -> Figure:
    """The ball's error over the phase, mean and standard deviation over throws, of PF, eBIP and ours (Fig. 28)."""
    figure, panels = _figure(1, 3, (9, 3))
    for axes, name, colour in zip(panels, ("PF", "eBIP", "rbpf"), COLOURS, strict=False):
        mean, std = errors[name].mean(0), errors[name].std(0)
        axes.fill_between(phases, np.maximum(mean - std, 0), mean + std, color=colour, alpha=BAND, lw=0)
        axes.plot(phases, mean, color=colour)
        axes.axvline(0.45, color=PAST, lw=1, ls="--")
        axes.set(title=name, xlabel="phase", ylim=(0, None))
    top = max(axes.get_ylim()[1] for axes in panels)
    for axes in panels:
        axes.set_ylim(0, top)
    panels[0].set_ylabel("error of the ball [m]")
    return figure


def trade_off(found: Found) -> Figure:
    """Time and error by members, and time by length (Fig. 29)."""
    figure, (left, middle, right) = _figure(1, 3, (9, 3))
    parts = list(found.values())
    members = [int(part["members"]) for part in parts]
    for name, colour in (("eBIP-", COLOURS[1]), ("eBIP", COLOURS[0])):
        left.plot(members, [1000 * float(part[f"step/{name}"]) for part in parts], "o-", color=colour, label=name)
        middle.plot(members, [part[f"errors/{name}"][:, 1, 0].mean() for part in parts], "o-", color=colour, label=name)
        right.plot(LENGTHS, 1000 * parts[-1][f"whole/{name}"], color=colour, label=f"{name}, {members[-1]} members")
    left.set(xlabel="members", ylabel="a step [ms]", ylim=(0, None))
    middle.set(xlabel="members", ylabel="joint error at 82 % [rad²]", ylim=(0, None))
    right.set(xlabel="share of the interaction", ylabel="to take it in [ms]", ylim=(0, None))
    left.legend(frameon=False)
    right.legend(frameon=False)
    return figure


def belief(part: Mapping[str, np.ndarray]) -> Figure:
    """The third joint as it was foreseen at four moments, over the whole phase (Fig. 28, left)."""
    figure, panels = _figure(2, 4, (10, 4.6))
    times, catch = part["times"], float(part["entered"])
    last = catch if np.isfinite(catch) else times[-1]
    ends = np.degrees([part["mean"][:, -1] - 3 * part["std"][:, -1], part["mean"][:, -1] + 3 * part["std"][:, -1]])
    grid = np.linspace(np.quantile(ends[0], 0.05), np.quantile(ends[1], 0.95), 200)
    low, high = np.degrees([(part["mean"] - 2 * part["std"]).min(), (part["mean"] + 2 * part["std"]).max()])
    for column, share in enumerate((0.2, 0.43, 0.65, 0.82)):
        i = min(int(np.searchsorted(times, share * last)), len(times) - 1)
        mean, std = np.degrees(part["mean"][i]), np.degrees(part["std"][i])
        upper, lower = panels[0][column], panels[1][column]
        density = np.exp(-0.5 * ((grid - mean[-1]) / std[-1]) ** 2) / (std[-1] * np.sqrt(2 * np.pi))
        upper.fill_between(grid, density, color=NOW, alpha=BAND, lw=0)
        upper.plot(grid, density, color=NOW)
        upper.axvline(np.degrees(part["truth"][-1]), color=INK, lw=1, ls="--")
        upper.set(title=f"{share:.0%} of the throw", yticks=[], xlabel="at the catch [°]")
        lower.fill_between(AT, mean - NINETY * std, mean + NINETY * std, color=NOW, alpha=BAND, lw=0)
        for before in range(max(i - 20, 0), i, 4):
            lower.plot(AT, np.degrees(part["mean"][before]), color=COLOURS[1], lw=0.6)
        lower.plot(AT, mean, color=NOW, label="foreseen")
        lower.plot(
            times[: i + 1] / last, np.degrees(part["truth"][: i + 1]), color=COLOURS[2], lw=2, label="where it went"
        )
        lower.set(xlabel="phase", ylim=(low, high))
    panels[1][0].set_ylabel("elbow [°]")
    panels[1][0].legend(frameon=False, fontsize=8)
    return figure


def strip(found: Found) -> Figure:
    """Four frames of every throw: the wind-up, the release, the flight and the catch (Fig. 30)."""
    figure, rows = _figure(len(found), 4, (11, 2.2 * len(found) + 0.2))
    for panels, part in zip(np.atleast_2d(rows), found.values(), strict=True):
        frames, end = part["frames"], float(part["entered"])
        end = end if np.isfinite(end) else float(part["times"][-1])
        release, every = float(part["release"]), float(part["every"])
        for axes, (time, name) in zip(
            panels,
            ((0.6 * release, "wind-up"), (release, "release"), ((release + end) / 2, "flight"), (end + 0.15, "catch")),
            strict=True,
        ):
            axes.imshow(frames[min(round(time / every), len(frames) - 1)])
            axes.set_title(f"{name}, {time:.2f} s", fontsize=8)
            axes.axis("off")
    return figure


def _figure(rows: int, columns: int, size: tuple[float, float]):  # type: ignore[no-untyped-def]
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(rows, columns)
    for axes in np.ravel(panels):
        plain(axes)
    return figure, panels
