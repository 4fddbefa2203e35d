"""How a person throws: what they keep from throw to throw, and what is never twice the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STANDS = 3.7  # [m] before the robot


@dataclass(frozen=True)
class Style:
    """What a person keeps from throw to throw. Angles [rad], lengths [m], times [s]."""

    height: float
    weight: float
    backswing: float
    backswing_time: float
    whip: float  # how late the arm gets fast: the swing takes so many times what its last speed would need
    stretch: float  # of the arm, of its whole length
    stride: float
    lean: float
    twist: float
    flight: float  # how long their throws usually fly
    gaze: float  # share of the direction in which the head turns
    gaze_off: np.ndarray  # (2,) yaw and pitch by which the head looks past it
    cells: np.ndarray  # (8,) how much each cell of the shoes feels
    mount: np.ndarray  # (3,) the turn by which the IMU sits askew


@dataclass(frozen=True)
class Variation:
    """What differs from throw to throw; as in Style."""

    lead: float
    backswing: float
    backswing_time: float
    whip: float
    stride: float
    lean: float
    twist: float
    place: np.ndarray
    plane: float
    start: float
    free_arm: np.ndarray
    gaze: np.ndarray
    gaze_time: float
    toes: np.ndarray


def style(rng: np.random.Generator) -> Style:
    """Someone."""
    return Style(
        height=float(np.clip(rng.normal(1.74, 0.08), 1.55, 1.95)),
        weight=float(np.clip(rng.normal(72, 10), 50, 100)),
        backswing=float(np.clip(rng.normal(0.65, 0.12), 0.35, 0.95)),
        backswing_time=float(rng.uniform(0.24, 0.33)),
        whip=float(rng.uniform(1.7, 1.95)),
        stretch=float(rng.uniform(0.90, 0.98)),
        stride=float(rng.uniform(0.15, 0.40)),
        lean=float(rng.uniform(0.10, 0.30)),
        twist=float(rng.uniform(0.10, 0.35)),
        flight=float(np.clip(rng.normal(0.92, 0.05), 0.8, 1.05)),
        gaze=float(rng.uniform(0.6, 0.95)),
        gaze_off=rng.normal(0, [0.04, 0.06]),
        cells=rng.lognormal(0, 0.25, 8),
        mount=rng.normal(0, 0.10, 3),
    )


def varied(who: Style, sideways: float, flight: float, rng: np.random.Generator) -> Variation:
    """One throw's, to a target so far sideways [m] that is to be reached in so long [s]."""
    return Variation(
        lead=rng.uniform(0.0, 0.12),
        backswing=who.backswing * rng.lognormal(0, 0.10) * (1 + 0.8 * (flight - 0.92)),
        backswing_time=who.backswing_time * rng.lognormal(0, 0.07),
        whip=who.whip * rng.lognormal(0, 0.03),
        stride=who.stride * rng.lognormal(0, 0.15),
        lean=who.lean * rng.lognormal(0, 0.15),
        twist=who.twist * rng.lognormal(0, 0.15) + 0.3 * np.arctan2(sideways, STANDS),
        place=rng.normal(0, [0.04, 0.04]),
        plane=rng.normal(0.05, 0.05),
        start=rng.normal(0.2, 0.06),
        free_arm=rng.normal(0, 0.05, 3),
        gaze=rng.normal(0, [0.03, 0.05]),
        gaze_time=rng.normal(0.0, 0.05),
        toes=rng.normal(0, 0.06, 2),
    )
