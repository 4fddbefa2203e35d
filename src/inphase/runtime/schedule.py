"""When something that happens at a steady rate is due."""

from __future__ import annotations

from math import floor, inf

from inphase.errors import OptionError

SAME = 1e-9  # of a period: two times that close are one


class Schedule:
    """Times `period` apart from `begin` on [s]; a time that has passed is still due, but several are one.

    Times are counted from the beginning, so that a cycle that comes late does not move those after it. Raises
    OptionError for a rate that is not positive.
    """

    def __init__(self, rate: float, begin: float) -> None:
        if not 0 < rate < inf:
            raise OptionError(f"expected a rate > 0 [1/s], got {rate}")
        self.period = 1.0 / rate
        self._begin, self._count = begin, 0

    @property
    def due(self) -> float:
        """When it is due next [s]."""
        return self._begin + self._count * self.period

    def is_due(self, now: float) -> bool:
        """Whether that time has come [s]."""
        return now >= self.due - SAME * self.period

    def done(self, now: float) -> int:
        """Done, once for all whose time has passed: go on to the next; how many were left out."""
        passed = max(floor((now - self._begin) / self.period + SAME), self._count)
        left_out, self._count = passed - self._count, passed + 1
        return left_out
