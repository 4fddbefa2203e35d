"""Numbers by their place in a message, whoever read it: `position[elbow]`, `pose.position.x`, `points[0].time`."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from inphase.errors import OptionError

STEP = re.compile(r"\.?(?P<part>[A-Za-z_]\w*)|\[(?P<key>[^\[\]]+)\]")
PLACE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*|\[[^\[\]]+\])*")
NUMBER, LIST = (int, float, np.number, np.bool_), (list, tuple, np.ndarray, bytes)  # rospy's uint8[] are bytes
NAMES = ("name", "joint_names")  # the part of a message that names the entries of its other lists
LONGEST, MOST = 256, 1024  # entries of a list that are told one by one, and of a message


@dataclass(frozen=True)
class Field:
    """Where a number stands in a message: attributes after dots, and entries of lists by their number or their name.

    A time or a duration is a number too [s]. Raises OptionError for a text that is no such place.
    """

    place: str
    _steps: tuple[tuple[str | None, str | None], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not PLACE.fullmatch(self.place):
            examples = "position[elbow], pose.position.x or data[3]"
            raise OptionError(f"expected a place in a message, such as {examples}, got {self.place!r}")
        steps = tuple((match["part"], match["key"]) for match in STEP.finditer(self.place))
        object.__setattr__(self, "_steps", steps)

    def of(self, message: Any) -> float:
        """The number; NaN where the message has none there."""
        value, around = message, [message]
        for part, key in self._steps:
            value = getattr(value, part, None) if part else _entry(value, key or "", around)
            around.append(value)
        seconds = _seconds(value)
        if seconds is not None:
            return seconds
        return float(value) if isinstance(value, NUMBER) else math.nan


def stamp_of(message: Any) -> float | None:
    """When a message was made, by its header [s]; None where it has none, or one that was never set."""
    return _seconds(getattr(getattr(message, "header", None), "stamp", None)) or None


def fields_of(message: Any) -> list[str]:
    """The places of the numbers in a message but those of its header, in its order; of long ones the first."""
    return list(islice(_inside(message, "", []), MOST))


def _inside(part: Any, path: str, around: list[Any]) -> Iterator[str]:
    for name in _parts(part):
        if path or name != "header":
            yield from _places(getattr(part, name), f"{path}.{name}" if path else name, [*around, part])


def _places(value: Any, path: str, around: list[Any]) -> Iterator[str]:
    if isinstance(value, NUMBER) or _seconds(value) is not None:
        yield path
    elif isinstance(value, LIST):
        names = _names(len(value), around)
        for i, entry in enumerate(value[:LONGEST]):
            key = names[i] if names and PLACE.fullmatch(f"{path}[{names[i]}]") else str(i)
            yield from _places(entry, f"{path}[{key}]", [*around, value])
    elif not isinstance(value, str):
        yield from _inside(value, path, around)


def _entry(values: Any, key: str, around: list[Any]) -> Any:
    if not isinstance(values, LIST):
        return None
    names = _names(len(values), around)
    place = names.index(key) if key in names else int(key) if key.isascii() and key.isdecimal() else len(values)
    return values[place] if place < len(values) else None


def _names(count: int, around: list[Any]) -> list[str]:
    """What so many entries are called by their message, or one around it; nothing where they have no names."""
    for part in reversed(around):
        for attribute in NAMES:
            names = getattr(part, attribute, None)  # a text is the name of the message itself
            if isinstance(names, (list, tuple)) and len(set(names)) == len(names) == count:
                return list(names)
    return []


def _seconds(stamp: Any) -> float | None:
    whole = getattr(stamp, "secs", getattr(stamp, "sec", None))  # of ROS 1, of ROS 2
    parts = getattr(stamp, "nsecs", getattr(stamp, "nanosec", None))
    return None if whole is None or parts is None else float(whole) + 1e-9 * float(parts)


def _parts(message: Any) -> list[str]:
    """The attributes of a message, in its order: rospy's have slots, those of others are dataclasses."""
    fields = getattr(message, "__dataclass_fields__", None) or getattr(type(message), "__slots__", None) or ()
    return [name for name in fields if not name.startswith("__") and name != "structure_needs_at_least_one_member"]
