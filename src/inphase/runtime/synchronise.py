"""Sensors of different rates, clocks and delays, read at one time."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from inphase.arrays import BoolArray, frozen
from inphase.channels import Channel, check_unique, spread
from inphase.errors import DataError, ObservationError, OptionError, listing
from inphase.runtime.device import Sample, Signal
from inphase.runtime.source_clock import WINDOW, SourceClock
from inphase.runtime.track import Fate, Track


class Synchroniser:
    """What all channels read at one time, from samples of sensors that do not know of each other.

    Between two readings no further apart than the staleness a channel is interpolated linearly, however the samples
    came; else, and after the newest, the last reading holds for the staleness; what is older or was never seen is NaN.
    Stamps of sensors that are not in `shared_clock` are brought to the loop's clock (see `SourceClock`).

    sensors: their signals, by name. staleness: [s], one number or by channel name or pattern. channels: those of the
    model, for what is an angle or a quaternion. history: [s] how far back it can be asked. Raises OptionError and
    ChannelError for a staleness that is missing or not positive, an unknown sensor, or a channel offered twice.
    """

    def __init__(
        self,
        sensors: Mapping[str, Sequence[Signal]],
        staleness: float | Mapping[str, float],
        channels: Sequence[Channel] = (),
        *,
        shared_clock: Collection[str] = (),
        history: float = 1.0,
        window: float = WINDOW,
    ) -> None:
        names = [signal.name for signals in sensors.values() for signal in signals]
        check_unique(names)
        stale = by_channel(staleness, names)
        if missing := [name for name in names if name not in stale]:
            raise OptionError(f"expected a staleness [s] of every channel, got none of {listing(missing)}")
        if unknown := [name for name in shared_clock if name not in sensors]:
            raise OptionError(f"no sensor is called {listing(unknown)}; the sensors are {listing(sensors)}")
        if not history >= 0:
            raise OptionError(f"expected a history of at least 0 s, got {history:g} s")
        self.names = tuple(names)
        self._tracks = {
            name: Track(
                name,
                signals,
                np.array([stale[signal.name] for signal in signals], dtype=np.float64),
                channels,
                shared_clock=name in shared_clock,
                history=history,
                window=window,
            )
            for name, signals in sensors.items()
        }

        ends = np.cumsum([0] + [len(track) for track in self._tracks.values()]).tolist()
        spans = [slice(begin, end) for begin, end in pairwise(ends)]
        self._columns = tuple(zip(self._tracks.values(), spans, strict=True))

    def take(self, sensor: str, samples: Iterable[Sample]) -> None:
        """Take in what a sensor read; raises ObservationError for an unknown sensor or a wrong number of values."""
        track = self._tracks.get(sensor)
        if track is None:
            raise ObservationError(f"no sensor is called {sensor!r}; the sensors are {listing(self._tracks)}")
        for sample in samples:
            track.take(sample)

    def at(self, time: float) -> Float[np.ndarray, " D"]:
        """(D,) what the channels, in the order of `names`, read at that time [s]; NaN where that is not known."""
        return frozen(np.concatenate([track.at(time) for track in self._tracks.values()]))

    def ages(self, time: float) -> Float[np.ndarray, " D"]:
        """(D,) how long before that time [s] each channel was last read; infinite where never."""
        return frozen(np.concatenate([track.ages(time) for track in self._tracks.values()]))

    def fetch(self, until: float, within: float = 0.0) -> list[tuple[float, Float[np.ndarray, " D"]]]:
        """What was read up to that time [s] and not fetched before: times in order, and (D,), NaN where nothing is new.

        Readings of several channels no further apart than `within` [s] are one, at the time of the newest, as long as
        no channel is in it twice: nothing is lost, and no more is told than the fastest sensor reads.
        """
        fetched = [
            _Reading(time, stamp, seen, track, columns)
            for track, columns in self._columns
            for time, stamp, seen in track.fetch(until)
        ]
        rounds: list[list[_Reading]] = []
        for reading in sorted(fetched, key=lambda reading: reading.time):
            last = rounds[-1] if rounds else []
            again = any(r.track is reading.track and (r.seen & reading.seen).any() for r in last)
            if not last or again or reading.time - last[0].time > within:
                rounds.append([reading])
            else:
                last.append(reading)
        return [(read[-1].time, self._read(read)) for read in rounds]

    def _read(self, readings: Sequence[_Reading]) -> Float[np.ndarray, " D"]:
        time = readings[-1].time
        if len(readings) == 1 and len(self._columns) == 1:
            values = readings[0].track.since(readings[0].stamp, time)
            values[~readings[0].seen] = np.nan
        else:
            values = np.full(len(self.names), np.nan)
            for r in readings:
                values[r.columns] = np.where(r.seen, r.track.since(r.stamp, time), values[r.columns])
        values.setflags(write=False)
        return values

    @property
    def counts(self) -> Mapping[str, Mapping[Fate, int]]:
        """By sensor, what became of its samples."""
        return MappingProxyType({name: MappingProxyType(dict(t.counts)) for name, t in self._tracks.items()})

    @property
    def unfetched(self) -> int:
        """How many readings had become older than all that is kept before anyone fetched them."""
        return sum(track.unfetched for track in self._tracks.values())

    @property
    def clocks(self) -> Mapping[str, SourceClock]:
        """By sensor, what is known of its clock."""
        return MappingProxyType({name: track.clock for name, track in self._tracks.items()})

    def span(self, sensor: str) -> tuple[float, float]:
        """When the first and the last sample of a sensor were taken [s], of the time that is kept.

        A sensor that says that it sees nothing yet has begun. Raises DataError where nothing was ever read.
        """
        track = self._tracks[sensor]
        if not track.stamps:
            raise DataError(f"{sensor}: expected samples, got none that could be used")
        begin, end = track.said
        first, last = track.clock.time_of(begin), track.clock.time_of(end)
        nudge = float(np.spacing(abs(first)))
        while track.clock.stamp_at(first) < begin:  # rounding: it would be before all that was read
            first, nudge = first + nudge, 2 * nudge
        return first, last


@dataclass(frozen=True)
class _Reading:
    """One sample that is new: when, (D,) which of the sensor's channels, and where they stand among all."""

    time: float
    stamp: float
    seen: BoolArray
    track: Track
    columns: slice


def by_channel(staleness: float | Mapping[str, float], names: Sequence[str]) -> dict[str, float]:
    """One number for all, or those of names and patterns; raises ChannelError for one that fits nothing."""
    if isinstance(staleness, Mapping):
        return spread(staleness, names)
    return dict.fromkeys(names, float(staleness))
