"""The model file: one versioned, checksummed file that holds all that is needed to respond.

Layout, little-endian: magic (8 bytes), format (u32), header length (u32), payload length (u64), SHA-256 of header and
payload (32 bytes), the header (JSON), the payload (float64 arrays one after the other, as the header lists them).
Nothing in it is executed, and no size it names is trusted before the file's own size has been compared.
"""

from __future__ import annotations

import hashlib
import io
import json
import struct
from os import PathLike
from pathlib import Path

import numpy as np

from inphase.errors import InphaseError, ModelFileError, OptionError
from inphase.io.atomic import whole_file
from inphase.io.model_header import arrays_of, build, describe, renewed, split
from inphase.model import Model

MAGIC = b"INPHASE\n"
FORMAT = 4  # 1 had no tempo, reflex, band and evidence; 2 no windows; 3 no leaps
PREFIX = struct.Struct("<8sIIQ32s")
LARGEST_HEADER = 16 * 2**20  # bytes
LARGEST_PAYLOAD = 2 * 2**30  # bytes


def write_model(model: Model, path: str | PathLike[str]) -> None:
    """Write a model file, whole or not at all.

    Raises OptionError where the folder is not there, or something stands there that is no model.
    """
    there = Path(path)
    if there.is_file() and there.stat().st_size:
        with there.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise OptionError(f"cannot write {there}: expected a model or nothing there, got another file")
    with whole_file(path) as temporary:
        temporary.write_bytes(model_bytes(model))


def model_bytes(model: Model) -> bytes:
    """All that a model file holds, to be kept within another file."""
    header, payload = _written(model)
    digest = hashlib.sha256(header + payload).digest()
    return PREFIX.pack(MAGIC, FORMAT, len(header), len(payload), digest) + header + payload


def model_hash(model: Model) -> str:
    """SHA-256 of all that a model is, in hexadecimal: the checksum its file holds, wherever that lies."""
    return hashlib.sha256(b"".join(_written(model))).hexdigest()


def read_model(path: str | PathLike[str]) -> Model:
    """The model in a file.

    Raises ModelFileError, naming the file, for one that is missing, not a model, cut short, damaged, written by a
    newer version, or that holds parts that do not fit each other.
    """
    name = Path(path).name
    try:
        size = Path(path).stat().st_size
        with Path(path).open("rb") as file:
            return _model(file, size, name)
    except OSError as error:
        raise ModelFileError(f"{name}: cannot be read: {error.strerror}") from None


def model_of_bytes(content: bytes, name: str) -> Model:
    """The model in what `model_bytes` gave; raises as `read_model`, naming it so."""
    return _model(io.BytesIO(content), len(content), name)


def checksum_named(content: bytes) -> str:
    """The checksum that the bytes of a model name, `model_hash` of it; '' where they are too few."""
    return PREFIX.unpack_from(content)[4].hex() if len(content) >= PREFIX.size else ""


def _model(file: io.BufferedIOBase, size: int, name: str) -> Model:
    version, header, payload = _read(file, size, name)
    try:
        described = json.loads(header)
        described = renewed(described, version)
        return build(described, split(described["arrays"], payload))
    except InphaseError as error:
        raise ModelFileError(f"{name}: the parts of the model do not fit: {error}") from None
    except KeyError as error:
        raise ModelFileError(f"{name}: expected an entry {error} in the header, got none") from None
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError, RecursionError) as error:
        raise ModelFileError(f"{name}: the header does not describe a model: {error}") from None


def _written(model: Model) -> tuple[bytes, bytes]:
    """Header and payload."""
    arrays = arrays_of(model)
    header = json.dumps(describe(model, arrays), ensure_ascii=False, allow_nan=False).encode()
    return header, b"".join(np.ascontiguousarray(array, dtype="<f8").tobytes() for array in arrays.values())


def _read(file: io.BufferedIOBase, size: int, name: str) -> tuple[int, bytes, bytes]:
    """Format, header and payload of a file of so many bytes that is whole and of a known format."""
    prefix = file.read(PREFIX.size)
    if prefix[:8] != MAGIC[: len(prefix[:8])] or not prefix:
        raise ModelFileError(f"{name}: not an inphase model: expected it to begin with {MAGIC!r}, got {prefix[:8]!r}")
    if len(prefix) < PREFIX.size:
        raise ModelFileError(f"{name}: cut short: expected at least {PREFIX.size} bytes, got {size}")
    _, version, header_size, payload_size, digest = PREFIX.unpack(prefix)
    if version > FORMAT or version < 1:
        raise ModelFileError(
            f"{name}: expected model format {FORMAT} or older, got {version}: "
            "written by a newer inphase, or damaged at byte 8"
        )
    for what, got, limit in (
        ("header", header_size, LARGEST_HEADER),
        ("payload", payload_size, LARGEST_PAYLOAD),
    ):
        if got > limit:
            raise ModelFileError(f"{name}: expected a {what} of at most {limit} bytes, got {got}")
    expected = PREFIX.size + header_size + payload_size
    if size != expected:
        raise ModelFileError(f"{name}: cut short or damaged: expected {expected} bytes, got {size}")
    content = file.read(header_size + payload_size)
    if hashlib.sha256(content).digest() != digest:
        raise ModelFileError(f"{name}: damaged: the checksum of its {len(content)} bytes differs from the one it names")
    return version, content[:header_size], content[header_size:]
