"""A fault is injected 20 times: under which conditions, and what holds after every run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from interactions import dataset, shapes_unchecked, taught
from rigs import HOME, Bench, Listed, bench, violations

import inphase
from inphase.runtime.devices import SimulatedPartner
from inphase.runtime.limits import Limits
from inphase.runtime.loop import Rates
from inphase.runtime.perception import Sight
from inphase.runtime.playing import Play
from inphase.runtime.safety import Answer, Policy, State
from inphase.runtime.smoothing import AlphaBeta

SEEDS = range(20)
LONGEST = 3.0  # [s] of a run that does not end by itself
ENDLESS = 12.0  # [s]: a retreat may take ten


def quick_model() -> inphase.Model:
    """Of interactions that take about a second."""
    return taught(dataset(np.random.default_rng(0), duration=1.0))


@contextmanager
def quickly() -> Iterator[None]:
    """Without a look at all that other tests have left in memory, and at the shapes of every array."""
    with pytest.MonkeyPatch.context() as patch, shapes_unchecked():
        patch.setattr("gc.collect", lambda: 0)
        yield


class Conditions:
    """Under which a fault is injected: drawn, and the same for a seed."""

    def __init__(self, model: inphase.Model, seed: int) -> None:
        rng = self.rng = np.random.default_rng(seed)
        self.model = model
        self.rates = Rates(sense=rng.uniform(25, 50), respond=rng.uniform(7, 15), command=rng.uniform(25, 40))
        self.partner = SimulatedPartner(
            model, seed, rate=float(rng.choice([30.0, 50.0, 80.0])), tempo=rng.uniform(0.6, 1.2)
        )
        horizon = float(rng.uniform(0.05, 0.3)) if seed % 2 else None
        self.play = Play(samples=8, horizon=horizon, control_lag=float(rng.uniform(0, 0.1)))
        self.limits = Limits(
            HOME - rng.uniform(0.2, 0.6, 2),
            HOME + rng.uniform(0.1, 0.5, 2),
            rng.uniform(0.3, 3, 2),
            rng.uniform(2, 20, 2),
        )
        self.smoothing = AlphaBeta(float(rng.uniform(0.2, 1.0)))
        self.retreat = HOME + rng.uniform(-0.1, 0.1, 2)
        self.onset, self.length = float(rng.uniform(0.3, 0.6)), float(rng.uniform(0.4, 0.7))
        self.staleness = float(rng.uniform(0.15, 0.25))  # more than the slowest sensor and two looks at it
        self.answer = list(Answer)[int(rng.integers(3))]
        self.sensor: Listed | None = None

    def bench(self, file: Path, sensor=None, *, policy: dict | None = None, **options) -> Bench:
        self.sensor = Listed(self.partner if sensor is None else sensor)
        return bench(
            self.model,
            partner=self.partner,
            sensors=[self.sensor],
            limits=self.limits,
            rates=self.rates,
            play=self.play,
            smoothing=self.smoothing,
            retreat=self.retreat,
            sight=Sight(staleness=self.staleness),
            policy=Policy(**{"good_cycles": 3, **(policy or {})}),
            file=file,
            **options,
        )

    @property
    def period(self) -> float:
        return 1 / self.rates.command


def check(run: Bench) -> None:
    """What holds after every run, whatever went wrong in it."""
    assert violations(run) == []
    assert run.loop.report.ended
    assert run.loop.actuation.at_rest
    state = State.HOLDING
    for event in run.safety:  # every transition is told, once, with its reason
        assert event.before == state.name
        assert event.reason
        state = State[event.after]
    assert state is run.loop.state
    of_events = [State.HOLDING] + [State[event.after] for event in run.safety]
    seen = [s for i, (_, _, s) in enumerate(run.robot.sent) if i == 0 or s is not run.robot.sent[i - 1][2]]
    steps = iter(of_events)
    assert all(any(s is told for told in steps) for s in seen)  # in that order
    recording = run.recorded()
    assert len(recording.estimates) > 0
    assert recording.events[-1].kind == "report"
    taken = [(now, command) for now, command, _ in run.robot.sent if now in set(run.robot.taken)]
    recorded = {command.time: command for command in recording.commands}
    for now, command in taken:  # what the robot was sent is what was recorded
        np.testing.assert_array_equal(recorded[now].positions, command.positions)


def check_reached(run: Bench, fact: float, answer: Answer, period: float, until: float = np.inf) -> None:
    """From one cycle of commands after a fact [s] on, what is sent is at least as careful as the policy says."""
    before = [state for now, _, state in run.robot.sent if now < fact - 1e-9]
    assert before[-1] is State.RUNNING, "the fault came when nothing was at stake"
    states = [state for now, _, state in run.robot.sent if fact + period - 1e-9 <= now < until - 1e-9]
    assert states
    assert min(state.rank for state in states) >= answer.state.rank
    assert any(event.time <= fact + period + 1e-9 for event in run.safety if event.before == "RUNNING")


def last_seen(sensor: Listed, before: float = np.inf) -> float:
    """When the last reading was made of those before a time [s]."""
    return max(s.received for s in sensor.given if s.received < before and np.isfinite(s.values).any())
