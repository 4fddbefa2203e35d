"""What there is in a bag: its topics, how often and how regularly they speak, and where their numbers stand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from inphase.runtime.adapters.bag_messages import Bag
from inphase.runtime.adapters.message_fields import fields_of, stamp_of


@dataclass
class BagTopic:
    """One topic of a bag.

    first, last: when its first and last message came [s], since `BagListing.begin`. places: of all numbers in the first
    message. stamped: whether its header says when it was made. problem: why its messages, or some, cannot be read.
    """

    topic: str
    type: str
    count: int = 0
    first: float = float("nan")
    last: float = float("nan")
    places: tuple[str, ...] = ()
    stamped: bool = False
    problem: str = ""

    @property
    def rate(self) -> float:
        """Messages a second; NaN of one alone."""
        return (self.count - 1) / (self.last - self.first) if self.last > self.first else float("nan")


@dataclass(frozen=True)
class BagListing:
    """What there is in a bag. begin: when its first message came [s], by the bag's clock. damage: why it ends early."""

    path: str
    begin: float
    topics: tuple[BagTopic, ...]
    damage: str


def list_bag(path: str | Path) -> BagListing:
    """All topics of a bag, from one walk through it; one message of each is unpacked. Raises as `Bag`."""
    bag = Bag(path)
    topics: dict[tuple[str, str], BagTopic] = {}
    times: dict[tuple[str, str], tuple[int, int]] = {}
    for connection, time, data in bag.packed():
        key = connection.topic, connection.type
        found = topics.setdefault(key, BagTopic(*key))
        found.count += 1
        first, last = times.get(key, (time, time))
        times[key] = min(first, time), max(last, time)
        if not found.places:
            message = bag.unpack(connection, data)
            found.places, found.stamped = tuple(fields_of(message)), stamp_of(message) is not None
    for connection in bag.connections:  # those without a message too
        key = connection.topic, connection.type
        topics.setdefault(key, BagTopic(*key))
    begin = min((first for first, _ in times.values()), default=0)
    for key, found in topics.items():
        if key in times:
            found.first, found.last = ((time - begin) * 1e-9 for time in times[key])
        found.problem = bag.problems.get(found.topic, "") or bag.why.get(found.topic, "")
    listed = tuple(topics[key] for key in sorted(topics))
    return BagListing(str(path), begin * 1e-9, listed, bag.damage)
