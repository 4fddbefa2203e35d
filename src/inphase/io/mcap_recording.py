"""Read what the recorder of a live run wrote (MCAP), whether it was closed, killed or damaged."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable, Iterator
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from inphase.errors import DataError, InphaseError, ModelFileError
from inphase.io.mcap_messages import (
    COMMAND,
    DESCRIPTION,
    ESTIMATE,
    EVENT,
    MODEL,
    OBSERVATION,
    RESPONSE,
    described_run,
    read_command,
    read_estimate,
    read_event,
    read_observation,
    read_response,
)
from inphase.io.model_file import checksum_named, model_of_bytes
from inphase.model import Model
from inphase.recording import RecordedCommand, RecordedEvent, Recording
from inphase.result import Estimate, Response

if TYPE_CHECKING:
    from mcap.records import McapRecord

COMPRESSED = ("zstd", "lz4")
MAGIC = b"\x89MCAP0\r\n"
T = TypeVar("T")


def read_recording(path: str | PathLike[str]) -> Recording:
    """The run in an MCAP file of `inphase.runtime.recorder`.

    Of a file that was cut short or is damaged, all up to the part that does not fit its checksum (a quarter of a
    second is one); `provenance["damage"]` says where that is, and is not there otherwise. A response stands beside the
    estimate before it: of several the last, and none that was made before all estimates. Raises DataError, naming the
    file, for one that is missing, no recording, or damaged before it says what it is of.
    """
    return _read(Path(path), _recording)


def read_recorded_model(path: str | PathLike[str]) -> Model | None:
    """The model that a recording was made with, from the recording; None where it holds none.

    Raises DataError, naming the file, as `read_recording`, and for a model that is damaged or not the one that the
    recording names.
    """
    return _read(Path(path), _recorded_model)


def _read(path: Path, parse: Callable[[bytes, str], T]) -> T:
    try:
        return parse(path.read_bytes(), path.stem)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except InphaseError as error:
        raise DataError(f"{path}: {error}") from None
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise DataError(f"{path}: its content is not that of a recording: {error!r}") from None


def _recording(content: bytes, stem: str) -> Recording:
    from mcap.records import Channel, Message, Metadata

    described, damage = None, ""
    index: dict[str, int] = {}
    topics: dict[int, str] = {}
    samples, estimates, responses = [], list[Estimate](), list[Response | None]()
    commands, events = list[RecordedCommand](), list[RecordedEvent]()
    for record in _records(content):
        if isinstance(record, str):
            damage = record
        elif isinstance(record, Metadata) and record.name == DESCRIPTION:
            described = described_run(record.metadata)
            index = {channel.name: i for i, channel in enumerate(described[1])}
        elif isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Message) and described is not None:
            topic = topics.get(record.channel_id)
            if topic == OBSERVATION:
                samples.append(read_observation(json.loads(record.data), index))
            elif topic == ESTIMATE:
                estimates.append(read_estimate(json.loads(record.data)))
                responses.append(None)
            elif topic == RESPONSE and responses:
                responses[-1] = read_response(json.loads(record.data))
            elif topic == COMMAND:
                commands.append(read_command(json.loads(record.data)))
            elif topic == EVENT:
                events.append(read_event(json.loads(record.data)))
    if described is None:
        raise DataError(_foreign(damage))
    name, channels, provenance = described
    return Recording(
        name or stem,
        channels,
        np.array([time for time, _ in samples], dtype=np.float64),
        np.array([values for _, values in samples], dtype=np.float64).reshape(len(samples), len(channels)),
        tuple(estimates),
        tuple(responses),
        {**provenance, "damage": damage} if damage else provenance,
        tuple(commands),
        tuple(events),
    )


def _recorded_model(content: bytes, stem: str) -> Model | None:
    from mcap.records import Attachment, Metadata

    described, attached, damage = None, None, ""
    for record in _records(content):
        if isinstance(record, str):
            damage = record
        elif isinstance(record, Metadata) and record.name == DESCRIPTION:
            described = described_run(record.metadata)
        elif isinstance(record, Attachment) and record.name == MODEL:
            attached = record.data
        if described is not None and attached is not None:
            break
    if described is None:
        raise DataError(_foreign(damage))
    if attached is None:
        return None
    named, got = described[2].get("model", ""), checksum_named(attached)
    if named != got:
        raise ModelFileError(f"{MODEL}: expected the model that the recording names, {named[:12]}…, got {got[:12]}…")
    return model_of_bytes(attached, MODEL)


def _foreign(damage: str) -> str:
    return f"expected a recording of inphase, got an MCAP file that tells of none{damage and ': '}{damage}"


def _records(content: bytes) -> Iterator[McapRecord | str]:
    """All records up to the end of the data or the first damage; then a text that says which."""
    from mcap.exceptions import McapError
    from mcap.records import Chunk, DataEnd
    from mcap.stream_reader import StreamReader, breakup_chunk

    if content[: len(MAGIC)] != MAGIC:
        raise DataError(f"expected an MCAP file, which begins with {MAGIC!r}, got {content[: len(MAGIC)]!r}")
    stream = io.BytesIO(content)  # not the file: a size that is not true would be asked of memory before it is read
    compressed = ""
    records = StreamReader(stream, emit_chunks=True, record_size_limit=len(content)).records
    whole = 0
    try:
        for record in records:
            if isinstance(record, Chunk):
                if record.compression in COMPRESSED:  # little may unpack to more than there is memory
                    compressed = record.compression
                    break
                yield from breakup_chunk(record, validate_crc=True)
            else:
                yield record
            if isinstance(record, DataEnd):
                return
            whole = stream.tell()
    except (McapError, struct.error, ValueError, OverflowError) as error:
        ends = stream.tell() >= len(content)
        yield f"{'cut short' if ends else 'damaged'} after byte {whole} of {len(content)}: {error or 'it ends there'}"
    if compressed:
        raise DataError(f"expected chunks that are not compressed, got {compressed}: `mcap decompress` unpacks them")
