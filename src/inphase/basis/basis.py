"""What every family of basis functions offers, and the checks they share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from numbers import Integral, Real
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from inphase.errors import OptionError

MOST = 1000  # functions a feature: beyond any recording, and short of overflow in a polynomial's coefficients
NARROWEST, WIDEST = 1e-6, 1e6  # of the phase: beyond, the functions are spikes or constants to a float


@runtime_checkable
class Basis(Protocol):
    """Functions of the phase whose weighted sum is the movement of one feature, y = Φ(φ) w (2.3.1).

    A family is a frozen, hashable dataclass: equal ones are evaluated once. Phases may have any shape. Unless a basis
    is `periodic`, the movement stands still outside [0, 1]: values stay what they are at the end, slopes are 0.
    """

    @property
    def size(self) -> int:
        """How many functions there are, B_d."""

    @property
    def periodic(self) -> bool:
        """Whether the functions run on from phase 1 into phase 0 (4.2.7.3)."""

    def __call__(self, phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P B"]:
        """(*P, B) the values of the functions."""

    def with_derivative(
        self, phases: Float[np.ndarray, "*P"]
    ) -> tuple[Float[np.ndarray, "*P B"], Float[np.ndarray, "*P B"]]:
        """(*P, B) the values and (*P, B) the slopes dΦ/dφ, one-sided at exactly 0 and 1."""

    def parameters(self) -> dict[str, Any]:
        """The arguments that make an equal basis: numbers, or tuples of them."""


def clipped(phases: Float[np.ndarray, "*P"]) -> Float[np.ndarray, "*P 1"]:
    """(*P, 1) the phases brought into [0, 1]."""
    return np.asarray(np.minimum(np.maximum(phases[..., None], 0.0), 1.0))


def clipped_and_inside(phases: Float[np.ndarray, "*P"]) -> tuple[Float[np.ndarray, "*P 1"], Bool[np.ndarray, "*P 1"]]:
    """(*P, 1) the phases brought into [0, 1], and (*P, 1) whether they were there already."""
    within = clipped(phases)
    return within, within == phases[..., None]


def placed(name: str, centres: Sequence[Any], size: int) -> tuple[float, ...]:
    """`centres` as `size` phases, not all of them in [0, 1] perhaps; raises OptionError for anything else."""
    values = tuple(float(c) if isinstance(c, Real) else math.nan for c in centres)
    if len(values) != size or not all(math.isfinite(c) for c in values):
        raise OptionError(f"{name}: expected {size} finite phases, one a function, got {centres!r}")
    return values


def whole(name: str, value: object, least: int, most: int = MOST) -> int:
    """`value` as a whole number; raises OptionError outside least … most."""
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= int(value) <= most:
        raise OptionError(f"{name}: expected a whole number from {least} to {most}, got {value!r}")
    return int(value)


def positive(name: str, value: object, default: float) -> float:
    """`value` as a width [phase], or `default` for None; raises OptionError for one that is not positive."""
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, Real) or not NARROWEST <= float(value) <= WIDEST:
        raise OptionError(f"{name}: expected a positive number from {NARROWEST:g} to {WIDEST:g}, got {value!r}")
    return float(value)


def settle(owner: Any, **values: Any) -> None:
    """Set fields of a frozen dataclass; for use in `__post_init__`."""
    for name, value in values.items():
        object.__setattr__(owner, name, value)


def arguments(basis: Any) -> dict[str, Any]:
    """The constructor arguments of a family's dataclass, as they are now, less those that are left open."""
    values = {field.name: getattr(basis, field.name) for field in fields(basis) if field.init}
    return {name: value for name, value in values.items() if value is not None}
