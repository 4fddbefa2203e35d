"""Bumps around the circle: for an interaction that repeats itself, as waving or shaking hands."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from inphase.arrays import frozen
from inphase.basis.basis import arguments, positive, settle, whole


@dataclass(frozen=True)
class Periodic:
    """`size` von Mises bumps exp(κ (cos 2π(φ - c) - 1)), their centres c uniform on [0, 1), for rhythms (4.2.7.3).

    Any phase is allowed; whole turns make no difference, in value or slope. width: [phase], the standard deviation of
    a Gaussian that is as sharp at its top, κ = 1 / (2π width)²; None takes the distance between two centres, as the
    Gaussians do. Two bumps, at 0 and ½, could not tell forwards from backwards: at least three are needed.
    Raises OptionError for fewer, or a width that is not positive.
    """

    size: int
    width: float | None = None
    periodic: ClassVar[bool] = True
    _centres: Float[np.ndarray, " B"] = field(init=False, repr=False, compare=False)
    _sharpness: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        size = whole("Periodic size", self.size, least=3)
        width = positive("Periodic width", self.width, default=1 / size)
        sharpness = 1 / (2 * math.pi * width) ** 2
        settle(self, size=size, width=width, _centres=frozen(np.arange(size) / size), _sharpness=sharpness)

    def __call__(self, phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P B"]:
        sine = np.sin(np.pi * (phases[..., None] - self._centres))
        # cos x - 1 = -2 sin² x/2, which keeps its digits near the top of a narrow bump.
        return np.asarray(np.exp(-2 * self._sharpness * sine * sine))

    def with_derivative(
        self, phases: Float[np.ndarray, "*P"]
    ) -> tuple[Float[np.ndarray, "*P B"], Float[np.ndarray, "*P B"]]:
        half_angle = np.pi * (phases[..., None] - self._centres)
        sine = np.sin(half_angle)
        values = np.exp(-2 * self._sharpness * sine * sine)
        return values, values * sine * np.cos(half_angle) * (-4 * np.pi * self._sharpness)

    def parameters(self) -> dict[str, Any]:
        return arguments(self)
