"""Gaussian bumps along the phase: the usual choice for a movement with a start and an end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from inphase.arrays import frozen
from inphase.basis.basis import arguments, clipped, positive, settle, spread, whole


@dataclass(frozen=True)
class Gaussian:
    """`size` Gaussians exp(-(φ - c)² / (2 width²)), their centres c uniform on [0, 1], both ends included (4.2.1).

    width: standard deviation [phase]; None takes the distance between two centres. There the sum has stopped to ripple
    (by 5e-9 of its height) while neighbours still differ: the condition number of ΦᵀΦ stays below 1e4 at any size. At
    0.7 of the distance the ripple is 1e-4; at 1.5 the condition number is 1e8, and weights grow that fit no better.
    IntPrim's `GaussianModel(8, 0.1)` names the variance: the width is sqrt(0.1).
    Raises OptionError for fewer than two functions, or a width that is not positive.
    """

    size: int
    width: float | None = None
    periodic: ClassVar[bool] = False
    _centres: Float[np.ndarray, " B"] = field(init=False, repr=False, compare=False)
    _scale: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        size = whole("Gaussian size", self.size, least=2)
        width = positive("Gaussian width", self.width, default=1 / (size - 1))
        settle(self, size=size, width=width, _centres=frozen(spread(size)), _scale=1 / width)

    def __call__(self, phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P B"]:
        distance = (clipped(phases)[0] - self._centres) * self._scale
        return np.asarray(np.exp(-0.5 * distance * distance))

    def with_derivative(
        self, phases: Float[np.ndarray, "*P"]
    ) -> tuple[Float[np.ndarray, "*P B"], Float[np.ndarray, "*P B"]]:
        within, inside = clipped(phases)
        distance = (within - self._centres) * self._scale
        values = np.exp(-0.5 * distance * distance)
        return values, values * distance * (inside * -self._scale)

    def parameters(self) -> dict[str, float | int]:
        return arguments(self)
