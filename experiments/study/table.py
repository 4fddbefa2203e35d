"""Tables in the dissertation's form: the best of a row or column marked, and what is not significantly worse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

SIGNIFICANT = 0.05  # of Mann and Whitney's U test, as in Tables 1 to 4


@dataclass(frozen=True, eq=False)
class Cell:
    """One cell. values: what it is the mean of, one a trial; none for a cell that stays empty."""

    values: np.ndarray
    digits: int = 3

    @property
    def mean(self) -> float:
        """Of its values; NaN where there are none."""
        return float(np.mean(self.values)) if np.size(self.values) else np.nan

    def text(self) -> str:
        """As the dissertation writes it: what is enormous as a power of ten."""
        if not np.isfinite(self.mean):
            return "–" if not np.size(self.values) else "∞"
        if abs(self.mean) >= 1000:
            power = int(np.floor(np.log10(abs(self.mean))))
            return f"{self.mean / 10.0**power:.2f}·10^{power}"
        return f"{self.mean:.{self.digits}f}"


@dataclass
class Table:
    """Rows of cells that are compared with each other within a row. theirs: the dissertation's number beside a cell.

    columns: their names. reference: of columns that are shown and not compared.
    """

    corner: str
    columns: Sequence[str]
    rows: list[tuple[str, Mapping[str, Cell | str], Mapping[str, str]]] = field(default_factory=list)

    def add(self, name: str, cells: Mapping[str, Cell | str], theirs: Mapping[str, str] | None = None) -> None:
        """A row: cells by column; text stands as it is. theirs: the dissertation's numbers, by column."""
        unknown = [c for c in [*cells, *(theirs or {})] if c not in self.columns]
        if unknown:
            raise ValueError(f"unknown column {unknown[0]!r}; valid: {', '.join(self.columns)}")
        self.rows.append((name, cells, theirs or {}))

    def markdown(self) -> str:
        """**bold**: the best of a row; ≈: not significantly worse than it. In brackets the dissertation's."""
        lines = [f"| {self.corner} | " + " | ".join(self.columns) + " |", "|---|" + "---:|" * len(self.columns)]
        for name, cells, theirs in self.rows:
            marks = marked({c: cell.values for c, cell in cells.items() if isinstance(cell, Cell)})
            shown = []
            for column in self.columns:
                cell = cells.get(column, "")
                text = cell if isinstance(cell, str) else marks.get(column, "{}").format(cell.text())
                shown.append(f"{text} ({theirs[column]})" if column in theirs else text)
            lines.append(f"| {name} | " + " | ".join(shown) + " |")
        return "\n".join(lines)


def marked(values: Mapping[str, np.ndarray]) -> dict[str, str]:
    """How to write each: the smallest mean, those not significantly worse (U test), and the others."""
    from scipy.stats import mannwhitneyu

    means = {name: np.mean(v) for name, v in values.items() if np.size(v) and np.all(np.isfinite(v))}
    if not means:
        return {}
    best = min(means, key=means.__getitem__)
    marks = dict.fromkeys(values, "{}") | {best: "**{}**"}
    for name in means:
        if name != best and mannwhitneyu(values[name], values[best]).pvalue >= SIGNIFICANT:
            marks[name] = "{} ≈"
    return marks
