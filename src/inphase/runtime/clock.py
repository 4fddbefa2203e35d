"""The one clock of a live interaction: that of the system, or one that only moves when it is told."""

from __future__ import annotations

import heapq
import itertools
import time
from collections.abc import Callable
from typing import Protocol, runtime_checkable

from inphase.errors import OptionError

SPIN = 0.0005  # [s] what sleeping may oversleep: the last stretch of a wait is watched instead


@runtime_checkable
class Clock(Protocol):
    """Seconds that never run backwards; where they begin means nothing."""

    def now(self) -> float:
        """The time [s]."""
        ...

    def wait_until(self, time: float) -> None:
        """Return at that time [s]; at once where it has passed."""
        ...


class SystemClock:
    """The clock of this machine."""

    def now(self) -> float:
        """The time [s]."""
        return time.perf_counter()

    def wait_until(self, time: float) -> None:
        """Sleep to shortly before that time [s] and watch the clock from there."""
        _sleep_until(time - SPIN)
        while self.now() < time:
            pass


def _sleep_until(end: float) -> None:
    while (left := end - time.perf_counter()) > 0:
        time.sleep(left)


class FakeClock:
    """A clock for tests: it moves only when it is told or waited on, and calls back at the times it passes."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start
        self._calls: list[tuple[float, int, Callable[[], object]]] = []
        self._order = itertools.count()

    def now(self) -> float:
        """The time [s]."""
        return self._now

    def at(self, time: float, call: Callable[[], object]) -> None:
        """Have `call` called once when the clock comes to that time [s]; calls of one time keep their order.

        Raises OptionError for a time that has passed.
        """
        if not time >= self._now:
            raise OptionError(f"expected a time of at least {self._now:g} s, got {time:g} s")
        heapq.heappush(self._calls, (time, next(self._order), call))

    def wait_until(self, time: float) -> None:
        """Move to that time [s], through all calls on the way; nowhere where it has passed."""
        while self._calls and self._calls[0][0] <= time:
            self._now, _, call = heapq.heappop(self._calls)
            call()
        self._now = max(self._now, time)

    def advance(self, seconds: float) -> None:
        """Move on by so many seconds; raises OptionError for a negative number."""
        if not seconds >= 0:
            raise OptionError(f"expected seconds >= 0, got {seconds:g}")
        self.wait_until(self._now + seconds)
