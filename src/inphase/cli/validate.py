"""`inphase validate`: what is wrong with a data set, by episode, channel and time."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import tyro
from rich.table import Table as PrintedTable

from inphase.channels import make_channels
from inphase.cli.console import Output, counted, waiting
from inphase.cli.reading import AsJson, Columns, Recordings, noted
from inphase.errors import DataError
from inphase.io import Table, find_episodes, pick_roles, read_episode
from inphase.io.files import episode_names
from inphase.io.notes import NOTES, Note, as_noted
from inphase.preprocess.checks import Finding, FindingKind, check
from inphase.trajectory import guess_quaternions

CANNOT_BE_USED = 1  # exit code


def validate(
    data: Recordings,
    columns: tyro.conf.OmitArgPrefixes[Columns],
    json_: AsJson = False,
) -> int:
    """Say what is wrong with recordings; nothing is changed. Exit code 1 if an episode cannot be used as it is.

    Args:
        data: files, folders or globs of CSV or npz recordings, one episode a file
        columns: what the columns are; without patterns all are looked at
        json_: print the findings as JSON
    """
    paths = find_episodes(data)
    notes = noted(paths, columns)
    with waiting(f"looking at {counted(len(paths), 'episode')}"):
        channels, findings = _findings(paths, notes, columns)
    findings.sort(key=lambda finding: finding.severity)
    if json_:
        json.dump([{**asdict(f), "kind": f.kind.value, "severity": f.severity} for f in findings], sys.stdout, indent=1)
        print()
    else:
        _print(findings, sum(note.use for note in notes), channels)
    return CANNOT_BE_USED if any(f.severity == "error" for f in findings) else 0


def _findings(paths: Sequence[Path], notes: Sequence[Note], columns: Columns) -> tuple[int, list[Finding]]:
    """How many channels were looked at, and what was found."""
    tables, findings = _read(paths, notes, columns)
    if not (tables or findings):
        raise DataError(f"expected at least one episode to use, but {NOTES} leaves out all {len(paths)}")
    if not tables:
        raise DataError(findings[0].message)
    # The columns that most episodes have are what is expected: the first may be the odd one.
    usual = Counter(table.columns for _, table in tables).most_common(1)[0][0]
    example = next(table for _, table in tables if table.columns == usual)
    names = [name for role in pick_roles(example, columns.observed, columns.controlled) for name in role]
    episodes = []
    for name, table in tables:
        try:
            episodes.append((name, table.times, table.pick(names)))
        except DataError as error:
            findings.append(Finding(name, None, None, FindingKind.UNREADABLE, str(error)))
    kinds = guess_quaternions(names, [values for _, _, values in episodes]) | columns.kinds
    return len(names), findings + check(episodes, make_channels(names, [], kinds=kinds))


def _read(
    paths: Sequence[Path], notes: Sequence[Note], columns: Columns
) -> tuple[list[tuple[str, Table]], list[Finding]]:
    """The episodes that are used and can be read, and a finding for each that cannot."""
    tables, findings = [], []
    for name, path, note in zip(episode_names(paths), paths, notes, strict=True):
        try:
            if note.use:
                table = read_episode(path, time=columns.time, delimiter=columns.separator)
                tables.append((name, as_noted(table, note)))
        except DataError as error:
            findings.append(Finding(name, None, None, FindingKind.UNREADABLE, str(error)))
    return tables, findings


def _print(findings: Sequence[Finding], episodes: int, channels: int) -> None:
    console = Output()
    table = PrintedTable(box=None, pad_edge=False)
    for title in ("episode", "channel"):  # where there is little room, the message needs it most
        table.add_column(title, overflow="fold", max_width=20 if console.width < 120 else None)
    table.add_column("at [s]", justify="right", no_wrap=True)
    table.add_column("finding", no_wrap=True)
    table.add_column()
    for finding in findings:
        style = "red" if finding.severity == "error" else ""
        at = "" if finding.time is None else f"{finding.time:.3f}"
        table.add_row(finding.episode, finding.channel or "", at, finding.kind.value, finding.message, style=style)
    if findings:
        console.print(table, soft_wrap=False)
    for severity, verdict in (("error", "cannot be used as it is"), ("warning", "is worth a look")):
        kinds = Counter(finding.kind.value for finding in findings if finding.severity == severity)
        if kinds:
            console.print(f"{verdict}: " + ", ".join(f"{kind} {count}" for kind, count in kinds.most_common()))
    count = len({finding.episode for finding in findings})
    console.print(
        f"{counted(episodes, 'episode')}, {counted(channels, 'channel')}: "
        + (f"{count} with findings" if findings else "nothing found")
    )
