"""When a channel is informative: a window of the phase, outside of which it is not used for inference (3.2.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from inphase.errors import OptionError


def check_windows(active: Float[np.ndarray, "F 2"], names: Sequence[str], periodic: bool) -> None:
    """Raise OptionError unless every feature, by its name, has a window (from, until) inside 0 … 1.

    Only a periodic phase goes on from 1 at 0: there a window may end before it begins.
    """
    if active.shape != (len(names), 2):
        raise OptionError(
            f"active: expected a window (from, until) of each of {len(names)} features, got {active.shape}"
        )
    start, end = active.T
    inside = (start >= 0) & (start <= 1) & (end >= 0) & (end <= 1)  # NaN is not
    wrong = np.flatnonzero(~inside | ((start > end) & (not periodic)))
    if len(wrong):
        first, order = int(wrong[0]), "" if periodic else ", from <= until"
        got = tuple(active[first].tolist())
        raise OptionError(
            f"active: expected phases (from, until) between 0 and 1{order} for {names[first]!r}, got {got}"
        )


def open_at(active: Float[np.ndarray, "F 2"], phase: float) -> Bool[np.ndarray, " F"]:
    """(F,) which windows hold a phase from 0 to 1: from <= phase < until, and 1 where until is 1.

    One that ends where it begins never opens; one that ends before it begins goes round through 1 and 0.
    """
    start, end = active.T
    begun, before = start <= phase, (phase < end) | (end >= 1)
    return np.asarray(np.where(start > end, begun | before, begun & before))
