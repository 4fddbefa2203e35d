"""Basis functions as text, `gaussian:12`: what --basis takes and tables show."""

from __future__ import annotations

import inspect

from inphase.basis import FAMILIES, Basis, make
from inphase.errors import OptionError, listing


def parse_basis(text: str) -> Basis:
    """The basis of a family's name and its arguments, the first one or more, between colons; raises OptionError."""
    family, *numbers = text.split(":")
    if family not in FAMILIES:
        raise OptionError(f"--basis: unknown family of basis functions {family!r}; one of {listing(FAMILIES)}")
    names = [name for name in inspect.signature(FAMILIES[family]).parameters if name != "centres"]
    try:
        values = [int(numbers[0]), *map(float, numbers[1:])]
        parameters = dict(zip(names[: len(values)], values, strict=True))
    except (IndexError, ValueError):
        form = f"{family}:{names[0]}" + "".join(f"[:{name}]" for name in names[1:])
        raise OptionError(f"--basis: expected {form}, got {text!r}") from None
    return make(family, **parameters)


def show_basis(basis: Basis) -> str:
    """The shortest such text of a basis: without the arguments that are the usual ones. Centres are not spelled."""
    family = next(name for name, kind in FAMILIES.items() if isinstance(basis, kind))
    named = list(basis.parameters().items())
    if "centres" in basis.parameters():
        return f"{family}:{basis.size} placed"
    while len(named) > 1 and make(family, **dict(named[:-1])) == basis:
        named.pop()
    return ":".join([family, *(f"{value:.3g}" for _, value in named)])
