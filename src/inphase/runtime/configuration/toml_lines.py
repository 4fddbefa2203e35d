"""On which line of a TOML text a key stands, for messages: the parser does not say."""

from __future__ import annotations

import re
from collections.abc import Sequence

PART = r"""(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')"""
KEY = rf"{PART}(?:\s*\.\s*{PART})*"
HEADER = re.compile(rf"\s*\[\[?\s*({KEY})\s*\]")
ENTRY = re.compile(rf"\s*({KEY})\s*=")
QUOTED = re.compile(rf"{PART}")


def line_of(text: str, path: Sequence[str]) -> int:
    """The line of the longest beginning of that path which has one; 1 where nothing of it has.

    What stands inside of an inline table or a list is where that begins.
    """
    best, length, table = 1, 0, list[str]()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := HEADER.match(line):
            found = table = _parts(header[1])
        elif entry := ENTRY.match(line):
            found = [*table, *_parts(entry[1])]
        else:
            continue
        common = next((i for i, pair in enumerate(zip(found, path, strict=False)) if pair[0] != pair[1]), None)
        common = min(len(found), len(path)) if common is None else common
        # A header of something deeper speaks of its table too, where that has no line of its own.
        if common > length:
            best, length = number, common
    return best


def _parts(key: str) -> list[str]:
    return [part[1:-1] if part[0] in "\"'" else part for part in QUOTED.findall(key)]
