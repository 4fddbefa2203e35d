"""What is foreseen of the catch while the throw goes on: Tables 2 and 3, and Fig. 28's course over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

import inphase
from experiments.bodies.arm import JOINTS
from experiments.catching.demonstrations import channels_of, gathered
from experiments.study import Found
from experiments.study.as_written import as_written
from inphase.basis import Basis, Gaussian, Polynomial, Sigmoid
from inphase.trajectory import Demonstration

COLUMNS = {
    "Ball": ("ball",),
    "Shoe, IMU": ("shoes", "imu"),
    "Shoe, IMU, Head": ("shoes", "imu", "head"),
    "Shoe, IMU, Head, Ball": ("shoes", "imu", "head", "ball"),
    "All": ("shoes", "imu", "head", "ball", "body"),
}
MARKS = (0.43, 0.82)  # of the interaction: before the throw, and in the flight
SIZES = (6, 8, 10, 12, 15)
BALL = ("ball_x", "ball_y", "ball_z")
FIRST = 3  # joints, of which Table 2 tells
COURSE = np.linspace(0.05, 0.95, 19)  # phases at which Fig. 28 looks


Methods: TypeAlias = Mapping[str, tuple[inphase.Model, Mapping[str, Any]]]


def chosen_basis(dataset: inphase.Dataset) -> dict[str, Basis]:
    """For every object that is sensed, what the Bayesian information criterion chooses of three families (3.3.1)."""
    candidates = [basis for n in SIZES for basis in (Gaussian(n), Sigmoid(n), Polynomial(n - 1))]
    return inphase.select_basis(dataset, candidates=candidates, per="group").best("bic")


def methods(train: inphase.Dataset, calibrate: bool) -> Methods:
    """The dissertation's methods on its own model, with as many members as demonstrations, and ours on `fit`."""
    written = as_written(train, chosen_basis(train))
    ours = inphase.fit(train, calibrate=calibrate)
    return {
        "BIP": (written, {"filter": "bip", "slips": False}),
        **_ensembles(written, len(train)),
        "eBIP, calibrated": (ours, {"filter": "ebip"}),
        "rbpf": (ours, {}),
    }


def learned_noise(train: inphase.Dataset) -> Methods:
    """The dissertation's ensembles and particles, on its own model but for the noise, which is learned."""
    return _ensembles(as_written(train, chosen_basis(train), white=False), len(train))


def _ensembles(model: inphase.Model, members: int) -> Methods:
    """Particles, and ensembles of either prior; every reading is taken at its word, as in the dissertation."""
    return {
        "PF": (model, {"filter": "particle", "particles": members, "slips": False}),
        "eBIP-": (model, {"filter": "ebip", "members": members, "prior": "mixture", "slips": False}),
        "eBIP": (model, {"filter": "ebip", "members": members, "slips": False}),
    }


def split(dataset: inphase.Dataset, folds: int, fold: int, seed: int) -> tuple[inphase.Dataset, inphase.Dataset]:
    """What is learned from, and what is tested, of the shuffled demonstrations."""
    order = np.random.default_rng([seed, 7]).permutation(len(dataset))
    tested = set(order[fold::folds].tolist())
    parts: list[list[Demonstration]] = [[], []]
    for i, demonstration in enumerate(dataset):
        parts[i in tested].append(demonstration)
    train, test = (inphase.Dataset(dataset.channels, tuple(part), dataset.provenance) for part in parts)
    return train, test


def cross_validated(
    found: Found,
    compared: Callable[[inphase.Dataset], Methods],
    folds: int,
    fold: int,
    seed: int,
    most: int | None = None,
) -> dict[str, np.ndarray]:
    """One fold: by "what/column/method", (tests, marks) errors; by "course/method", (tests, phases) of the ball's."""
    train, test = split(gathered(found), folds, fold, seed)
    results: dict[str, list[Any]] = {}
    taught = compared(train)
    for method, (model, options) in taught.items():
        session = model.session(seed=seed, **options)
        for column, modalities in COLUMNS.items():
            for demonstration in list(test)[:most]:
                session.reset()
                marks = np.union1d(MARKS, COURSE) if column == "All" else np.array(MARKS)
                told = dict(foreseen(session, demonstration, channels_of(*modalities), marks))
                errors = {phase: errors_of(catch, demonstration, test.names) for phase, catch in told.items()}
                for i, what in enumerate(("joints", "ball")):
                    key = f"{what}/{column}/{method}"
                    results.setdefault(key, []).append([errors[mark][i] for mark in MARKS])
                if column == "All":
                    results.setdefault(f"course/{method}", []).append([errors[phase][1] for phase in COURSE])
    sizes: dict[str, Any] = {
        "weights": next(iter(taught.values()))[0].layout.slices[-1].stop,
        "demonstrations": len(train),
    }
    return {name: np.array(values) for name, values in {**results, **sizes}.items()}


def foreseen(
    session: inphase.Session, demonstration: Demonstration, observed: Sequence[str], marks: np.ndarray
) -> Iterator[tuple[float, np.ndarray]]:
    """At every mark, the phase so far, (9,) where joints and ball will be at the catch."""
    names = session.model.observed
    seen = np.array([name in observed for name in names])
    waiting = list(marks)
    for time, phase, values in zip(demonstration.times, demonstration.phases, demonstration.values, strict=True):
        while waiting and phase > waiting[0]:
            response = session.respond(start=1.0, samples=1, channels=[*BALL, *JOINTS])
            yield waiting.pop(0), np.asarray(response.mean[0])
        if not waiting:
            return
        session.observe(float(time), np.where(seen, values[: len(names)], np.nan))


def truth(demonstration: Demonstration, names: Sequence[str]) -> np.ndarray:
    """(9,) where ball and joints were at the catch: the last that was read of each."""
    columns = [list(names).index(name) for name in (*BALL, *JOINTS)]
    values = demonstration.values[:, columns]
    return np.array([column[np.isfinite(column)][-1] for column in values.T])


def errors_of(catch: np.ndarray, demonstration: Demonstration, names: Sequence[str]) -> tuple[float, float]:
    """The mean squared error of the first three joints [rad²], and the mean absolute one of the ball [m]."""
    off = catch - truth(demonstration, names)
    return float(np.mean(off[3 : 3 + FIRST] ** 2)), float(np.mean(np.abs(off[:3])))


def joined(found: Found, key: str) -> np.ndarray:
    """Of all folds."""
    return np.concatenate([np.atleast_1d(part[key]) for part in found.values()])


def trained_on(found: Mapping[str, Mapping[str, np.ndarray]], key: str) -> str:
    """What was the same or nearly so in all folds, as text."""
    values = sorted({int(part[key]) for part in found.values()})
    return f"{values[0]}" if len(values) == 1 else f"{values[0]} to {values[-1]}"
