"""How an episode was sampled: its length, rate and jitter, its gaps and what was not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.preprocess.checks.clock import GAP
from inphase.trajectory import Demonstration


@dataclass(frozen=True, eq=False)
class Sampling:
    """How an episode was sampled.

    start, end: the first and the last time [s], in its own clock. rate: one by the median step [1/s]. jitter: the
    standard deviation of the steps that are no gap, as a share of the median step. longest_gap: [s] the longest time
    without a reading of a channel that is three usual steps of it or more, and of an episode that begins or ends
    without it; 0 where there is none. missing: (D,) the share of samples at which a channel was not seen.
    """

    samples: int
    start: float
    end: float
    rate: float
    jitter: float
    longest_gap: float
    missing: Float[np.ndarray, " D"]

    def __post_init__(self) -> None:
        freeze(self, missing=self.missing)

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return self.end - self.start


def sampling(demonstration: Demonstration) -> Sampling:
    """How this demonstration was sampled."""
    times, seen = demonstration.times, ~np.isnan(demonstration.values)
    steps = np.diff(times)
    median = float(np.median(steps))
    usual = steps[steps <= GAP * median]
    return Sampling(
        samples=len(times),
        start=float(times[0]),
        end=float(times[-1]),
        rate=1 / median,
        jitter=float(usual.std()) / median,
        longest_gap=max((_gap(times, column) for column in seen.T if column.any()), default=0.0),
        missing=1 - seen.mean(axis=0),
    )


def _gap(times: Float[np.ndarray, " T"], seen: Sequence[bool] | np.ndarray) -> float:
    """The longest time between readings [s], the ends of the episode counted as such; 0 if that is usual."""
    at = times[np.asarray(seen)]
    steps = np.diff(at)
    usual = float(np.median(steps)) if len(steps) else float(np.median(np.diff(times)))
    longest = max(float(step) for step in (at[0] - times[0], times[-1] - at[-1], *steps))
    return longest if longest > GAP * usual else 0.0
