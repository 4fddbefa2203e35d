"""Basis functions as text, `gaussian:12`: what --basis takes and tables show."""

from __future__ import annotations

from inphase import basis as families
from inphase.basis import FAMILIES, Basis
from inphase.errors import OptionError


def parse_basis(text: str) -> Basis:
    """The basis of `family:size` or `family:size:width`, of a polynomial `polynomial:degree`; raises OptionError."""
    family, *numbers = text.split(":")
    names = ("degree" if family == "polynomial" else "size", "width")
    try:
        values = [int(numbers[0]), *map(float, numbers[1:])]
        parameters = dict(zip(names[: len(values)], values, strict=True))
    except (IndexError, ValueError):
        raise OptionError(f"--basis: expected family:size or family:size:width, got {text!r}") from None
    return families.make(family, **parameters)


def show_basis(basis: Basis) -> str:
    """The shortest such text of a basis: without a width that is the usual one."""
    family = next(name for name, kind in FAMILIES.items() if isinstance(basis, kind))
    size, *width = basis.parameters().values()
    short = f"{family}:{size}"
    return short if parse_basis(short) == basis else f"{short}:{width[0]:.3g}"
