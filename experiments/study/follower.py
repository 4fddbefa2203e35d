"""Who follows an interaction and foretells the rest: any filter, or Interaction Primitives, asked in the same way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

import inphase
from experiments.study.interaction_primitive import InteractionPrimitive

MARKS = 20  # moments of an interaction at which the rest of it is foretold
AHEAD = 20  # points of the rest
WRITTEN, OURS = "as_written", "calibrated"  # models: the dissertation's, and what `inphase.fit` makes


class Follower(Protocol):
    """Takes in samples, and foretells."""

    def observe(self, time: float, values: np.ndarray) -> float:
        """The phase."""

    def foretell(self) -> np.ndarray:
        """(AHEAD, Dc) what the robot is going to do, from now to the end."""


class _Session:
    def __init__(self, session: inphase.Session) -> None:
        self.session = session

    def observe(self, time: float, values: np.ndarray) -> float:
        return self.session.observe(time, values).phase

    def foretell(self) -> np.ndarray:
        return self.session.respond(samples=AHEAD).mean


class _Warped:
    def __init__(self, model: inphase.Model) -> None:
        self.primitive = InteractionPrimitive(model)

    def observe(self, time: float, values: np.ndarray) -> float:
        return self.primitive.observe(time, values)

    def foretell(self) -> np.ndarray:
        controlled = len(self.primitive.model.controlled)
        return self.primitive.expect(np.linspace(self.primitive.phase, 1.0, AHEAD))[:, -controlled:]


@dataclass(frozen=True)
class Method:
    """How one follows. model: the name of the model it takes. make: of a model and a seed."""

    model: str
    make: Callable[[inphase.Model, int], Follower]


def filtered(model: str, name: str) -> Method:
    """A session with the filter of that name."""
    wary = model != WRITTEN  # the dissertation's filters take every reading at its word
    return Method(model, lambda learned, seed: _Session(learned.session(name, seed=seed, slips=wary)))


def warped_in_time(model: str) -> Method:
    """Interaction Primitives with dynamic time warping."""
    return Method(model, lambda learned, seed: _Warped(learned))


def cheaper(lengths: Sequence[int], time: np.ndarray, other: np.ndarray) -> str:
    """Up to which length the first of two times is less, as the end of a sentence; empty where it never is."""
    less = [length for length, a, b in zip(lengths, time, other, strict=True) if a < b]
    return f"; of {max(less)} samples and less it takes more" if less else ""
