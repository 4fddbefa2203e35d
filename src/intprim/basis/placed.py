"""Functions with a width and centres: between phase 0 and 1, or between others, as in models that IntPrim saved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import OptionError
from inphase.basis import Basis, Gaussian, Sigmoid
from intprim.basis.basis_model import SharedBasisModel


@dataclass(frozen=True)
class Placed:
    """`size` Gaussians or logistic steps whose centres are uniform from `start` to `end`, both ends included."""

    family: type[Gaussian] | type[Sigmoid]
    size: int
    width: float
    start: float
    end: float
    periodic: ClassVar[bool] = False

    def __call__(self, phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P B"]:
        return self.with_derivative(phases)[0]

    def with_derivative(
        self, phases: Float[np.ndarray, "*P"]
    ) -> tuple[Float[np.ndarray, "*P B"], Float[np.ndarray, "*P B"]]:
        within = np.minimum(np.maximum(phases, 0.0), 1.0)
        distance = (within[..., None] - np.linspace(self.start, self.end, self.size)) / self.width
        if self.family is Gaussian:
            values = np.exp(-0.5 * distance * distance)
            slopes = -distance * values
        else:
            values = 0.5 + 0.5 * np.tanh(0.5 * distance)
            slopes = values * (1 - values)
        return values, slopes * ((within == phases)[..., None] / self.width)

    def parameters(self) -> dict[str, float | int]:
        return {"size": self.size, "width": self.width, "start": self.start, "end": self.end}


class PlacedModel(SharedBasisModel):
    """What the Gaussian and the sigmoidal model share: a width, and centres from `start_phase` to `end_phase`.

    Raises OptionError for a scale that is not positive, ends that are not finite and in order, or too few functions.
    """

    family: ClassVar[type[Gaussian] | type[Sigmoid]]

    def __init__(
        self,
        degree: int,
        scale: float,
        observed_dof_names: ArrayLike,
        start_phase: float = 0.0,
        end_phase: float | None = None,
    ) -> None:
        if isinstance(scale, bool) or not 0 < scale < math.inf:
            raise OptionError(f"scale: expected a positive number, got {scale!r}")
        end, old_end = (1.0, 1.01) if end_phase is None else (end_phase, end_phase)
        if not -math.inf < start_phase < end < math.inf:
            raise OptionError(f"expected start_phase < end_phase, got {start_phase!r} and {end!r}")
        basis, old_basis = (self._place(degree, float(scale), float(start_phase), float(e)) for e in (end, old_end))
        super().__init__(basis, old_basis, float(scale), observed_dof_names)
        self.centers = np.linspace(start_phase, end, self._degree)

    @classmethod
    def _place(cls, degree: int, scale: float, start: float, end: float) -> Basis:
        """The functions with these arguments, those of `inphase` where it has them."""
        plain = Gaussian(degree, math.sqrt(scale), margin=0.0) if cls.family is Gaussian else Sigmoid(degree, scale)
        if (start, end) == (0.0, 1.0):
            return plain
        return Placed(cls.family, plain.size, plain.parameters()["width"], start, end)
