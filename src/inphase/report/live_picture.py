"""A picture of a live run: what was wanted, what was sent, what the robot did, and how far the interaction had come."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from inphase.channels import Role
from inphase.errors import OptionError
from inphase.io.atomic import whole_file
from inphase.recording import Recording
from inphase.report.look import BAND, INK, NINETY, NOW, check_picture, plain, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CHANNELS = 4  # at most so many, or nothing can be read
SENT, DID = "#e9a23b", "#d1603d"
STATES = {
    "HOLDING": "#f3ead7",
    "RETREATING": "#f6dccf",
    "STOPPING": "#f3cfcf",
    "STOPPED": "#e3e3e3",
}  # others are plain


@dataclass(frozen=True)
class Track:
    """What a robot did. times: (T,) [s] by the clock of the recording. positions: (T, D) by its signals."""

    times: Float[np.ndarray, " T"]
    positions: Float[np.ndarray, "T D"]
    signals: tuple[str, ...]


@dataclass(frozen=True)
class Truth:
    """How the interaction truly went, where that is known.

    times: (T,) [s] by the clock of the recording. values: (T, D) by channel. phases: (T,).
    """

    times: Float[np.ndarray, " T"]
    values: Float[np.ndarray, "T D"]
    names: tuple[str, ...]
    phases: Float[np.ndarray, " T"]


def draw_run(
    path: str | PathLike[str], recording: Recording, *, truth: Truth | None = None, robot: Track | None = None
) -> None:
    """Draw a run into a file (.png, .svg or .pdf), which is written whole or not at all.

    Raises OptionError where matplotlib is not installed, the kind of file is unknown, the folder does not exist or
    nothing was recorded.
    """
    check_picture(path)
    if not recording.estimates:
        raise OptionError(f"{recording.name}: expected a run in which something was observed, got none")
    figure = make_figure(recording, truth, robot)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=130)


def make_figure(recording: Recording, truth: Truth | None = None, robot: Track | None = None) -> Figure:
    """The controlled channels, those that move most, one above the other; below them the phase."""
    from matplotlib.figure import Figure

    controlled = [i for i, channel in enumerate(recording.channels) if channel.role is Role.CONTROLLED]
    drawn = _busiest(recording, [recording.channels[i].name for i in controlled])
    figure = Figure(figsize=(9.0, 1.0 + 2.9 * len(drawn) + 1.9), layout="constrained")
    axes = figure.subplots(len(drawn) + 1, 1, sharex=True, height_ratios=[3] * len(drawn) + [2], squeeze=False)[:, 0]
    begin = next((event.time for event in recording.events if event.kind == "start"), recording.estimates[0].time)
    for above, name in zip(axes, drawn, strict=False):
        unit = next(channel.unit for channel in recording.channels if channel.name == name)
        _draw_channel(above, recording, truth, robot, name, begin)
        above.set_ylabel(with_unit(name, unit))
    _draw_phase(axes[-1], recording, truth, begin)
    for one in axes:
        _shade(one, recording, begin)
        plain(one)
    axes[-1].set_xlabel("time [s]")
    figure.suptitle(recording.name, fontsize=11)
    entries: dict[str, Any] = {}
    for one in axes:
        entries |= {label: handle for handle, label in zip(*one.get_legend_handles_labels(), strict=True)}
    figure.legend([*entries.values()], [*entries], loc="outside lower center", ncols=3, frameon=False)
    return figure


def _busiest(recording: Recording, names: list[str]) -> list[str]:
    """The channels whose commands go farthest, in the order of the recording."""
    sent: dict[str, list[float]] = {name: [] for name in names}
    for command in recording.commands:
        for name in names:
            if name in command.signals:
                sent[name].append(command.positions[0, command.signals.index(name)])
    far = sorted(names, key=lambda name: -float(np.ptp(sent[name])) if sent[name] else 0.0)[:CHANNELS]
    return [name for name in names if name in far]


def _draw_channel(
    axes: Axes, recording: Recording, truth: Truth | None, robot: Track | None, name: str, begin: float
) -> None:
    responses = [response for response in recording.responses if response is not None and name in response.channels]
    now = [(r.times[0], r.mean[0, i], r.std[0, i]) for r in responses for i in [r.channels.index(name)]]
    if now:
        times, mean, std = np.array(now).T
        axes.fill_between(times - begin, mean - NINETY * std, mean + NINETY * std, color=NOW, alpha=BAND, lw=0)
        axes.plot(times - begin, mean, color=NOW, lw=1.6, label="response now, with 90 % band")
    if truth is not None:
        course = truth.values[:, truth.names.index(name)]
        axes.plot(truth.times - begin, course, color=INK, lw=1.9, label="true response")
    commands = [command for command in recording.commands if name in command.signals]
    if commands:
        sent = [command.positions[0, command.signals.index(name)] for command in commands]
        axes.plot([command.time - begin for command in commands], sent, color=SENT, lw=1.6, ls="--", label="sent")
    if robot is not None and name in robot.signals:
        did = robot.positions[:, robot.signals.index(name)]
        axes.plot(robot.times - begin, did, color=DID, lw=1.9, label="robot")


def _draw_phase(axes: Axes, recording: Recording, truth: Truth | None, begin: float) -> None:
    times, phases, stds = np.array([[e.time, e.phase, e.phase_std] for e in recording.estimates]).T
    if truth is not None:
        axes.plot(truth.times - begin, truth.phases, color=INK, lw=1.9)
    axes.fill_between(times - begin, phases - NINETY * stds, phases + NINETY * stds, color=NOW, alpha=BAND, lw=0)
    axes.plot(times - begin, phases, color=NOW, lw=1.6)
    axes.set_ylim(-0.05, 1.05)
    axes.set_ylabel("phase")


def _shade(axes: Axes, recording: Recording, begin: float) -> None:
    """When the robot was not playing the response."""
    for start, end, state in _spells(recording):
        if state in STATES:
            axes.axvspan(start - begin, end - begin, color=STATES[state], lw=0, zorder=0, label=state.lower())


def _spells(recording: Recording) -> Iterator[tuple[float, float, str]]:
    """From when to when the robot was in which state."""
    changes = [(event.time, event.before, event.after) for event in recording.events if event.after]
    told = [event.time for event in recording.events] + [estimate.time for estimate in recording.estimates]
    first, last = min(told), max(told)
    at, state = first, changes[0][1] if changes else ""
    for time, _, after in changes:
        yield at, time, state
        at, state = time, after
    yield at, last, state
