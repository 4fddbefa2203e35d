"""Who answers a person: the dissertation's methods as it wrote them, and ours as a user has them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import inphase
from experiments.cooperation.sensors import CONTROLLED, GROUPS, OBSERVED
from experiments.study.follower import AHEAD, MARKS, OURS, WRITTEN, Method, filtered, warped_in_time

JOINTS = len(GROUPS["arm"])  # of the controlled channels


class _Blind:
    """Plays what was demonstrated on average, at its usual pace, whatever the person does."""

    def __init__(self, model: inphase.Model) -> None:
        self.model, self.phase = model, 0.0
        self.columns = [model.names.index(name) for name in CONTROLLED]

    def observe(self, time: float, values: np.ndarray) -> float:
        self.phase = min(time * self.model.phase.nominal_velocity, 1.0)
        return self.phase

    def foretell(self) -> np.ndarray:
        return self.model.predict(np.linspace(self.phase, 1.0, AHEAD))[:, self.columns]


METHODS = {
    "mean": Method(OURS, lambda model, seed: _Blind(model)),
    "IP, DTW": warped_in_time(WRITTEN),
    "BIP": filtered(WRITTEN, "bip"),
    "eBIP": filtered(WRITTEN, "ebip"),
    "particle": filtered(WRITTEN, "particle"),
    "BIP, calibrated": filtered(OURS, "bip"),
    "eBIP, calibrated": filtered(OURS, "ebip"),
    "promp, calibrated": filtered(OURS, "promp"),
    "rbpf": filtered(OURS, "rbpf"),
}


def followed(
    method: str,
    models: Mapping[str, inphase.Model],
    demonstration: inphase.Demonstration,
    kept: np.ndarray,
    times: np.ndarray,
    seed: int,
) -> np.ndarray:
    """(MARKS, 3) errors at even moments of a demonstration, of which these samples (T,) are seen at times (T,) [s].

    Of the arm's joints in the rest of it [rad], of the gripper in it, and of the phase.
    """
    of = METHODS[method]
    follower = of.make(models[of.model], seed)
    phases, true = demonstration.phases, demonstration.values[:, -len(CONTROLLED) :]
    at = phases[kept]
    marks = np.searchsorted(at, np.arange(1, MARKS + 1) / MARKS - 1e-9).clip(max=len(at) - 1)
    errors = np.zeros((MARKS, 3))
    for i, (time, row) in enumerate(zip(times, kept, strict=True)):
        phase = follower.observe(time, demonstration.values[row, : len(OBSERVED)])
        here = marks == i
        if here.any():
            grid = np.linspace(at[i], 1.0, AHEAD)
            rest = np.stack([np.interp(grid, phases, column) for column in true.T], axis=1)
            off = np.abs(follower.foretell() - rest).mean(axis=0)
            errors[here] = off[:JOINTS].mean(), off[JOINTS], abs(phase - at[i])
    return errors
