"""Demonstrations: throws that the expert caught, as the sensors saw them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

import inphase
from experiments.bodies.arm import JOINTS
from experiments.catching.expert import demonstrate, plan
from experiments.catching.sensors import MODALITIES, OBSERVED, UNITS, Watch, watches
from experiments.catching.style import Style, style
from experiments.catching.thrower import Throw, throw
from experiments.catching.world import World
from inphase.runtime import FakeClock, SensorRecording, combine
from inphase.trajectory import Demonstration

PERSONS = 6
RATE = 60.0  # [1/s] as in 3.3.1
TRIES = 20
LEARNED, TESTED, STRANGER = 0, 1, 2  # what a throw is for, so that none is in two


def person(seed: int, number: int, purpose: int = LEARNED) -> Style:
    """One of those who throw; those whom nobody learned from are other people."""
    return style(np.random.default_rng([seed, 100 + (purpose == STRANGER), number]))


def thrown(seed: int, number: int, purpose: int) -> tuple[Throw, np.random.Generator]:
    """A throw, and what else is to be drawn for it. Persons take turns."""
    rng = np.random.default_rng([seed, purpose, number])
    return throw(person(seed, number % PERSONS, purpose), rng), rng


def demonstrated(seed: int, number: int) -> tuple[Demonstration, int]:
    """A throw that was caught, from the wind-up to the catch, and how many were not before it."""
    for tried in range(TRIES):
        happens, rng = thrown(seed, number + 1000 * tried, LEARNED)
        planned = plan(happens, rng)
        world = None if planned is None else demonstrate(happens, planned)
        if world is not None and world.entered is not None and world.inside:
            return recorded(world, [seed, LEARNED, number + 1000 * tried], f"throw {number}"), tried
    raise RuntimeError(f"throw {number}: expected one of {TRIES} to be caught, got none")


def recorded(world: World, seed: list[int], name: str) -> Demonstration:
    """What the sensors read until the ball came into the box, at 60 samples a second."""
    assert world.entered is not None
    clock = FakeClock()
    sensors = [*watches(world, seed), Watch("joints", world, np.random.default_rng([*seed, 9]))]
    for sensor in sensors:
        sensor.start(clock)
    clock.advance(world.entered + 0.05)
    recordings = {}
    for sensor in sensors:
        samples = sensor.read()
        stamps, values = np.array([s.stamp for s in samples]), np.stack([s.values for s in samples])
        recordings[sensor.name] = SensorRecording(sensor.signals, stamps, values)
    whole = combine(recordings, RATE, name=name)
    kept = whole.times <= world.entered
    return Demonstration(whole.times[kept] - whole.times[0], whole.values[kept], name)


def make(seed: int, numbers: Iterable[int]) -> dict[str, Any]:
    """Several demonstrations as arrays: times, values, how many samples each has, and how many throws were left out."""
    made = [demonstrated(seed, number) for number in numbers]
    return {
        "times": np.concatenate([d.times for d, _ in made]),
        "values": np.concatenate([d.values for d, _ in made]),
        "lengths": np.array([len(d) for d, _ in made]),
        "left_out": sum(tried for _, tried in made),
    }


def gathered(found: Mapping[str, Mapping[str, np.ndarray]]) -> inphase.Dataset:
    """The data set of all that was made."""
    times, values = [], []
    for label in sorted(found):
        part = found[label]
        ends = np.cumsum(part["lengths"])[:-1]
        times += np.split(part["times"], ends)
        values += np.split(part["values"], ends)
    return inphase.Dataset.from_arrays(
        times,
        values,
        OBSERVED,
        list(JOINTS),
        units=UNITS,
        groups={"shoe_left_*": "shoe_left", "shoe_right_*": "shoe_right"},
    )


def channels_of(*modalities: str) -> list[str]:
    """The names of their channels."""
    from experiments.catching.sensors import KINDS

    unknown = set(modalities) - set(MODALITIES)
    assert not unknown, unknown
    return [signal.name for name in modalities for signal in KINDS[name].signals]
