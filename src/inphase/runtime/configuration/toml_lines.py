"""On which line of a TOML text a key stands, for messages: the parser does not say."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PART = r"""(?:[A-Za-z0-9_-]+|"(?:\\.|[^"\\\n])*"|'[^'\n]*')"""
KEY = rf"{PART}(?:[ \t]*\.[ \t]*{PART})*"
BETWEEN = re.compile(r"(?:\s|#[^\n]*)+")
HEADER = re.compile(rf"\[\[?[ \t]*({KEY})[ \t]*\]")
ENTRY = re.compile(rf"({KEY})[ \t]*=")
LINE = re.compile(r"[^\n]*\n?")
# What a value is made of: texts and comments first, since what looks like a bracket within them is none.
TOKEN = re.compile(
    r'''"""(?:\\.|[^\\])*?"""+ | \'\'\'.*?\'\'\'+ | "(?:\\.|[^"\\\n])*" | '[^'\n]*' | \#[^\n]*'''
    r"""| (?P<opens>[\[{]) | (?P<closes>[\]}]) | (?P<ends>\n) | .""",
    re.DOTALL | re.VERBOSE,
)


def line_of(text: str, path: Sequence[str]) -> int:
    """The line of the longest beginning of that path which has one; 1 where nothing of it has.

    What stands inside of an inline table or a list is where that begins. A table without a line of its own is where
    the first of its entries or tables is.
    """
    best, longest, own = 1, 0, False
    for at, found in _keys(text):
        pairs = zip(found, path, strict=False)
        common = next((i for i, (one, other) in enumerate(pairs) if one != other), min(len(found), len(path)))
        whole = common == len(found)
        if (common, whole) > (longest, own) and common:
            best, longest, own = text.count("\n", 0, at) + 1, common, whole
    return best


def _keys(text: str) -> Iterator[tuple[int, list[str]]]:
    """Where every header and every entry begins, and its path from the root."""
    at, table = 0, list[str]()
    while at < len(text):
        if between := BETWEEN.match(text, at):
            at = between.end()
        elif header := HEADER.match(text, at):
            table = _parts(header[1])
            yield at, table
            at = _next_line(text, header.end())
        elif entry := ENTRY.match(text, at):
            yield at, [*table, *_parts(entry[1])]
            at = _after_value(text, entry.end())
        else:
            at = _next_line(text, at)


def _parts(key: str) -> list[str]:
    """The names of a dotted key: the parser knows what may be quoted how."""
    inner: Any = tomllib.loads(f"{key} = 0")
    parts = list[str]()
    while isinstance(inner, dict):
        part, inner = next(iter(inner.items()))
        parts.append(part)
    return parts


def _after_value(text: str, at: int) -> int:
    """Where the line ends on which a value does."""
    depth = 0
    for token in TOKEN.finditer(text, at):
        depth += (token["opens"] is not None) - (token["closes"] is not None)
        if token["ends"] and depth <= 0:
            return token.end()
    return len(text)


def _next_line(text: str, at: int) -> int:
    line = LINE.match(text, at)
    return line.end() if line else len(text)
