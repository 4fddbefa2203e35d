"""What shows only when episodes are compared: another length, rate, unit or branch, a channel that is always dead."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase.arrays import FloatArray, IntArray
from inphase.channels import Channel, Kind
from inphase.errors import DataError
from inphase.preprocess.checks.clock import median_step
from inphase.preprocess.checks.finding import EVERY_EPISODE, Finding, FindingKind
from inphase.preprocess.checks.jumps import RADIANS, TAU
from inphase.preprocess.checks.stillness import constant_columns, spread_of
from inphase.trajectory import SHORTEST

Episode: TypeAlias = tuple[str, Float[np.ndarray, " _"], Float[np.ndarray, "_ D"]]

LONGER = 2.0  # times the usual duration, or its inverse: people are not that much slower without a reason ...
OUTLIER = 3.5  # ... unless durations vary so: standard deviations (1.4826 MAD) of their logarithm
FASTER = 1.2  # times the usual sample rate, or its inverse
UNITS = {1000.0: "millimetres and metres", 100.0: "centimetres and metres", 180 / np.pi: "degrees and radians"}
UNIT_RATIO = 20.0  # of the spread and of the size of a group of channels, both: another unit
BRANCH = np.pi / 2  # [rad] how near to a whole turn the offset of every episode must be ...
FURTHEST = 3  # ... and how many turns it may be


def check_episodes(episodes: Sequence[Episode], channels: Sequence[Channel]) -> list[Finding]:
    """What sets an episode apart from the others, and what is wrong with all: (name, times (T,) [s], values (T, D)).

    Raises DataError where the shapes do not fit.
    """
    for episode in episodes:
        check_shape(*episode, channels)
    usable = [episode for episode in episodes if len(episode[1]) >= SHORTEST]
    if len(usable) < 2:
        return []
    with np.errstate(all="ignore"):  # the numbers may be anything
        return _clocks(usable) + _constant(usable, channels) + _units(usable, channels) + _branches(usable, channels)


def check_shape(name: str, times: FloatArray, values: FloatArray, channels: Sequence[Channel]) -> None:
    """Raise DataError where times are not (T,) and values not (T, D)."""
    if times.ndim != 1 or values.shape != (len(times), len(channels)):
        raise DataError(f"{name}: expected {len(channels)} channels, got times {times.shape}, values {values.shape}")


def _clocks(episodes: Sequence[Episode]) -> list[Finding]:
    findings = []
    durations = np.array([_duration(times) for _, times, _ in episodes])
    steps = np.array([median_step(times) for _, times, _ in episodes])
    lengths, rates = _ratios(durations), _ratios(1 / steps)
    deviations = np.abs(np.log(lengths[np.isfinite(lengths)]))
    allowed = max(np.log(LONGER), OUTLIER * 1.4826 * float(np.median(deviations)) if len(deviations) else 0.0)
    for (name, _, _), duration, step, length, rate in zip(episodes, durations, steps, lengths, rates, strict=True):
        if abs(np.log(length)) > allowed:
            message = f"lasts {duration:.4g} s, the others {duration / length:.4g} s (median)"
            findings.append(Finding(name, None, None, FindingKind.LENGTH, message))
        if abs(np.log(rate)) > np.log(FASTER):
            message = f"{_rounded(1 / step)} samples a second, the others {_rounded(1 / (step * rate))} (median)"
            findings.append(Finding(name, None, None, FindingKind.CLOCK, message))
    return findings


def _constant(episodes: Sequence[Episode], channels: Sequence[Channel]) -> list[Finding]:
    findings = []
    seen = np.array([np.isfinite(values).any(axis=0) for _, _, values in episodes])
    constant = np.array([constant_columns(values) for _, _, values in episodes])
    for i in map(int, np.flatnonzero(seen.any(axis=0) & (constant | ~seen).all(axis=0))):
        channel = channels[i]
        columns = [values[np.isfinite(values[:, i]), i] for _, _, values in episodes]
        levels = sorted({float(column[0]) for column in columns if len(column)})
        message = f"never moves: always {levels[0]:g}" + (f" to {levels[-1]:g}" if len(levels) > 1 else "")
        findings.append(Finding(EVERY_EPISODE, channel.name, None, FindingKind.CONSTANT, message))
    return findings


def _units(episodes: Sequence[Episode], channels: Sequence[Channel]) -> list[Finding]:
    groups: dict[str, list[int]] = {}
    for i, channel in enumerate(channels):
        if channel.kind is Kind.LINEAR:
            groups.setdefault(channel.group, []).append(i)
    findings = []
    for group, columns in groups.items():
        # A partner who stands still has a small spread, and one near the origin is small: another unit shows in both.
        spreads = _ratios([np.linalg.norm([spread_of(values[:, i]) for i in columns]) for _, _, values in episodes])
        sizes = _ratios([np.linalg.norm([_size(values[:, i]) for i in columns]) for _, _, values in episodes])
        for (name, _, _), spread, size in zip(episodes, spreads, sizes, strict=True):
            if min(spread, size) > UNIT_RATIO or max(spread, size) < 1 / UNIT_RATIO:
                message = f"moves {spread:.3g} times as far as in the others{_units_named(spread)}"
                findings.append(Finding(name, group, None, FindingKind.UNIT, message))
    return findings


def _branches(episodes: Sequence[Episode], channels: Sequence[Channel]) -> list[Finding]:
    findings = []
    for i, channel in enumerate(channels):
        if channel.kind is Kind.QUATERNION or channel.unit not in RADIANS:
            continue
        seen = [(name, values[np.isfinite(values[:, i]), i]) for name, _, values in episodes]
        paths = [(name, np.unwrap(path) if channel.kind is Kind.ANGLE else path) for name, path in seen if len(path)]
        middles = np.array([np.median(path) for _, path in paths])
        turns = _turns(middles)
        # Only what stays on one branch, and near it in every episode, is an angle for sure where no unit says so.
        if turns is None or any(np.ptp(path) >= TAU for _, path in paths):
            continue
        for (name, _), middle, turn in zip(paths, middles, turns, strict=True):
            if turn:
                others = int((turns == 0).sum())
                side = "above" if turn > 0 else "below"
                message = f"lies {abs(turn)} × 2π {side} {others} of the others: its median is {middle:.3g} rad"
                findings.append(Finding(name, channel.name, None, FindingKind.BRANCH, message))
    return findings


def _turns(middles: Float[np.ndarray, " E"]) -> IntArray | None:
    """(E,) on which branch each lies, 0 for the one of the most; None where they are not whole turns apart."""
    if len(middles) < 2:
        return None
    neighbours = (np.abs(middles[:, None] - middles) < np.pi).sum(axis=1)
    centre = middles[np.argmax(neighbours)]
    centre = np.median(middles[np.abs(middles - centre) < np.pi])
    turns = np.round((middles - centre) / TAU).astype(np.int64)
    fits = np.abs(middles - centre - TAU * turns) < BRANCH
    return turns if fits.all() and turns.any() and np.abs(turns).max() <= FURTHEST else None


def _ratios(amounts: ArrayLike) -> Float[np.ndarray, " E"]:
    """(E,) each amount by the usual one, which is their upper median; NaN where an amount is 0 or not known."""
    known = np.array(amounts, dtype=np.float64)
    known[~(np.isfinite(known) & (known > 0))] = np.nan
    present = np.sort(known[np.isfinite(known)])
    return known / present[len(present) // 2] if len(present) else known


def _rounded(rate: float) -> str:
    return f"{round(rate, 1):g}"


def _duration(times: Float[np.ndarray, " T"]) -> float:
    known = times[np.isfinite(times)]
    return float(np.ptp(known)) if len(known) else 0.0


def _size(column: Float[np.ndarray, " T"]) -> float:
    seen = np.abs(column[np.isfinite(column)])
    return float(np.percentile(seen, 98)) if len(seen) else 0.0


def _units_named(ratio: float) -> str:
    ratio = max(ratio, 1 / ratio)
    nearest = min(UNITS, key=lambda factor: abs(np.log(factor / ratio)))
    return f": {UNITS[nearest]}?" if 0.5 < ratio / nearest < 2 else ""
