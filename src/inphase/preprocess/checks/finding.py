"""What a check has to say: a `Finding` names episode, channel and time of one fault."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass


class FindingKind(str, enum.Enum):
    """What is wrong; the value is the short name to show."""

    UNREADABLE = "unreadable"  # the file, for those who read it
    TOO_SHORT = "too-short"
    BACKWARDS = "backwards"
    INFINITE = "infinite"
    SHORT = "short"
    GAP = "gap"
    CLOCK = "clock"
    LENGTH = "length"
    NOT_A_NUMBER = "not-a-number"
    CONSTANT = "constant"
    FROZEN = "frozen"
    JUMP = "jump"
    BRANCH = "branch"
    SIGN_FLIP = "sign-flip"
    NORM = "norm"
    UNIT = "unit"

    @property
    def severity(self) -> str:
        """`error` where the episode cannot be used as it is, `warning` where it can be and a look is worth while."""
        errors = (FindingKind.UNREADABLE, FindingKind.TOO_SHORT, FindingKind.BACKWARDS, FindingKind.INFINITE)
        return "error" if self in errors else "warning"


@dataclass(frozen=True)
class Finding:
    """One fault of a recording; many of one kind in one channel are one finding, with the first time and a count.

    episode: its name, or EVERY_EPISODE. channel: a channel, the group of a quaternion or of channels of one unit, or
    None where all are concerned. time: [s], in the clock of the episode, None where the whole of it is
    concerned or the clock did not know.
    """

    episode: str
    channel: str | None
    time: float | None
    kind: FindingKind
    message: str

    def __post_init__(self) -> None:
        if self.time is not None and not math.isfinite(self.time):
            object.__setattr__(self, "time", None)

    @property
    def severity(self) -> str:
        """`error` or `warning`, by its kind."""
        return self.kind.severity


EVERY_EPISODE = "every episode"


def times_over(count: int) -> str:
    """'once', 'twice', '7 times'."""
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def clock(time: float) -> str:
    """A time to read, '1.25 s': to a tenth of a millisecond, also where the clock counts from 1970."""
    return f"{round(float(time), 4):.15g} s"
