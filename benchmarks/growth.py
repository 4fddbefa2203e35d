"""How the cost of a step grows with channels, basis functions, members, demonstrations and batch.

One axis at a time, from size to twice the size, the others as in the middle; the median of a few steps with one BLAS
thread. Growth is told by the slope of log time over log size, over the upper half of an axis: 1 is in proportion, 2 the
square. Beside it stand the slope of the arithmetic that the equations ask for over the same sizes (work.py), and the
dissertation's (section 3.1). An axis ends early where the next step would take too long.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, replace

import one_thread  # noqa: F401 - before numpy

# isort: split
import batch
import numpy as np
from chance import STEP, Extent, make_model, observations
from growth_picture import draw_growth
from work import DISSERTATION, WORK

import inphase
from inphase.errors import OptionError
from inphase.filters import make
from inphase.io.atomic import check_target, whole_file
from inphase.report.look import check_picture

MIDDLE = Extent(channels=62, basis=8, members=125, demonstrations=62)
AXES = {
    "channels": (4, 8, 16, 31, 62, 125, 250, 500, 1000, 2000),
    "basis": (4, 8, 16, 32, 64, 128),
    "members": (16, 31, 62, 125, 250, 500, 1000, 2000),
    "demonstrations": (8, 16, 31, 62, 125, 250, 500, 1000, 2000),
}
QUICK_MIDDLE = Extent(channels=4, basis=5, members=20, demonstrations=8)
QUICK_AXES = dict.fromkeys(AXES, (4, 8, 16)) | {"members": (10, 20, 40)}
FILTERS = ("ebip", "bip", "particle", "rbpf")
OPTION = {"ebip": "members", "particle": "particles", "rbpf": "particles"}
MOST_STEPS, FEWEST_STEPS, ENOUGH = 15, 3, 0.5  # so many steps of a size, at least so many, and [s] that are enough
TOO_LONG, STEEPEST = 8.0, 8.0  # [s] no step shall take; the factor by which the next may take longer


def slope(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """The exponent by which costs grow: the slope of their logarithms over the upper half of the sizes.

    NaN for fewer than two sizes.
    """
    upper = min(len(sizes) // 2, max(len(sizes) - 2, 0))
    if len(sizes) - upper < 2:
        return float("nan")
    return float(np.polyfit(np.log(sizes[upper:]), np.log(costs[upper:]), 1)[0])


def step_seconds(name: str, model: inphase.Model, members: int, rng: np.random.Generator) -> float:
    """The median time of a step [s], the first left out."""
    filter = make(name, model, **({OPTION[name]: members} if name in OPTION else {}))
    belief, taken = filter.init(rng), []
    dt = STEP / model.phase.nominal_velocity
    for observation in observations(model, MOST_STEPS, rng):
        begun = time.perf_counter()
        belief, _ = filter.step(belief, observation, dt, rng)
        taken.append(time.perf_counter() - begun)
        if len(taken) >= FEWEST_STEPS and sum(taken) > ENOUGH:
            break
    return float(np.median(taken[1:]))


def grow(axis: str, sizes: Sequence[int], middle: Extent, filters: Sequence[str]) -> list[dict]:
    """The rows of an axis: one a filter and size."""
    rows: list[dict] = []
    going = [name for name in filters if axis != "members" or name in OPTION]
    for number in sizes:
        extent, rng = replace(middle, **{axis: number}), np.random.default_rng(0)
        model = make_model(extent, rng)
        for name in list(going):
            seconds = step_seconds(name, model, extent.members, rng)
            rows.append(
                {"axis": axis, "filter": name, **asdict(extent), "seconds": seconds, "work": WORK[name](extent)}
            )
            if seconds * STEEPEST > TOO_LONG:
                going.remove(name)
    return rows


def slopes(rows: Sequence[dict]) -> list[dict]:
    """By axis and filter: the slope that was measured, that of the work, and that of section 3.1 (None: not given)."""
    found = []
    for axis, name in dict.fromkeys((row["axis"], row["filter"]) for row in rows):
        some = [row for row in rows if (row["axis"], row["filter"]) == (axis, name)]
        sizes = [row[axis] for row in some]
        found.append(
            {
                "axis": axis,
                "filter": name,
                "up_to": sizes[-1],
                "seconds": some[-1]["seconds"],
                "measured": slope(sizes, [row["seconds"] for row in some]),
                "work": slope(sizes, [row["work"] for row in some]),
                "dissertation": DISSERTATION.get(name, {}).get(axis),
            }
        )
    return found


def tell_slopes(found: Sequence[dict]) -> None:
    head = ("axis", "filter", "up to", "step there", "slope", "of the work", "section 3.1")
    print("{:16s}{:10s}{:>7s}{:>14s}{:>9s}{:>13s}{:>13s}".format(*head))
    for row in found:
        given = "" if row["dissertation"] is None else f"{row['dissertation']:.1f}"
        print(
            f"{row['axis']:16s}{row['filter']:10s}{row['up_to']:7d}{1e3 * row['seconds']:11.2f} ms"
            f"{row['measured']:9.2f}{row['work']:13.2f}{given:>13s}"
        )


def tell_batches(rows: Sequence[dict]) -> None:
    count = batch.PROCESSES
    print(f"\n{'':24s}{'one after':>13s}   times faster")
    head = ("size", "filter", "batch", "another", f"{count} workers", "on idle cores", "one array, at most", "fastest")
    print("{:10s}{:8s}{:>6s}{:>13s}{:>11s}{:>15s}{:>20s}  {}".format(*head))
    for row in rows:
        print(
            f"{row['size']:10s}{row['filter']:8s}{row['batch']:6d}{1e3 * row['seconds']:10.1f} ms"
            f"{row['workers']:11.2f}{row['idle_workers']:15.2f}{row['stacked']:20.2f}  {batch.fastest(row)}"
        )


def str_of(middle: Extent) -> str:
    return (
        f"{middle.channels} channels × {middle.basis}, {middle.members} members or particles, "
        f"{middle.demonstrations} demonstrations"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few tiny sizes: no evidence of anything")
    parser.add_argument("--axes", nargs="+", choices=[*AXES, "batch"], default=[*AXES, "batch"], metavar="AXIS")
    parser.add_argument("--filters", nargs="+", choices=FILTERS, default=FILTERS, metavar="NAME")
    parser.add_argument("--json", metavar="FILE", help="where to write the figures")
    parser.add_argument("--output", metavar="FILE", help="where to draw them: .png, .svg or .pdf")
    options = parser.parse_args()
    try:
        for path in filter(None, (options.json, options.output)):
            check_target(path)
        if options.output:
            check_picture(options.output)
    except OptionError as error:
        parser.error(str(error))
    axes, middle = (QUICK_AXES, QUICK_MIDDLE) if options.quick else (AXES, MIDDLE)
    print(f"in the middle: {str_of(middle)}\n")
    rows: list[dict] = []
    for axis in (axis for axis in axes if axis in options.axes):
        rows += grow(axis, axes[axis], middle, options.filters)
    found = slopes(rows)
    tell_slopes(found)
    batches: list[dict] = []
    if "batch" in options.axes:
        for title, size in list(batch.SIZES.items())[: 1 if options.quick else None]:
            for name in batch.FILTERS:
                counts = batch.BATCHES[:2] if options.quick else batch.BATCHES
                batches += batch.measure(title, size, name, counts, np.random.default_rng(0))
        tell_batches(batches)
    figures = {"version": inphase.__version__, "rows": rows, "slopes": found, "batches": batches}
    if options.json:
        with whole_file(options.json) as temporary:
            temporary.write_text(json.dumps(figures, indent=1), encoding="utf-8")
        print(f"wrote {options.json}")
    if options.output:
        draw_growth(options.output, str_of(middle), rows, found, batches)
        print(f"wrote {options.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
