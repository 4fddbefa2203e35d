"""The ratios of an earlier run, and whether those of this one are as good.

A row is named after its size and filter and has up to two ratios, which hardly depend on the machine as times do:
"loop/step", how many times faster a step is than the plain loop, and "step/floor", how many times slower than the
products that it cannot avoid.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median

Ratios = Mapping[str, float]

MARGIN = 1.25  # times worse than before: noise seldom is, a change for the worse that matters soon is
MEASURED = 3  # times for a baseline
ROUNDS = 5  # of the rows that fail: noise only makes them worse
PAUSE = 15.0  # [s] between two rounds: a busy moment passes


def worsening(ratio: str, before: float, now: float) -> float:
    """How many times worse a ratio has become; below 1 it is better."""
    return before / now if ratio == "loop/step" else now / before


def complaints(row: str, before: Ratios | None, now: Ratios, margin: float = MARGIN) -> list[str]:
    """What is wrong with a row, a sentence each."""
    if before is None:
        return [f"{row}: expected a row of the baseline, got none of that name; --write-baseline measures anew"]
    found = [f"{row}: expected {ratio}, as in the baseline, got none" for ratio in before if ratio not in now]
    for ratio, value in now.items():
        if ratio not in before:
            found.append(f"{row}: expected {ratio} in the baseline, got none; --write-baseline measures anew")
        elif (times := worsening(ratio, before[ratio], value)) > margin:
            found.append(f"{row}: {ratio} {value:.2f} is {times:.2f} times worse than {before[ratio]:.2f}")
    return found


def better(one: Ratios, other: Ratios) -> Ratios:
    """The better of both, ratio by ratio."""
    shared = {name: (value, other.get(name, value)) for name, value in one.items()}
    return {name: a if worsening(name, a, b) > 1 else b for name, (a, b) in shared.items()}


def typical(measured: Sequence[Ratios]) -> Ratios:
    """The median of several measurements, ratio by ratio: one that came out too well would fail all that follow."""
    return {name: median(ratios[name] for ratios in measured) for name in measured[0]}


def gate(
    baseline: Mapping[str, Ratios],
    rows: Iterable[str],
    measure: Callable[[str], Ratios],
    margin: float = MARGIN,
    pause: Callable[[], object] = lambda: time.sleep(PAUSE),
) -> list[str]:
    """What is worse than the baseline: rows that fail are measured again, after a while, and the best counts."""
    now = {row: measure(row) for row in rows}

    def failing() -> dict[str, list[str]]:
        found = {row: complaints(row, baseline.get(row), ratios, margin) for row, ratios in now.items()}
        return {row: sentences for row, sentences in found.items() if sentences}

    for _ in range(ROUNDS - 1):
        again = [row for row in failing() if row in baseline]
        if not again:
            break
        pause()
        now |= {row: better(now[row], measure(row)) for row in again}
    return [sentence for sentences in failing().values() for sentence in sentences]


def read_baseline(path: Path) -> dict[str, Ratios]:
    """The rows of a file."""
    return dict(json.loads(path.read_text(encoding="utf-8")))


def write_baseline(path: Path, rows: Mapping[str, Ratios]) -> None:
    """Rows to a file, one a line; of the rows that are there already, those not measured now are kept."""
    kept = read_baseline(path) if path.exists() else {}
    rounded = {row: {name: round(value, 3) for name, value in ratios.items()} for row, ratios in rows.items()}
    lines = [f" {json.dumps(row)}: {json.dumps(ratios)}" for row, ratios in {**kept, **rounded}.items()]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
