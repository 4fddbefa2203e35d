"""How much memory a long session takes: as much at its end as at its start?"""

from __future__ import annotations

import gc
import tracemalloc
from pathlib import Path
from resource import getpagesize

import numpy as np

import inphase

RATE = 30  # [Hz] of the samples
STRETCH = 30  # samples that are shown without a gap, where not all of the hours are
UNSEEN_EVERY, PATTERNS = 7, 5  # every so many samples one of so many sets of channels is out of sight
TRACED = 0.05  # of the samples, the last ones, while every allocation is followed


def session_memory(session: inphase.Session, stream: np.ndarray, hours: float, most: int) -> dict[str, float]:
    """Resident memory [bytes] of a session of so many hours, after a hundredth and at its end; growth that was traced.

    stream: (T, observed) what the partner reads, again and again. most: samples are shown, in stretches over all hours.
    """
    everything = round(hours * 3600 * RATE)
    every = max(-(-everything // most), 1)  # stretch
    shown = [k for k in range(everything) if k // STRETCH % every == 0]
    early, late = len(shown) // 100, round((1 - TRACED) * len(shown))
    middle, before, traced = (late + len(shown)) // 2, 0, 0
    for i, k in enumerate(shown):
        if i == early:
            before = resident()
        if i == late:
            tracemalloc.start()
        if i == middle:
            traced = living()
        session.observe(k / RATE, sample(stream, k))
        session.respond(samples=2)
    growth = living() - traced
    tracemalloc.stop()
    return {
        "hours": hours,
        "observes": len(shown),
        "resident_before": before,
        "resident_after": resident(),
        "traced_observes": len(shown) - middle,
        "traced_growth": growth,
    }


def sample(stream: np.ndarray, k: int) -> np.ndarray:
    """What is seen in sample k: now and then not all."""
    row = stream[k % len(stream)].copy()
    if k % UNSEEN_EVERY == 0:
        row[k // UNSEEN_EVERY % PATTERNS :: PATTERNS] = np.nan
    return row


def living() -> int:
    """Bytes that were allocated since tracing began and are still held."""
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def resident() -> int:
    """Resident memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * getpagesize()
