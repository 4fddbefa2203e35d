"""Which number of which topic of a bag is which channel: a small TOML file.

rate = 60                # samples a second of the data set
stamps = "source"        # or "synchronised", or "received": see TopicMap

[observed]               # channel = "topic place", in the order of the columns
hand_x = "/hand/pose pose.position.x"

[controlled]
elbow = "/joint_states position[elbow]"

[units]                  # channel or pattern = text; so with [kinds], [groups], [staleness]
"hand_?" = "m"
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import inf
from os import PathLike
from typing import Any

from inphase.channels import Channel, make_channels, spread
from inphase.errors import DataError, InphaseError, OptionError, listing
from inphase.io.toml import read_toml
from inphase.runtime.adapters.message_fields import Field

STAMPS = ("source", "synchronised", "received")


@dataclass(frozen=True)
class TopicMap:
    """Channels of a data set, each from a topic and a place in its messages.

    observed, controlled: 'topic place' by channel, as in '/joint_states position[elbow]'. rate: [1/s] of the data set.
    units, kinds, groups, staleness [s]: by channel or pattern. stamps: the headers' own, each topic's clock brought to
    that of the bag ("source"); the headers', of clocks that agree already ("synchronised"); or when the messages came
    to the bag ("received"), which is also taken of topics without stamps. Raises OptionError and ChannelError.
    """

    observed: Mapping[str, str] = field(default_factory=dict)
    controlled: Mapping[str, str] = field(default_factory=dict)
    rate: float = 60.0
    stamps: str = "source"
    units: Mapping[str, str] = field(default_factory=dict)
    kinds: Mapping[str, str] = field(default_factory=dict)
    groups: Mapping[str, str] = field(default_factory=dict)
    staleness: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("observed", "controlled", "units", "kinds", "groups", "staleness"):
            _check_table(name, getattr(self, name))
        if not self.observed and not self.controlled:
            raise OptionError("expected at least one channel under [observed] or [controlled], got none")
        if isinstance(self.rate, bool) or not isinstance(self.rate, int | float) or not 0 < self.rate < inf:
            raise OptionError(f"rate: expected a number > 0 [1/s], got {self.rate!r}")
        if self.stamps not in STAMPS:
            raise OptionError(f"stamps: expected one of {listing(STAMPS)}, got {self.stamps!r}")
        for key, seconds in self.staleness.items():
            if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not 0 < seconds < inf:
                raise OptionError(f"staleness of {key!r}: expected a time > 0 [s], got {seconds!r}")
        names = [channel.name for channel in self.channels]
        stale = spread(self.staleness, names)
        if self.staleness and len(stale) < len(names):
            unsaid = listing(name for name in names if name not in stale)
            raise OptionError(f"staleness: expected one of every channel, or none at all, got none of {unsaid}")
        list(self.topics)  # every place is one

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All channels, the observed ones first."""
        return make_channels(list(self.observed), list(self.controlled), self.units, self.kinds, self.groups)

    @property
    def topics(self) -> dict[str, dict[str, Field]]:
        """By topic, the channels that it gives and where their numbers stand."""
        topics: dict[str, dict[str, Field]] = {}
        for channel, source in {**self.observed, **self.controlled}.items():
            topic, _, place = source.partition(" ")
            try:
                topics.setdefault(topic, {})[channel] = Field(place.strip())
            except OptionError:
                example = "/joint_states position[elbow]"
                raise OptionError(
                    f"{channel}: expected a topic and a place, as in {example!r}, got {source!r}"
                ) from None
        return topics


def read_topic_map(path: str | PathLike[str]) -> TopicMap:
    """The topic map in a TOML file; raises DataError that names the file and the key."""
    content = read_toml(path)
    known = [part.name for part in fields(TopicMap)]
    unknown = [key for key in content if key not in known]
    if unknown:
        raise DataError(f"{path}: unknown {listing(unknown)}; there is {listing(known)}")
    if "rate" not in content:
        raise DataError(f"{path}: expected a rate [1/s], got none")
    try:
        return TopicMap(**{key: _as_float(value) for key, value in content.items()})
    except InphaseError as error:
        raise DataError(f"{path}: {error}") from None


def _check_table(name: str, table: Any) -> None:
    if not isinstance(table, Mapping):
        raise OptionError(f"{name}: expected a table [{name}] by channel, got {table!r}")
    for key, text in table.items():
        if name != "staleness" and not isinstance(text, str):
            raise OptionError(f"{name}: expected a text for {key!r}, got {text!r}")


def _as_float(value: Any) -> Any:
    """Whole numbers as the others, in a table too."""
    if isinstance(value, Mapping):
        return {key: _as_float(entry) for key, entry in value.items()}
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
