"""How accurate every filter is on real recordings, beside the baselines: all conditions, four-fold cross-validation.

Writes docs/accuracy.md, whole or not at all. With five filters it takes a quarter of an hour or more on two idle
processors; `--quick` runs the same on a few short episodes under one condition, as the tests do.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from joblib import cpu_count

import inphase
from inphase.cli.accuracy import print_evaluation
from inphase.cli.console import Output
from inphase.evaluation import CONDITIONS, Evaluation, evaluate
from inphase.filters import FILTERS
from inphase.io.atomic import whole_file

ROOT = Path(__file__).resolve().parents[1]
RECORDINGS = ROOT.parent / "shared" / "data"
PAGE = ROOT / "docs" / "accuracy.md"
FOLDS, QUICK_FOLDS = 4, 2
QUICK_EPISODES, QUICK_EVERY = 4, 12
COVER = (0.85, 0.95)  # what the share inside the 90 % band should be in every condition

JOINTS = [f"{joint}_{axis}" for joint in ("shoulder", "elbow", "wrist") for axis in "xyz"]
ACTIONS = ("waving", "handshake", "rocket", "parachute")


HEAD = """\
# Accuracy

Made by {made} (`benchmarks/accuracy.py`), with inphase {version}, in {minutes:.1f} minutes with {jobs} processes.

Cross-validation on real recordings with nothing set by hand, as `inphase evaluate` does it. Conditions that were not
demonstrated are made of the held-out episodes: half and double speed, a pause of two seconds, the partner out of sight
for 30 % of the time.

- **now**: the mean squared error of the controlled channels at every sample over their training variance (1 is what
  always answering the training mean would score), its standard error over episodes, and the share of readings inside
  the predictor's own 90 % band.
- **end50**: the same error of the final pose, as foreseen after half of the episode.
- **nll**: the negative log predictive density a reading, in units of the training standard deviation.

*Mean trajectory* is the average demonstration played by the clock, *ridge* a regression on the partner's last moments;
neither knows the tempo. The best of a column is bold, *wanted* is the goal of the project. Of several tasks each
counts alike.

"""


@dataclass(frozen=True)
class Group:
    """A data set of the recordings.

    folders: a task each. every: so many-th sample is taken. wanted, lost: the error now that is to be reached, and
    where the partner was lost out of sight.
    """

    name: str
    title: str
    folders: tuple[str, ...]
    observed: list[str]
    controlled: list[str]
    wanted: float
    lost: float
    every: int = 1

    def load(self, recordings: Path, quick: bool) -> dict[str, inphase.Dataset]:
        """The tasks by folder; only a few short episodes of the first one if that is enough."""
        tasks = {}
        for folder in self.folders[:1] if quick else self.folders:
            files = sorted((recordings / folder).glob("*.csv"))[: QUICK_EPISODES if quick else None]
            loaded = inphase.load(files, self.observed, self.controlled)
            every = self.every * (QUICK_EVERY if quick else 1)
            thinned = [inphase.Demonstration(d.times[::every], d.values[::every], d.name) for d in loaded]
            tasks[folder] = inphase.Dataset(loaded.channels, tuple(thinned))
        return tasks


GROUPS = (
    Group(
        "handover",
        "Hand-over of a baton, motion capture",
        ("handover",),
        [f"taker_{axis}" for axis in "xyz"],
        [f"giver_{axis}" for axis in "xyz"],
        wanted=0.045,
        lost=0.055,
        every=2,
    ),
    Group(
        "nuisi",
        "Two people wave, shake hands and bump fists, camera skeletons",
        tuple(f"nuisi/{action}" for action in ACTIONS),
        [f"p1_{joint}" for joint in JOINTS],
        [f"p2_{joint}" for joint in JOINTS],
        wanted=0.52,
        lost=0.52,
    ),
    Group(
        "yumi",
        "The same four actions, a person and a robot",
        tuple(f"yumi/{action}" for action in ACTIONS),
        [f"human_{joint}" for joint in JOINTS],
        [f"yumi_joint_{number}" for number in range(1, 8)],
        wanted=0.65,
        lost=0.65,
    ),
)


def main() -> int:
    """Run the benchmark; exit code 2 where there are no recordings."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few short episodes, one condition; needs --output")
    parser.add_argument("--output", type=Path, metavar="FILE", help="the page to write, otherwise docs/accuracy.md")
    parser.add_argument("--data", type=Path, default=RECORDINGS, metavar="FOLDER", help="where the recordings are")
    parser.add_argument("--filters", nargs="+", default=list(FILTERS), metavar="NAME")
    parser.add_argument("--jobs", type=int, default=cpu_count(), metavar="N", help="processes side by side")
    options = parser.parse_args()
    if options.quick and options.output is None:
        parser.error("--quick is no evidence: name another page with --output")
    missing = [str(options.data / f) for group in GROUPS for f in group.folders if not (options.data / f).is_dir()]
    if missing:
        print(f"accuracy: expected the recordings {missing[0]}, found none; --data names a folder", file=sys.stderr)
        return 2
    begun, console, parts = time.monotonic(), Output(), []
    for group in GROUPS:
        tasks = group.load(options.data, options.quick)
        found = evaluate(
            tasks,
            options.filters,
            folds=QUICK_FOLDS if options.quick else FOLDS,
            conditions=list(CONDITIONS)[: 1 if options.quick else None],
            jobs=options.jobs,
            progress=teller(group.name, begun),
        )
        print_evaluation(console, found)
        parts.append(section(group, tasks, found))
    minutes = (time.monotonic() - begun) / 60
    output = options.output or PAGE
    with whole_file(output) as temporary:
        temporary.write_text(page(parts, minutes, options.jobs, options.quick), encoding="utf-8")
    print(f"wrote {output} after {minutes:.1f} minutes with {options.jobs} processes")
    return 0


def teller(name: str, begun: float) -> Callable[[float], None]:
    """Prints a line at every tenth of the work."""
    told = [0]

    def tell(share: float) -> None:
        if int(10 * share) > told[0]:
            told[0] = int(10 * share)
            print(f"{name}: {10 * told[0]:3d} %, {time.monotonic() - begun:.0f} s", flush=True)

    return tell


def page(sections: list[str], minutes: float, jobs: int, quick: bool) -> str:
    """The whole page."""
    made = "a quick run on a few short episodes, no evidence of anything" if quick else "`make accuracy`"
    return HEAD.format(made=made, version=inphase.__version__, minutes=minutes, jobs=jobs) + "\n".join(sections)


def section(group: Group, tasks: dict[str, inphase.Dataset], found: Evaluation) -> str:
    """The tables of one data set."""
    episodes = sum(map(len, tasks.values()))
    low, high = (100 * share for share in COVER)
    wanted = [
        f"≤ {group.lost if condition.startswith('lost') else group.wanted:g} ({low:.0f} … {high:.0f} %)"
        for condition in found.conditions
    ]
    tables = table("now", found, [["*wanted*", *wanted]]), table("end50", found), table("nll", found)
    return f"## {group.title}\n\n{episodes} episodes of {', '.join(tasks)}.\n\n" + "\n".join(tables)


def table(metric: str, found: Evaluation, more: list[list[str]] | None = None) -> str:
    """A table of one metric, filters and baselines by condition."""
    columns = [cells(metric, condition, found) for condition in found.conditions]
    rows = [[f"**{metric}**", *found.conditions], ["---"] * (1 + len(columns))]
    rows += [list(row) for row in zip(found.predictors, *columns, strict=True)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows + (more or []))


def cells(metric: str, condition: str, found: Evaluation) -> list[str]:
    """A column: a figure for every predictor."""
    figures = [found.figure(metric, name, condition) for name in found.predictors]
    shown = [f"{figure.mean:.3f}" if abs(figure.mean) < 10 else f"{figure.mean:.1f}" for figure in figures]
    best = min(shown, key=float)
    texts = []
    for name, figure, mean in zip(found.predictors, figures, shown, strict=True):
        text = f"**{mean}**" if mean == best else mean
        if metric == "now":
            cover = found.figure("cover", name, condition).mean
            text += f" ± {figure.error:.3f} ({100 * cover:.0f} %)"
        texts.append(text)
    return texts


if __name__ == "__main__":
    sys.exit(main())
