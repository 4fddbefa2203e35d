"""Checks of arguments, each told in one line that names the argument, what was expected and what was got."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from inphase import DataError, InphaseError, OptionError

Numbers = ArrayLike | float | int  # as ArrayLike means it: some who check types tell 1 from 1.0 and a complex


def numbers(
    name: str,
    values: Numbers | None,
    axes: str,
    *,
    finite: bool = True,
    error: type[InphaseError] = DataError,
    **sizes: int,
) -> Float[np.ndarray, ...]:
    """`values` as an array with axes like "T D", some of them of a given size. Raises `error` for anything else."""
    letters = axes.split()
    wanted = f"({', '.join(letters)}{',' * (len(letters) == 1)})" + " with" * bool(sizes)
    wanted = " ".join([wanted, ", ".join(f"{letter} = {size}" for letter, size in sizes.items())]).strip()
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise error(f"{name}: expected numbers {wanted}, got {values!r:.60}") from None
    if array.ndim != len(letters) or any(sizes.get(a, n) != n for a, n in zip(letters, array.shape, strict=True)):
        got = "None" if values is None else array.shape or "one number"
        raise error(f"{name}: expected {wanted}, got {got}")
    if finite and not np.isfinite(array).all():
        raise error(f"{name}: expected finite values, got NaN or infinity")
    return array


def dofs_of(indices: Numbers, count: int, name: str) -> Int[np.ndarray, " M"]:
    """(M,) indices of DoFs, one or several given; raises OptionError for one that does not exist."""
    wanted = np.atleast_1d(np.asarray(indices))
    if wanted.ndim > 1 or wanted.dtype.kind not in "iuf" or not np.isin(wanted, np.arange(count)).all():
        raise OptionError(f"{name}: expected indices of DoFs from 0 to {count - 1}, got {np.asarray(indices).tolist()}")
    return wanted.astype(np.int64)


def names_of(names: ArrayLike, argument: str) -> list[str]:
    """The names of DoFs; raises OptionError for none, or what is no list of them."""
    array = np.asarray(names)
    if array.ndim != 1 or not len(array):
        raise OptionError(f"{argument}: expected a name for every DoF, got {names!r}")
    return [str(name) for name in array]
