"""Read one episode from an npz file, trusting nothing that the file says about itself."""

from __future__ import annotations

import math
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.lib import format as npy
from numpy.typing import NDArray

from inphase.arrays import FloatArray
from inphase.errors import DataError, listing
from inphase.io.table import Table

LARGEST = 2**30  # bytes that the arrays of one episode may take once unpacked


def read_npz(path: str | Path, *, time: str = "time") -> Table:
    """The episode in an npz file: `time` (T,) [s] and one (T,) array a channel, or `values` (T, D) and `channels` (D,).

    Raises DataError that names file and array; nothing is unpickled, and nothing over 1 GiB is unpacked.
    """
    arrays = _arrays(path)
    if time not in arrays:
        raise DataError(f"{path}: no array {time!r}; the arrays are {listing(arrays)}")
    times = _numbers(path, time, arrays[time])
    if times.ndim != 1:
        raise DataError(f"{path}: array {time!r}: expected shape (T,), got {times.shape}")
    if {"values", "channels"} <= set(arrays):
        return Table(str(path), *_matrix(path, times, arrays))
    names = tuple(name for name in arrays if name != time)
    if not names:
        raise DataError(f"{path}: expected arrays of channels beside {time!r}, got none")
    columns = [_numbers(path, name, arrays[name]) for name in names]
    for name, column in zip(names, columns, strict=True):
        if column.shape != times.shape:
            raise DataError(
                f"{path}: array {name!r}: expected shape {times.shape} as {time!r}, got {column.shape} "
                "(one array a channel, or 'values' (T, D) and 'channels' (D,))"
            )
    return Table(str(path), names, times, np.stack(columns, axis=1))


def _matrix(
    path: str | Path, times: Float[np.ndarray, " T"], arrays: Mapping[str, NDArray[Any]]
) -> tuple[tuple[str, ...], Float[np.ndarray, " T"], Float[np.ndarray, "T D"]]:
    channels = arrays["channels"]
    if channels.dtype.kind != "U" or channels.ndim != 1:
        raise DataError(f"{path}: array 'channels': expected names (D,), got {channels.dtype} {channels.shape}")
    names = tuple(str(name) for name in channels)
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if twice:
        raise DataError(f"{path}: array 'channels': names must differ, got twice: {listing(twice)}")
    values = _numbers(path, "values", arrays["values"])
    if values.shape != (len(times), len(names)):
        raise DataError(
            f"{path}: array 'values': expected shape {(len(times), len(names))} from the times and the channels, "
            f"got {values.shape}"
        )
    return names, times, values


def _arrays(path: str | Path) -> dict[str, NDArray[Any]]:
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            size = sum(member.file_size for member in members)
            if size > LARGEST:
                raise DataError(f"{path}: expected at most {LARGEST} bytes of arrays, got {size}")
            return {member.filename.removesuffix(".npy"): _array(path, archive, member) for member in members}
    except DataError:
        raise
    except Exception as error:  # noqa: BLE001 - a damaged file makes zipfile and numpy raise almost anything
        raise DataError(f"{path}: expected an npz file, got {_reason(error)}") from None


def _array(path: str | Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    name = member.filename.removesuffix(".npy")
    try:
        # A damaged header may read as code of old Python versions, of which numpy and Python warn.
        with warnings.catch_warnings(), archive.open(member) as file:
            warnings.simplefilter("ignore")
            shape, dtype = _npy_header(file)
            if dtype.hasobject:
                raise DataError(f"{path}: array {name!r}: expected numbers, got Python objects, which are not read")
            # numpy reserves what the header claims, and would list names of no length for ever.
            if dtype.itemsize == 0 or math.prod(shape) * dtype.itemsize > member.file_size:
                raise DataError(f"{path}: array {name!r}: {member.file_size} bytes cannot hold {dtype} {shape}")
        with warnings.catch_warnings(), archive.open(member) as file:
            warnings.simplefilter("ignore")
            return np.asarray(npy.read_array(file, allow_pickle=False))
    except DataError:
        raise
    except Exception as error:  # noqa: BLE001 - as above
        raise DataError(f"{path}: array {name!r} is damaged: {_reason(error)}") from None


def _npy_header(file: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(file)
    return shape, dtype


def _numbers(path: str | Path, name: str, array: NDArray[Any]) -> FloatArray:
    if array.dtype.kind not in "fiub":
        raise DataError(f"{path}: array {name!r}: expected numbers, got {array.dtype}")
    return array.astype(np.float64)


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
