"""Bytes of files that may be damaged or a stranger's: nothing they say makes more memory be asked for than is there."""

from __future__ import annotations

import bz2
from io import BytesIO
from typing import IO

LARGEST = 2**30  # bytes that a chunk may unpack to


class BoundedStream:
    """A file that is never asked for more than it holds: a damaged length may say anything."""

    def __init__(self, file: IO[bytes] | BytesIO, size: int) -> None:
        self._file, self._size = file, size

    def read(self, count: int) -> bytes:
        """So many bytes, or what there is."""
        return self._file.read(max(min(count, self._size - self._file.tell()), 0))

    def exactly(self, count: int) -> bytes:
        """So many bytes; raises EOFError where there are less."""
        data = self.read(count)
        if len(data) < count:
            raise EOFError("cut short in the middle of a record")
        return data


def unpack(compression: str, data: bytes, size: int) -> bytes:
    """The content of a chunk, or as much as there is of one that was cut short; raises what its library raises."""
    if not 0 <= size <= LARGEST:
        raise ValueError(f"expected a chunk of at most {LARGEST} bytes, got one of {size}")
    if compression in ("", "none"):
        return data
    if compression == "bz2":
        return bz2.BZ2Decompressor().decompress(data, size)
    if compression == "lz4":
        import lz4.frame

        unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, size)
        return unpacked
    if compression == "zstd":
        import zstandard

        try:
            return zstandard.ZstdDecompressor().stream_reader(data).read(size)
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from None
    raise ValueError(f"expected chunks packed by bz2, lz4 or zstd, got {compression!r}")
