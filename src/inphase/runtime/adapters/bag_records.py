"""The messages of a bag, still packed, as they lie in its files: in order, from the first to the end or to the damage.

The index of a bag is not used, since a broken one has none: a file is read once from its start, a chunk at a time.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

from inphase.errors import DataError
from inphase.io.mcap_messages import DESCRIPTION
from inphase.runtime.adapters.bag_chunks import BoundedStream, unpack

ROS1, MCAP, SQLITE = b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0"
MESSAGE, HEADER, CHUNK, CONNECTION = 2, 3, 5, 7  # kinds of record in a bag of ROS 1


class BagDamage(Exception):
    """What keeps the rest of a file from being read."""


@dataclass(frozen=True)
class Connection:
    """A topic as somebody wrote it; `definition` is of its type, in a format of ROS, empty where the bag has none."""

    topic: str
    type: str
    encoding: str
    definition: str = ""
    format: str = ""


Record = tuple[Connection, int, bytes] | Connection  # a message and when it came [ns]; or a topic, before its first


def read_records(path: Path, topics: Collection[str] | None = None) -> Iterator[Record]:
    """All records of one file, told by its first bytes; of the messages at least those on `topics`.

    Raises DataError for what is no bag, BagDamage after the last record that can be read.
    """
    from mcap.exceptions import McapError

    try:
        with path.open("rb") as file:
            magic = file.read(len(SQLITE))
            file.seek(0)
            stream = BoundedStream(file, path.stat().st_size)
            if magic.startswith(ROS1):
                yield from _ros1(stream)
            elif magic.startswith(MCAP):
                yield from _mcap(stream)
            elif magic == SQLITE:
                yield from _sqlite(path, topics)
            else:
                raise DataError(f"expected a bag (.bag, .db3 or .mcap), got a file that begins with {magic!r}")
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}") from None
    except (McapError, EOFError, struct.error, ValueError, OverflowError, KeyError, MemoryError, RuntimeError) as error:
        if isinstance(error, DataError):
            raise
        raise BagDamage(" ".join(str(error).split()) or type(error).__name__) from None


# ------------------------------------------------------------------------------------------------------------- ROS 1


def _ros1(stream: BoundedStream) -> Iterator[Record]:
    version = stream.exactly(13)
    if version != b"#ROSBAG V2.0\n":
        raise DataError(f"expected a bag of version 2.0, got {version!r}")
    yield from _ros1_records(stream, {})


def _ros1_records(stream: BoundedStream, known: dict[bytes, Connection]) -> Iterator[Record]:
    """Those of the file, or of one chunk in it."""
    open_still = False
    while len(length := stream.read(4)) > 0:
        fields = _fields(stream.exactly(_number(length)))
        kind, length = fields[b"op"][0], stream.exactly(4)
        data = stream.read(_number(length))
        if kind == CHUNK:
            content = unpack(fields[b"compression"].decode(), data, _number(fields[b"size"]))
            yield from _ros1_records(BoundedStream(BytesIO(content), len(content)), known)
        if len(data) < _number(length):
            raise EOFError("cut short in the middle of a record")
        if kind == CONNECTION and fields[b"conn"] not in known:
            told = _fields(data)
            definition = told[b"message_definition"].decode(errors="replace")
            known[fields[b"conn"]] = Connection(
                fields[b"topic"].decode(), told[b"type"].decode(), "ros1", definition, "ros1msg"
            )
            yield known[fields[b"conn"]]
        elif kind == MESSAGE:
            seconds, parts = struct.unpack("<II", fields[b"time"])
            yield known[fields[b"conn"]], seconds * 10**9 + parts, data
        elif kind == HEADER:
            open_still = not any(fields[b"index_pos"])  # where the index is, is written last
            if fields.get(b"encryptor"):
                raise DataError(f"expected a bag that is not encrypted, got one by {fields[b'encryptor'].decode()}")
    if open_still:
        raise EOFError("it was never closed, and may lack its end")


def _fields(data: bytes) -> dict[bytes, bytes]:
    fields, at = {}, 0
    while at < len(data):
        end = at + 4 + _number(data[at : at + 4])
        name, _, fields[name] = data[at + 4 : end].partition(b"=")
        at = end
    return fields


def _number(data: bytes) -> int:
    return int(struct.unpack("<I", data)[0])


# ------------------------------------------------------------------------------------------------------------- ROS 2


def _mcap(stream: Any) -> Iterator[Record]:
    from mcap.records import Channel, Chunk, DataEnd, Message, Metadata, Schema
    from mcap.stream_reader import StreamReader, breakup_chunk

    schemas: dict[int, Schema] = {}
    known: dict[int, Connection] = {}
    for record in StreamReader(stream, emit_chunks=True).records:
        parts = [record]
        if isinstance(record, Chunk):
            content = unpack(record.compression, record.data, record.uncompressed_size)
            parts = breakup_chunk(replace(record, compression="", data=content), validate_crc=True)
        for part in parts:
            if isinstance(part, Schema):
                schemas[part.id] = part
            elif isinstance(part, Channel):
                schema = schemas.get(part.schema_id) or Schema(0, b"", "", "")
                definition = schema.data.decode(errors="replace")
                yield known.setdefault(
                    part.id, Connection(part.topic, schema.name, part.message_encoding, definition, schema.encoding)
                )
            elif isinstance(part, Message):
                yield known[part.channel_id], part.log_time, part.data
            elif isinstance(part, Metadata) and part.name == DESCRIPTION:
                raise DataError(
                    "expected a bag of ROS, got a run that inphase recorded: inphase.io.read_recording and "
                    "`inphase replay` read it"
                )
        if isinstance(record, DataEnd):
            return


def _sqlite(path: Path, topics: Collection[str] | None) -> Iterator[Record]:
    import sqlite3

    logged = path.with_name(f"{path.name}-wal").exists()  # then the last messages are in the log, which needs a lock
    uri = f"{path.resolve().as_uri()}?mode=ro{'' if logged else '&immutable=1'}"
    try:
        with closing(sqlite3.connect(uri, uri=True)) as database:
            database.execute("PRAGMA writable_schema = ON")  # a file that was cut short is not opened otherwise
            tables = {str(name) for (name,) in database.execute("SELECT name FROM sqlite_master")}
            if not {"topics", "messages"} <= tables:
                raise DataError(f"expected a bag of ROS 2, got a database of {', '.join(sorted(tables)) or 'nothing'}")
            defined: dict[str, tuple[str, str]] = {}
            if "message_definitions" in tables:
                query = "SELECT topic_type, encoded_message_definition, encoding FROM message_definitions"
                defined = {str(kind): (str(text), str(form)) for kind, text, form in database.execute(query)}
            query = "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
            known = {
                number: Connection(str(name), str(kind), str(encoding), *defined.get(kind, ()))
                for number, name, kind, encoding in database.execute(query)
            }
            yield from known.values()
            picked = [number for number, topic in known.items() if topics is None or topic.topic in topics]
            marks = ", ".join("?" * len(picked))
            query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks})"
            for number, time, data in database.execute(query, picked):
                yield known[number], int(time), bytes(data)
    except sqlite3.Error as error:
        raise BagDamage(str(error)) from None
