"""A recording played to a session, with what happens printed on the way."""

from __future__ import annotations

import time

import numpy as np
from rich.console import Console

from inphase.cli.scores import figure, percent
from inphase.evaluation.replay import Moment, Replay, steps
from inphase.metrics import Scores
from inphase.result import Status
from inphase.session import Session
from inphase.trajectory import Demonstration

ROWS = 10  # of the table


def follow(console: Console, session: Session, demonstration: Demonstration) -> tuple[Replay, float]:
    """A replay from the start, and the median time of one observe and respond [s]; prints ten rows as it goes."""
    model = session.model
    spread = model.spread[len(model.observed) :]
    rows = set(np.linspace(0, len(demonstration) - 1, ROWS + 1).round().astype(int)[1:].tolist())
    console.print(f"{demonstration.name}: {len(demonstration)} samples, {demonstration.duration:.2f} s")
    console.print("time [s]          phase   pace    error   inside   status", style="bold")
    session.reset()
    moments: list[Moment] = []
    durations = []
    stream = steps(model, demonstration, session)
    for i in range(len(demonstration)):
        begun = time.perf_counter()
        moments.append(next(stream))
        durations.append(time.perf_counter() - begun)
        if i in rows:
            estimate = moments[-1].estimate
            error = Scores.of(moments[-1].now_error[None], moments[-1].response.std[:1], spread).nmse
            inside = Replay(demonstration.name, tuple(moments), spread).now.coverage
            console.print(
                f"{estimate.time - demonstration.times[0]:8.2f}  {estimate.phase:.3f} ± {estimate.phase_std:.3f}   "
                f"{estimate.phase_velocity / model.phase.nominal_velocity:4.2f}   {figure(error):>6}   "
                f"{percent(inside):>6}   {_name(estimate.status)}"
            )
    _print_trouble(console, moments)
    return Replay(demonstration.name, tuple(moments), spread), float(np.median(durations))


def _name(status: Status) -> str:
    return status.name.lower().replace("_", " ")


def _print_trouble(console: Console, moments: list[Moment]) -> None:
    """Every status but the usual one with its sentence, how often and from when on."""
    for status in Status:
        times = [m.estimate.time for m in moments if m.estimate.status is status]
        if times and status is not Status.FOLLOWING:
            since = times[0] - moments[0].estimate.time
            console.print(
                f"{_name(status)}, {len(times)} of {len(moments)} samples from {since:.2f} s on: {status.value}",
                soft_wrap=False,
            )
