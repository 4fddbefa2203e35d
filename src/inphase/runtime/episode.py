"""One recorded demonstration: made of what every sensor gave, written under the next number, and looked over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np
from jaxtyping import Float

from inphase.arrays import frozen
from inphase.channels import Channel
from inphase.errors import DataError, listing
from inphase.io.csv import write_csv
from inphase.io.files import SUFFIXES
from inphase.io.notes import read_notes, write_notes
from inphase.preprocess.checks import EVERY_EPISODE, Finding, check_episode, check_episodes
from inphase.runtime.combine import SensorRecording, combine_counted
from inphase.runtime.track import Fate
from inphase.trajectory import Demonstration


@dataclass(frozen=True)
class SensorCount:
    """What one sensor gave for an episode: samples, how many a second, and what was dropped of them and why."""

    samples: int
    rate: float
    dropped: Mapping[Fate, int]


@dataclass(frozen=True, eq=False)
class Episode:
    """An episode that is in its file.

    times: (T,) [s] from 0. values: (T, D) in the order of the channels, NaN where not seen. sensors: by name. gaps: by
    channel, the longest time [s] in which it was not seen. findings: what is worth a look, also beside those before.
    """

    path: Path
    times: Float[np.ndarray, " T"]
    values: Float[np.ndarray, "T D"]
    sensors: Mapping[str, SensorCount]
    gaps: Mapping[str, float]
    findings: tuple[Finding, ...]

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.times[-1])


def joined(
    recordings: Mapping[str, SensorRecording],
    channels: Sequence[Channel],
    rate: float,
    staleness: float | Mapping[str, float] | None,
) -> tuple[Demonstration, dict[str, SensorCount]]:
    """What the sensors gave as one demonstration, and what was taken of them.

    Its columns are in the order of the channels, its times from 0 s. Raises DataError where that is too little, as
    `combine`.
    """
    together, fates = combine_counted(recordings, rate, channels, staleness=staleness, name="the episode")
    names = [signal.name for recording in recordings.values() for signal in recording.signals]
    values = together.values[:, [names.index(channel.name) for channel in channels]]
    if len(values) < 3:
        raise DataError(f"the episode: expected at least 3 samples at {rate:g} a second, got {len(values)}")
    if unseen := [c.name for c, column in zip(channels, values.T, strict=True) if np.isnan(column).all()]:
        raise DataError(f"the episode: nothing was read of {listing(unseen)}")
    counts = {
        name: SensorCount(
            len(r.stamps), _rate(r.times), {fate: number for fate, number in fates[name].items() if fate.dropped}
        )
        for name, r in recordings.items()
    }
    return Demonstration(np.arange(len(values)) / rate, values, "the episode"), counts


def write_next(folder: Path, demonstration: Demonstration, channels: Sequence[Channel]) -> Path:
    """Write it under the first number after all that are there: whole or not at all, and over no other.

    Raises OptionError and OSError where it cannot be written.
    """
    for number in count(next_number(folder)):
        path = folder / f"{number:03d}.csv"
        try:
            write_csv(path, [channel.name for channel in channels], demonstration.times, demonstration.values, new=True)
        except FileExistsError:  # someone else records here too
            continue
        return path
    raise AssertionError("numbers do not end")


def next_number(folder: Path) -> int:
    """One more than the largest number that is the name of an episode there."""
    try:
        stems = [path.stem for path in folder.iterdir() if path.suffix.lower() in SUFFIXES]
    except OSError as error:
        raise DataError(f"{folder}: cannot be read: {error.strerror}") from None
    return 1 + max((int(stem) for stem in stems if stem.isascii() and stem.isdigit()), default=0)


def delete(path: Path) -> None:
    """Delete an episode, and what the notes beside it say of it: the next of that name is another."""
    notes = read_notes(path.parent)
    path.unlink(missing_ok=True)
    if notes.pop(path.stem, None) is not None:
        write_notes(path.parent, notes)


def described(
    path: Path,
    demonstration: Demonstration,
    counts: Mapping[str, SensorCount],
    channels: Sequence[Channel],
    before: Sequence[Episode],
) -> Episode:
    """What there is to say of an episode, beside those before it."""
    episode = path.stem, demonstration.times, demonstration.values
    across = check_episodes([*((e.path.stem, e.times, e.values) for e in before), episode], channels)
    known = {(finding.channel, finding.kind) for finding in across if finding.episode == EVERY_EPISODE}
    alone = [finding for finding in check_episode(*episode, channels) if (finding.channel, finding.kind) not in known]
    gaps = {c.name: _gap(demonstration, column) for column, c in enumerate(channels)}
    return Episode(
        path,
        demonstration.times,
        demonstration.values,
        counts,
        {name: gap for name, gap in gaps.items() if gap > 0},
        (*alone, *(finding for finding in across if finding.episode in (path.stem, EVERY_EPISODE))),
    )


def _rate(times: Float[np.ndarray, " T"]) -> float:
    """Samples a second; 0 where there are too few to tell."""
    length = float(np.ptp(times))
    return (len(times) - 1) / length if length > 0 else 0.0


def _gap(demonstration: Demonstration, column: int) -> float:
    """The longest time between two samples that were seen, beyond the usual step; the ends count [s]."""
    times, seen = demonstration.times, ~np.isnan(demonstration.values[:, column])
    if seen.all():
        return 0.0
    step = float(times[1] - times[0])
    edges = np.concatenate([[times[0] - step], times[seen], [times[-1] + step]])
    return float(frozen(np.diff(edges)).max()) - step
