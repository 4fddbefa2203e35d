"""What a page of the documentation has to run: blocks of code, commands in them, and code in tables."""

from __future__ import annotations

import re
from collections.abc import Iterator


def blocks(text: str) -> Iterator[tuple[str, int, str]]:
    """The fenced blocks of a page as (language, line of the first line, text), less those marked as not run.

    The mark is a comment before the block: <!-- not run: why -->.
    """
    lines, i, marked = text.splitlines(), 0, False
    while i < len(lines):
        fence = re.fullmatch(r"```(\w*).*", lines[i])
        if fence:
            end = next(j for j in range(i + 1, len(lines)) if lines[j].startswith("```"))
            if not marked:
                yield fence[1], i + 2, "\n".join(lines[i + 1 : end])
            i, marked = end, False
        elif lines[i].strip():
            marked = lines[i].strip().startswith("<!-- not run:")
        i += 1


def commands(block: str) -> list[str]:
    """The commands of a console block: no prompt, no comment, continued lines in one."""
    lines = (line.strip().removeprefix("$ ") for line in block.replace("\\\n", " ").splitlines())
    return [line for line in lines if line and not line.startswith("#")]


def rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """The rows of a page's tables as (line, cells), their heads included."""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("| "):
            yield number, [cell.strip() for cell in line.strip().strip("|").split("|")]


def leading_code(cell: str) -> list[str]:
    """The pieces of code that a cell begins with, up to the first that is prose."""
    return re.findall(r"`([^`]+)`", re.match(r"(?:`[^`]+` *)*", cell)[0])
