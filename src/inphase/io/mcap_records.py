"""The records of an MCAP file, one after the other, as far as it is written: of a whole file, or of one that grows."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from typing import TYPE_CHECKING

from inphase.errors import DataError

if TYPE_CHECKING:
    from mcap.records import McapRecord

COMPRESSED = ("zstd", "lz4")
MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # of every record: what it is, and how many bytes follow
SPAN = struct.Struct("<QQ")  # at the beginning of a chunk: the times of its first and its last message [ns]
CHUNK = 0x06


class Records:
    """Takes whole records from where it was the last time on; one that is not whole yet waits.

    offset: all bytes before it have been taken. ended: whether the data came to its end. damage: what
    is wrong with the record at the offset, after which nothing more is taken; empty while all is well.
    """

    def __init__(self) -> None:
        self.offset = 0
        self.ended = False
        self.damage = ""

    def take(self, stream: io.BufferedIOBase, size: int, at_most: int | None = None) -> Iterator[McapRecord]:
        """What there is in a stream of that many bytes; chunks broken up.

        at_most: bytes, after which the rest is left, by whole records. Nothing that a record says of its length makes
        more memory be asked for than there are bytes. Raises DataError for what is no MCAP file, or compressed.
        """
        from mcap.exceptions import McapError
        from mcap.records import Chunk, DataEnd
        from mcap.stream_reader import StreamReader, breakup_chunk

        if not self.offset:
            stream.seek(0)
            begins = stream.read(len(MAGIC))
            if not MAGIC.startswith(begins):
                raise DataError(f"expected an MCAP file, which begins with {MAGIC!r}, got {begins!r}")
            if len(begins) < len(MAGIC):
                return
            self.offset = len(MAGIC)
        stop = size if at_most is None else self.offset + at_most
        packed = ""
        while not self.ended and not self.damage and self.offset < stop:
            found = _head(stream, self.offset, size)
            if found is None:
                return
            _, end = found
            stream.seek(self.offset)
            content = stream.read(end - self.offset)
            if len(content) < end - self.offset:  # it became shorter meanwhile
                return
            reader = StreamReader(io.BytesIO(content), skip_magic=True, emit_chunks=True, record_size_limit=None)
            try:
                record = next(iter(reader.records), None)
                chunk = record if isinstance(record, Chunk) else None
                if chunk is not None and chunk.compression in COMPRESSED:  # little may unpack to more than memory
                    packed = chunk.compression
                    break
                records = [record] if chunk is None else breakup_chunk(chunk, validate_crc=True)
            except (McapError, struct.error, ValueError, OverflowError) as error:
                self.damage = f"damaged after byte {self.offset} of {size}: {error or 'a record ends too early'}"
                return
            self.offset = end
            self.ended = isinstance(record, DataEnd)
            yield from (record for record in records if record is not None)
        if packed:
            raise DataError(f"expected chunks that are not compressed, got {packed}: `mcap decompress` unpacks them")


def last_time(stream: io.BufferedIOBase, size: int) -> int:
    """The time of the last message [ns] in the whole chunks of a stream of that many bytes, by their heads alone."""
    offset, last = len(MAGIC), 0
    while (found := _head(stream, offset, size)) is not None:
        kind, end = found
        if kind == CHUNK:
            stream.seek(offset + HEAD.size)
            span = stream.read(SPAN.size)
            last = max(last, SPAN.unpack(span)[1]) if len(span) == SPAN.size else last
        offset = end
    return last


def _head(stream: io.BufferedIOBase, offset: int, size: int) -> tuple[int, int] | None:
    """What the record there is and where it ends; None where it is not whole yet."""
    if size < offset + HEAD.size:
        return None
    stream.seek(offset)
    head = stream.read(HEAD.size)
    if len(head) < HEAD.size:
        return None
    kind, length = HEAD.unpack(head)
    end = offset + HEAD.size + length
    return (kind, end) if end <= size else None
