"""One episode as a CSV file: read, with the very cell named where one is wrong, and written."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from jaxtyping import Float

from inphase.errors import DataError, OptionError, listing
from inphase.io.atomic import whole_file
from inphase.io.table import Table

MISSING = ("", "nan", "na", "null")  # what an empty cell may say, in lower case
DELIMITERS = (",", ";", "\t", "|", " ")  # what a file may really be written with, the likeliest first


def read_csv(path: str | Path, *, time: str = "time", delimiter: str = ",") -> Table:
    """The episode in a CSV file with a header line of names and one column of times [s].

    An empty cell, `nan`, `NA` or `null` is NaN. Raises DataError that names file, line, channel, expected and got,
    OptionError for a delimiter that is not one character.
    """
    delimiter = _one_character(delimiter)
    lines, rows = _rows(path, _text(path), delimiter)
    if not rows:
        raise DataError(f"{path}: expected a header line of names, got an empty file")
    names = _header(path, rows[0], time, delimiter)
    if len(rows) == 1:
        raise DataError(f"{path}: expected samples below the header, got none")
    for line, row in zip(lines, rows, strict=True):
        if len(row) != len(names):
            raise DataError(f"{path}, line {line}: expected {len(names)} cells as in the header, got {len(row)}")
    cells = _numbers(path, names, lines[1:], rows[1:])
    at = names.index(time)
    return Table(str(path), tuple(names[:at] + names[at + 1 :]), cells[:, at], np.delete(cells, at, axis=1))


def write_csv(
    path: str | Path,
    columns: Sequence[str],
    times: Float[np.ndarray, " T"],
    values: Float[np.ndarray, "T D"],
    *,
    time: str = "time",
    new: bool = False,
) -> None:
    """Write an episode so that `read_csv` reads the very same numbers; times in [s], NaN as an empty cell.

    Raises OptionError where the file cannot be written; it is written whole or not at all. With `new` no file is
    written over: FileExistsError.
    """
    with whole_file(path, new=new) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([time, *columns])
        for row in np.column_stack([times, values]).tolist():
            writer.writerow(["" if cell != cell else repr(cell) for cell in row])


def _one_character(delimiter: str) -> str:
    if delimiter == r"\t":  # as a shell passes it
        return "\t"
    if len(delimiter) != 1 or delimiter in '"\r\n':
        raise OptionError(f"expected a delimiter of one character such as ',' or ';', got {delimiter!r}")
    return delimiter


def _text(path: str | Path) -> str:
    try:
        data = Path(path).read_bytes()
        return data.decode("utf-8-sig")
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        got = data[error.start : error.start + 1].hex()
        raise DataError(f"{path}, line {line}: expected text in UTF-8, got the byte 0x{got}") from None


def _rows(path: str | Path, text: str, delimiter: str) -> tuple[list[int], list[list[str]]]:
    """The rows that are not blank, and the number of the line that each ends on."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True, strict=True)
    lines, rows = [], []
    try:
        for row in reader:
            if row and (len(row) > 1 or row[0].strip()):
                lines.append(reader.line_num)
                rows.append(row)
    except csv.Error as error:
        raise DataError(f"{path}, line {reader.line_num}: expected cells between {delimiter!r}, got {error}") from None
    return lines, rows


def _header(path: str | Path, cells: Sequence[str], time: str, delimiter: str) -> list[str]:
    names = [" ".join(cell.splitlines()).strip() for cell in cells]  # on one line, so that messages are
    names[0] = names[0].lstrip("# ")  # numpy.savetxt comments its header out
    if all(_is_number(name) for name in names):
        raise DataError(f"{path}: expected a header line of names, got {listing(names, 4)}")
    if time not in names:
        other = [mark for mark in DELIMITERS if mark in names[0] and mark != delimiter]
        if len(names) == 1 and other:
            raise DataError(
                f"{path}: expected {delimiter!r} between columns, found {other[0]!r}: "
                f"pass delimiter={other[0]!r} (--delimiter)"
            )
        raise DataError(f"{path}: no column {time!r}; the columns are {listing(names)}")
    if len(names) == 1:
        raise DataError(f"{path}: expected channels beside {time!r}, got none")
    if "" in names:
        raise DataError(f"{path}: expected a name for every column, got none for column {names.index('') + 1}")
    twice = {name: None for i, name in enumerate(names) if name in names[:i]}
    if twice:
        raise DataError(f"{path}: column names must differ, got twice: {listing(twice)}")
    return names


def _numbers(
    path: str | Path, names: Sequence[str], lines: Sequence[int], rows: Sequence[Sequence[str]]
) -> Float[np.ndarray, "T C"]:
    cells = list(chain.from_iterable(rows))
    try:
        # Python reads "1_000" as a number; a recording with an underscore is damaged, so it goes the slow way.
        numbers = None if "_" in "".join(cells) else np.array(cells, dtype=np.float64)
    except ValueError:
        numbers = None
    if numbers is None:
        numbers = np.array(
            [
                _number(path, line, name, cell)
                for line, row in zip(lines, rows, strict=True)
                for name, cell in zip(names, row, strict=True)
            ]
        )
    return numbers.reshape(len(rows), len(names))


def _number(path: str | Path, line: int, name: str, cell: str) -> float:
    text = cell.strip()
    if text.lower() in MISSING:
        return np.nan
    if _is_number(text):
        return float(text)
    comma = " (a decimal comma? write a point)" if _is_number(text.replace(",", ".", 1)) else ""
    raise DataError(f"{path}, line {line}, channel {name!r}: expected a number, got {text!r}{comma}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
