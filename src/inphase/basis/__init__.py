"""Basis functions: how a movement becomes a few weights, and weights a movement (2.3.1, 4.2.1)."""

from __future__ import annotations

import inspect

from inphase.basis.basis import Basis
from inphase.basis.gaussian import Gaussian
from inphase.basis.layout import Layout
from inphase.basis.periodic import Periodic
from inphase.basis.polynomial import Polynomial
from inphase.basis.sigmoid import Sigmoid
from inphase.errors import OptionError, listing

__all__ = ["FAMILIES", "Basis", "Gaussian", "Layout", "Periodic", "Polynomial", "Sigmoid", "make"]

FAMILIES: dict[str, type[Basis]] = {
    "gaussian": Gaussian,
    "sigmoid": Sigmoid,
    "polynomial": Polynomial,
    "periodic": Periodic,
}


def make(family: str, **parameters: object) -> Basis:
    """The basis of a family by its name in lower case, as `make("gaussian", size=9)`.

    Raises OptionError for an unknown family, arguments it does not have or lacks, or values it does not allow.
    """
    if family not in FAMILIES:
        raise OptionError(f"unknown family of basis functions {family!r}; one of {listing(FAMILIES)}")
    signature = inspect.signature(FAMILIES[family])
    try:
        signature.bind(**parameters)
    except TypeError as error:
        raise OptionError(
            f"{family} basis: {error}; its arguments are {listing(signature.parameters)}, got {listing(parameters)}"
        ) from None
    return FAMILIES[family](**parameters)
