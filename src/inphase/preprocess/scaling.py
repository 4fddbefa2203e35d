"""Min-max scaling by group: features that belong together keep their geometry (4.2.5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError, listing

ROUNDING = 1e-12  # of the size of the values: a feature that moves less than this does not move


@dataclass(frozen=True, eq=False)
class Scaling:
    """Brings every feature to 0 … 1 over the demonstrations, those of a group by one span, each from its own low.

    low, high: (F,) what becomes 0 and 1; where both are the same, 1 is one unit above `low`.
    Raises OptionError where high is below low.
    """

    low: Float[np.ndarray, " F"]
    high: Float[np.ndarray, " _F"]

    def __post_init__(self) -> None:
        freeze(self, low=self.low, high=self.high)
        if self.low.ndim != 1 or self.low.shape != self.high.shape:
            raise OptionError(f"expected low (F,) and high (F,), got {self.low.shape} and {self.high.shape}")
        wrong = np.flatnonzero(~(np.isfinite(self.low) & np.isfinite(self.high) & (self.high >= self.low)))
        if len(wrong):
            raise OptionError(f"expected finite low <= high for every feature, got others at {listing(wrong)}")

    @classmethod
    def learn(cls, groups: Sequence[str], values: Sequence[Float[np.ndarray, "_ F"]]) -> Scaling:
        """The scaling of features in these groups, one name each, over trajectories (T, F); NaN is passed over.

        A group that never moves, or was never seen, is not stretched: its span is 1. Source: 4.2.5.
        """
        everything = np.concatenate([np.empty((0, len(groups))), *values])
        lowest = np.fmin.reduce(everything, axis=0, initial=np.inf)
        highest = np.fmax.reduce(everything, axis=0, initial=-np.inf)
        members = [[f for f, other in enumerate(groups) if other == group] for group in groups]
        bottom = lowest
        with np.errstate(invalid="ignore"):  # a feature that was never seen spans -inf
            top = lowest + np.array([(highest - lowest)[together].max() for together in members])
        low = np.where(np.isfinite(bottom), bottom, 0.0)
        return cls(low, np.where(_still(bottom, top), low, top))

    @classmethod
    def none(cls, count: int) -> Scaling:
        """The scaling of `count` features that leaves them as they are."""
        return cls(np.zeros(count), np.ones(count))

    @cached_property
    def offset(self) -> Float[np.ndarray, " F"]:
        """(F,) what becomes 0."""
        return self.low

    @cached_property
    def span(self) -> Float[np.ndarray, " F"]:
        """(F,) what becomes 1 long, never 0."""
        return frozen(np.where(self.high > self.low, self.high - self.low, 1.0))

    def scale(self, values: Float[np.ndarray, "... F"]) -> Float[np.ndarray, "... F"]:
        """Values (..., F) in the unit of the model; NaN stays."""
        return np.asarray((values - self.offset) / self.span)

    def unscale(self, values: Float[np.ndarray, "... F"]) -> Float[np.ndarray, "... F"]:
        """Values (..., F) back in the units of the features."""
        return np.asarray(values * self.span + self.offset)

    def scale_var(self, var: Float[np.ndarray, "... F"]) -> Float[np.ndarray, "... F"]:
        """Variances (..., F) in the unit of the model, squared."""
        return np.asarray(var / self.span**2)

    def unscale_var(self, var: Float[np.ndarray, "... F"]) -> Float[np.ndarray, "... F"]:
        """Variances (..., F) back in the units of the features, squared."""
        return np.asarray(var * self.span**2)


def _still(low: Float[np.ndarray, " F"], high: Float[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
    """Whether what lies between these does not move, or was never seen."""
    with np.errstate(invalid="ignore"):
        return np.asarray(~(high - low > ROUNDING * np.maximum(np.abs(low), np.abs(high))))
