"""Response elicitation (2.4): the robot does what it was told to, the partner adapts, and both are recorded."""

from __future__ import annotations

import numpy as np

import inphase
from experiments.handshake.encounter import LASTS, Encounter, Told
from experiments.handshake.partner import Partner, Style
from experiments.handshake.sensors import HAND, PRESSURES
from experiments.handshake.trajectories import Trajectory, testing, training

TRAINERS = (0, 1, 2)  # persons; 3 to 7 are met in the tests for the first time
PEOPLE = tuple(range(8))
REPETITIONS = 3


def familiar(person: int) -> bool:
    """Whether somebody has met the robot in the training."""
    return person in TRAINERS


def follow(person: int, trajectory: Trajectory, label: tuple[int, ...], seed: int) -> tuple[Partner, Told]:
    """Somebody shakes the hand of a robot that does not heed them."""
    rng = np.random.default_rng([seed, *label])
    partner = Partner(Style.of(person, seed, familiar(person)).once(rng), rng)
    encounter = Encounter(partner, rng)
    encounter.until(LASTS, trajectory.at)
    return partner, encounter.told


def taught(person: int, which: int, repetitions: int, seed: int) -> dict[str, np.ndarray]:
    """All repetitions of one training trajectory with one trainer: times (R, T), read (R, T, 30), truth (R, T, 6)."""
    told = [follow(person, training()[which], (2, person, which, again), seed)[1] for again in range(repetitions)]
    return {"times": np.stack([t.times for t in told]), "read": np.stack([t.read for t in told])} | {
        "truth": np.stack([t.truth for t in told])
    }


def static(person: int, which: int, again: int, seed: int) -> tuple[Partner, Told]:
    """A test against one of the four other trajectories."""
    return follow(person, testing()[which], (3, person, which, again), seed)


def dataset(times: np.ndarray, read: np.ndarray) -> inphase.Dataset:
    """Demonstrations (N, T) [s] and (N, T, 30) as inphase learns from them: the hand observed, pressures controlled."""
    return inphase.Dataset.from_arrays(
        list(times), list(read), HAND, PRESSURES, units={"hand_?": "m", "pressure_*": "MPa"}
    )
