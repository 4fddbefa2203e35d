"""Numbers by their place in a message, whoever read it: `position[elbow]`, `pose.position.x`, `data[3]`."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from inphase.errors import OptionError

PLACE = re.compile(r"(?P<path>[A-Za-z_]\w*(\.[A-Za-z_]\w*)*)(\[(?P<key>[^\[\]]+)\])?")
NUMBER, LIST = (int, float, np.number), (list, tuple, np.ndarray)
NAMES = ("name", "joint_names")  # the part of a message that names the entries of its other lists
LONGEST = 256  # entries of a list that are told one by one


@dataclass(frozen=True)
class Field:
    """Where a number stands in a message: attributes with dots, then an entry of a list, by its number or its name.

    Raises OptionError for a text that is no such place.
    """

    place: str

    def __post_init__(self) -> None:
        if not PLACE.fullmatch(self.place):
            examples = "position[elbow], pose.position.x or data[3]"
            raise OptionError(f"expected a place in a message, such as {examples}, got {self.place!r}")

    def of(self, message: Any) -> float:
        """The number; NaN where the message has none there."""
        match = PLACE.fullmatch(self.place)
        assert match is not None
        value = message
        for part in match["path"].split("."):
            value = getattr(value, part, None)
        if match["key"] is not None:
            value = _entry(message, value, match["key"])
        return float(value) if isinstance(value, NUMBER) else math.nan


def _entry(message: Any, values: Any, key: str) -> Any:
    names = _names(message)
    place = names.index(key) if key in names else int(key) if key.isascii() and key.isdecimal() else None
    try:
        return None if place is None else values[place]
    except (IndexError, TypeError, KeyError):
        return None


def _names(message: Any) -> list[str]:
    return next((list(getattr(message, part)) for part in NAMES if hasattr(message, part)), [])


def stamp_of(message: Any) -> float | None:
    """When a message was made, by its header [s]; None where it has none, or one that was never set."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    seconds = getattr(stamp, "secs", getattr(stamp, "sec", None))  # of ROS 1, of ROS 2
    parts = getattr(stamp, "nsecs", getattr(stamp, "nanosec", None))
    if seconds is None or parts is None or not (seconds or parts):
        return None
    return float(seconds) + 1e-9 * float(parts)


def fields_of(message: Any) -> list[str]:
    """The places of all numbers in a message but those of its header, in its order."""
    return list(_fields(message, message, ""))


def _fields(whole: Any, part: Any, path: str) -> Iterator[str]:
    for name in _parts(part):
        value, here = getattr(part, name), f"{path}{name}"
        if isinstance(value, (bool, int, float, np.number)):
            yield here
        elif isinstance(value, (list, tuple, np.ndarray)) and all(
            isinstance(v, (int, float, np.number)) for v in value
        ):
            names = _names(whole)
            named = len(names) == len(value) and len(set(names)) == len(names)
            yield from (f"{here}[{names[i] if named else i}]" for i in range(min(len(value), LONGEST)))
        elif not isinstance(value, (str, bytes, *LIST)) and not (path == "" and name == "header"):
            yield from _fields(whole, value, f"{here}.")


def _parts(message: Any) -> list[str]:
    """The attributes of a message, in its order: rospy's have slots, those of others are dataclasses."""
    fields = getattr(message, "__dataclass_fields__", None) or getattr(type(message), "__slots__", None) or ()
    return [name for name in fields if not name.startswith("__")]
