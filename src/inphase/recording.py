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
class Recording:
    """One interaction with its estimates and responses.

    channels: the observed ones, then the controlled. times: (T,) [s], increasing. values: (T, D) what they read, NaN
    where a channel was not seen; both are read-only. estimates: one a step, which may have taken in several samples.
    responses: one a step, None where none was asked for. Raises DataError for parts that do not fit.
    """

    name: str
    channels: tuple[Channel, ...]
    times: Float[np.ndarray, " T"]
    values: Float[np.ndarray, "T D"]
    estimates: tuple[Estimate, ...]
    responses: tuple[Response | None, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for part in ("channels", "estimates", "responses"):
            object.__setattr__(self, part, tuple(getattr(self, part)))
        freeze(self, times=self.times, values=self.values)
        check_channels(self.channels)
        expected = (len(self.times), len(self.channels))
        if self.values.shape != expected:
            raise DataError(f"{self.name}: expected values (T, D) = {expected}, got {self.values.shape}")
        if not (np.isfinite(self.times).all() and (np.diff(self.times) > 0).all()):
            raise DataError(f"{self.name}: expected finite times that increase")
        if len(self.estimates) != len(self.responses):
            raise DataError(
                f"{self.name}: expected a response or None for each of {len(self.estimates)} estimates, "
                f"got {len(self.responses)}"
            )

    @property
    def dataset(self) -> Dataset:
        """What was seen, to learn from; raises DataError where it is too short."""
        return Dataset(self.channels, (Demonstration(self.times, self.values, self.name),), self.provenance)
