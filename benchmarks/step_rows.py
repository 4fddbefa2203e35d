"""One step of one filter at one size: its time, its memory, and its time beside the plain loop, the floor and numpy."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from floors import floor
from loops import LOOPS
from sizes import DURATION, Size, observations
from timing import numpy_call, peak, spread, tiny_calls, work

import inphase
from inphase.filters import Particle, Rbpf, make
from inphase.observation import Observation

WARMING = 2  # steps before the measured ones: what is computed once and kept is no part of a step
TRACED = 10  # steps whose memory is traced
LONG_ENOUGH = 1e-4  # [s], for the clock of processor time: a floor that takes less is timed several times at once

Step = Callable[[Any, Observation, float, np.random.Generator], Any]


class Follower:
    """What follows an interaction step by step, and how long each step took, and worked [s]."""

    def __init__(self, step: Step, state: Any, dt: float) -> None:
        self.step, self.state, self.dt, self.rng = step, state, dt, np.random.default_rng(0)
        self.taken: list[float] = []
        self.worked: list[float] = []

    def take(self, seen: Observation) -> None:
        """One step."""
        idle, begun = time.thread_time(), time.perf_counter()
        self.state = self.step(self.state, seen, self.dt, self.rng)
        self.taken.append(time.perf_counter() - begun)
        self.worked.append(time.thread_time() - idle)

    def warmed(self, samples: list[Observation]) -> Follower:
        """The same from the start, after a few steps that do not count."""
        start = self.state
        for seen in samples[:WARMING]:
            self.take(seen)
        return Follower(self.step, start, self.dt)


def options(name: str, size: Size) -> dict[str, Any]:
    """Of the filter: an ensemble is as large as the size says, particles are as many as they are by default."""
    return {"members": size.members} if name == "ebip" else {}


def members(name: str, size: Size) -> int:
    """Of the ensemble, or particles; of filters that have neither, the demonstrations."""
    return {"particle": Particle.particles, "rbpf": Rbpf.particles}.get(name, size.members)


def filtering(model: inphase.Model, name: str, size: Size, dt: float) -> Follower:
    """A filter at the start of an interaction."""
    filter = make(name, model, **options(name, size))

    def step(belief: Any, seen: Observation, dt: float, rng: np.random.Generator) -> Any:
        belief, info = filter.step(belief, seen, dt, rng)
        if not info.healthy:
            raise RuntimeError(f"{size} {name}: expected a step that uses its sample, got one that does not")
        return belief

    return Follower(step, filter.init(np.random.default_rng(0)), dt)


def looping(model: inphase.Model, name: str, size: Size, dt: float) -> Follower:
    """Its plain loop at the start of an interaction."""
    loop = LOOPS[name](model, members(name, size))
    return Follower(loop.step, loop.init(np.random.default_rng(0)), dt)


def measure_step(model: inphase.Model, name: str, size: Size, *, repeats: int, loops: int) -> dict[str, Any]:
    """Times [µs] of `repeats` steps along an interaction, and ratios of median processor times.

    The loop (`loops` times), the floor and a tiny numpy call are timed in between, so that whatever else the machine
    does meanwhile, it does to all. A loop is so much longer than a step that it would be interrupted more often: hence
    processor time.
    """
    dt, samples = DURATION / repeats, observations(model, repeats, np.random.default_rng(0))
    filter, loop = (begin(model, name, size, dt).warmed(samples) for begin in (filtering, looping))
    least, tiny = floor(name, model, members(name, size), samples[0].features), tiny_calls()
    at_once = 1 + int(LONG_ENOUGH / min(work(least) for _ in range(WARMING)))
    floors, calls = [], []
    looped = set(np.linspace(0, repeats - 1, loops).round().astype(int).tolist())
    for i, seen in enumerate(samples):
        filter.take(seen)
        floors.append(work(least, at_once))
        calls.append(numpy_call(tiny))
        if i in looped:
            loop.take(seen)
    worked = {"step": filter.worked, "loop": loop.worked, "floor": floors, "call": calls}
    median = {what: float(np.median(times)) for what, times in worked.items()}
    return {
        "size": str(size),
        "filter": name,
        **spread(filter.taken),
        "loop/step": median["loop"] / median["step"],
        "step/floor": median["step"] / median["floor"],
        "calls": median["step"] / median["call"],
    }


def measure_memory(model: inphase.Model, name: str, size: Size) -> dict[str, float]:
    """The memory [bytes] that a step holds at once beyond what was held before it: the median of a few."""
    samples = observations(model, TRACED, np.random.default_rng(0))
    filter, found = filtering(model, name, size, DURATION / TRACED).warmed(samples), []
    tracemalloc.start()
    try:
        for seen in samples:
            found.append(peak(lambda seen=seen: filter.take(seen)))
    finally:
        tracemalloc.stop()
    return {"bytes": float(np.median(found))}
