"""Bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap) as demonstrations, or as a sensor that plays them. Needs no ROS.

A topic map says which number of which topic is which channel (see `topic_map`); `list_bag` says what there is to map.
Topics of any rate and clock are brought together as sensors are live (see `inphase.runtime.synchronise`).
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from inphase.channels import spread
from inphase.errors import DataError, InphaseError, listing
from inphase.runtime.adapters.bag_listing import BagListing, BagTopic, list_bag
from inphase.runtime.adapters.bag_messages import Bag
from inphase.runtime.adapters.message_fields import Field, fields_of, stamp_of
from inphase.runtime.adapters.topic_map import TopicMap, read_topic_map
from inphase.runtime.combine import SensorRecording, combine
from inphase.runtime.device import Signal
from inphase.runtime.devices.replay_sensor import ReplaySensor
from inphase.trajectory import Dataset, Demonstration

__all__ = [
    "BagListing",
    "BagTopic",
    "LeftOut",
    "TopicMap",
    "bag_sensor",
    "list_bag",
    "read_bag",
    "read_bags",
    "read_topic_map",
]


LONGEST = 400  # letters of a reason


@dataclass(frozen=True)
class LeftOut:
    """Something of a bag that is not in the data set, and why: a topic, a channel, or '' for the rest of the bag."""

    bag: str
    what: str
    why: str

    def __str__(self) -> str:
        return f"{self.bag}: {self.what}: {self.why}" if self.what else f"{self.bag}: {self.why}"


def read_bags(paths: Sequence[str | Path], topic_map: TopicMap) -> tuple[Dataset, list[LeftOut]]:
    """A data set of one demonstration a bag, and all that was left out; a bag that gives none is left out whole.

    Raises DataError where no bag gives one, and as `Bag`.
    """
    demonstrations, left_out = list[Demonstration](), list[LeftOut]()
    for path in paths:
        try:
            demonstration, left = read_bag(path, topic_map)
        except DataError as error:
            left_out.append(LeftOut(str(path), "", str(error)))
        else:
            demonstrations.append(demonstration)
            left_out += left
    if not demonstrations:
        raise DataError(str(left_out[0]) if left_out else "expected at least one bag, got none")
    provenance = {"source": listing(paths), "episodes": str(len(demonstrations))}
    return Dataset(topic_map.channels, tuple(demonstrations), provenance), left_out


def read_bag(path: str | Path, topic_map: TopicMap) -> tuple[Demonstration, list[LeftOut]]:
    """One bag as a demonstration of the map's channels, and all that was left out of it.

    Times [s] begin with the first message of the map. A channel that was never seen is NaN throughout. Raises DataError
    where no mapped topic gives a number, or topics do not overlap in time, and as `Bag`.
    """
    bag = Bag(path, topic_map.topics)
    rows = {topic: _Rows(places) for topic, places in topic_map.topics.items()}
    begin: int | None = None
    for connection, time, message in bag.messages():
        begin = time if begin is None else begin
        rows[connection.topic].add(message, time, begin)
    missing = _missing(bag, rows, topic_map.stamps)
    units = spread(topic_map.units, [channel.name for channel in topic_map.channels])
    recordings = {topic: row.recording(units, topic_map.stamps) for topic, row in rows.items() if row.seen.any()}
    if not recordings:
        reasons = "; ".join(f"{what or 'the rest'}: {why}" for what, why in missing.items())
        raise DataError(f"{path}: expected numbers on a topic of the map, got none: {reasons}")
    demonstration = _together(recordings, topic_map, Path(path).stem)
    unmapped = {c.topic: f"not in the map ({c.type})" for c in bag.connections if c.topic not in rows}
    return demonstration, [LeftOut(str(path), what, why) for what, why in {**missing, **unmapped}.items()]


def bag_sensor(
    file: Path, map: Path, name: str = "bag", only: tuple[str, ...] | None = None, speed: float = 1.0
) -> ReplaySensor:
    """A sensor that plays a bag as a topic map says, `speed` times as fast.

    map: the file of the map. only: names or patterns of the channels that it offers; the observed ones unless told.
    Raises as `read_topic_map`, `read_bag` and `ReplaySensor`.
    """
    topic_map = read_topic_map(map)
    demonstration, _ = read_bag(file, topic_map)
    return ReplaySensor(demonstration, topic_map.channels, only=only, speed=speed, name=name)


class _Rows:
    """The numbers of one topic, message by message."""

    def __init__(self, places: Mapping[str, Field]) -> None:
        self.places, self.offered = places, list[str]()
        self.unstamped = 0
        self._values, self._received, self._stamps = array("d"), array("d"), array("d")

    def add(self, message: Any, time: int, begin: int) -> None:
        """One more message, when it came and when the recording began [ns]."""
        stamp = stamp_of(message)
        self.unstamped += stamp is None
        self.offered = self.offered or fields_of(message)
        self._values.extend([place.of(message) for place in self.places.values()])
        self._received.append((time - begin) * 1e-9)
        self._stamps.append(np.nan if stamp is None else stamp - begin * 1e-9)

    def __len__(self) -> int:
        return len(self._received)

    @property
    def values(self) -> Float[np.ndarray, "T D"]:
        """What it read."""
        return np.array(self._values).reshape(len(self), len(self.places))

    @property
    def seen(self) -> Bool[np.ndarray, " D"]:
        """Whether there ever was a number, by channel."""
        return np.asarray(np.isfinite(self.values).any(axis=0))

    def recording(self, units: Mapping[str, str], stamps: str) -> SensorRecording:
        """All of it, as of a sensor."""
        signals = tuple(Signal(channel, units.get(channel, "")) for channel in self.places)
        received = np.array(self._received)
        if stamps == "received" or self.unstamped:
            return SensorRecording(signals, received, self.values)
        return SensorRecording(signals, np.array(self._stamps), self.values, received if stamps == "source" else None)


def _together(recordings: Mapping[str, SensorRecording], topic_map: TopicMap, name: str) -> Demonstration:
    """All topics at one rate, in the order of the map's channels."""
    order = [channel.name for channel in topic_map.channels]
    names = [signal.name for recording in recordings.values() for signal in recording.signals]
    staleness = {channel: time for channel, time in spread(topic_map.staleness, order).items() if channel in names}
    channels = [channel for channel in topic_map.channels if channel.name in names]
    try:
        whole = combine(recordings, topic_map.rate, channels, staleness=staleness or None, name=name)
    except InphaseError as error:
        raise DataError(f"{name}: {str(error).removeprefix(f'{name}: ')}") from None
    values = np.full((len(whole), len(order)), np.nan)
    values[:, [order.index(channel) for channel in names]] = whole.values
    return Demonstration(whole.times, values, name)


def _missing(bag: Bag, rows: Mapping[str, _Rows], stamps: str) -> dict[str, str]:
    """What the map asks for and the bag does not give, and why."""
    there = {connection.topic for connection in bag.connections}
    missing = {} if there else {"the bag": "it holds no topic"}
    for topic, row in rows.items() if there else ():
        unseen = [channel for channel, seen in zip(row.places, row.seen, strict=True) if not seen]
        if topic not in there:
            missing[topic] = f"not in the bag, and so no {listing(unseen)}; its topics are {listing(sorted(there))}"
        elif topic in bag.problems:
            missing[topic] = bag.problems[topic]
        elif broken := bag.broken[topic]:
            missing[topic] = f"{broken} of {broken + len(row)} messages cannot be read: {bag.why[topic]}"
        elif not len(row):
            missing[topic] = "no message"
        elif 0 < row.unstamped < len(row) and stamps != "received":
            missing[topic] = f"its stamps, as {row.unstamped} of {len(row)} messages have none; taken when they came"
        for channel in unseen if len(row) else ():
            offered = listing(row.offered)
            missing[channel] = f"never a number at {row.places[channel].place} of {topic}; there are {offered}"
    told = {**missing, "": bag.damage} if bag.damage else missing
    return {what: shorten(why, LONGEST, placeholder=" …") for what, why in told.items()}  # on one line, whatever it is
