"""How long something takes, for hours, in a memory that does not grow."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log

import numpy as np

SHORTEST, LONGEST = 1e-6, 100.0  # [s] what is shorter or longer counts as this, but for the maximum
WIDTH = 0.02  # of a bin, as a share of the time it stands for
BINS = int(log(LONGEST / SHORTEST) / WIDTH) + 2


@dataclass(frozen=True)
class Spread:
    """How long something took [s]: half of the times at most p50, 99 of 100 at most p99; to about one percent."""

    count: int
    p50: float
    p99: float
    max: float


class Timing:
    """Counts durations in bins that are 2 % wide."""

    def __init__(self) -> None:
        self._counts = [0] * BINS
        self.max = 0.0

    def add(self, seconds: float) -> None:
        """One more."""
        self._counts[int(log(min(max(seconds, SHORTEST), LONGEST) / SHORTEST) / WIDTH)] += 1
        if seconds > self.max:
            self.max = seconds

    @property
    def spread(self) -> Spread:
        """What was found so far; zeros where that is nothing."""
        sums = np.cumsum(self._counts)
        count = int(sums[-1])
        if not count:
            return Spread(0, 0.0, 0.0, 0.0)
        p50, p99 = (self._middle(int(np.searchsorted(sums, share * count))) for share in (0.50, 0.99))
        return Spread(count, p50, p99, self.max)

    def _middle(self, bin: int) -> float:
        return min(SHORTEST * exp((bin + 0.5) * WIDTH), self.max)
