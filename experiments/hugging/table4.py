"""Table 4: joints and contact forces that are predicted from what a partner does, for four ways of showing sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import inphase
from experiments.hugging.demonstrations import FORCES, TRAINED, dataset
from experiments.hugging.showing import UNIFORM, WAYS
from experiments.hugging.world import JOINTS
from experiments.study.as_written import as_written

LOOKAHEADS = (0.0, 0.05, 0.10)
PARTS = {"Joints": list(range(len(JOINTS))), "Left": FORCES["left"], "Right": FORCES["right"]}
METHODS = {"as written": "ebip", "ebip": "ebip", "rbpf": "rbpf"}  # the first has the dissertation's model, two ours


def split(count: int, folds: int, fold: int) -> tuple[list[int], list[int]]:
    """Which hugs are learned from, and which are played: every partner is in every fold, as in 3.3.2.3."""
    held_out = [i for i in range(count) if i // TRAINED % folds == fold]
    return [i for i in range(count) if i not in held_out], held_out


def cross_validated(
    taught: Mapping[str, Mapping[str, Any]],
    way: str,
    methods: Mapping[str, str],
    folds: int,
    fold: int,
    most: int,
    every: int,
) -> dict[str, Any]:
    """One fold: errors (hugs, lookaheads, parts) by method, the state's dimension, and what was chosen.

    most: hugs that are played. every: so many-th row of them is seen.
    """
    with threadpool_limits(limits=1):
        everything = dataset(taught)
        train, held_out = split(len(everything), folds, fold)
        shown = WAYS[way](everything.subset(train))
        played = shown.change(everything.subset(held_out[:most]))
        found: dict[str, Any] = {"says": shown.says}
        ours = None
        for name, filter in methods.items():
            if name == "as written":
                model = as_written(shown.dataset, shown.bases or UNIFORM)
                options: dict[str, Any] = {"members": len(train), "slips": False}
            else:
                ours = ours or inphase.fit(shown.dataset, basis=shown.bases, calibrate=False)
                model, options = ours, {}
            session, errors = model.session(filter, **options), []
            for demonstration in played:
                said, then, phase = follow(session, demonstration, every)
                error = np.abs(said - then)
                errors.append([[error[:, k, part].mean() for part in PARTS.values()] for k in range(len(LOOKAHEADS))])
                if len(errors) == 1:
                    found |= {f"said {name}": said, "then": then, "times": demonstration.times[::every]}
                    found |= {f"phase {name}": phase}
            found[f"error {name}"] = np.array(errors)
            found[f"dimension {name}"] = model.layout.size
    return found


def follow(
    session: inphase.Session, demonstration: inphase.Demonstration, every: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(T, 3, 20) what is said by look-ahead, (T, 3, 20) what was done so much later, and (T,) the phase estimated."""
    session.reset()
    count = len(session.model.observed)
    truth, all_phases = demonstration.values[:, count:], demonstration.phases
    phases = all_phases[::every]
    later = [np.minimum(phases + ahead, 1.0) for ahead in LOOKAHEADS]
    then = np.stack([np.stack([np.interp(at, all_phases, column) for column in truth.T], 1) for at in later], 1)
    said, believed = np.empty_like(then), np.empty(len(phases))
    for i, (time, row) in enumerate(zip(demonstration.times[::every], demonstration.values[::every], strict=True)):
        believed[i] = session.observe(time, row[:count]).phase
        for k, ahead in enumerate(LOOKAHEADS):
            said[i, k] = session.respond(lookahead=ahead, samples=1).mean[0]
    return said, then, believed
