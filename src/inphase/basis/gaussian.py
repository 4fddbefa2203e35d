"""Gaussian bumps along the phase: the usual choice for a movement with a start and an end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from inphase.arrays import frozen
from inphase.basis.basis import arguments, clipped, clipped_and_inside, placed, positive, settle, whole
from inphase.errors import OptionError


@dataclass(frozen=True)
class Gaussian:
    """`size` Gaussians exp(-(φ - c)² / (2 width²)), their centres c uniform (4.2.1).

    width: standard deviation [phase]; None takes the distance between two centres. There the sum has stopped to ripple
    (by 5e-9 of its height) while neighbours still differ: the condition number of ΦᵀΦ stays below 1e5 at any size. At
    0.7 of the distance the ripple is 1e-4; at 1.5 the condition number is 1e8, and weights grow that fit no better.
    margin: how far the outer centres lie beyond 0 and 1, in distances between two; None takes 1, or what so few leave.
    With the outer ones at the ends, as in 4.2.1 (margin 0), half of the neighbours are missing there, and a hand that
    rests at the end of a movement cannot be held still to better than 3 % of its way.
    centres: (size,) phases, instead of uniform ones; a width is then needed.
    IntPrim's `GaussianModel(8, 0.1)` names the variance: the width is sqrt(0.1), the margin 0.
    Raises OptionError for fewer than two functions, a width that is not positive, a margin that leaves no distance, or
    centres that are not as many phases or have a margin.
    """

    size: int
    width: float | None = None
    margin: float | None = None
    centres: Sequence[float] | None = None
    periodic: ClassVar[bool] = False
    _centres: Float[np.ndarray, " B"] = field(init=False, repr=False, compare=False)
    _scale: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        size = whole("Gaussian size", self.size, least=2)
        if self.centres is not None:
            self._settle_at(size, placed("Gaussian centres", self.centres, size))
            return
        margin: object = min(1.0, size / 2 - 1) if self.margin is None else self.margin
        if isinstance(margin, bool) or not isinstance(margin, (int, float)) or not 0 <= margin < (size - 1) / 2:
            raise OptionError(f"Gaussian margin: expected 0 <= margin < {(size - 1) / 2:g}, got {self.margin!r}")
        distance = 1 / (size - 1 - 2 * margin)
        width = positive("Gaussian width", self.width, default=distance)
        centres = frozen((np.arange(size) - margin) * distance)
        settle(self, size=size, width=width, margin=float(margin), _centres=centres, _scale=1 / width)

    def _settle_at(self, size: int, centres: tuple[float, ...]) -> None:
        if self.margin is not None or self.width is None:
            given = f"width={self.width!r}, margin={self.margin!r}"
            raise OptionError(f"Gaussian centres: expected a width and no margin beside them, got {given}")
        width = positive("Gaussian width", self.width, default=1.0)
        settle(self, size=size, width=width, centres=centres, _centres=frozen(list(centres)), _scale=1 / width)

    def __call__(self, phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P B"]:
        distance = (clipped(phases) - self._centres) * self._scale
        distance *= distance
        distance *= -0.5
        return np.asarray(np.exp(distance, out=distance))

    def with_derivative(
        self, phases: Float[np.ndarray, "*P"]
    ) -> tuple[Float[np.ndarray, "*P B"], Float[np.ndarray, "*P B"]]:
        within, inside = clipped_and_inside(phases)
        distance = (within - self._centres) * self._scale
        values = np.exp(-0.5 * distance * distance)
        return values, values * distance * (inside * -self._scale)

    def parameters(self) -> dict[str, Any]:
        return arguments(self)
