"""Fig. 29: what members cost, and what they are good for."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from experiments.catching.demonstrations import channels_of, gathered
from experiments.catching.prediction import COLUMNS, MARKS, chosen_basis, errors_of, foreseen, split
from experiments.study import Found
from experiments.study.as_written import as_written

LENGTHS = np.linspace(0.1, 1.0, 10)


def by_members(found: Found, members: int, folds: int, seed: int, tests: int) -> dict[str, Any]:
    """With so many members, eBIP's and eBIP⁻'s errors at both marks, and how long they take.

    step: [s] of one observation, the median. whole: (10,) [s] of the first tenths of an interaction, all together.
    """
    train, test = split(gathered(found), folds, 0, seed)
    model = as_written(train, chosen_basis(train))
    observed = channels_of(*COLUMNS["All"])
    result: dict[str, Any] = {"members": members}
    for name, prior in (("eBIP", "demonstrations"), ("eBIP-", "mixture")):
        session = model.session(filter="ebip", members=members, prior=prior, seed=seed, slips=False)
        errors, steps, wholes = [], [], []
        for demonstration in list(test)[:tests]:
            session.reset()
            told = dict(foreseen(session, demonstration, observed, np.array(MARKS)))
            errors.append([errors_of(told[mark], demonstration, test.names) for mark in MARKS])
            session.reset()
            took = []
            for at, values in zip(demonstration.times, demonstration.values, strict=True):
                began = time.perf_counter()
                session.observe(float(at), values[: len(model.observed)])
                took.append(time.perf_counter() - began)
            steps.append(np.median(took))
            wholes.append(np.interp(LENGTHS * len(took), np.arange(len(took)) + 1, np.cumsum(took)))
        result |= {f"errors/{name}": np.array(errors), f"step/{name}": np.median(steps)}
        result[f"whole/{name}"] = np.median(wholes, axis=0)
    return result
