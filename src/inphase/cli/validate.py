"""`inphase validate`: what is wrong with a data set, by episode, channel and time."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table as PrintedTable

from inphase.channels import make_channels
from inphase.cli.reading import Columns
from inphase.errors import ChannelError, DataError
from inphase.io import Table, find_episodes, pick_roles, read_episode
from inphase.io.files import episode_names
from inphase.preprocess.checks import Finding, FindingKind, check
from inphase.trajectory import guess_quaternions

CANNOT_BE_USED = 1  # exit code


def validate(
    data: tyro.conf.Positional[tuple[str, ...]],
    columns: tyro.conf.OmitArgPrefixes[Columns],
    json_: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> int:
    """Say what is wrong with recordings: gaps, jumps, sign flips, dead channels, odd clocks; nothing is changed.

    Exit code 1 when an episode cannot be used as it is, 0 when there is nothing worse than a warning.

    Args:
        data: files, folders or globs of CSV or npz episodes
        columns: what the columns are; without patterns all are looked at
        json_: print the findings as JSON
    """
    paths = find_episodes(data)
    tables, findings = _read(paths, columns)
    if not tables:
        raise DataError(findings[0].message)
    names = [name for role in pick_roles(tables[0][1], columns.observed, columns.controlled) for name in role]
    episodes = []
    for name, table in tables:
        try:
            episodes.append((name, table.times, table.pick(names)))
        except DataError as error:
            findings.append(Finding(name, None, None, FindingKind.UNREADABLE, str(error)))
    kinds = guess_quaternions(names, [values for _, _, values in episodes]) | columns.kinds
    findings += check(episodes, make_channels(names, [], kinds=kinds))
    if json_:
        json.dump([{**asdict(f), "kind": f.kind.value, "severity": f.severity} for f in findings], sys.stdout, indent=1)
        print()
    else:
        _print(findings, len(paths), len(names))
    return CANNOT_BE_USED if any(f.severity == "error" for f in findings) else 0


def _read(paths: Sequence[Path], columns: Columns) -> tuple[list[tuple[str, Table]], list[Finding]]:
    """The episodes that can be read, and a finding for each that cannot."""
    tables, findings = [], []
    for name, path in zip(episode_names(paths), paths, strict=True):
        try:
            tables.append((name, read_episode(path, time=columns.time, delimiter=columns.separator)))
        except (DataError, ChannelError) as error:
            findings.append(Finding(name, None, None, FindingKind.UNREADABLE, str(error)))
    return tables, findings


def _print(findings: Sequence[Finding], episodes: int, channels: int) -> None:
    console = Console(highlight=False)
    table = PrintedTable(box=None, pad_edge=False)
    for title in ("episode", "channel"):
        table.add_column(title, no_wrap=True)
    table.add_column("at [s]", justify="right", no_wrap=True)
    table.add_column("finding", no_wrap=True)
    table.add_column("", overflow="fold")
    for finding in sorted(findings, key=lambda f: f.severity):
        style = "red" if finding.severity == "error" else ""
        at = "" if finding.time is None else f"{finding.time:.3f}"
        table.add_row(finding.episode, finding.channel or "", at, finding.kind.value, finding.message, style=style)
    if findings:
        console.print(table)
    errors = len({f.episode for f in findings if f.severity == "error"})
    warnings = len({f.episode for f in findings if f.severity == "warning"})
    console.print(
        f"{episodes} episodes, {channels} channels: "
        + (f"{errors} cannot be used as they are, {warnings} are worth a look" if findings else "nothing found")
    )
