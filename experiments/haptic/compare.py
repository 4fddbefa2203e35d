"""Table 4 on hugs that were made up: all force sensors, those selected, groups of them, and groups with sparse bases.

    python experiments/haptic/compare.py [--quick]

Prints the mean absolute error of joints [rad] and forces [raw], by cross-validation, as experiments/haptic/README.md
shows it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from hugs import GROUPS, JOINTS, PRESSED, SENSORS, hugs
from joblib import Parallel, delayed
from scipy.stats import mannwhitneyu
from threadpoolctl import threadpool_limits

import inphase
from inphase.basis import Basis, Gaussian
from inphase.filters import FILTERS

UNIFORM = Gaussian(12)
LOOKAHEADS = (0.0, 0.05, 0.10)
PARTNERS = 4
SIGNIFICANT = 0.05
PARTS = {  # of the controlled channels
    "Joints": slice(0, len(JOINTS)),
    "Left": slice(len(JOINTS), len(JOINTS) + len(PRESSED) // 2),
    "Right": slice(len(JOINTS) + len(PRESSED) // 2, len(JOINTS) + len(PRESSED)),
}


@dataclass(frozen=True)
class Variant:
    """How the sensors are shown: what becomes of a data set, and the bases of its channels."""

    shown: inphase.Dataset
    bases: Basis | dict[str, Basis]
    change: Callable[[inphase.Dataset], inphase.Dataset]
    says: str = ""


def everything(train: inphase.Dataset) -> Variant:
    """All force sensors."""
    return Variant(train, UNIFORM, lambda dataset: dataset)


def selected(train: inphase.Dataset) -> Variant:
    """The sensors that say something of the robot's own forces."""
    selection = inphase.select_channels(train, channels="touch_*", about="force_*")
    chosen = set(selection.chosen)
    found = sum(any(name in chosen for name in SENSORS[group]) for group in PRESSED)
    useful = sum(name in chosen for group in PRESSED for name in SENSORS[group])
    says = f"{len(chosen)} sensors, {useful} of which are pressed, of {found} of {len(PRESSED)} groups"
    return Variant(train.select(selection.names), UNIFORM, lambda dataset: dataset.select(selection.names), says)


def grouped(train: inphase.Dataset) -> Variant:
    """The largest reading of every group."""
    reduction = inphase.Reduction({f"group_{group}": (tuple(SENSORS[group]), "max") for group in GROUPS})
    return Variant(reduction.dataset(train), UNIFORM, reduction.dataset)


def grouped_sparse(train: inphase.Dataset) -> Variant:
    """The same, with bases where there is contact."""
    variant = grouped(train)
    sparse = inphase.sparse_bases(variant.shown, ["group_*", "force_*"])
    usual = dict.fromkeys(variant.shown.names, UNIFORM)
    says = f"{min(b.size for b in sparse.values())} to {max(b.size for b in sparse.values())} functions a channel"
    return replace(variant, bases=usual | sparse, says=says)


VARIANTS: dict[str, Callable[[inphase.Dataset], Variant]] = {
    "All": everything,
    "MIFS": selected,
    "Group": grouped,
    "Group + OLS": grouped_sparse,
}


@dataclass(frozen=True, eq=False)
class Played:
    """One fold of one variant. errors: {filter: (hugs, lookaheads, parts)}."""

    variant: str
    dimension: int
    errors: dict[str, np.ndarray]
    says: str


def play(name: str, dataset: inphase.Dataset, held_out: Sequence[int], filters: Sequence[str]) -> Played:
    """Learn from the other hugs, and be shown these."""
    with threadpool_limits(limits=1):
        variant = VARIANTS[name](dataset.subset([i for i in range(len(dataset)) if i not in held_out]))
        # The primitive alone: the reflex looks at the last moments and not at the state.
        model = replace(inphase.fit(variant.shown, basis=variant.bases, calibrate=False), reflex=None)
        shown = variant.change(dataset.subset(held_out))
        errors = {f: np.array([_errors(model, demonstration, f) for demonstration in shown]) for f in filters}
    return Played(name, model.layout.size + len(model.phase.mean), errors, variant.says)


def _errors(model: inphase.Model, demonstration: inphase.Demonstration, filter: str) -> np.ndarray:
    """(lookaheads, parts) the mean absolute error over one hug, against what was done that much phase later."""
    session, count, phases = model.session(filter), len(model.observed), demonstration.phases
    truth = demonstration.values[:, count:]
    later = [np.minimum(phases + ahead, 1.0) for ahead in LOOKAHEADS]
    then = np.stack([np.stack([np.interp(at, phases, column) for column in truth.T], axis=1) for at in later])
    said = np.empty_like(then)
    for i, (time, row) in enumerate(zip(demonstration.times, demonstration.values, strict=True)):
        session.observe(time, row[:count])
        for k, ahead in enumerate(LOOKAHEADS):
            said[k, i] = session.respond(lookahead=ahead, samples=1).mean[0]
    return np.stack([np.abs(said - then)[:, :, part].mean((1, 2)) for part in PARTS.values()], axis=1)


def table(found: Sequence[Played], filter: str) -> str:
    """The form of Table 4. In brackets the best; a star: worse, by Mann and Whitney's U."""
    names = list(VARIANTS)
    errors = {name: np.concatenate([p.errors[filter] for p in found if p.variant == name]) for name in names}
    sizes = [round(np.mean([p.dimension for p in found if p.variant == name])) for name in names]
    lines = [f"{filter:14}" + "".join(f"{name:>14}" for name in names)]
    lines.append(f"{'Dimension':14}" + "".join(f"{size:>14}" for size in sizes))
    for k, ahead in enumerate(LOOKAHEADS):
        for j, part in enumerate(PARTS):
            each = {name: errors[name][:, k, j] for name in names}
            best = min(names, key=lambda name: each[name].mean())
            cells = []
            for name in names:
                worse = mannwhitneyu(each[name], each[best]).pvalue < SIGNIFICANT
                value = f"{each[name].mean():.3f}"
                cells.append(f"[{value}]" if name == best else f"{value}{'*' if worse else ' '}")
            lines.append(f"{ahead:<6.2f}{part:8}" + "".join(f"{cell:>14}" for cell in cells))
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few short hugs, two folds, one filter")
    parser.add_argument("--hugs", type=int, default=96, help="how many, of four partners")
    parser.add_argument("--folds", type=int, default=4)
    parser.add_argument("--filters", nargs="+", choices=list(FILTERS), default=["ebip", "rbpf"])
    parser.add_argument("--seed", type=int, default=0, help="of the hugs")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    chosen = parser.parse_args(arguments)
    count, folds, rate = (16, 2, 4.0) if chosen.quick else (chosen.hugs, chosen.folds, 10.0)
    filters = ("ebip",) if chosen.quick else tuple(chosen.filters)
    dataset = hugs(count, PARTNERS, rate, chosen.seed)
    # Every partner in every fold: as in 3.3.2.3, those who are shown were seen before.
    splits = [[i for i in range(count) if i // PARTNERS % folds == fold] for fold in range(folds)]
    found = Parallel(n_jobs=1 if chosen.quick else chosen.jobs)(
        delayed(play)(name, dataset, held_out, filters) for held_out in splits for name in VARIANTS
    )
    print(
        f"{count} hugs, {folds} folds; mean absolute error, [the best], * worse than it (U test, p < {SIGNIFICANT})\n"
    )
    for filter in filters:
        print(table(found, filter) + "\n")
    for name in VARIANTS:
        for says in dict.fromkeys(p.says for p in found if p.variant == name and p.says):
            print(f"{name}: {says}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
