"""Table 4: joints and contact forces that are predicted from what a partner does, for four ways of showing sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import inphase
from experiments.hugging.demonstrations import FORCES, TRAINED, dataset
from experiments.hugging.showing import WAYS
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
    taught: Mapping[str, Mapping[str, Any]], way: str, method: str, folds: int, fold: int, calibrate: bool, most: int
) -> dict[str, Any]:
    """One fold: error (hugs, lookaheads, parts), the state's dimension, and what was chosen. most: hugs played."""
    with threadpool_limits(limits=1):
        everything = dataset(taught)
        train, held_out = split(len(everything), folds, fold)
        shown = WAYS[way](everything.subset(train))
        if method == "as written":
            model = as_written(shown.dataset, shown.bases)
        else:
            model = inphase.fit(shown.dataset, basis=shown.bases, calibrate=calibrate)
        options = {"members": len(train)} if METHODS[method] == "ebip" and method == "as written" else {}
        played = shown.change(everything.subset(held_out[:most]))
        session = model.session(METHODS[method], **options)
        errors, curves = [], {}
        for number, demonstration in zip(held_out, played, strict=False):
            said, then, phase = follow(session, demonstration)
            error = np.abs(said - then)
            errors.append([[error[:, k, part].mean() for part in PARTS.values()] for k in range(len(LOOKAHEADS))])
            if not curves:
                curves = {"said": said, "then": then[:, 0], "times": demonstration.times, "number": number}
                curves["phase"] = phase
    return {"error": np.array(errors), "dimension": model.layout.size, "says": shown.says, **curves}


def follow(session: inphase.Session, demonstration: inphase.Demonstration) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(T, 3, 20) what is said by look-ahead, (T, 3, 20) what was done so much later, and (T,) the phase estimated."""
    session.reset()
    count = len(session.model.observed)
    truth, phases = demonstration.values[:, count:], demonstration.phases
    later = [np.minimum(phases + ahead, 1.0) for ahead in LOOKAHEADS]
    then = np.stack([np.stack([np.interp(at, phases, column) for column in truth.T], 1) for at in later], 1)
    said, believed = np.empty_like(then), np.empty(len(phases))
    for i, (time, row) in enumerate(zip(demonstration.times, demonstration.values, strict=True)):
        believed[i] = session.observe(time, row[:count]).phase
        for k, ahead in enumerate(LOOKAHEADS):
            said[i, k] = session.respond(lookahead=ahead, samples=1).mean[0]
    return said, then, believed
