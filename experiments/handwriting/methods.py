"""Who follows a stroke: the dissertation's methods as it wrote them, and ours as a user has them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import inphase
from experiments.handwriting.strokes import Stroke
from experiments.study.follower import AHEAD, MARKS, OURS, WRITTEN, filtered, warped_in_time

METHODS = {
    "IP, DTW": warped_in_time(WRITTEN),
    "BIP": filtered(WRITTEN, "bip"),
    "eBIP": filtered(WRITTEN, "ebip"),
    "particle": filtered(WRITTEN, "particle"),
    "eBIP, calibrated": filtered(OURS, "ebip"),
    "promp, calibrated": filtered(OURS, "promp"),
    "rbpf": filtered(OURS, "rbpf"),
}


def followed(method: str, models: Mapping[str, inphase.Model], stroke: Stroke, seed: int) -> np.ndarray:
    """(MARKS, 2) errors at even moments of a stroke: of the rest of it as foretold [its unit], and of the phase."""
    of = METHODS[method]
    follower, phases = of.make(models[of.model], seed), stroke.phases
    marks = np.linspace(0, len(phases) - 1, MARKS + 1).round().astype(int)[1:]
    errors: list[tuple[float, float]] = []
    for i, (time, row) in enumerate(zip(stroke.times, stroke.read, strict=True)):
        phase = follower.observe(time, row)
        if i in marks:
            rest = stroke.at(np.linspace(phases[i], 1.0, AHEAD))
            error = float(np.abs(follower.foretell() - rest).mean()), abs(phase - phases[i])
            errors += [error] * int((marks == i).sum())
    return np.array(errors)
