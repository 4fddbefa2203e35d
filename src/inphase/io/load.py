"""Recordings on disk to a `Dataset`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from inphase.channels import match
from inphase.errors import ChannelError, DataError, listing
from inphase.io.csv import read_csv
from inphase.io.files import SUFFIXES, Source, episode_names, find_episodes
from inphase.io.notes import NOTES, Note, as_noted, notes_for
from inphase.io.npz import read_npz
from inphase.io.table import Table
from inphase.preprocess.trim import trim as trim_idle
from inphase.trajectory import Dataset, Demonstration


def load(
    source: Source,
    observed: str | Sequence[str] = (),
    controlled: str | Sequence[str] = (),
    *,
    time: str = "time",
    delimiter: str = ",",
    units: Mapping[str, str] | None = None,
    kinds: Mapping[str, str] | None = None,
    groups: Mapping[str, str] | None = None,
    trim: bool = False,
    notes: bool = True,
) -> Dataset:
    """The data set in a file, a folder, a glob pattern, or several of them: one demonstration a file, .csv or .npz.

    `observed` and `controlled` are names or patterns (`taker_?`) of the columns of each role; columns that fit neither
    are not loaded, and with no pattern at all every column is observed. The first file names the channels; others may
    hold them in another order, and more. `units`, `kinds` and `groups` go from a name or pattern to the value. `trim`
    cuts the idle start and end off every demonstration. What `inphase-notes.json` beside the files says is left out or
    cut, unless `notes` is False; the provenance tells. Raises DataError that names the file, and ChannelError.
    """
    paths = find_episodes(source)
    names = episode_names(paths)
    noted = notes_for(paths) if notes else [Note()] * len(paths)
    used = [i for i, note in enumerate(noted) if note.use]
    if not used:
        raise DataError(f"expected at least one episode to use, but {NOTES} leaves out all {len(paths)}")
    first = read_episode(paths[used[0]], time=time, delimiter=delimiter)
    roles = pick_roles(first, observed, controlled)
    demonstrations = []
    for i in used:
        table = first if i == used[0] else read_episode(paths[i], time=time, delimiter=delimiter)
        demonstrations.append(_demonstration(as_noted(table, noted[i]), [*roles[0], *roles[1]]))
    dataset = Dataset.from_arrays(
        [demonstration.times for demonstration in demonstrations],
        [demonstration.values for demonstration in demonstrations],
        *roles,
        units=units,
        kinds=kinds,
        groups=groups,
        names=[names[i] for i in used],
        provenance={"source": _as_given(source), "episodes": str(len(used)), **_decided(names, noted)},
    )
    return trim_idle(dataset) if trim else dataset


def read_episode(path: str | Path, *, time: str = "time", delimiter: str = ",") -> Table:
    """One episode, by the suffix of its file; raises DataError for an unknown suffix and for what cannot be read."""
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        return read_csv(path, time=time, delimiter=delimiter)
    if suffix == ".npz":
        return read_npz(path, time=time)
    raise DataError(f"{path}: expected a file that ends in {' or '.join(SUFFIXES)}, got {suffix or 'no suffix'}")


def pick_roles(
    table: Table, observed: str | Sequence[str] = (), controlled: str | Sequence[str] = ()
) -> tuple[list[str], list[str]]:
    """The names of the observed and of the controlled columns; all are observed where no pattern is given.

    Raises ChannelError for a pattern that fits no column, or a column that fits both roles.
    """
    if not observed and not controlled:
        return list(table.columns), []
    try:
        picked = [[table.columns[i] for i in match(patterns, table.columns)] for patterns in (observed, controlled)]
    except ChannelError as error:
        raise ChannelError(f"{table.name}: {error}") from None
    both = [name for name in picked[0] if name in picked[1]]
    if both:
        raise ChannelError(
            f"{table.name}: expected every channel to be observed or controlled, got as both: {listing(both)}"
        )
    return picked[0], picked[1]


def _demonstration(table: Table, names: Sequence[str]) -> Demonstration:
    """The picked columns, checked; every error names the file and the channel."""
    values = table.pick(names)
    if np.isinf(values).any():
        sample, column = np.argwhere(np.isinf(values))[0]
        raise DataError(
            f"{table.name}: expected finite values or NaN, got {values[sample, column]} "
            f"in channel {names[column]!r} at {table.times[sample]:.10g} s"
        )
    return Demonstration(table.times, values, table.name)


def _decided(names: Sequence[str], noted: Sequence[Note]) -> dict[str, str]:
    """What was left out and what was cut, in words; nothing where that is nothing."""
    out = [
        f"{name} ({note.reason})" if note.reason else name
        for name, note in zip(names, noted, strict=True)
        if not note.use
    ]
    cut = [f"{name} ({_span(note)})" for name, note in zip(names, noted, strict=True) if note.use and note.cuts]
    return {what: f"{len(some)}: {listing(some)}" for what, some in (("left out", out), ("cut", cut)) if some}


def _span(note: Note) -> str:
    start, end = (None if time is None else f"{time:.10g} s" for time in (note.start, note.end))
    return " ".join(part for part in (start and f"from {start}", end and f"until {end}") if part)


def _as_given(source: Source) -> str:
    parts = [source] if isinstance(source, (str, os.PathLike)) else list(source)
    return listing(os.fspath(part) for part in parts)
