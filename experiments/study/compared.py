"""How much better one method is than another, by study and part, as the page of studies has it.

`python -m experiments.study.compared docs/studies.md` tells of `rbpf` and eBIP as written; with `BIP "IP, DTW"` after
it, of BIP and time warping.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import numpy as np

SECTION = re.compile(r"<!-- begin (\w+) -->(.*?)<!-- end \1 -->", re.DOTALL)
PART = re.compile(r"^### ([^\n]*)\n(.*?)(?=^### |\Z)", re.DOTALL | re.MULTILINE)
LINE = r"\|[^\n]*\|\n"
TABLE = re.compile(rf"(?:^([^\n|]+)\n\n)?^({LINE})\|[-:|]+\|\n((?:{LINE})+)", re.MULTILINE)  # and what is said of it
ERROR = re.compile(r"error", re.IGNORECASE)
SAID = {"**ebip, the model as": "eBIP", "**rbpf on": "rbpf"}  # of a table that is of one method
TINIEST = 5e-4  # of a cell: it has three places


def pairs(text: str, method: str = "rbpf", other: str = "eBIP") -> np.ndarray:
    """(cells, 2) errors of a method and of another, as they are printed: columns of a table, or tables."""
    found: list[tuple[float, float]] = []
    alone: dict[str, list[float]] = {}
    for match in TABLE.finditer(text):
        said, head, body = match[1] or "", match[2], match[3]
        names = _cells(head)
        rows = [_cells(line) for line in body.strip().splitlines()]
        if method in names and other in names and ERROR.search(names[0]):
            here = [names.index(name) for name in (method, other)]
            found += [(_number(row[here[0]]), _number(row[here[1]])) for row in rows]
        for words, name in SAID.items():
            if said.startswith(words):
                alone[name] = [_number(cell) for row in rows if row[0][0].isdigit() for cell in row[1:]]
    if method in alone and other in alone:
        found += zip(alone[method], alone[other], strict=True)
    return np.array(found).reshape(-1, 2)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def _number(cell: str) -> float:
    return float(re.sub(r"\(.*?\)|[*≈ ]", "", cell))


def told(name: str, cells: np.ndarray) -> str:
    """A line of a study or a part."""
    factor = np.median(cells[:, 1] / np.maximum(cells[:, 0], TINIEST))
    good = int((cells[:, 0] <= cells[:, 1]).sum())
    return f"{name:36} at least as good in {good:3} of {len(cells):3} cells, {factor:.2f} times in the median"


def main() -> None:
    """Print a line a study, and one for each of its parts where there are several."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("page", type=Path)
    parser.add_argument("method", nargs="?", default="rbpf", help="a column's name")
    parser.add_argument("other", nargs="?", default="eBIP", help="the one it is compared with")
    options = parser.parse_args()
    every = []
    for study, section in SECTION.findall(options.page.read_text(encoding="utf-8")):
        parts = {name: pairs(text, options.method, options.other) for name, text in PART.findall(section)}
        parts = {name: cells for name, cells in parts.items() if len(cells)}
        if parts:
            every.append(np.concatenate(list(parts.values())))
            print(told(study, every[-1]))
        for name, cells in parts.items() if len(parts) > 1 else ():
            print(told(f"  {name[:34]}", cells))
    if len(every) > 1:
        print(told("together", np.concatenate(every)))


if __name__ == "__main__":
    main()
