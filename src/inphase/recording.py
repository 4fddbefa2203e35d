"""A run as it was recorded: what was seen, and what a session made of it at every step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.channels import Channel, check_channels
from inphase.errors import DataError
from inphase.result import Estimate, Response
from inphase.trajectory import Dataset, Demonstration


@dataclass(frozen=True, eq=False)
class RecordedCommand:
    """What a robot was sent: positions it should reach, of which one alone is a single point.

    time: when it was sent [s]. times: (S,) [s] of the same clock. positions: (S, C), in the units of `signals`, the
    robot's own names; arrays are read-only. Raises DataError for parts that do not fit.
    """

    time: float
    times: Float[np.ndarray, " S"]
    positions: Float[np.ndarray, "S C"]
    signals: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "signals", tuple(self.signals))
        freeze(self, times=self.times, positions=self.positions)
        expected = (self.times.size, len(self.signals))
        if self.positions.shape != expected:
            raise DataError(f"command at {self.time:g} s: expected positions {expected}, got {self.positions.shape}")


@dataclass(frozen=True)
class RecordedEvent:
    """Something that happened and why; `before` and `after` are states, empty where none changed.

    time: [s]. kind: who tells it, as in "safety" or "recorder".
    """

    time: float
    kind: str
    reason: str
    before: str = ""
    after: str = ""


@dataclass(frozen=True, eq=False)
class Recording:
    """One interaction with its estimates and responses, and what a robot was told.

    channels: the observed ones, then the controlled. times: (T,) [s], never decreasing. values: (T, D) what they read,
    NaN where a channel was not seen; both are read-only. estimates: one a step, which may have taken in several
    samples. responses: one a step, None where none was asked for. commands, events: in the order in which they
    happened. Raises DataError for parts that do not fit.
    """

    name: str
    channels: tuple[Channel, ...]
    times: Float[np.ndarray, " T"]
    values: Float[np.ndarray, "T D"]
    estimates: tuple[Estimate, ...]
    responses: tuple[Response | None, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)
    commands: tuple[RecordedCommand, ...] = ()
    events: tuple[RecordedEvent, ...] = ()

    def __post_init__(self) -> None:
        for part in ("channels", "estimates", "responses", "commands", "events"):
            object.__setattr__(self, part, tuple(getattr(self, part)))
        freeze(self, times=self.times, values=self.values)
        check_channels(self.channels)
        expected = (len(self.times), len(self.channels))
        if self.values.shape != expected:
            raise DataError(f"{self.name}: expected values (T, D) = {expected}, got {self.values.shape}")
        # A session takes in two samples of one time, and so does the record of what it was given.
        if not (np.isfinite(self.times).all() and (np.diff(self.times) >= 0).all()):
            raise DataError(f"{self.name}: expected finite times that increase or stay")
        if len(self.estimates) != len(self.responses):
            raise DataError(
                f"{self.name}: expected a response or None for each of {len(self.estimates)} estimates, "
                f"got {len(self.responses)}"
            )

    @property
    def dataset(self) -> Dataset:
        """What was seen, to learn from; raises DataError where it is too short."""
        return Dataset(self.channels, (Demonstration(self.times, self.values, self.name),), self.provenance)
