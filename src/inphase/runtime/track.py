"""The recent samples of one sensor, in the order they were read, and what its channels read in between."""

from __future__ import annotations

import enum
from bisect import bisect_left, bisect_right, insort
from collections import Counter
from collections.abc import Iterable, Sequence
from math import inf

import numpy as np
from jaxtyping import Float

from inphase.arrays import BoolArray, FloatArray
from inphase.channels import Channel, Kind, Role, quaternions
from inphase.errors import ObservationError, OptionError
from inphase.runtime.device import Sample, Signal
from inphase.runtime.source_clock import WINDOW, SourceClock

JUMP = 1.0  # [s] ahead of its receipt, which no delay explains
JUMP_LASTS = 0.5  # [s] of nothing but stamps out of place, and the device's clock was set or began anew


class Fate(str, enum.Enum):
    """What became of a sample; the values are the sentence to say."""

    TAKEN = "came in order"
    REORDERED = "came after one that was read later, and was put in its place"
    DUPLICATED = "dropped: came before, or adds nothing to one of the same stamp"
    LATE = "dropped: older than all that is kept"
    AHEAD = "dropped: stamped in the future"
    EMPTY = "dropped: nothing was read"
    BROKEN = "dropped: a stamp that is not finite"
    RESTARTED = "the device's clock was set: begun anew with it, and all before forgotten"

    @property
    def dropped(self) -> bool:
        """Whether the sample was left out."""
        return self in (Fate.DUPLICATED, Fate.LATE, Fate.AHEAD, Fate.EMPTY, Fate.BROKEN)


class Track:
    """One sensor's samples of the last `history` [s], by stamp, with the clock that made the stamps.

    staleness: (D,) [s] how long a reading holds, and how far apart two may lie to be interpolated. channels: those of
    the model; an angle is interpolated the shorter way round, a quaternion on its sphere. Raises OptionError for a
    staleness that is not positive and finite, or a quaternion of which the sensor has a part only.
    """

    def __init__(
        self,
        name: str,
        signals: Sequence[Signal],
        staleness: Float[np.ndarray, " D"],
        channels: Sequence[Channel] = (),
        *,
        shared_clock: bool = False,
        history: float = 1.0,
        window: float = WINDOW,
    ) -> None:
        for signal, value in zip(signals, staleness, strict=True):
            if not 0 < value < inf:
                raise OptionError(f"staleness of {signal.name!r}: expected a positive, finite time [s], got {value:g}")
        self.name = name
        self.clock = SourceClock(shared_clock, window)
        self.counts: Counter[Fate] = Counter()
        self._staleness = staleness
        self._reach = float(staleness.max(initial=0.0))
        self._kept = history + self._reach
        self._shared, self._window = shared_clock, window
        self._angles, self._quaternions = _kinds(name, signals, channels)
        self._stamps: list[float] = []
        self._rows: list[FloatArray] = []
        self._fresh: list[tuple[float, BoolArray]] = []  # by stamp, which readings nobody has fetched
        self.unfetched = 0  # and how many never will be: they are older than all that is kept
        self._seen = np.full(len(signals), -inf)
        self._odd_since: float | None = None
        self._said = (inf, -inf)  # the stamps of the first and the last sample, of those in which nothing was read, too

    def take(self, sample: Sample) -> Fate:
        """Put one sample in its place; raises ObservationError for one of another number of values."""
        if len(sample.values) != len(self._seen):
            raise ObservationError(f"{self.name}: expected {len(self._seen)} values, got {len(sample.values)}")
        fate = self._place(sample)
        self.counts[fate] += 1
        return fate

    def __len__(self) -> int:
        return len(self._seen)

    def at(self, time: float) -> Float[np.ndarray, " D"]:
        """What the channels read at that time of the loop [s]; NaN where that is not known."""
        return self._read_at(self.clock.stamp_at(time))

    def since(self, stamp: float, time: float) -> Float[np.ndarray, " D"]:
        """What the channels read at that time of the loop [s], which is no earlier than that stamp."""
        place = bisect_left(self._stamps, stamp)
        if place < len(self._stamps) and self._stamps[place] == stamp and self.clock.time_of(stamp) == time:
            row = self._rows[place]
            if not np.isnan(row).any():  # all was read just then: there is nothing to interpolate
                return row.copy()
        return self._read_at(max(self.clock.stamp_at(time), stamp))  # forth and back a time is off by its last bit

    def _read_at(self, stamp: float) -> Float[np.ndarray, " D"]:
        here = bisect_right(self._stamps, stamp)
        before, since = self._nearest(range(here - 1, -1, -1), stamp)
        after, until = self._nearest(range(here, len(self._stamps)), stamp)
        values = np.where(stamp - since <= self._staleness, before, np.nan)
        between = until - since <= self._staleness  # both are there, and near enough
        if between.any():
            share = (stamp - since[between]) / (until - since)[between]
            way = after - before
            way[self._angles] -= 2 * np.pi * np.round(way[self._angles] / (2 * np.pi))
            for parts in self._quaternions:
                if before[parts] @ after[parts] < 0:  # the same turn, written with the other sign
                    way[parts] = -after[parts] - before[parts]
            values[between] = before[between] + share * way[between]
            for parts in self._quaternions:
                values[parts] *= np.linalg.norm(before[parts]) / max(
                    np.linalg.norm(values[parts]), np.finfo(float).tiny
                )
        return values

    def ages(self, time: float) -> Float[np.ndarray, " D"]:
        """(D,) how long ago each channel was last read, at that time of the loop [s]; infinite where never."""
        return np.asarray(np.maximum(self.clock.stamp_at(time) - self._seen, 0.0))

    def fetch(self, until: float) -> list[tuple[float, float, BoolArray]]:
        """What was read up to that time [s] and not fetched before: when, by which stamp, and (D,) which channels."""
        fresh = [(self.clock.time_of(stamp), stamp, seen) for stamp, seen in self._fresh]
        self._fresh = [(stamp, seen) for time, stamp, seen in fresh if time > until]
        return [entry for entry in fresh if entry[0] <= until]

    @property
    def stamps(self) -> Sequence[float]:
        """Of the samples kept, increasing [s]."""
        return self._stamps

    @property
    def said(self) -> tuple[float, float]:
        """The stamps [s] of the first and the last sample of the time that is kept, also of one that saw nothing."""
        begin, end = self._said
        return max(begin, min(self._stamps[0], end - self._kept)), end

    def _place(self, sample: Sample) -> Fate:
        stamp, received = float(sample.stamp), float(sample.received)
        if not (np.isfinite(stamp) and np.isfinite(received)):
            return Fate.BROKEN
        odd, restarted = self._out_of_place(stamp, received), False
        if odd is None:
            self._odd_since = None
        else:
            self._odd_since = received if self._odd_since is None else self._odd_since
            if received - self._odd_since < JUMP_LASTS:
                return odd
            self._restart()
            restarted = True
        self.clock.add(stamp, received)
        self._said = min(self._said[0], stamp), max(self._said[1], stamp)
        values = np.where(np.isfinite(sample.values), sample.values, np.nan)
        for parts in self._quaternions:
            if np.isnan(values[parts]).any():
                values[parts] = np.nan
        fate = Fate.EMPTY if np.isnan(values).all() else self._insert(stamp, values)
        return Fate.RESTARTED if restarted else fate

    def _out_of_place(self, stamp: float, received: float) -> Fate | None:
        if not self._stamps:
            return None
        if stamp < self._stamps[-1] - self._kept:
            return Fate.LATE
        return Fate.AHEAD if self.clock.time_of(stamp) > received + JUMP else None

    def _restart(self) -> None:
        self.clock = SourceClock(self._shared, self._window)
        self._stamps, self._rows, self._fresh, self._odd_since = [], [], [], None
        self._seen[:] = -inf
        self._said = inf, -inf

    def _insert(self, stamp: float, values: FloatArray) -> Fate:
        place = bisect_left(self._stamps, stamp)
        last = place == len(self._stamps)
        if not last and self._stamps[place] == stamp:
            row = self._rows[place]
            added = np.isnan(row) & ~np.isnan(values)
            if not added.any():
                return Fate.DUPLICATED
            row[added] = values[added]
            self._fresh.append((stamp, added))
        else:
            insort(self._stamps, stamp)
            self._rows.insert(place, values)
            self._fresh.append((stamp, ~np.isnan(values)))
        seen = ~np.isnan(values)
        self._seen[seen] = np.maximum(self._seen[seen], stamp)
        gone = bisect_left(self._stamps, self._stamps[-1] - self._kept)
        del self._stamps[:gone], self._rows[:gone]
        if gone:
            kept = [entry for entry in self._fresh if entry[0] >= self._stamps[0]]
            self.unfetched += len(self._fresh) - len(kept)
            self._fresh = kept
        return Fate.TAKEN if last else Fate.REORDERED

    def _nearest(self, places: Iterable[int], stamp: float) -> tuple[FloatArray, FloatArray]:
        """(D,) the first reading of every channel along these places, and its stamp; NaN where there is none."""
        values, stamps = np.full((2, len(self._seen)), np.nan)
        for place in places:
            if abs(self._stamps[place] - stamp) > self._reach:
                break
            row = self._rows[place]
            new = np.isnan(values) & ~np.isnan(row)
            values[new], stamps[new] = row[new], self._stamps[place]
            if not np.isnan(values).any():
                break
        return values, stamps


def _kinds(name: str, signals: Sequence[Signal], channels: Sequence[Channel]) -> tuple[list[int], list[list[int]]]:
    """The columns of angles, and those of every quaternion."""
    columns = {signal.name: i for i, signal in enumerate(signals)}
    angles = [columns[c.name] for c in channels if c.kind is Kind.ANGLE and c.name in columns]
    turns = []
    for role in Role:
        owned = [c for c in channels if c.role is role]
        for parts in quaternions(owned):
            inside = [columns[owned[i].name] for i in parts if owned[i].name in columns]
            if 0 < len(inside) < len(parts):
                raise OptionError(
                    f"{name}: expected all four channels of quaternion {owned[parts[0]].group!r} from one sensor"
                )
            if inside:
                turns.append(inside)
    return angles, turns
