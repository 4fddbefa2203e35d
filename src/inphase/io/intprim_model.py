"""Model files of the old library (.bip): pickles, read as data; nothing that a file names is imported or called."""

from __future__ import annotations

import pickletools
import re
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from inphase.errors import ModelFileError

# The names that numpy arrays and MinMaxScalers are written with, from Python 2.7 to today (numpy 2 says `numpy._core`).
RECONSTRUCT, FROM_BUFFER = "numpy.core.multiarray._reconstruct", "numpy.core.numeric._frombuffer"
SCALAR, ENCODE, ARRAY, DTYPE = "numpy.core.multiarray.scalar", "_codecs.encode", "numpy.ndarray", "numpy.dtype"
SCALERS = ("sklearn.preprocessing.data.MinMaxScaler", "sklearn.preprocessing._data.MinMaxScaler")
ADMITTED = (RECONSTRUCT, FROM_BUFFER, SCALAR, ENCODE, ARRAY, DTYPE, *SCALERS)
CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": ()}
TUPLES = {"TUPLE1": -1, "TUPLE2": -2, "TUPLE3": -3}


@dataclass(frozen=True, eq=False)
class OldModel:
    """What a .bip file holds.

    basis_weights: (N, B), a row a demonstration. scaling_groups: the DoFs that share a scaler; None where nothing was
    scaled. low, high: (G,) what the scaler of each group brings to 0 and 1, in the units of the DoFs.
    """

    basis_weights: Float[np.ndarray, "N B"]
    scaling_groups: tuple[tuple[int, ...], ...] | None
    low: Float[np.ndarray, " G"]
    high: Float[np.ndarray, " G"]


@dataclass(eq=False)
class Call:
    """A call that the file asks for: written down, never done."""

    name: str
    arguments: tuple[Any, ...]
    state: Any = None


def read_bip(path: str | PathLike[str]) -> OldModel:
    """The weights and scalers in a .bip file of the old library, from Python 2.7 or 3 (4.2.6).

    Raises ModelFileError for a file that is damaged, is none, or names anything but numpy arrays and MinMaxScalers.
    """
    try:
        content = _parse(Path(path).read_bytes())
        if not isinstance(content, dict) or "basis_weights" not in content:
            raise ModelFileError("expected a dictionary with 'basis_weights'")
        weights = np.atleast_2d(_array(content["basis_weights"]))
        if weights.ndim != 2 or not weights.size or not np.isfinite(weights).all():
            raise ModelFileError(f"expected finite basis weights (N, B), got shape {weights.shape}")
        listed: Any = content.get("scaling_groups")
        groups = None if listed is None else _groups(listed, weights.shape[1])
        scalers = content.get("scalers", []) if groups else []
        if len(scalers) != len(groups or ()):
            raise ModelFileError(f"expected a scaler for each of {len(groups or ())} groups, got {len(scalers)}")
        ends = np.array([_ends(scaler) for scaler in scalers]).reshape(-1, 2)
        return OldModel(weights, groups, ends[:, 0], ends[:, 1])
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read: {error.strerror}") from None
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from None
    except Exception as error:  # noqa: BLE001 - a damaged file may break any step
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ModelFileError(f"{path}: expected a .bip file of IntPrim, got {reason}") from None


def _parse(data: bytes) -> Any:
    """What a pickle holds, with a `Call` for each call; raises ModelFileError for what no .bip file needs."""
    stack: list[Any] = []
    marks: list[int] = []
    memo: dict[int, Any] = {}
    argument: Any

    def cut(start: int) -> list[Any]:
        if start < -len(stack):
            raise ModelFileError("expected a .bip file of IntPrim, got a damaged one")
        items = stack[start:]
        del stack[start:]
        return items

    for opcode, argument, _ in pickletools.genops(data):
        name = opcode.name
        if name in CONSTANTS:
            stack.append(CONSTANTS[name])
        elif name in ("EMPTY_LIST", "EMPTY_DICT"):
            stack.append([] if name == "EMPTY_LIST" else {})
        elif re.fullmatch(r"BININT\d?|LONG[14]|BINFLOAT|(SHORT_)?BIN(STRING|UNICODE|BYTES)8?|BYTEARRAY8", name):
            stack.append(argument)
        elif name == "MARK":
            marks.append(len(stack))
        elif name == "TUPLE" or name in TUPLES:
            stack.append(tuple(cut(TUPLES.get(name) or marks.pop())))
        elif name in ("APPEND", "APPENDS"):
            items = cut(-1 if name == "APPEND" else marks.pop())
            stack[-1].extend(items)
        elif name in ("SETITEM", "SETITEMS"):
            items = cut(-2 if name == "SETITEM" else marks.pop())
            stack[-1].update(zip(items[::2], items[1::2], strict=True))
        elif name in ("MEMOIZE", "BINPUT", "LONG_BINPUT"):
            memo[len(memo) if argument is None else argument] = stack[-1]
        elif name in ("BINGET", "LONG_BINGET"):
            stack.append(memo[argument])
        elif name in ("GLOBAL", "STACK_GLOBAL"):
            stack.append(_admitted(".".join(cut(-2) if argument is None else argument.split(" "))))
        elif name in ("REDUCE", "NEWOBJ"):
            called, arguments = cut(-2)
            stack.append(Call(_admitted(called), tuple(arguments)))
        elif name == "BUILD":
            (state,) = cut(-1)
            stack[-1].state = state
        elif name == "STOP":
            return stack.pop()
        elif name not in ("PROTO", "FRAME"):
            raise ModelFileError(f"refused: it holds the instruction {name}, which no .bip file of IntPrim needs")
    raise ModelFileError("expected a .bip file of IntPrim, got one without an end")


def _admitted(name: str) -> str:
    name = name.replace("numpy._core.", "numpy.core.")
    if name not in ADMITTED:
        raise ModelFileError(f"refused: it names {name[:80]!r}; a .bip file holds numpy arrays and MinMaxScalers alone")
    return name


def _groups(listed: Any, most: int) -> tuple[tuple[int, ...], ...]:
    """The indices in each group, at most as many as there are weights: a short file may say a list very often."""
    groups: list[tuple[int, ...]] = []
    for group in listed:
        indices = [_array(dof) for dof in group] if isinstance(group, (list, tuple)) else _array(group)
        groups.append(tuple(np.array(indices).astype(int).tolist()))
        most -= len(groups[-1])
        if not groups[-1] or most < 0:
            raise ModelFileError("expected scaling groups of at least one DoF each, and no more DoFs than weights")
    return tuple(groups)


def _array(value: Any) -> NDArray[np.float64]:
    """The numbers in what was written as an array or as a number."""
    if isinstance(value, (bool, int, float)):
        return np.array(value, dtype=np.float64)
    if isinstance(value, Call) and value.name == RECONSTRUCT:
        _, shape, kind, fortran, data = value.state
        order = "F" if fortran else "C"
    elif isinstance(value, Call) and value.name == FROM_BUFFER:
        data, kind, shape, order = value.arguments
    elif isinstance(value, Call) and value.name == SCALAR:
        (kind, data), shape, order = value.arguments, (), "C"
    else:
        raise ModelFileError(f"expected an array of numbers, got {getattr(value, 'name', type(value).__name__)}")
    code = kind.arguments[0]
    if not re.fullmatch("[iu][1248]|f[248]", code):
        raise ModelFileError(f"expected an array of numbers, got elements of kind {code!r}")
    if isinstance(data, Call) and data.name == ENCODE:
        data = data.arguments[0]  # bytes that Python 3 wrote for Python 2: a text, to be encoded
    data = data.encode("latin-1") if isinstance(data, str) else data
    flat: NDArray[Any] = np.frombuffer(data, kind.state[1].replace("|", "=") + code)
    return flat.reshape(tuple(shape), order="F" if order == "F" else "C").astype(np.float64)


def _ends(scaler: Any) -> tuple[float, float]:
    """What a MinMaxScaler of one feature brings to 0 and 1; it computes x * scale_ + min_."""
    if not isinstance(scaler, Call) or scaler.name not in SCALERS:
        raise ModelFileError("expected MinMaxScalers as scalers")
    if "scale_" not in (scaler.state or {}):
        raise ModelFileError("its scalers were never fitted: compute_standardization was not called")
    scale, shift = (_array(scaler.state[name]).item() for name in ("scale_", "min_"))
    if not (0 < scale < np.inf and np.isfinite(shift)):
        raise ModelFileError(f"expected scalers with a finite scale above 0, got {scale:g} and shift {shift:g}")
    return -shift / scale, (1 - shift) / scale
