"""How much better `rbpf` is than eBIP as written, by study: `python -m experiments.study.compared docs/studies.md`."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

SECTION = re.compile(r"<!-- begin (\w+) -->(.*?)<!-- end \1 -->", re.DOTALL)
LINE = r"\|[^\n]*\|\n"
TABLE = re.compile(rf"(?:^([^\n|]+)\n\n)?^({LINE})\|[-:|]+\|\n((?:{LINE})+)", re.MULTILINE)  # and what is said of it
ERROR = re.compile(r"error", re.IGNORECASE)
TINIEST = 5e-4  # of a cell: it has three places


def pairs(section: str) -> np.ndarray:
    """(cells, 2) errors of eBIP as written and of `rbpf`, as they are printed: columns of a table, or tables."""
    found: list[tuple[float, float]] = []
    by_method: dict[str, list[float]] = {}
    for match in TABLE.finditer(section):
        said, head, body = match[1] or "", match[2], match[3]
        names = _cells(head)
        rows = [_cells(line) for line in body.strip().splitlines()]
        if "eBIP" in names and "rbpf" in names and ERROR.search(names[0]):
            here = [names.index(name) for name in ("eBIP", "rbpf")]
            found += [(_number(row[here[0]]), _number(row[here[1]])) for row in rows]
        elif said.startswith(("**ebip, the model as", "**rbpf on")):
            errors = [_number(cell) for row in rows if row[0][0].isdigit() for cell in row[1:]]
            by_method["rbpf" if said.startswith("**rbpf") else "ebip"] = errors
    found += zip(by_method.get("ebip", []), by_method.get("rbpf", []), strict=True)
    return np.array(found).reshape(-1, 2)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def _number(cell: str) -> float:
    return float(re.sub(r"\(.*?\)|[*≈ ]", "", cell))


def main(page: Path) -> None:
    """Print a line a study."""
    for name, section in SECTION.findall(page.read_text(encoding="utf-8")):
        cells = pairs(section)
        if len(cells):
            factors = cells[:, 0] / np.maximum(cells[:, 1], TINIEST)
            good = int((cells[:, 1] <= cells[:, 0]).sum())
            median = np.median(factors)
            print(f"{name:12} at least as good in {good} of {len(cells)} cells, {median:.2f} times in the median")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
