"""How every command is told which recordings to read, and what their columns are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from inphase.channels import Kind
from inphase.cli.console import Output, counted, waiting
from inphase.filters import FILTERS
from inphase.io import load
from inphase.io.notes import NOTES, Note, notes_for
from inphase.trajectory import Dataset

Recordings = Annotated[
    tuple[str, ...],
    tyro.conf.Positional,
    tyro.conf.arg(metavar="PATH...", help_behavior_hint="(required)"),
]
AsJson = Annotated[bool, tyro.conf.arg(name="json", help_behavior_hint="")]
# What there is to choose from stands where others say `STR`: the help is never older than the library.
FilterName = Annotated[str, tyro.conf.arg(metavar="|".join(FILTERS))]
Patterns = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...", help_behavior_hint="")]


@dataclass(frozen=True)
class Format:
    """How recordings are written."""

    time: str = "time"
    """the column of times [s]"""
    delimiter: Annotated[str, tyro.conf.arg(metavar="CHAR")] = ","
    """what stands between the columns of a CSV file; tab for a tabulator"""

    ignore_notes: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False
    """take recordings as they are, whatever inphase-notes.json beside them says is left out or cut"""

    @property
    def separator(self) -> str:
        """The delimiter as a character."""
        return "\t" if self.delimiter in ("tab", "\\t") else self.delimiter


@dataclass(frozen=True)
class Columns(Format):
    """What the columns of recordings are."""

    observed: Patterns = ()
    """channels of the partner that is observed: names or patterns ('taker_?')"""
    controlled: Patterns = ()
    """channels of the partner that is controlled, the robot"""
    angle: Patterns = ()
    """channels that are angles [rad] and may jump by a full turn"""
    quaternion: Patterns = ()
    """channels that are parts x, y, z, w of a quaternion; those named ..qx to ..qw are found without"""
    linear: Patterns = ()
    """channels that are plain numbers although they are named like a quaternion"""
    trim: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False
    """cut off the idle start and end of every episode"""

    @property
    def kinds(self) -> dict[str, str]:
        """Pattern → kind, as `inphase.load` takes it."""
        named = ((self.angle, Kind.ANGLE), (self.quaternion, Kind.QUATERNION), (self.linear, Kind.LINEAR))
        return {pattern: kind.value for patterns, kind in named for pattern in patterns}

    def load(self, source: Sequence[str]) -> Dataset:
        """The data set of these files, folders or globs; raises DataError and ChannelError."""
        with waiting("reading recordings"):
            dataset = load(
                source,
                self.observed,
                self.controlled,
                time=self.time,
                delimiter=self.separator,
                kinds=self.kinds,
                trim=self.trim,
                notes=not self.ignore_notes,
            )
        decided = [f"{what} {dataset.provenance[what]}" for what in ("left out", "cut") if what in dataset.provenance]
        if decided:
            _tell(decided)
        return dataset


def noted(paths: Sequence[Path], format: Format) -> list[Note]:
    """What the notes beside them say of these files, which is told; raises DataError for notes that cannot be used."""
    if format.ignore_notes:
        return [Note()] * len(paths)
    notes = notes_for(paths)
    counts = {"left out": sum(not n.use for n in notes), "cut": sum(n.use and n.cuts for n in notes)}
    if any(counts.values()):
        _tell(f"{what} {counted(count, 'episode')}" for what, count in counts.items() if count)
    return notes


def _tell(decided: Iterable[str]) -> None:
    # On standard error: what is printed may be read by a machine.
    said = "; ".join(decided)
    Output(stderr=True).print(f"as {NOTES} says: {said} (--ignore-notes: take all as recorded)", style="dim")
