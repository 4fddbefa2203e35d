"""Polynomials in the phase: few weights for a slow and smooth feature."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from inphase.arrays import frozen
from inphase.basis.basis import MOST, arguments, clipped, clipped_and_inside, settle, whole


@dataclass(frozen=True)
class Polynomial:
    """The degree + 1 polynomials of Bernstein, C(n, k) φᵏ (1 - φ)ⁿ⁻ᵏ with n = degree (4.2.1).

    They span what 1, φ, φ², … span, far better conditioned (ΦᵀΦ at degree 8: 2e4 against 5e11); they lie between 0 and
    1 and add up to 1, so that a weight is about what the feature reads at phase k / n. IntPrim's `PolynomialModel(8)`
    has eight functions: its degree is 7. Raises OptionError for a degree below 0.
    """

    degree: int
    periodic: ClassVar[bool] = False
    _binomials: Float[np.ndarray, " B"] = field(init=False, repr=False, compare=False)
    _lower_binomials: Float[np.ndarray, " C"] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        degree = whole("Polynomial degree", self.degree, least=0, most=MOST - 1)
        settle(self, degree=degree, _binomials=binomials(degree), _lower_binomials=binomials(degree - 1))

    @property
    def size(self) -> int:
        """How many functions there are, B_d."""
        return self.degree + 1

    def __call__(self, phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P B"]:
        return bernstein(clipped(phases), self._binomials)

    def with_derivative(
        self, phases: Float[np.ndarray, "*P"]
    ) -> tuple[Float[np.ndarray, "*P B"], Float[np.ndarray, "*P B"]]:
        within, inside = clipped_and_inside(phases)
        # d/dφ b(n, k) = n (b(n - 1, k - 1) - b(n - 1, k))
        lower = bernstein(within, self._lower_binomials) * (inside * float(self.degree))
        slopes = np.zeros((*phases.shape, self.size))
        slopes[..., 1:] += lower
        slopes[..., :-1] -= lower
        return bernstein(within, self._binomials), slopes

    def parameters(self) -> dict[str, Any]:
        return arguments(self)


def binomials(degree: int) -> Float[np.ndarray, " B"]:
    """(degree + 1,) C(degree, k) for every k from 0."""
    return frozen([math.comb(degree, k) for k in range(degree + 1)])


def bernstein(within: Float[np.ndarray, "*P 1"], binomials: Float[np.ndarray, " B"]) -> Float[np.ndarray, "*P B"]:
    """(*P, B) the Bernstein polynomials that have these binomials, at phases from 0 to 1."""
    powers = np.arange(len(binomials))
    return np.asarray(binomials * within**powers * (1 - within) ** powers[::-1])
