"""Logistic steps along the phase: for a feature that changes from one level to the next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from inphase.arrays import frozen
from inphase.basis.basis import arguments, clipped, clipped_and_inside, placed, positive, settle, whole

LOGISTIC_STD = math.pi / math.sqrt(3)  # of the bump that is the slope of a logistic step of width 1


@dataclass(frozen=True)
class Sigmoid:
    """`size` logistic steps 1 / (1 + exp(-(φ - c) / width)), their centres c uniform on [0, 1] (4.2.1).

    width: of the step [phase], IntPrim's scale; None makes the slope of a step a bump as wide (in standard deviations)
    as the distance between two centres, the rule of the Gaussians. No step is done at phase 0: a feature that starts
    far from zero is fitted better by Gaussians.
    centres: (size,) phases, instead of uniform ones.
    Raises OptionError for fewer than two functions, a width that is not positive, or centres that are not as many.
    """

    size: int
    width: float | None = None
    centres: Sequence[float] | None = None
    periodic: ClassVar[bool] = False
    _centres: Float[np.ndarray, " B"] = field(init=False, repr=False, compare=False)
    _scale: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        size = whole("Sigmoid size", self.size, least=2)
        width = positive("Sigmoid width", self.width, default=1 / (size - 1) / LOGISTIC_STD)
        centres = None if self.centres is None else placed("Sigmoid centres", self.centres, size)
        places = np.linspace(0.0, 1.0, size) if centres is None else np.array(centres)
        settle(self, size=size, width=width, centres=centres, _centres=frozen(places), _scale=1 / width)

    def __call__(self, phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P B"]:
        return self._steps(clipped(phases))

    def with_derivative(
        self, phases: Float[np.ndarray, "*P"]
    ) -> tuple[Float[np.ndarray, "*P B"], Float[np.ndarray, "*P B"]]:
        within, inside = clipped_and_inside(phases)
        values = self._steps(within)
        return values, values * (1 - values) * (inside * self._scale)

    def parameters(self) -> dict[str, Any]:
        return arguments(self)

    def _steps(self, within: Float[np.ndarray, "*P 1"]) -> Float[np.ndarray, "*P B"]:
        # The logistic function as a tangent: exp(-x) would overflow far from the centre.
        return np.asarray(0.5 + 0.5 * np.tanh((within - self._centres) * (0.5 * self._scale)))
