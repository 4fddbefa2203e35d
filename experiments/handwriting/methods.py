"""Who follows a stroke: the dissertation's methods as it wrote them, and ours as a user has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

import inphase
from experiments.handwriting.strokes import CONTROLLED, Stroke
from experiments.study.interaction_primitive import InteractionPrimitive

MARKS = 20  # moments of a stroke at which the rest of it is foretold
AHEAD = 20  # points of the rest


class Follower(Protocol):
    """Takes in samples, and foretells."""

    def observe(self, time: float, values: np.ndarray) -> float:
        """The phase."""

    def foretell(self) -> np.ndarray:
        """(AHEAD, 2) what the robot is going to draw, from now to the end."""


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


@dataclass(frozen=True)
class Method:
    """How one follows. model: the name of the model it takes. make: of a model and a seed."""

    model: str
    make: Callable[[inphase.Model, int], Follower]


def _filtered(model: str, name: str) -> Method:
    return Method(model, lambda learned, seed: _Session(learned.session(name, seed=seed)))


WRITTEN, OURS = "as_written", "calibrated"
METHODS = {
    "IP, DTW": Method(WRITTEN, lambda model, seed: _Primitive(model)),
    "BIP": _filtered(WRITTEN, "bip"),
    "eBIP": _filtered(WRITTEN, "ebip"),
    "particle": _filtered(WRITTEN, "particle"),
    "eBIP, calibrated": _filtered(OURS, "ebip"),
    "promp, calibrated": _filtered(OURS, "promp"),
    "rbpf": _filtered(OURS, "rbpf"),
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
