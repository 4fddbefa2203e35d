"""Read what the recorder of a live run wrote (MCAP), whether it was closed, killed or damaged."""

from __future__ import annotations

import io
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TypeVar

from inphase.errors import DataError, InphaseError, ModelFileError
from inphase.io.mcap_messages import DESCRIPTION, MODEL, described_run
from inphase.io.mcap_records import MAGIC, Records
from inphase.io.mcap_run import Gathered
from inphase.io.model_file import checksum_named, model_of_bytes
from inphase.model import Model
from inphase.recording import Recording

UNREADABLE = (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError)  # of a wrong message
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
    except UNREADABLE as error:
        raise DataError(f"{path}: its content is not that of a recording: {error!r}") from None


def _recording(content: bytes, stem: str) -> Recording:
    records, gathered = Records(), Gathered()
    for record in records.take(io.BytesIO(content), len(content)):
        gathered.take(record)
    damage = _damage(records, content)
    if gathered.described is None:
        raise DataError(_foreign(damage))
    name, channels, provenance = gathered.described
    return Recording(
        name or stem,
        channels,
        gathered.times,
        gathered.values,
        tuple(gathered.estimates),
        tuple(gathered.responses.get(i) for i in range(gathered.count)),
        {**provenance, "damage": damage} if damage else provenance,
        tuple(gathered.commands),
        tuple(gathered.events),
    )


def _recorded_model(content: bytes, stem: str) -> Model | None:
    from mcap.records import Attachment, Metadata

    records, described, attached = Records(), None, None
    for record in records.take(io.BytesIO(content), len(content)):
        if isinstance(record, Metadata) and record.name == DESCRIPTION:
            described = described_run(record.metadata)
        elif isinstance(record, Attachment) and record.name == MODEL:
            attached = record.data
        if described is not None and attached is not None:
            break
    if described is None:
        raise DataError(_foreign(_damage(records, content)))
    if attached is None:
        return None
    named, got = described[2].get("model", ""), checksum_named(attached)
    if named != got:
        raise ModelFileError(f"{MODEL}: expected the model that the recording names, {named[:12]}…, got {got[:12]}…")
    return model_of_bytes(attached, MODEL)


def _foreign(damage: str) -> str:
    return f"expected a recording of inphase, got an MCAP file that tells of none{damage and ': '}{damage}"


def _damage(records: Records, content: bytes) -> str:
    """Why there is no more in a file; empty where it came to its end."""
    if not records.offset:
        raise DataError(f"expected an MCAP file, which begins with {MAGIC!r}, got {content!r}")
    if records.ended or records.damage:
        return records.damage
    return f"cut short after byte {records.offset} of {len(content)}: it ends there"
