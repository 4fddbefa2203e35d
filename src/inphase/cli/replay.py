"""`inphase replay`: play a recording to a model, sample by sample, as if it were live."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from inphase.cli.reading import Columns
from inphase.evaluation.metrics import Scores
from inphase.evaluation.replay import MARKS, Moment, Replay, by_the_clock, fitting, steps
from inphase.model import Model
from inphase.report.replay_picture import ReplayPanel, draw_replays
from inphase.trajectory import Demonstration

ROWS = 10  # of the table that is printed on the way
PANELS = 6  # replays in one picture


def replay(
    model: tyro.conf.Positional[Path],
    recording: tyro.conf.Positional[tuple[str, ...]],
    filter: str = "ebip",
    seed: int = 0,
    members: int | None = None,
    time_: Annotated[str, tyro.conf.arg(name="time")] = "time",
    delimiter: str = ",",
    picture: Path | None = None,
    json_: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> int:
    """Play recordings to a model and score its responses.

    Args:
        model: a model file
        recording: files, folders or globs of episodes
        filter: how phase and weights are inferred: bip or ebip
        seed: of the filter's random numbers
        members: the size of the ensemble (ebip)
        time_: the column of times [s]
        delimiter: what stands between columns
        picture: draw the (first six) replays into this file
        json_: print the figures as JSON
    """
    trained = Model.load(model)
    columns = Columns(time=time_, delimiter=delimiter)
    options = {} if members is None else {"members": members}
    console = Console(highlight=False, quiet=json_)
    results, panels = [], []
    for demonstration in fitting(trained, columns.load(recording)):
        played, update = play(console, trained, demonstration, filter, seed, **options)
        found = figures(trained, demonstration, played)
        results.append({"episode": demonstration.name, "filter": filter, **found, "update": update})
        panels.append(panel(demonstration.name, trained, demonstration, played))
    print_summary(console, results, filter)
    if picture is not None:
        draw_replays(picture, panels[:PANELS])
        console.print(f"wrote {picture}", soft_wrap=True)
    if json_:
        json.dump(results, sys.stdout, indent=1)
        print()
    return 0


def play(
    console: Console, model: Model, demonstration: Demonstration, filter: str, seed: int, **options: Any
) -> tuple[Replay, float]:
    """A replay that prints as it goes, and the median time of one observe and respond [s]."""
    session = model.session(filter, seed, **options)
    spread = model.spread[len(model.observed) :]
    console.print(f"{demonstration.name}: {len(demonstration)} samples, {demonstration.duration:.2f} s", soft_wrap=True)
    console.print("   time      phase          pace   error now   inside 90 %   status")
    moments: list[Moment] = []
    durations = []
    rows = set(np.linspace(0, len(demonstration) - 1, ROWS + 1).round().astype(int)[1:].tolist())
    stream = steps(model, demonstration, session)
    for i in range(len(demonstration)):
        begun = time.perf_counter()
        moments.append(next(stream))
        durations.append(time.perf_counter() - begun)
        if i in rows:
            so_far = Replay(demonstration.name, tuple(moments), spread).now
            e = moments[-1].estimate
            pace = e.phase_velocity / model.phase.nominal_velocity
            error = Scores.of(moments[-1].now_error[None], moments[-1].response.std[:1], spread).nmse
            console.print(
                f"{e.time - demonstration.times[0]:6.2f} s   {e.phase:.3f} ± {e.phase_std:.3f}   {pace:4.2f} x   "
                f"{_figure(error)}      {_percent(so_far.coverage)}         {e.status.value}",
                soft_wrap=True,
            )
    return Replay(demonstration.name, tuple(moments), spread), float(np.median(durations))


def figures(model: Model, demonstration: Demonstration, played: Replay) -> dict[str, float | None]:
    """The scores of a replay, beside those of the mean demonstration played by the clock."""
    now, clock = played.now, by_the_clock(model, demonstration)
    found = {
        "nmse": now.nmse,
        "coverage": now.coverage,
        "nll": now.nll,
        **{f"final_pose_{100 * mark:.0f}": played.final_pose(mark) for mark in MARKS},
        "log_likelihood": played.log_likelihood,
        "clock_nmse": clock.nmse,
        "clock_coverage": clock.coverage,
        "clock_nll": clock.nll,
    }
    return {key: value if np.isfinite(value) else None for key, value in found.items()}


def panel(title: str, model: Model, demonstration: Demonstration, played: Replay) -> ReplayPanel:
    """What the picture needs of a replay."""
    moments = played.moments
    return ReplayPanel(
        title,
        model,
        demonstration,
        [m.estimate for m in moments],
        [m.response for m in moments],
        [m.preview for m in moments if m.preview is not None],
    )


def print_summary(console: Console, results: list[dict[str, Any]], filter: str) -> None:
    """The scores of replays as a table, a row an episode, beside those of the mean played by the clock."""
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("episode", no_wrap=True)
    for title in ("error\n(nMSE)", "inside\n90 %", "nll", *(f"final pose\nat {100 * m:.0f} %" for m in MARKS)):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("│ by the clock:\n│ error (nMSE)", justify="right", no_wrap=True)
    table.add_column("inside\n90 %", justify="right", no_wrap=True)
    for found in results:
        value = {key: np.nan if v is None else v for key, v in found.items()}
        table.add_row(
            found["episode"],
            _figure(value["nmse"]),
            _percent(value["coverage"]),
            _figure(value["nll"]),
            *(_figure(value[f"final_pose_{100 * m:.0f}"]) for m in MARKS),
            _figure(value["clock_nmse"]),
            _percent(value["clock_coverage"]),
        )
    console.print(table)
    update = np.median([found["update"] for found in results])
    console.print(
        f"error: mean squared, 1 = always answering the training mean; by the clock: the mean demonstration, whatever\n"
        f"the partner does. {filter}: {1e3 * update:.2f} ms a sample to observe and respond",
        style="dim",
        soft_wrap=True,
    )


def _figure(value: float) -> str:
    return f"{value:6.3f}" if np.isfinite(value) else "     –"


def _percent(value: float) -> str:
    return f"{100 * value:3.0f} %" if np.isfinite(value) else "   – "
