"""Recorded hand-overs through `intprim`, with the numbers that its tutorial sets, and through `inphase`, side by side.

    python experiments/migration/hand_over.py ../shared/data/handover

Four-fold cross-validation as in docs/accuracy.md; prints the table of docs/migrating-from-intprim.md.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import io
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from joblib import cpu_count

import inphase
import inphase.filters
import intprim
from inphase.evaluation import CONDITIONS, Evaluation, evaluate

OBSERVED, CONTROLLED = ["taker_x", "taker_y", "taker_z"], ["giver_x", "giver_y", "giver_z"]
EVERY = 2  # so many-th sample, to 30 Hz: what the tutorial's process noise is for
PROCESS_VAR, PHASE_VAR = 1e-8, 1e-4  # 4.2.7.1
QUICK_EPISODES, QUICK_EVERY = 8, 12
METRICS = ("now", "cover", "end50")


@dataclass(frozen=True, eq=False)
class Primitive:
    """A trained primitive with a filter to copy, as the tutorial makes them, and what is seen of a partner."""

    primitive: Any
    filter: Any
    noise: np.ndarray
    active: np.ndarray

    @classmethod
    def learn(cls, dataset: inphase.Dataset, kind: str, inflated: float = 1.0) -> Primitive:
        """Selection by BIC, scaling by partner, noise by regression, the ensemble of all demonstrations."""
        names, observed = list(dataset.names), len(dataset.observed)
        groups = [list(range(observed)), list(range(observed, len(names)))]
        trajectories = [demonstration.values.T for demonstration in dataset]
        selection = intprim.basis.Selection(names, scaling_groups=groups)
        for trajectory in trajectories:
            selection.add_demonstration(trajectory)
        everything = np.arange(len(names))
        with contextlib.redirect_stdout(io.StringIO()):
            _, basis = selection.get_best_model(*selection.get_information_criteria(everything))
        primitive = intprim.BayesianInteractionPrimitive(basis, scaling_groups=groups)
        intprim.examples.train_model(primitive, trajectories)
        velocity_mean, velocity_var = intprim.examples.get_phase_stats(trajectories)
        phase = ([0.0, velocity_mean], [PHASE_VAR, velocity_var], PROCESS_VAR)
        np.random.seed(0)  # noqa: NPY002 - as scripts do
        if kind == "ebip":
            of = intprim.filter.spatiotemporal.EnsembleKalmanFilter(basis, *phase, primitive.basis_weights)
        else:
            mean, cov = primitive.get_basis_weight_parameters()
            of = intprim.filter.spatiotemporal.ExtendedKalmanFilter(basis, *phase, mean, cov)
        noise = inflated * np.diag(selection.get_model_mse(basis, everything))
        return cls(primitive, of, noise, np.arange(observed))

    def begin(self) -> Any:
        """One interaction: a sample in, mean and standard deviation of the controlled DoFs out, now and at the end."""
        primitive, count = copy.copy(self.primitive), len(self.active)
        primitive.set_filter(copy.deepcopy(self.filter))

        def step(time: float, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            sample = np.concatenate([values, np.zeros(len(self.noise) - count)])[:, None]
            trajectory, phase, _, cov = primitive.generate_probable_trajectory_recursive(
                sample, self.noise, self.active, num_samples=2
            )
            functions = [primitive.basis_model.get_block_diagonal_basis_matrix(at) for at in (phase, 1.0)]
            var = np.stack([np.einsum("bd,bc,cd->d", f, cov, f, optimize=True) for f in functions])
            std = np.sqrt(var + np.diag(self.noise)) * primitive.scaling.span
            return trajectory.T[:, count:], std[:, count:]

        return step


LEARNERS = {
    "intprim, ensemble": partial(Primitive.learn, kind="ebip"),
    "intprim, ensemble, noise × 100": partial(Primitive.learn, kind="ebip", inflated=100.0),
    "intprim, extended": partial(Primitive.learn, kind="bip"),
    "intprim, extended, noise × 100": partial(Primitive.learn, kind="bip", inflated=100.0),
}


def load(folder: Path, quick: bool) -> inphase.Dataset:
    """The recordings of a folder, thinned."""
    loaded = inphase.load(sorted(folder.glob("*.csv"))[: QUICK_EPISODES if quick else None], OBSERVED, CONTROLLED)
    every = EVERY * (QUICK_EVERY if quick else 1)
    thinned = [inphase.Demonstration(d.times[::every], d.values[::every], d.name) for d in loaded]
    return inphase.Dataset(loaded.channels, tuple(thinned))


def table(found: Evaluation, conditions: tuple[str, ...]) -> str:
    """A Markdown table: the error now, the share inside the 90 % band and the error of the final pose."""
    lines = ["| now (cover), end50 | " + " | ".join(conditions) + " |", "|---|" + "---|" * len(conditions)]
    for predictor in dict.fromkeys(row.predictor for row in found.rows):
        cells = []
        for condition in conditions:
            rows = [row for row in found.rows if (row.predictor, row.condition) == (predictor, condition)]
            now, cover, end = (float(np.mean([getattr(row, metric) for row in rows])) for metric in METRICS)
            cells.append(f"{now:.3f} ({100 * cover:.0f} %), {end:.3f}")
        label = f"inphase, `{predictor}`" if predictor in inphase.filters.FILTERS else predictor
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="the folder of the recordings")
    parser.add_argument("--quick", action="store_true", help="a few thin episodes under two conditions")
    chosen = parser.parse_args(arguments)
    conditions = tuple(CONDITIONS)[:2] if chosen.quick else tuple(CONDITIONS)
    found = evaluate(
        load(chosen.folder, chosen.quick),
        ("rbpf",),
        folds=2 if chosen.quick else 4,
        conditions=conditions,
        others=LEARNERS,
        jobs=1 if chosen.quick else min(cpu_count(), 4),
    )
    print(table(found, conditions))
    return 0


if __name__ == "__main__":
    sys.exit(main())
