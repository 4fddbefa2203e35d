"""How long a basis selection takes, beside fitting every demonstration and candidate one after the other.

    python benchmarks/selection.py [--quick]

Both compare the grid of the dissertation's library (4.2.2) on demonstrations of two channels, and give AIC and BIC;
held-out likelihoods are given by `select_basis` alone. By turns, in processor time: the shortest of each counts.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from timing import work

import inphase
from inphase.basis import Basis, Gaussian, Polynomial, Sigmoid
from inphase.training.selection import select_basis

DEMONSTRATIONS, QUICK = 50, 5
LENGTHS = (60, 130)
NOISE = 0.01
TURNS, QUICK_TURNS = 5, 2
DEGREES, SCALES = range(5, 14, 2), np.arange(0.01, 0.2, 0.03).tolist()


def candidates() -> list[Basis]:
    """Three families, their degrees and scales as IntPrim's Selection has them."""
    gaussians = [Gaussian(size, scale**0.5, margin=0.0) for size in DEGREES for scale in SCALES]
    return [
        *gaussians,
        *(Sigmoid(size, scale) for size in DEGREES for scale in SCALES),
        *(Polynomial(n - 1) for n in DEGREES),
    ]


def demonstrations(count: int, rng: np.random.Generator) -> inphase.Dataset:
    """Two channels, of 8 Gaussians with variance 0.1 and of 8 steps, with noise."""
    bases, times, values = (Gaussian(8, 0.1**0.5, margin=0.0), Sigmoid(8, 0.05)), [], []
    for _ in range(count):
        phases = np.linspace(0, 1, int(rng.integers(*LENGTHS)))
        columns = [basis(phases) @ rng.normal(size=basis.size) for basis in bases]
        times.append(2 * phases)
        values.append(np.stack(columns, axis=1) + NOISE * rng.normal(size=(len(phases), 2)))
    return inphase.Dataset.from_arrays(times, values, ["x"], ["y"])


def one_by_one(dataset: inphase.Dataset, bases: list[Basis]) -> np.ndarray:
    """(2, C, 2) AIC and BIC of every candidate and channel, by a loop over candidates, demonstrations and channels."""
    found = np.empty((2, len(bases), 2))
    for c, basis in enumerate(bases):
        for channel in range(2):
            squares = []
            for demonstration in dataset:
                functions, readings = basis(demonstration.phases), demonstration.values[:, channel]
                weights = np.linalg.lstsq(functions, readings, rcond=None)[0]
                squares.append(np.mean((readings - functions @ weights) ** 2))
            length = np.mean([len(demonstration) for demonstration in dataset])
            misfit = length * (np.log(2 * np.pi * np.mean(squares)) + 1)
            found[:, c, channel] = misfit + 2 * basis.size, misfit + np.log(length) * basis.size
    return found


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few demonstrations, as the tests do")
    quick = parser.parse_args(arguments).quick
    dataset = demonstrations(QUICK if quick else DEMONSTRATIONS, np.random.default_rng(0))
    bases = candidates()
    times = np.array(
        [
            [work(lambda: one_by_one(dataset, bases)), work(lambda: select_basis(dataset, candidates=bases), 5)]
            for _ in range(QUICK_TURNS if quick else TURNS)
        ]
    )
    slow, fast = times.min(0)
    print(f"{len(bases)} candidates, {len(dataset)} demonstrations of 2 channels")
    print(f"one by one    {1e3 * slow:8.1f} ms")
    print(f"select_basis  {1e3 * fast:8.1f} ms   {slow / fast:.0f} times faster")
    return 0


if __name__ == "__main__":
    sys.exit(main())
