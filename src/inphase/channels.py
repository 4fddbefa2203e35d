"""Channels: what the columns of a recording are, and how names and patterns pick them."""

from __future__ import annotations

import enum
import fnmatch
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from inphase.errors import ChannelError, listing

T = TypeVar("T")


class Role(str, enum.Enum):
    """Who a channel belongs to: the partner that is observed, or the one that is controlled."""

    OBSERVED = "observed"
    CONTROLLED = "controlled"


class Kind(str, enum.Enum):
    """How the numbers of a channel are compared: on a line, on a circle [rad], or as part of a unit quaternion."""

    LINEAR = "linear"
    ANGLE = "angle"
    QUATERNION = "quaternion"


@dataclass(frozen=True)
class Channel:
    """One column of a recording.

    `unit` is free text, shown in tables and pictures (angles are radians). Channels of one `group` are scaled
    together; without one, the group is the name less its axis: `hand` for `hand_x`, `head_q` for `head_qw`.
    Four channels that end in x, y, z, w make one quaternion when they share a group and are of that kind.
    """

    name: str
    role: Role
    unit: str = ""
    kind: Kind = Kind.LINEAR
    group: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            raise ChannelError("a channel needs a name, got ''")
        if not self.group:
            whole = re.sub("_?[xyzwXYZW]$", "", self.name) if self.kind is Kind.QUATERNION else ""
            object.__setattr__(self, "group", whole or group_of(self.name))


def kind_named(value: str) -> Kind:
    """The kind of that name; raises ChannelError for another."""
    try:
        return Kind(value)
    except ValueError:
        raise ChannelError(f"unknown kind of channel {value!r}; one of {listing(k.value for k in Kind)}") from None


def group_of(name: str) -> str:
    """The name without its axis: `hand` for `hand_x`, `head_q` for `head_qw`; other names are their own group."""
    return re.sub(r"(?<=_q)[xyzw]$|(?<=^q)[xyzw]$|_[xyz]$", "", name) or name


def make_channels(
    observed: Sequence[str],
    controlled: Sequence[str],
    units: Mapping[str, str] | None = None,
    kinds: Mapping[str, str] | None = None,
    groups: Mapping[str, str] | None = None,
) -> tuple[Channel, ...]:
    """Channels from names, observed first; the mappings go from a name or pattern to the value.

    Raises ChannelError where a name stands twice, a pattern fits nothing, or a quaternion is not whole.
    """
    names = [*observed, *controlled]
    check_unique(names)
    unit_of, kind_of, group_by_name = (spread(mapping or {}, names) for mapping in (units, kinds, groups))
    roles = [Role.OBSERVED] * len(observed) + [Role.CONTROLLED] * len(controlled)
    channels = tuple(
        Channel(
            name,
            role,
            unit=unit_of.get(name, ""),
            kind=kind_named(kind_of.get(name, Kind.LINEAR)),
            group=group_by_name.get(name, ""),
        )
        for name, role in zip(names, roles, strict=True)
    )
    quaternions(channels)
    return channels


def check_channels(channels: Sequence[Channel]) -> None:
    """Raise ChannelError for a name that stands twice, controlled before observed channels, or a broken quaternion."""
    check_unique([channel.name for channel in channels])
    roles = [channel.role for channel in channels]
    if roles != sorted(roles, key=lambda role: role is Role.CONTROLLED):
        raise ChannelError("expected the observed channels before the controlled ones")
    quaternions(channels)


def check_unique(names: Sequence[str]) -> None:
    """Raise ChannelError where a name stands twice."""
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if twice:
        raise ChannelError(f"channel names must differ, got twice: {listing(twice)}")


def match(patterns: Iterable[str], names: Sequence[str]) -> list[int]:
    """Positions in `names`, in their order, of all that fit a name or shell pattern (`*`, `?`, `[ab]`).

    Raises ChannelError for a pattern that fits nothing.
    """
    patterns = [patterns] if isinstance(patterns, str) else list(patterns)
    found: set[int] = set()
    places: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        places.setdefault(name, []).append(i)
    for pattern in patterns:
        # A name is taken literally first: a channel may really be called "force[0]".
        hits = places.get(pattern) or [i for i, name in enumerate(names) if fnmatch.fnmatchcase(name, pattern)]
        if not hits:
            raise ChannelError(f"no channel fits {pattern!r}; the channels are {listing(names)}")
        found.update(hits)
    return sorted(found)


def spread(by_pattern: Mapping[str, T], names: Sequence[str]) -> dict[str, T]:
    """A value for every name that fits a name or pattern; a later pattern overrides an earlier one."""
    return {names[i]: value for pattern, value in by_pattern.items() for i in match([pattern], names)}


def quaternions(channels: Sequence[Channel]) -> list[tuple[int, int, int, int]]:
    """Positions (x, y, z, w) of every quaternion, in the order of its first component.

    Raises ChannelError where a group of quaternion channels is not exactly x, y, z and w of one role.
    """
    groups: dict[tuple[str, Role], list[int]] = {}
    for i, channel in enumerate(channels):
        if channel.kind is Kind.QUATERNION:
            groups.setdefault((channel.group, channel.role), []).append(i)
    found = []
    for (group, _), members in groups.items():
        by_axis = {channels[i].name[-1].lower(): i for i in members}
        if len(members) != 4 or set(by_axis) != set("xyzw"):
            raise ChannelError(
                f"quaternion {group!r} must have four channels whose names end in x, y, z, w, "
                f"got {listing(channels[i].name for i in members)}"
            )
        found.append((by_axis["x"], by_axis["y"], by_axis["z"], by_axis["w"]))
    return found
