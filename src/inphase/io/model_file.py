"""The model file: one versioned, checksummed file that holds all that is needed to respond.

Layout, little-endian: magic (8 bytes), format (u32), header length (u32), payload length (u64), SHA-256 of header and
payload (32 bytes), the header (JSON), the payload (float64 arrays one after the other, as the header lists them).
Nothing in it is executed, and no size it names is trusted before the file's own size has been compared.
"""

from __future__ import annotations

import hashlib
import json
import math
import struct
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from inphase import basis
from inphase.basis import Layout
from inphase.channels import Channel, Kind, Role
from inphase.errors import InphaseError, ModelFileError, OptionError
from inphase.io.atomic import whole_file
from inphase.model import Model
from inphase.noise import Noise
from inphase.phase import PhaseModel
from inphase.preprocess.coordinates import Coordinates
from inphase.preprocess.scaling import Scaling
from inphase.weight_prior import WeightPrior

MAGIC = b"INPHASE\n"
FORMAT = 1
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
    arrays = _arrays(model)
    header = json.dumps(_describe(model, arrays), ensure_ascii=False, allow_nan=False).encode()
    payload = b"".join(np.ascontiguousarray(array, dtype="<f8").tobytes() for array in arrays.values())
    digest = hashlib.sha256(header + payload).digest()
    with whole_file(path) as temporary:
        temporary.write_bytes(PREFIX.pack(MAGIC, FORMAT, len(header), len(payload), digest) + header + payload)


def read_model(path: str | PathLike[str]) -> Model:
    """The model in a file.

    Raises ModelFileError, naming the file, for one that is missing, not a model, cut short, damaged, written by a
    newer version, or that holds parts that do not fit each other.
    """
    name = Path(path).name
    header, payload = _read(Path(path), name)
    try:
        described = json.loads(header)
        return _build(described, _split(described["arrays"], payload))
    except InphaseError as error:
        raise ModelFileError(f"{name}: the parts of the model do not fit: {error}") from None
    except KeyError as error:
        raise ModelFileError(f"{name}: expected an entry {error} in the header, got none") from None
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError, RecursionError) as error:
        raise ModelFileError(f"{name}: the header does not describe a model: {error}") from None


def _read(path: Path, name: str) -> tuple[bytes, bytes]:
    """Header and payload of a file that is whole and of a known format."""
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            prefix = file.read(PREFIX.size)
            if prefix[:8] != MAGIC[: len(prefix[:8])] or not prefix:
                raise ModelFileError(
                    f"{name}: not an inphase model: expected it to begin with {MAGIC!r}, got {prefix[:8]!r}"
                )
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
    except OSError as error:
        raise ModelFileError(f"{name}: cannot be read: {error.strerror}") from None
    if hashlib.sha256(content).digest() != digest:
        raise ModelFileError(f"{name}: damaged: the checksum of its {len(content)} bytes differs from the one it names")
    return content[:header_size], content[header_size:]


def _arrays(model: Model) -> dict[str, Any]:
    return {
        "references": model.coordinates.references,
        "low": model.scaling.low,
        "high": model.scaling.high,
        "weights": model.prior.samples,
        "noise_var": model.noise.var,
        "noise_correlation_time": model.noise.correlation_time,
        "phase_mean": model.phase.mean,
        "phase_cov": model.phase.cov,
        "spread": model.spread,
    }


def _describe(model: Model, arrays: dict[str, Any]) -> dict[str, Any]:
    kinds = list(dict.fromkeys(model.layout.bases))
    families = {cls: family for family, cls in basis.FAMILIES.items()}
    return {
        "channels": [
            {"name": c.name, "role": c.role.value, "unit": c.unit, "kind": c.kind.value, "group": c.group}
            for c in model.channels
        ],
        "bases": [{"family": families[type(kind)], **kind.parameters()} for kind in kinds],
        "basis_of_feature": [kinds.index(kind) for kind in model.layout.bases],
        "prior": {
            "shrinkage": model.prior.shrinkage,
            "trust": model.prior.trust,
            "partner": model.prior.partner,
        },
        "phase": {
            "diffusion": model.phase.diffusion,
            "nominal_velocity": model.phase.nominal_velocity,
            "periodic": model.phase.periodic,
        },
        "provenance": dict(model.provenance),
        "arrays": {name: list(array.shape) for name, array in arrays.items()},
    }


def _split(shapes: dict[str, list[int]], payload: bytes) -> dict[str, Any]:
    """The arrays of a payload, which must fill it exactly."""
    if any(not isinstance(n, int) or n < 0 for shape in shapes.values() for n in shape):
        raise ValueError(f"expected array shapes of whole numbers, got {shapes}")
    expected = sum(8 * math.prod(shape) for shape in shapes.values())
    if expected != len(payload):
        raise ValueError(f"expected arrays of {expected} bytes, got {len(payload)}")
    arrays, at = {}, 0
    for name, shape in shapes.items():
        count = math.prod(shape)
        arrays[name] = np.frombuffer(payload, dtype="<f8", count=count, offset=at).reshape(shape)
        at += 8 * count
    return arrays


def _build(described: dict[str, Any], arrays: dict[str, Any]) -> Model:
    channels = tuple(
        Channel(_text(c["name"]), Role(c["role"]), _text(c["unit"]), Kind(c["kind"]), _text(c["group"]))
        for c in described["channels"]
    )
    bases = [basis.make(**entry) for entry in described["bases"]]
    prior, phase = described["prior"], described["phase"]
    if not isinstance(phase["periodic"], bool):
        raise ValueError(f"expected periodic to be true or false, got {phase['periodic']!r}")
    return Model(
        channels=channels,
        coordinates=Coordinates(channels, arrays["references"]),
        scaling=Scaling(arrays["low"], arrays["high"]),
        layout=Layout(tuple(bases[_index(i, len(bases))] for i in described["basis_of_feature"])),
        prior=WeightPrior(
            arrays["weights"],
            _number(prior["shrinkage"]),
            _number(prior["trust"]),
            _index(prior["partner"], arrays["weights"].shape[-1] + 1),
        ),
        noise=Noise(arrays["noise_var"], arrays["noise_correlation_time"]),
        phase=PhaseModel(
            arrays["phase_mean"],
            arrays["phase_cov"],
            _number(phase["diffusion"]),
            _number(phase["nominal_velocity"]),
            phase["periodic"],
        ),
        spread=arrays["spread"],
        provenance={_text(k): _text(v) for k, v in described["provenance"].items()},
    )


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError(f"expected text, got {value!r}")
    return value


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"expected a number, got {value!r}")
    return float(value)


def _index(value: object, count: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < count:
        raise ValueError(f"expected a whole number from 0 to {count - 1}, got {value!r}")
    return value
