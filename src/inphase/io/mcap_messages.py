"""How a live run is written as MCAP: a record of what it is of, its model, and JSON messages on five topics.

A float is written so that it is read again to the last bit. JSON knows neither NaN nor infinity: NaN is null, infinity
1e999, which every reader takes for it; a channel that was not seen is left out. Channels and signals are named in every
message, so that Foxglove plots `/observation.values.hand_x`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, Kind, Role, check_channels
from inphase.errors import DataError
from inphase.recording import RecordedCommand, RecordedEvent
from inphase.result import Estimate, Response, Status

FORMAT = "1"
DESCRIPTION = "inphase"  # the name of the metadata record
MODEL = "model.inphase"  # the name of the attachment, which is a model file
OBSERVATION, ESTIMATE, RESPONSE, COMMAND, EVENT = "/observation", "/estimate", "/response", "/command", "/event"
NUMBER = {"type": ["number", "null"]}
NUMBERS = {"type": "array", "items": NUMBER}
BY_NAME = {"type": "object", "additionalProperties": NUMBERS}
TEXT = {"type": "string"}
ESTIMATED = ("time", "phase", "phase_std", "phase_velocity", "phase_velocity_std", "log_likelihood")
TOLD = ("kind", "reason", "before", "after")
FIELDS: dict[str, dict[str, Any]] = {
    OBSERVATION: {"time": NUMBER, "values": {"type": "object", "additionalProperties": {"type": "number"}}},
    ESTIMATE: {**dict.fromkeys(ESTIMATED, NUMBER), "status": {"enum": [status.name for status in Status]}},
    RESPONSE: {"times": NUMBERS, "phases": NUMBERS, "mean": BY_NAME, "std": BY_NAME},
    COMMAND: {"time": NUMBER, "times": NUMBERS, "positions": BY_NAME},
    EVENT: {"time": NUMBER, **dict.fromkeys(TOLD, TEXT)},
}


def schema(topic: str) -> bytes:
    """The JSON schema of the messages on a topic."""
    fields = FIELDS[topic]
    return json.dumps({"type": "object", "properties": fields, "required": list(fields)}).encode()


# ------------------------------------------------------------------------------------------------------- description


Described = tuple[str, tuple[Channel, ...], dict[str, str]]  # name, channels and provenance


def describe_run(name: str, channels: Sequence[Channel], provenance: Mapping[str, str]) -> dict[str, str]:
    """What the metadata record says: texts by name, with a checksum, as MCAP has none for it."""
    described = {
        "format": FORMAT,
        "name": name,
        "channels": json.dumps([asdict(channel) for channel in channels]),
        "provenance": json.dumps(dict(provenance)),
    }
    return {**described, "sha256": _checksum(described)}


def described_run(described: Mapping[str, str]) -> Described:
    """Name, channels and provenance from a metadata record; raises DataError and what a wrong entry raises."""
    if _checksum(described) != described.get("sha256"):
        raise DataError("damaged: the checksum of the description differs from the one it names")
    if described["format"] != FORMAT:
        raise DataError(f"expected format {FORMAT}, got {described['format']}: written by a newer inphase")
    channels = tuple(
        Channel(str(c["name"]), Role(c["role"]), str(c["unit"]), Kind(c["kind"]), str(c["group"]))
        for c in json.loads(described["channels"])
    )
    check_channels(channels)
    return described["name"], channels, {key: str(text) for key, text in json.loads(described["provenance"]).items()}


def _checksum(described: Mapping[str, str]) -> str:
    named = sorted((key, text) for key, text in described.items() if key != "sha256")
    return hashlib.sha256(json.dumps(named).encode()).hexdigest()


# ---------------------------------------------------------------------------------------------------------- messages


def observation(time: float, names: Sequence[str], values: Float[np.ndarray, " D"]) -> str:
    """One sample of the first D of these channels; what is not finite was not seen."""
    seen = np.flatnonzero(np.isfinite(values)).tolist()
    return json.dumps({"time": float(time), "values": {names[i]: float(values[i]) for i in seen}})


def estimate(made: Estimate) -> str:
    """An estimate; its status by its name, as the sentence may be put otherwise some day."""
    numbers = {name: float(getattr(made, name)) for name in ESTIMATED}
    return f'{_plain(json.dumps(numbers))[:-1]}, "status": "{made.status.name}"}}'


def response(made: Response) -> str:
    """A response, by channel."""
    mean, std = _by_name(made.channels, made.mean), _by_name(made.channels, made.std)
    return f'{{"times": {_numbers(made.times)}, "phases": {_numbers(made.phases)}, "mean": {mean}, "std": {std}}}'


def command(sent: RecordedCommand) -> str:
    """A command, by signal."""
    positions = _by_name(sent.signals, sent.positions)
    return f'{{"time": {_numbers(sent.time)}, "times": {_numbers(sent.times)}, "positions": {positions}}}'


def event(told: RecordedEvent) -> str:
    """An event."""
    return f'{{"time": {_numbers(told.time)}, {json.dumps({name: getattr(told, name) for name in TOLD})[1:]}'


def _numbers(values: Float[np.ndarray, ...] | float) -> str:
    return _plain(json.dumps(np.asarray(values, dtype=np.float64).tolist()))


def _by_name(names: Sequence[str], columns: Float[np.ndarray, "S C"]) -> str:
    named = zip(names, columns.T, strict=True)
    return "{" + ", ".join([f"{json.dumps(name)}: {_numbers(column)}" for name, column in named]) + "}"


def _plain(text: str) -> str:
    """Numbers as every reader of JSON takes them."""
    return text.replace("NaN", "null").replace("Infinity", "1e999")


# ----------------------------------------------------------------------------------------------- and what they told


def read_observation(message: Any, index: Mapping[str, int]) -> tuple[float, Float[np.ndarray, " D"]]:
    """Time and values of all channels, NaN where not seen; `index` is their place by name."""
    values = np.full(len(index), np.nan)
    for name, value in message["values"].items():
        values[index[name]] = _number(value)
    return _number(message["time"]), values


def read_estimate(message: Any) -> Estimate:
    """The estimate of a message."""
    return Estimate(**{name: _number(message[name]) for name in ESTIMATED}, status=Status[message["status"]])


def read_response(message: Any) -> Response:
    """The response of a message."""
    times, phases = _array(message["times"]), _array(message["phases"])
    if phases.shape != times.shape:
        raise ValueError(f"expected {len(times)} phases, got {len(phases)}")
    channels = tuple(message["mean"])
    mean, std = (_columns(message[name], channels, len(times)) for name in ("mean", "std"))
    return Response(times, phases, mean, std, channels)


def read_command(message: Any) -> RecordedCommand:
    """The command of a message."""
    times, signals = _array(message["times"]), tuple(message["positions"])
    positions = _columns(message["positions"], signals, len(times))
    return RecordedCommand(_number(message["time"]), times, positions, signals)


def read_event(message: Any) -> RecordedEvent:
    """The event of a message."""
    return RecordedEvent(_number(message["time"]), *(str(message[name]) for name in TOLD))


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)


def _array(values: Any) -> Float[np.ndarray, " S"]:
    return np.array([_number(value) for value in values], dtype=np.float64)


def _columns(by_name: Any, names: Sequence[str], count: int) -> Float[np.ndarray, "S C"]:
    return np.array([_array(by_name[name]) for name in names], dtype=np.float64).reshape(len(names), count).T
