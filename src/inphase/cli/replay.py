"""`inphase replay`: play a recording to a model, sample by sample, as if it were live. Of runs: `replay_run`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from inphase.cli.console import Output
from inphase.cli.follow import follow
from inphase.cli.picture import panel
from inphase.cli.reading import AsJson, Columns, FilterName, Format, Recordings
from inphase.cli.scores import LEGEND, ScoreTable, figures
from inphase.evaluation.replay import fitting
from inphase.filters import RECOMMENDED
from inphase.io.atomic import check_target
from inphase.model import Model
from inphase.report.look import check_picture
from inphase.report.replay_picture import draw_replays

PANELS = 6  # replays in one picture


def replay(
    model: tyro.conf.Positional[Path],
    recordings: Recordings,
    format: tyro.conf.OmitArgPrefixes[Format],
    filter: FilterName = RECOMMENDED,
    seed: int = 0,
    members: Annotated[int | None, tyro.conf.arg(help_behavior_hint="")] = None,
    particles: Annotated[int | None, tyro.conf.arg(help_behavior_hint="")] = None,
    picture: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")] = None,
    json_: AsJson = False,
) -> int:
    """Play recordings to a model and score its responses.

    Of a recorded run, `inphase replay RUN.mcap` computes every estimate once more and compares; see its own --help.

    Args:
        model: a model file
        recordings: files, folders or globs of CSV or npz recordings, one episode a file
        format: how the recordings are written
        filter: how phase and weights are inferred
        seed: of the filter's random numbers
        members: the size of the ensemble of ebip; otherwise the filter's choice
        particles: how many there are of rbpf or particle; otherwise the filter's choice
        picture: draw the first six replays into this file (.png, .svg or .pdf)
        json_: print the figures as JSON
    """
    if picture is not None:
        check_picture(picture)
        check_target(picture)
    trained = Model.load(model)
    sizes: dict[str, Any] = {"members": members, "particles": particles}
    session = trained.session(filter, seed, **{name: size for name, size in sizes.items() if size is not None})
    demonstrations = fitting(trained, Columns(format.time, format.delimiter, format.ignore_notes).load(recordings))
    console, step_by_step = Output(quiet=json_), Output(quiet=json_ or len(demonstrations) > 1)
    table = ScoreTable(console, [d.name for d in demonstrations])
    results: list[dict[str, Any]] = []
    panels = []
    for i, demonstration in enumerate(demonstrations):
        played, step_time = follow(step_by_step, session, demonstration)
        found = figures(trained, demonstration, played)
        results.append({"episode": demonstration.name, "filter": filter, **found, "step_time": step_time})
        if i == 0:
            table.print_head()
        table.print_row(demonstration.name, found)
        if picture is not None and i < PANELS:
            panels.append(panel(demonstration.name, trained, demonstration, played))
    if len(results) > 1:
        table.print_mean(results)
    step_time = float(np.median([found["step_time"] for found in results]))
    console.print(f"{LEGEND}\n{filter}: {1e3 * step_time:.2f} ms to observe a sample and respond", style="dim")
    if picture is not None:
        draw_replays(picture, panels)
        console.print(f"wrote {picture}")
    if json_:
        json.dump(results, sys.stdout, indent=1)
        print()
    return 0
