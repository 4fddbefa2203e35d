"""How long a call takes, and how much memory it asks for meanwhile."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Sequence

import numpy as np


def duration(call: Callable[[], object]) -> float:
    """The time of one call [s]."""
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun


def durations(call: Callable[[int], object], repeats: int) -> list[float]:
    """The time of every call [s]; it is told which one it is."""
    return [duration(lambda i=i: call(i)) for i in range(repeats)]


def work(call: Callable[[], object], times: int = 1) -> float:
    """The processor time of one call [s], the mean of so many: what else the machine does meanwhile is not in it."""
    begun = time.thread_time()
    for _ in range(times):
        call()
    return (time.thread_time() - begun) / times


def spread(taken: Sequence[float]) -> dict[str, float]:
    """Median, 99th percentile and maximum [µs] of times [s]."""
    micro = 1e6 * np.asarray(taken)
    return {"median": float(np.median(micro)), "p99": float(np.quantile(micro, 0.99)), "max": float(micro.max())}


def peak(call: Callable[[], object]) -> int:
    """The most memory [bytes] that a call held at once beyond what was held before it; tracemalloc has to trace."""
    before, _ = tracemalloc.get_traced_memory()
    tracemalloc.reset_peak()
    call()
    return tracemalloc.get_traced_memory()[1] - before


def tiny_calls() -> Sequence[Callable[[], object]]:
    """A mix of numpy calls on so few numbers that all of their time is that of calling numpy."""
    rng = np.random.default_rng(0)
    some, others = rng.standard_normal((2, 100))
    row, column = rng.standard_normal((1, 8)), rng.standard_normal((8, 1))
    return (
        lambda: some + others,
        lambda: some * others,
        lambda: np.exp(some),
        lambda: row @ column,
        lambda: some.sum(),
    )


def numpy_call(calls: Sequence[Callable[[], object]]) -> float:
    """The processor time of one tiny numpy call [s]: the mean of a mix."""

    def mix() -> None:
        for call in calls:
            call()

    return work(mix, times=10) / len(calls)
