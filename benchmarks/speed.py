"""How long a step takes, by filter and size, in one sitting with one BLAS thread.

Times on a shared machine are worth little by themselves. What counts are ratios to work that is timed in between: a
plain loop of the same equations (loop/step: so many times faster is a step), the products that a step cannot avoid
(step/floor), and a tiny numpy call (calls), in processor time. `--gate` compares the first two with a baseline.
"""

from __future__ import annotations

import one_thread  # noqa: F401 - isort: skip - before numpy is loaded

import argparse
import json
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg  # noqa: F401 - so that no step has to wait for it
from baseline import MARGIN, MEASURED, gate, read_baseline, typical, write_baseline
from session_rows import measure_session
from sizes import SIZES, Size, make_model
from step_rows import measure_memory, measure_step

import inphase
from inphase.filters import FILTERS

BASELINE = Path(__file__).with_name("baseline.json")
QUICK = SIZES[:2]
QUICK_GATE = (SIZES[0], SIZES[4])  # all overhead, and all arithmetic
COMPARED = {"repeats": 60, "loops": 5}  # quick or not: what a step costs hangs on the time since the last one
SESSIONS = ("ebip", "rbpf")
RATIOS = ("loop/step", "step/floor")
NAMED = {str(size): size for size in SIZES}


def main() -> int:
    """Run the benchmark; exit code 1 where the gate finds something worse."""
    options = parsed()
    if options.gate or options.write_baseline:
        return compare(options)
    repeats, loops = (20, 2) if options.quick else (200, 7)
    sizes = chosen(options, QUICK if options.quick else SIZES)
    found: dict[str, list[dict[str, Any]]] = {"steps": [], "sessions": []}
    print("filter.step, times in µs, peak memory in kB\n")
    print(line("size", "filter", "median", "p99", "max", "peak kB", *RATIOS, "calls"))
    for size in sizes:
        for name in options.filters:
            row = measure_step(model_of(size), name, size, repeats=repeats, loops=loops)
            row |= measure_memory(model_of(size), name, size)
            found["steps"].append(row)
            times = [f"{row[key]:.0f}" for key in ("median", "p99", "max")]
            ratios = [f"{row[key]:.2f}" for key in RATIOS]
            peak = f"{row['bytes'] / 1e3:.0f}"
            print(line(row["size"], name, *times, peak, *ratios, f"{row['calls']:.0f}"), flush=True)
    print("\nsession, times in µs; first: the first sample over the others\n")
    columns = [f"{what}_{key}" for what in ("observe", "respond_2", "respond_50") for key in ("median", "p99")]
    print(line("size", "filter", "observe", "p99", "respond 2", "p99", "respond 50", "p99", "first"))
    for size in sizes:
        for name in (name for name in SESSIONS if name in options.filters):
            row = measure_session(model_of(size), name, size, repeats=repeats)
            found["sessions"].append(row)
            print(line(row["size"], name, *(f"{row[key]:.0f}" for key in columns), f"{row['first']:.2f}"), flush=True)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        print(f"\nwrote {options.json}")
    return 0


def compare(options: argparse.Namespace) -> int:
    """Measure the ratios alone, and hold them against the baseline or make it of them."""
    sizes = chosen(options, QUICK_GATE if options.quick else SIZES)
    rows = {f"{size} {name}": (size, name) for size in sizes for name in options.filters}

    def measure(row: str) -> dict[str, float]:
        size, name = rows[row]
        found = measure_step(model_of(size), name, size, **COMPARED)
        ratios = {ratio: found[ratio] for ratio in RATIOS}
        print(line(str(size), name, *(f"{ratio} {value:.2f}" for ratio, value in ratios.items()), width=20), flush=True)
        return ratios

    if options.write_baseline:
        write_baseline(options.baseline, {row: typical([measure(row) for _ in range(MEASURED)]) for row in rows})
        print(f"wrote {options.baseline}")
        return 0
    worse = gate(read_baseline(options.baseline), rows, measure, options.margin)
    print("\n".join(worse) or f"no ratio is more than {options.margin:g} times worse than in {options.baseline.name}")
    return int(bool(worse))


def parsed() -> argparse.Namespace:
    """The options of this run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two sizes, few repeats")
    parser.add_argument("--sizes", nargs="+", choices=NAMED, metavar="SIZE", help=f"of {'  '.join(NAMED)}")
    parser.add_argument("--filters", nargs="+", choices=FILTERS, default=list(FILTERS), metavar="NAME")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures of the table")
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument("--gate", action="store_true", help="compare the ratios with the baseline")
    instead.add_argument("--write-baseline", action="store_true", help="make the baseline of the ratios measured now")
    parser.add_argument("--margin", type=float, default=MARGIN, help=f"times worse that pass, otherwise {MARGIN:g}")
    parser.add_argument("--baseline", type=Path, default=BASELINE, metavar="FILE", help=f"otherwise {BASELINE.name}")
    options = parser.parse_args()
    if options.gate and not options.baseline.exists():
        parser.error(f"expected the baseline {options.baseline}, found none; --write-baseline makes it")
    if options.json and (options.gate or options.write_baseline):
        parser.error("--json goes with the table, not with --gate or --write-baseline")
    return options


def chosen(options: argparse.Namespace, usual: tuple[Size, ...]) -> tuple[Size, ...]:
    """The sizes that were asked for, or the usual ones."""
    return tuple(NAMED[name] for name in options.sizes) if options.sizes else usual


@cache
def model_of(size: Size) -> inphase.Model:
    """The model of that size, the same in every run."""
    return make_model(size, np.random.default_rng(0))


def line(size: str, name: str, *cells: str, width: int = 11) -> str:
    """A line of a table."""
    return f"{size:10s} {name:8s} " + " ".join(f"{cell:>{width}s}" for cell in cells)


if __name__ == "__main__":
    sys.exit(main())
