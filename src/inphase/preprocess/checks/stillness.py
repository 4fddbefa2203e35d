"""Channels that are not seen or not alive: infinite, missing, constant, frozen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from inphase.channels import Channel
from inphase.preprocess.checks.finding import Finding, FindingKind, clock, times_over

SAME = 1e-12  # of the largest value: what rounding leaves of no movement at all
FROZEN = 10  # steps without any change, or more, can be a sensor that hangs ...
ABRUPT = 0.015  # ... if the movement that it cuts off, or the catching up, is a step of this share of the range
SWITCH = 4  # a channel of no more different values is a switch or a gripper, which rests and jumps by nature


def check_values(
    name: str, times: Float[np.ndarray, " T"], values: Float[np.ndarray, "T D"], channels: Sequence[Channel]
) -> list[Finding]:
    """Infinite and missing values, constant and frozen channels of an episode."""
    findings = []
    for channel, column, constant in zip(channels, values.T, constant_columns(values), strict=True):
        infinite = np.flatnonzero(np.isinf(column))
        if len(infinite):
            message = f"expected finite values, got {column[infinite[0]]} ({len(infinite)} in all)"
            findings.append(Finding(name, channel.name, float(times[infinite[0]]), FindingKind.INFINITE, message))
        missing = np.isnan(column)
        if missing.any():
            findings.append(_missing(name, channel.name, times, missing))
        if constant:
            message = f"never moves: always {column[np.isfinite(column)][0]:g}"
            findings.append(Finding(name, channel.name, None, FindingKind.CONSTANT, message))
    return findings + _frozen(name, times, values, channels)


def constant_columns(values: Float[np.ndarray, "T D"]) -> Bool[np.ndarray, " D"]:
    """(D,) whether each channel was seen more than once and always read the same."""
    seen = np.isfinite(values)
    low = np.where(seen, values, np.inf).min(axis=0, initial=np.inf)
    high = np.where(seen, values, -np.inf).max(axis=0, initial=-np.inf)
    size = np.maximum(np.abs(low), np.abs(high))
    return np.asarray((seen.sum(axis=0) > 1) & (high - low <= SAME * size))


def is_switch(column: Float[np.ndarray, " T"]) -> bool:
    """Whether a channel takes a handful of values only."""
    return len(np.unique(column[np.isfinite(column)])) <= SWITCH


def spread_of(column: Float[np.ndarray, " T"]) -> float:
    """From the 2nd to the 98th percentile of what was seen, or the whole range where that is 0; 0 if nothing was."""
    seen = np.sort(column[np.isfinite(column)])
    if not len(seen):
        return 0.0
    cut = round(0.02 * len(seen))
    return float(seen[-1 - cut] - seen[cut]) or float(seen[-1] - seen[0])


def runs(mask: Bool[np.ndarray, " T"]) -> list[tuple[int, int]]:
    """First and last position of every unbroken run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(start), int(stop) - 1) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def _missing(name: str, channel: str, times: Float[np.ndarray, " T"], missing: Bool[np.ndarray, " T"]) -> Finding:
    found = runs(missing)
    count = int(missing.sum())
    start, stop = max(found, key=lambda run: run[1] - run[0])
    message = (
        f"nothing at {count} of {len(times)} samples ({count / len(times):.1%}), lost {times_over(len(found))}, "
        f"longest from {clock(times[start])} to {clock(times[stop])}"
    )
    if missing.all():
        message = "nothing in the whole episode"
    return Finding(name, channel, float(times[found[0][0]]), FindingKind.NOT_A_NUMBER, message)


def _frozen(
    name: str, times: Float[np.ndarray, " T"], values: Float[np.ndarray, "T D"], channels: Sequence[Channel]
) -> list[Finding]:
    moving = [int(i) for i in np.flatnonzero(~constant_columns(values))]
    hanging = {i: set(_hanging(values[:, i])) for i in moving}
    # What stops every channel at once is the recorder, and one finding.
    together = set.intersection(*hanging.values()) if len(hanging) > 1 else set()
    found: list[tuple[str | None, set[tuple[int, int]]]] = [(None, together)]
    found += [(channels[i].name, hanging[i] - together) for i in moving]
    findings = []
    for channel, spans in found:
        if spans:
            start, stop = max(spans, key=lambda span: span[1] - span[0])
            message = (
                f"{'everything ' if channel is None else ''}repeats one value and then moves on abruptly, "
                f"{times_over(len(spans))}, longest from {clock(times[start])} to {clock(times[stop])}"
            )
            findings.append(Finding(name, channel, float(times[min(spans)[0]]), FindingKind.FROZEN, message))
    return findings


def _hanging(column: Float[np.ndarray, " T"]) -> list[tuple[int, int]]:
    """First and last sample of every stretch of one value that begins or ends abruptly."""
    seen = np.flatnonzero(np.isfinite(column))
    steps = np.abs(np.diff(column[seen]))
    still = [(start, stop) for start, stop in runs(steps == 0) if stop - start + 1 >= FROZEN]
    if not still or is_switch(column):
        return []
    abrupt = ABRUPT * spread_of(column)
    found = []
    for start, stop in still:
        # Something that comes to rest slows down first and sets off slowly; a sensor that hangs does neither.
        edges = [*steps[max(start - 1, 0) : start], *steps[stop + 1 : stop + 2]]
        if max(edges, default=0.0) > abrupt:
            found.append((int(seen[start]), int(seen[stop + 1])))
    return found
