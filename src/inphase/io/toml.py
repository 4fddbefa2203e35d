"""Read a TOML file, with the line named where it is none."""

from __future__ import annotations

import re
import sys
from os import PathLike
from pathlib import Path
from typing import Any

from inphase.errors import DataError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PLACE = re.compile(r" \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)$")


def read_toml(path: str | PathLike[str]) -> dict[str, Any]:
    """The tables of a TOML file; raises DataError that names the file, and the line of what is no TOML."""
    try:
        data = Path(path).read_bytes()
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        line, got = data.count(b"\n", 0, error.start) + 1, data[error.start]
        raise DataError(f"{path}, line {line}: expected text in UTF-8, got the byte 0x{got:02x}") from None
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise DataError(f"{path}: expected TOML, got lists or tables nested too deeply") from None
    except ValueError as error:  # a TOMLDecodeError, or a number of more digits than Python reads
        place = PLACE.search(str(error))
        if place is None:
            raise DataError(f"{path}: expected TOML: {error}") from None
        line = int(place["line"] or len(text.splitlines()) or 1)
        column = f" (column {place['column']})" if place["column"] else " (at its end)"
        raise DataError(f"{path}, line {line}: expected TOML: {str(error)[: place.start()]}{column}") from None
