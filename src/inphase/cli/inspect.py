"""`inphase inspect`: what a model file or a data set holds, and how good its demonstrations are."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro

from inphase.cli.card import describe_dataset, describe_model, print_dataset, print_model
from inphase.cli.console import Output, waiting
from inphase.cli.evidence import print_evidence
from inphase.cli.quality import describe_quality, print_quality
from inphase.cli.reading import AsJson, Columns, Recordings
from inphase.errors import OptionError, listing
from inphase.io import edit_notes, find_episodes
from inphase.io.atomic import check_target
from inphase.io.files import episode_names
from inphase.io.notes import unknown
from inphase.model import Model
from inphase.report.look import check_picture
from inphase.report.overlay_picture import draw_overlay
from inphase.training import assess
from inphase.trajectory import Dataset

Flag = Annotated[bool, tyro.conf.arg(help_behavior_hint="")]
File = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")]
Names = Annotated[tuple[str, ...], tyro.conf.arg(metavar="EPISODE...", help_behavior_hint="")]
Reasons = Annotated[tuple[str, ...], tyro.conf.arg(metavar="EPISODE[=WHY]...", help_behavior_hint="")]
Spans = Annotated[tuple[str, ...], tyro.conf.arg(metavar="EPISODE=FROM:UNTIL...", help_behavior_hint="")]


def inspect(
    source: Recordings,
    columns: tyro.conf.OmitArgPrefixes[Columns],
    report: Flag = False,
    picture: File = None,
    drop: Reasons = (),
    cut: Spans = (),
    keep: Names = (),
    json_: AsJson = False,
) -> int:
    """Show what a model file or a data set holds, and how good its demonstrations are.

    What is decided of recordings is noted in inphase-notes.json beside them, and holds for every command.

    Args:
        source: a model file (.inphase); or files, folders or globs of recordings
        columns: what the columns of recordings are
        report: of a model, show what was chosen by held-out demonstrations, and all that was tried
        picture: of recordings, draw all over each other into this file (.png, .svg or .pdf)
        drop: leave these episodes out from now on, and say why: episode_007="dropped the baton"
        cut: use these episodes only from one time until another [s]: episode_009=0.8:7.2, one of them may be missing
        keep: take these episodes as they were recorded again
        json_: print as JSON
    """
    console = Output(quiet=json_)
    is_model = len(source) == 1 and Path(source[0]).suffix == ".inphase"
    if report and not is_model:
        raise OptionError(f"--report: expected a model file (.inphase), got {listing(source)}")
    for option, given in (("picture", picture), ("drop", drop), ("cut", cut), ("keep", keep)):
        if is_model and given:
            raise OptionError(f"--{option}: expected recordings, got the model file {source[0]}")
    if is_model:
        card = _model(console, source[0], report)
    else:
        if picture is not None:
            check_picture(picture)
            check_target(picture)
        if drop or cut or keep:
            _note(console, source, columns, drop, cut, keep)
        card = _recordings(console, columns.load(source), picture)
    if json_:
        json.dump(card, sys.stdout, indent=1, allow_nan=False)
        print()
    return 0


def _model(console: Output, path: str, report: bool) -> dict[str, Any]:
    model = Model.load(path)
    print_model(console, model)
    console.print(*(f"{key}: {value}" for key, value in model.provenance.items()), sep="\n")
    if report:
        print_evidence(console, model)
    return describe_model(model)


def _recordings(console: Output, dataset: Dataset, picture: Path | None) -> dict[str, Any]:
    with waiting("holding demonstrations against each other"):
        quality = assess(dataset)
    print_dataset(console, dataset)
    print_quality(console, dataset, quality)
    if picture is not None:
        draw_overlay(picture, dataset, quality)
        console.print(f"wrote {picture}")
    return {**describe_dataset(dataset), **describe_quality(dataset, quality), "provenance": dict(dataset.provenance)}


def _note(
    console: Output,
    source: Sequence[str],
    columns: Columns,
    drop: Sequence[str],
    cut: Sequence[str],
    keep: Sequence[str],
) -> None:
    names = episode_names(find_episodes(source))
    written = edit_notes(
        source,
        drop=dict(_named("drop", text, names) for text in drop),
        cut={name: _span(name, text) for name, text in (_named("cut", part, names) for part in cut)},
        keep=keep,
        time=columns.time,
        delimiter=columns.separator,
    )
    for path in written:
        console.print(f"wrote {path}" if path.exists() else f"removed {path}: nothing is left to note")


def _named(option: str, text: str, names: Sequence[str]) -> tuple[str, str]:
    """The episode and what stands behind it; names may hold an = themselves."""
    for name in sorted(names, key=len, reverse=True):
        if text == name or text.startswith(f"{name}="):
            return name, text[len(name) + 1 :]
    raise OptionError(f"--{option}: {unknown(text.partition('=')[0], names)}")


def _span(name: str, text: str) -> tuple[float | None, float | None]:
    """From when until when [s]."""
    try:
        start, end = (float(part) if part.strip() else None for part in text.split(":"))
    except ValueError:
        start = end = None
    if start is None and end is None:
        raise OptionError(f"--cut: expected {name}=FROM:UNTIL [s], such as {name}=0.8:7.2, got {name}={text}")
    return start, end
