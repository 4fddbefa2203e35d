"""`inphase evaluate`: how well filters follow interactions that they have not seen, by cross-validation."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from inphase.cli.accuracy import LEGEND, accuracy_series, describe_evaluation, print_evaluation
from inphase.cli.console import Output, counted, working
from inphase.cli.jobs import Jobs
from inphase.cli.reading import AsJson, Columns, Recordings
from inphase.cli.unfinished import describe_settings, read_rows
from inphase.errors import DataError, OptionError, WorkerError, listing
from inphase.evaluation import BASELINES, CONDITIONS, Evaluation, Row
from inphase.evaluation import evaluate as cross_validate
from inphase.evaluation.protocol import FOLDS
from inphase.filters import FILTERS, RECOMMENDED
from inphase.io.atomic import check_target, whole_file
from inphase.report.accuracy_picture import draw_accuracy
from inphase.report.look import check_picture
from inphase.training import fit
from inphase.trajectory import Dataset

FilterNames = Annotated[tuple[str, ...], tyro.conf.arg(metavar=f"{'|'.join(FILTERS)}...")]
ConditionNames = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...")]
File = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")]


def evaluate(
    data: Recordings,
    columns: tyro.conf.OmitArgPrefixes[Columns],
    jobs: tyro.conf.OmitArgPrefixes[Jobs],
    filters: FilterNames = (RECOMMENDED,),
    folds: int = FOLDS,
    conditions: ConditionNames = tuple(CONDITIONS),
    seed: int = 0,
    quick: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], help_behavior_hint="")] = None,
    resume: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    picture: File = None,
    json_: AsJson = False,
) -> int:
    """Say how well filters follow recordings that they have not seen, beside two baselines.

    The baselines are the mean trajectory, played by the clock, and a ridge regression on the partner's last moments.

    Args:
        data: files, folders or globs of CSV or npz recordings, one episode a file; of several folders each is a task
        columns: what the columns are
        jobs: who works
        filters: how phase and weights are inferred, one or more; none for the baselines alone
        folds: every so many-th episode is held out at a time
        conditions: under which held-out episodes are shown: other tempos, a pause, a partner out of sight
        seed: of the filters' random numbers
        quick: learn without holding anything out once more, as `inphase fit --quick` does: a second instead of a minute
        output: write all figures, every episode's too, into this JSON file; after Ctrl-C those that are there
        resume: go on with what --output holds, after Ctrl-C or for more filters or conditions
        picture: draw errors and coverage into this file (.png, .svg or .pdf)
        json_: print all figures as JSON
    """
    if picture is not None:
        check_picture(picture)
    for path in (output, picture):
        if path is not None:
            check_target(path)
    if resume and output is None:
        raise OptionError("--resume: expected --output, the file to go on with, got none")
    jobs.check()
    tasks = _read(data, columns)
    settings = describe_settings(tasks, folds, seed, quick)
    known = read_rows(output, settings) if resume and output is not None else []
    rows: list[Row] = []
    count, console = sum(map(len, tasks.values())), Output(quiet=json_)

    def tell(evaluation: Evaluation, missing: int) -> None:
        found = {**settings, "partial": missing > 0, "missing": missing, **describe_evaluation(evaluation)}
        print_evaluation(console, evaluation)
        console.print(LEGEND, style="dim")
        if missing:
            console.print(f"partial: {missing} of {missing + len(evaluation.rows)} scores are missing")
        if output is not None:
            with whole_file(output) as temporary:
                temporary.write_text(json.dumps(found, indent=1, allow_nan=False) + "\n", encoding="utf-8")
            console.print(f"wrote {output}" + ("; the same command with --resume goes on" if missing else ""))
        if json_:
            json.dump(found, sys.stdout, indent=1, allow_nan=False)
            print()

    try:
        with jobs.opened() as workers, working(f"evaluating with {counted(count, 'episode')}") as progress:
            evaluation = cross_validate(
                tasks,
                filters,
                folds=folds,
                conditions=conditions,
                seed=seed,
                fit=partial(fit, calibrate=not quick),
                known=known,
                keep=rows.extend,
                progress=progress,
                **workers,
            )
    except (KeyboardInterrupt, WorkerError):
        if rows:
            wanted = [*tasks], [*filters, *BASELINES], [*conditions]
            rows.sort(key=lambda row: [*map(list.index, wanted, (row.task, row.predictor, row.condition)), row.fold])
            tell(Evaluation(tuple(rows)), count * len({*wanted[1]}) * len({*conditions}) - len(rows))
        raise
    tell(evaluation, 0)
    if picture is not None:
        title = evaluation.tasks[0] if len(evaluation.tasks) == 1 else f"mean of {len(evaluation.tasks)} tasks"
        draw_accuracy(picture, title, evaluation.conditions, accuracy_series(evaluation))
        console.print(f"wrote {picture}")
    return 0


def _read(data: Sequence[str], columns: Columns) -> dict[str, Dataset]:
    """The tasks by name: every one of several folders, or all recordings together."""
    folders = [part for part in data if Path(part).is_dir()]
    if len(data) > 1 and folders and len(folders) < len(data):
        raise OptionError(
            f"expected folders, each a task, or files of one task; got as folders {listing(folders)}, "
            f"and {listing(part for part in data if part not in folders)}"
        )
    if len(data) == 1 or not folders:
        name = Path(data[0]).resolve().name if folders else "recordings"
        tasks = {name: columns.load(data)}
    else:
        tasks = {name: columns.load([part]) for name, part in zip(_names(folders), folders, strict=True)}
    first = next(iter(tasks))
    for task, dataset in tasks.items():
        if not dataset.observed or not dataset.controlled:
            raise OptionError(
                f"expected --observed and --controlled, the channels of either partner; got as observed "
                f"{listing(dataset.observed)}, and as controlled {listing(dataset.controlled)}"
            )
        for role in ("observed", "controlled"):
            expected, got = getattr(tasks[first], role), getattr(dataset, role)
            if set(expected) != set(got):
                raise DataError(
                    f"{task}: expected the {role} channels of {first}, {listing(expected)}; got {listing(got)}"
                )
    return tasks


def _names(folders: Sequence[str]) -> list[str]:
    """The names of folders, or their paths where names are equal; raises OptionError for a folder that stands twice."""
    paths = [Path(folder).resolve() for folder in folders]
    twice = [str(path) for i, path in enumerate(paths) if path in paths[:i]]
    if twice:
        raise OptionError(f"expected every folder once, got twice: {listing(twice)}")
    names = [path.name for path in paths]
    return [name if names.count(name) == 1 else folder for name, folder in zip(names, folders, strict=True)]
