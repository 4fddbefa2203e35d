"""The header of a model file: what JSON can say of a model, and the names and shapes of its arrays."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np
from jaxtyping import Float

from inphase import basis
from inphase.basis import Layout
from inphase.channels import Channel, Kind, Role
from inphase.errors import listing
from inphase.evidence import Evidence, Trial
from inphase.model import Model
from inphase.noise import Noise
from inphase.phase import PhaseModel
from inphase.preprocess.coordinates import Coordinates
from inphase.preprocess.scaling import Scaling
from inphase.reflex import Reflex
from inphase.tempo import Tempo
from inphase.weight_prior import WeightPrior

REFLEX_ARRAYS = ("lags", "centre", "scale", "places", "gains", "mean", "error_var")
REFLEX_NUMBERS = ("width", "trend", "weight", "fade")
# What older formats did not have, as they meant it.
SINCE: dict[int, dict[str, Any]] = {
    2: {"tempo": {}, "reflex": None, "band": 1.0, "evidence": None},
    3: {"active": None},
}
SINCE_WITHIN: dict[int, dict[str, dict[str, Any]]] = {2: {"prior": {"blocks": []}}, 3: {}}  # in entries that they had


def renewed(described: dict[str, Any], version: int) -> dict[str, Any]:
    """A header of an older format as one of today; raises ValueError for entries it could not have."""
    for since, entries in SINCE.items():
        if version < since:
            early = [name for name in entries if name in described]
            if early:  # the number of the format is not under the checksum
                raise ValueError(f"expected no entry {listing(early)} in format {version}")
            within = {name: more | described[name] for name, more in SINCE_WITHIN[since].items()}
            described = entries | described | within
    return described


def arrays_of(model: Model) -> dict[str, Any]:
    """The arrays of a model by name, in the order in which they are written."""
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
        **_arrays_of_reflex(model.reflex),
    }


def _arrays_of_reflex(reflex: Reflex | None) -> dict[str, Any]:
    if reflex is None:
        return {}
    return {f"reflex_{name}": getattr(reflex, name) for name in REFLEX_ARRAYS}


def describe(model: Model, arrays: dict[str, Any]) -> dict[str, Any]:
    """All of a model but its arrays, of which it holds the shapes: what the header says."""
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
            "blocks": list(model.prior.blocks),
        },
        "phase": {
            "diffusion": model.phase.diffusion,
            "nominal_velocity": model.phase.nominal_velocity,
            "periodic": model.phase.periodic,
        },
        "tempo": asdict(model.tempo),
        "reflex": None if model.reflex is None else {name: getattr(model.reflex, name) for name in REFLEX_NUMBERS},
        "band": model.band,
        "evidence": None if model.evidence is None else asdict(model.evidence),
        "active": None if model.always_active else model.active.tolist(),
        "provenance": dict(model.provenance),
        "arrays": {name: list(array.shape) for name, array in arrays.items()},
    }


def split(shapes: dict[str, list[int]], payload: bytes) -> dict[str, Any]:
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


def build(described: dict[str, Any], arrays: dict[str, Any]) -> Model:
    """The model that a header and its arrays describe.

    Raises KeyError, ValueError, TypeError or an InphaseError where they do not.
    """
    channels = tuple(
        Channel(_text(c["name"]), Role(c["role"]), _text(c["unit"]), Kind(c["kind"]), _text(c["group"]))
        for c in described["channels"]
    )
    bases = [basis.make(**entry) for entry in described["bases"]]
    prior, phase = described["prior"], described["phase"]
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
            tuple(_index(count, arrays["weights"].shape[-1] + 1) for count in _list(prior["blocks"])),
        ),
        noise=Noise(arrays["noise_var"], arrays["noise_correlation_time"]),
        phase=PhaseModel(
            arrays["phase_mean"],
            arrays["phase_cov"],
            _number(phase["diffusion"]),
            _number(phase["nominal_velocity"]),
            _bool(phase["periodic"]),
        ),
        spread=arrays["spread"],
        tempo=Tempo(**{_text(k): _number(v) for k, v in described["tempo"].items()}),
        reflex=_reflex(described["reflex"], arrays),
        band=_number(described["band"]),
        evidence=_evidence(described["evidence"]),
        active=_windows(described["active"]),
        provenance={_text(k): _text(v) for k, v in described["provenance"].items()},
    )


def _reflex(described: dict[str, Any] | None, arrays: dict[str, Any]) -> Reflex | None:
    if described is None:
        return None
    parts: dict[str, Any] = {name: arrays[f"reflex_{name}"] for name in REFLEX_ARRAYS}
    parts |= {name: _number(described[name]) for name in REFLEX_NUMBERS}
    return Reflex(**parts)


def _evidence(described: dict[str, Any] | None) -> Evidence | None:
    if described is None:
        return None
    trials = tuple(
        Trial(
            _text(t["choice"]),
            _text(t["value"]),
            _number(t["error"]),
            _number(t["error_std"]),
            _number(t["coverage"]),
            _number(t["nll"]),
            _bool(t["chosen"]),
        )
        for t in described["trials"]
    )
    conditions = tuple(_text(c) for c in described["conditions"])
    return Evidence(_index(described["held_out"], 2**31), conditions, trials, _number(described["by_the_clock"]))


def _windows(described: list[Any] | None) -> Float[np.ndarray, "_ 2"]:
    if described is None:
        return np.empty((0, 2))
    pairs = [_list(pair) for pair in _list(described)]
    if not pairs or any(len(pair) != 2 for pair in pairs):
        raise ValueError(f"expected windows of two phases each, got {described!r}")
    return np.array([[_number(end) for end in pair] for pair in pairs])


def _bool(value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"expected true or false, got {value!r}")
    return value


def _list(value: object) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"expected a list, got {value!r}")
    return value


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
