"""How every command is told what a recording's columns are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inphase.channels import Kind
from inphase.io import load
from inphase.trajectory import Dataset


@dataclass(frozen=True)
class Columns:
    """What the columns of the recordings are."""

    observed: tuple[str, ...] = ()
    """names or patterns ('taker_?') of the channels of the partner that is observed"""
    controlled: tuple[str, ...] = ()
    """names or patterns of the channels of the partner that is controlled, the robot"""
    time: str = "time"
    """the column of times [s]"""
    delimiter: str = ","
    """what stands between columns; 'tab' for a tabulator"""
    angle: tuple[str, ...] = ()
    """names or patterns of channels that are angles [rad] and may jump by a full turn"""
    quaternion: tuple[str, ...] = ()
    """… that are parts x, y, z, w of a quaternion (those named …qx to …qw are found by themselves)"""
    linear: tuple[str, ...] = ()
    """… that are plain numbers although they are named like a quaternion"""
    trim: bool = False
    """cut off the idle start and end of every episode"""

    @property
    def kinds(self) -> dict[str, str]:
        """Pattern → kind, as `inphase.load` takes it."""
        named = ((self.angle, Kind.ANGLE), (self.quaternion, Kind.QUATERNION), (self.linear, Kind.LINEAR))
        return {pattern: kind.value for patterns, kind in named for pattern in patterns}

    @property
    def separator(self) -> str:
        """The delimiter as a character."""
        return "\t" if self.delimiter in ("tab", "\\t") else self.delimiter

    def load(self, source: str | Sequence[str]) -> Dataset:
        """The data set of these files, folders or globs; raises DataError and ChannelError."""
        return load(
            source,
            self.observed,
            self.controlled,
            time=self.time,
            delimiter=self.separator,
            kinds=self.kinds,
            trim=self.trim,
        )
