"""The clock of an episode: enough samples, times that increase, no gaps, a steady rate."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from inphase.preprocess.checks.finding import Finding, FindingKind, clock, times_over
from inphase.trajectory import SHORTEST

SHORT = 20  # samples: below it a trajectory of ten basis functions is hardly determined
GAP = 3.0  # median steps: longer than this is a gap
UNEVEN = 0.5  # of the median step: a step that differs by more is uneven ...
UNEVEN_SHARE = 0.1  # ... and so is the clock when this share of its steps is


def check_clock(name: str, times: Float[np.ndarray, " T"]) -> list[Finding]:
    """What is wrong with the times [s] of an episode."""
    if len(times) < SHORTEST:
        message = f"expected at least {SHORTEST} samples, got {len(times)}"
        return [Finding(name, None, None, FindingKind.TOO_SHORT, message)]
    findings = []
    if len(times) < SHORT:
        message = f"{len(times)} samples are few: a movement needs {SHORT} or more"
        findings.append(Finding(name, None, None, FindingKind.SHORT, message))
    return findings + _order(name, times) + _steps(name, times)


def median_step(times: Float[np.ndarray, " T"]) -> float:
    """The median of the steps that go forward [s], NaN where none does."""
    steps = np.diff(times)
    forward = steps[np.isfinite(steps) & (steps > 0)]
    return float(np.median(forward)) if len(forward) else float("nan")


def _order(name: str, times: Float[np.ndarray, " T"]) -> list[Finding]:
    findings = []
    lost = np.flatnonzero(~np.isfinite(times))
    if len(lost):
        message = f"expected finite times, got {times[lost[0]]} at sample {lost[0]} ({len(lost)} in all)"
        findings.append(Finding(name, None, None, FindingKind.BACKWARDS, message))
    known = times[np.isfinite(times)]
    wrong = np.flatnonzero(np.diff(known) <= 0)
    if len(wrong):
        before, after = known[wrong[0]], known[wrong[0] + 1]
        message = f"time does not increase {times_over(len(wrong))}: first {clock(after)} comes after {clock(before)}"
        findings.append(Finding(name, None, float(after), FindingKind.BACKWARDS, message))
    return findings


def _steps(name: str, times: Float[np.ndarray, " T"]) -> list[Finding]:
    median = median_step(times)
    steps = np.diff(times)
    gaps = np.flatnonzero(np.isfinite(steps) & (steps > GAP * median))
    uneven = np.flatnonzero((steps > 0) & (steps <= GAP * median) & (np.abs(steps - median) > UNEVEN * median))
    findings = []
    if len(gaps):
        longest = gaps[np.argmax(steps[gaps])]
        message = (
            f"no sample for long {times_over(len(gaps))}, the longest from {clock(times[longest])} to "
            f"{clock(times[longest + 1])}; the median step is {median:.4g} s"
        )
        findings.append(Finding(name, None, float(times[gaps[0]]), FindingKind.GAP, message))
    if len(uneven) > UNEVEN_SHARE * len(steps):
        message = (
            f"{len(uneven)} of {len(steps)} steps, {steps[uneven].min():.4g} s to {steps[uneven].max():.4g} s, "
            f"are far from the median step of {median:.4g} s"
        )
        findings.append(Finding(name, None, float(times[uneven[0]]), FindingKind.CLOCK, message))
    return findings
