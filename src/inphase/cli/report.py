"""`inphase report`: recorded runs, or recordings played to a model, as a page that opens from disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import tyro

from inphase.cli.console import Output, working
from inphase.cli.reading import Columns, Format, Recordings
from inphase.errors import OptionError, listing
from inphase.evaluation.replay import fitting
from inphase.filters import RECOMMENDED, make
from inphase.io import read_recorded_model, read_recording
from inphase.io.atomic import check_target
from inphase.model import Model
from inphase.report.account import Account, account_of_demonstration, account_of_recording
from inphase.report.page.document import check_page, write_page
from inphase.report.page.figures import RUNS
from inphase.trajectory import Demonstration

MODEL, RUN = ".inphase", ".mcap"
UNASKED = "what was believed was not computed again (--quick)"
Filters = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...", help_behavior_hint=f"(default: {RECOMMENDED})")]
Optional = tyro.conf.arg(help_behavior_hint="")


def report(
    source: Recordings,
    format: tyro.conf.OmitArgPrefixes[Format],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("report.html"),
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None,
    filter: Filters = (),
    seed: int = 0,
    title: Annotated[str | None, Optional] = None,
    quick: Annotated[bool, Optional] = False,
) -> int:
    """Make a page of what was seen, believed and answered at every step: of runs, or of recordings played to a model.

    Several runs, episodes or filters are compared with each other.

    Args:
        source: recorded runs (.mcap); or one model file (.inphase) and recordings that are played to it
        format: how recordings are written
        output: the page (.html), which opens from disk and contacts nothing
        model: the model the runs were made with, where they hold none
        filter: one or more filters that recordings are played to; runs have their own
        seed: of the filter's random numbers
        title: of the page; otherwise the names of the runs
        quick: tell of runs what was recorded alone, without computing again what was believed
    """
    check_page()
    check_target(output)
    if output.suffix.lower() not in (".html", ".htm"):
        raise OptionError(f"--output: expected a page, .html, got {output}")
    console = Output()
    models = [name for name in source if Path(name).suffix == MODEL]
    runs = [Path(name) for name in source if Path(name).suffix.lower() == RUN]
    others = [name for name in source if name not in models and Path(name) not in runs]
    if models:
        if len(models) > 1 or runs or model is not None or not others:
            raise OptionError(
                f"expected recorded runs (.mcap), or one model and recordings to play to it, got {listing(source)}"
            )
        accounts = _played(Path(models[0]), others, format, filter or (RECOMMENDED,), seed)
    else:
        if others:
            raise OptionError(f"{listing(others)}: no recorded run (.mcap); other recordings need a model before them")
        if filter:
            raise OptionError(
                f"--filter: a recorded run has its own; play its model to recordings for {listing(filter)}"
            )
        accounts = _recorded(runs, model, quick)
    write_page(output, accounts, title)
    for account in accounts:
        for remark in account.remarks:
            console.print(f"{account.title}: {remark}", style="dim")
    console.print(f"wrote {output}: {output.stat().st_size / 1e6:.1f} MB")
    return 0


def _recorded(runs: Sequence[Path], named: Path | None, quick: bool) -> list[Account]:
    _check_count(len(runs), "runs")
    given = None if named is None else Model.load(named)
    accounts = []
    titles = _told_apart([str(run) for run in runs])
    for run, title in zip(runs, titles, strict=True):
        recording = read_recording(run)
        model = given or (None if quick else read_recorded_model(run))
        with working(title) as told:
            account = account_of_recording(recording, model, title=title, told=told)
        accounts.append(replace(account, remarks=(UNASKED,)) if quick and given is None else account)
    return accounts


def _played(path: Path, recordings: Sequence[str], format: Format, filters: Sequence[str], seed: int) -> list[Account]:
    model = Model.load(path)
    for name in filters:
        make(name, model)  # an unknown one is told before anything is played
    episodes: list[Demonstration] = fitting(
        model, Columns(format.time, format.delimiter, format.ignore_notes).load(recordings)
    )
    _check_count(len(episodes) * len(filters), "episodes and filters")
    accounts = []
    for episode in episodes:
        for name in filters:
            with working(f"{episode.name}, {name}") as told:
                accounts.append(account_of_demonstration(model, episode, name, seed, told=told))
    return accounts


def _check_count(count: int, what: str) -> None:
    if not 1 <= count <= RUNS:
        raise OptionError(f"expected 1 to {RUNS} {what} in a report, got {count}")


def _told_apart(paths: Sequence[str]) -> list[str]:
    """The names of files, with their folders where names are the same."""
    stems = [Path(path).stem for path in paths]
    return stems if len(set(stems)) == len(stems) else list(paths)
