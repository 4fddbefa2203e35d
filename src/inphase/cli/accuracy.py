"""What an evaluation found, as tables for people, values for machines and points for the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import Console
from rich.text import Text

from inphase.cli.console import counted
from inphase.cli.scores import figure, percent
from inphase.evaluation import BASELINES, METRICS, Evaluation
from inphase.report.accuracy_picture import AccuracySeries

NAME, CELL = 15, 12  # characters, with a blank between: five conditions fit 80 columns
ALONE = ("end50", "nll")  # of the average, or of the only task, a table each beside that of now
NOTHING = figure(None)
LEGEND = """\
now: mean squared error of the controlled channels at every sample; 1 is what
always answering the mean reading would score
inside: the share of readings that lies inside the predictor's own 90 % band
end50: the same of the final pose, as foreseen after half of the episode
nll: negative log-likelihood; * marks the best of a column"""


def print_evaluation(console: Console, evaluation: Evaluation) -> None:
    """A table of every task, and all tables of their mean."""
    tasks = evaluation.tasks
    for task in tasks:
        count = len({row.episode for row in evaluation.rows if row.task == task})
        console.print(f"{task}: {counted(count, 'episode')}", style="bold")
        _print_tables(console, evaluation, [task], ("now", *(ALONE if len(tasks) == 1 else ())))
    if len(tasks) > 1:
        console.print(f"mean of {len(tasks)} tasks", style="bold")
        _print_tables(console, evaluation, tasks, ("now", *ALONE))


def _print_tables(console: Console, evaluation: Evaluation, tasks: Sequence[str], metrics: Sequence[str]) -> None:
    for metric in metrics:
        title = "now (inside)" if metric == "now" else metric
        console.print(f"{title:{NAME}}" + "".join(f" {name:>{CELL}}" for name in evaluation.conditions))
        columns = [_column(evaluation, metric, condition, tasks) for condition in evaluation.conditions]
        for name, *cells in zip(evaluation.predictors, *columns, strict=True):
            line = Text.assemble(f"{name:{NAME}}", *cells)
            line.rstrip()
            console.print(line)
        console.print()


def _column(evaluation: Evaluation, metric: str, condition: str, tasks: Sequence[str]) -> list[tuple[str, str]]:
    """A cell a predictor, with its style."""
    means = [evaluation.figure(metric, name, condition, tasks).mean for name in evaluation.predictors]
    best = figure(float(np.nanmin([*means, np.inf])))
    cells = []
    for name, shown in zip(evaluation.predictors, map(figure, means), strict=True):
        is_best = shown == best != NOTHING
        text = shown + ("*" if is_best else " ")
        if metric == "now":
            inside = percent(evaluation.figure("cover", name, condition, tasks).mean)
            text += f"({inside.replace(' ', '')})"
        cells.append((f" {text:>{CELL}}", "bold" if is_best else ""))
    return cells


def describe_evaluation(evaluation: Evaluation) -> dict[str, Any]:
    """Every mean with its standard error, and every episode, as plain values; None where nothing was scored."""
    of: list[tuple[str | None, tuple[str, ...]]] = [(task, (task,)) for task in evaluation.tasks]
    figures = [
        {"task": task, "predictor": predictor, "condition": condition}
        | {metric: _plain(found.mean) for metric, found in row.items()}
        | {f"{metric}_error": _plain(found.error) for metric, found in row.items()}
        for task, tasks in [*of, (None, evaluation.tasks)]
        for predictor in evaluation.predictors
        for condition in evaluation.conditions
        for row in [{metric: evaluation.figure(metric, predictor, condition, tasks) for metric in METRICS}]
    ]
    episodes = [{key: _plain(value) for key, value in asdict(row).items()} for row in evaluation.rows]
    return {"figures": figures, "episodes": episodes}


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def accuracy_series(evaluation: Evaluation) -> list[AccuracySeries]:
    """The mean of all tasks, as it is drawn."""
    series = []
    for name in evaluation.predictors:
        now, cover = (
            [evaluation.figure(metric, name, condition) for condition in evaluation.conditions]
            for metric in ("now", "cover")
        )
        series.append(
            AccuracySeries(
                name,
                now=np.array([found.mean for found in now]),
                now_error=np.array([found.error for found in now]),
                cover=np.array([found.mean for found in cover]),
                cover_error=np.array([found.error for found in cover]),
                baseline=name in BASELINES,
            )
        )
    return series
