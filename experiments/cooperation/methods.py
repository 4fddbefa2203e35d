"""Who answers a person: the dissertation's methods as it wrote them, and ours as a user has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

import inphase
from experiments.cooperation.sensors import CONTROLLED, GROUPS
from experiments.study.interaction_primitive import InteractionPrimitive

MARKS = 20  # moments of an interaction at which the rest of it is foretold
AHEAD = 20  # points of the rest
JOINTS = len(GROUPS["arm"])  # of the controlled channels


class Follower(Protocol):
    """Takes in samples, and foretells."""

    def observe(self, time: float, values: np.ndarray) -> float:
        """The phase."""

    def foretell(self) -> np.ndarray:
        """(AHEAD, 7) what the robot is going to do, from now to the end."""


class _Session:
    def __init__(self, session: inphase.Session) -> None:
        self.session = session

    def observe(self, time: float, values: np.ndarray) -> float:
        return self.session.observe(time, values).phase

    def foretell(self) -> np.ndarray:
        return self.session.respond(samples=AHEAD).mean


class _Primitive:
    def __init__(self, model: inphase.Model) -> None:
        self.primitive = InteractionPrimitive(model)
        self.columns = [model.names.index(name) for name in CONTROLLED]

    def observe(self, time: float, values: np.ndarray) -> float:
        return self.primitive.observe(time, values)

    def foretell(self) -> np.ndarray:
        return self.primitive.expect(np.linspace(self.primitive.phase, 1.0, AHEAD))[:, self.columns]


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


@dataclass(frozen=True)
class Method:
    """How one follows. model: the name of the model it takes. make: of a model and a seed."""

    model: str
    make: Callable[[inphase.Model, int], Follower]


def _filtered(model: str, name: str) -> Method:
    return Method(model, lambda learned, seed: _Session(learned.session(name, seed=seed)))


WRITTEN, OURS = "as_written", "calibrated"
METHODS = {
    "mean": Method(OURS, lambda model, seed: _Blind(model)),
    "IP, DTW": Method(WRITTEN, lambda model, seed: _Primitive(model)),
    "BIP": _filtered(WRITTEN, "bip"),
    "eBIP": _filtered(WRITTEN, "ebip"),
    "particle": _filtered(WRITTEN, "particle"),
    "BIP, calibrated": _filtered(OURS, "bip"),
    "eBIP, calibrated": _filtered(OURS, "ebip"),
    "promp, calibrated": _filtered(OURS, "promp"),
    "rbpf": _filtered(OURS, "rbpf"),
}


def followed(
    method: str,
    models: Mapping[str, inphase.Model],
    demonstration: inphase.Demonstration,
    kept: np.ndarray,
    times: np.ndarray,
    seed: int,
    columns: np.ndarray,
) -> np.ndarray:
    """(MARKS, 3) errors at even moments of a demonstration, of which these samples (T,) are seen at times (T,) [s].

    Of the arm's joints in the rest of it [rad], of the gripper in it, and of the phase. columns: what is observed.
    """
    of = METHODS[method]
    follower = of.make(models[of.model], seed)
    phases, true = demonstration.phases, demonstration.values[:, -len(CONTROLLED) :]
    at = phases[kept]
    marks = np.searchsorted(at, np.arange(1, MARKS + 1) / MARKS - 1e-9).clip(max=len(at) - 1)
    errors = np.zeros((MARKS, 3))
    for i, (time, row) in enumerate(zip(times, kept, strict=True)):
        phase = follower.observe(time, demonstration.values[row, columns])
        here = marks == i
        if here.any():
            grid = np.linspace(at[i], 1.0, AHEAD)
            rest = np.stack([np.interp(grid, phases, column) for column in true.T], axis=1)
            off = np.abs(follower.foretell() - rest).mean(axis=0)
            errors[here] = off[:JOINTS].mean(), off[JOINTS], abs(phase - at[i])
    return errors
