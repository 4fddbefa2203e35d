"""A study from its first task to its page: what is done already is not done again."""

from __future__ import annotations

import importlib
import importlib.util
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import inphase
from experiments.study.page import Page
from experiments.study.plan import Settings, Study, Task
from experiments.study.stored import SECONDS, digest
from inphase.errors import OptionError
from inphase.workers import Team

Progress = Callable[[float], None]
BESIDE = Path(__file__).parents[1]
SHARED = ("study", "bodies")  # by several studies
LIBRARY = Path(inphase.__file__).parent


def load(name: str) -> Study:
    """A study by the name of its folder. Raises OptionError where a module that it needs is not installed."""
    try:
        study: Study = importlib.import_module(f"experiments.{name}.study").STUDY
        missing = [module for module in study.modules if importlib.util.find_spec(module) is None]
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith(("experiments", "inphase")):
            raise
        missing = [error.name]
    if missing:
        raise OptionError(
            f"{name} needs {' and '.join(missing)}: pip install 'inphase[sim,demo]', with Python 3.11 or newer"
        )
    return study


def conduct(
    name: str,
    study: Study,
    settings: Settings,
    team: Team,
    *,
    parts: tuple[str, ...] = (),
    again: bool = False,
    keep: bool = False,
    progress: Progress | None = None,
    say: Callable[[str], None] = print,
) -> Page:
    """Do what is not done yet, and tell all of it.

    parts: their names; none for all. again: do all anew. keep: take also what another state of the code has made, with
    the same settings.
    progress: is told the share of the tasks that is done.
    """
    chosen = study.chosen(parts)
    code = digest([*(BESIDE / folder for folder in (name, *SHARED)), LIBRARY])
    source = f"{code}-{digest([], settings.quick, settings.seed)}"
    seed = f" --seed {settings.seed}" if settings.seed else ""
    page = Page(name, settings.folder, [part.what for part in study.parts.values()])
    page.say(study.says)
    for i, (part, told) in enumerate(chosen.items()):

        def share(done: float, before: int = i) -> None:
            if progress is not None:
                progress((before + done) / len(chosen))

        tasks = study.parts[part].tasks(settings)
        settings = replace(settings, labels={**settings.labels, part: tuple(tasks)})
        _work(tasks, settings, part, source, team, again, keep, share, say)
        if told:
            stored = settings.of(part)
            found = {label: stored[label] for label in tasks}
            page.head(study.parts[part].what, f"inphase experiment {name} --part {part}{seed}", _minutes(found))
            study.parts[part].tell(settings, found, page)
    page.write(study.title)
    return page


def _work(
    tasks: Mapping[str, Task],
    settings: Settings,
    part: str,
    source: str,
    team: Team,
    again: bool,
    keep: bool,
    progress: Progress,
    say: Callable[[str], None],
) -> None:
    """Have the tasks done whose results are not there."""
    stored = settings.of(part)
    made_by = {label: stored.made_by(label) for label in tasks}
    drawn = source.partition("-")[2]
    there = [
        label
        for label, made in made_by.items()
        if made is not None and not again and (made == source or (keep and made.endswith(f"-{drawn}")))
    ]
    stale = sum(made is not None for made in made_by.values()) - len(there)
    if stale and not again:
        taken = "" if keep else " (--keep takes those of other code)"
        say(f"{part}: {stale} results are of other code or settings, and are made anew{taken}")
    waiting = deque((label, partial(_timed, task)) for label, task in tasks.items() if label not in there)
    if there and waiting:
        say(f"{part}: {len(there)} of {len(tasks)} results are there")
    done = len(there)
    try:
        for label, (seconds, result) in team.as_done(waiting):
            stored.keep(label, result, source, seconds)
            done += 1
            progress(done / len(tasks))
    except KeyboardInterrupt:
        say(f"{part}: {done} of {len(tasks)} results are kept in {settings.folder}; the same command goes on")
        raise


def _timed(task: Task) -> tuple[float, Mapping[str, Any]]:
    began = time.perf_counter()
    result = task()
    return time.perf_counter() - began, result


def _minutes(found: Mapping[str, Mapping[str, Any]]) -> float:
    """Of one processor, for all tasks together."""
    return float(sum(float(result[SECONDS]) for result in found.values())) / 60
