"""How much faster an evaluation is with several workers than with one: processes, and a local cluster of dask.

On thinned recordings of every data set, by turns in one run. Workers are started before the clock is: that takes
seconds, an evaluation hours. Other load on the machine makes the ratio smaller.
"""

from __future__ import annotations

import one_thread  # noqa: F401 - isort: skip - before numpy is loaded

import argparse
import os
import statistics
import sys
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

from accuracy import GROUPS, RECORDINGS
from timing import duration

import inphase
from inphase.evaluation import CONDITIONS, Evaluation, evaluate
from inphase.workers import local_cluster

FOLDS = 4
LIMIT = "1.7"  # times faster with two workers is what is wanted


def main() -> int:
    """Run the benchmark; exit code 1 where results differ, 2 where there are no recordings."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few short episodes of one data set, once")
    parser.add_argument("--data", type=Path, default=RECORDINGS, metavar="FOLDER", help="where the recordings are")
    parser.add_argument("--episodes", type=int, default=12, metavar="N", help="of the first folder of a data set")
    parser.add_argument("--every", type=int, default=4, metavar="N", help="so many-th sample is taken")
    parser.add_argument("--rounds", type=int, default=3, metavar="N")
    parser.add_argument("--workers", type=int, default=2, metavar="N")
    options = parser.parse_args()
    if options.quick:
        options.episodes, options.every, options.rounds = 4, 24, 1
    missing = [group.folders[0] for group in GROUPS if not (options.data / group.folders[0]).is_dir()]
    if missing:
        print(f"workers: expected the recordings {options.data / missing[0]}, found none", file=sys.stderr)
        return 2
    with ExitStack() as stack:
        places: dict[str, list[dict[str, object]]] = {"processes": [{"jobs": n} for n in (1, options.workers)]}
        clusters = [stack.enter_context(local_cluster(n)) for n in (1, options.workers)]
        places["local cluster"] = [{"cluster": address} for address in clusters]
        print(f"{'recordings':12}{'':15}{'1 worker':>10}{f'{options.workers} workers':>12}{'faster':>9}")
        equal = True
        for group in GROUPS[: 1 if options.quick else None]:
            tasks = thinned(replace(group, folders=group.folders[:1]).load(options.data, quick=False), options)
            for place, (one, several) in places.items():
                taken, same = by_turns(tasks, [one, several], options)
                equal &= same
                ratio = taken[0] / taken[1]
                print(f"{group.name:12}{place:15}{taken[0]:8.1f} s{taken[1]:10.1f} s{ratio:7.2f} ×", flush=True)
    print(f"wanted: {LIMIT} × with 2 workers; results {'equal' if equal else 'DIFFER'}; load {os.getloadavg()[0]:.1f}")
    return 0 if equal else 1


def thinned(tasks: dict[str, inphase.Dataset], options: argparse.Namespace) -> dict[str, inphase.Dataset]:
    """A few episodes of every task, with fewer samples."""
    every, found = options.every, {}
    for name, whole in tasks.items():
        few = [inphase.Demonstration(d.times[::every], d.values[::every], d.name) for d in whole][: options.episodes]
        found[name] = inphase.Dataset(whole.channels, tuple(few))
    return found


def by_turns(
    tasks: dict[str, inphase.Dataset], places: list[dict[str, object]], options: argparse.Namespace
) -> tuple[list[float], bool]:
    """The median time [s] at every place, and whether all found the same."""
    found: list[Evaluation] = []
    taken: list[list[float]] = [[] for _ in places]

    def work(place: dict[str, object], filters: list[str]) -> None:
        folds, conditions = (2, list(CONDITIONS)[:1]) if options.quick else (FOLDS, list(CONDITIONS))
        learn = partial(inphase.fit, calibrate=False)
        found.append(evaluate(tasks, filters, folds=folds, conditions=conditions, fit=learn, **place))  # type: ignore[arg-type]

    for place in places:
        work(place, [])  # whoever works has imported everything
    found.clear()
    for _ in range(options.rounds):
        for times, place in zip(taken, places, strict=True):
            times.append(duration(lambda place=place: work(place, ["rbpf"])))
    first = [repr(row) for row in found[0].rows]
    return [statistics.median(times) for times in taken], all([repr(row) for row in f.rows] == first for f in found)


if __name__ == "__main__":
    sys.exit(main())
