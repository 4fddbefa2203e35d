"""What goes wrong with sensors, injected into a whole loop: limits hold, the policy is reached, the recording replays.

Each fault comes 20 times, each time at another moment, of another strength, and with other rates, limits and commands.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from injected import ENDLESS, LONGEST, SEEDS, Conditions, check, check_reached, last_seen, quick_model, quickly
from rigs import HOME, Listed

import inphase
from inphase.runtime.devices import Dead, Drifting, Duplicated, Late, NanBursting, Reordered
from inphase.runtime.safety import Answer, State


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return quick_model()


@pytest.fixture(autouse=True)
def _quick() -> Iterator[None]:
    with quickly():
        yield


@pytest.mark.parametrize("seed", SEEDS)
def test_a_dead_sensor(model, tmp_path, seed):
    now = Conditions(model, seed)
    length = now.length if seed % 4 else np.inf
    run = now.bench(tmp_path / "run.mcap", Dead(now.partner, now.onset, length), policy={"stale_sensors": now.answer})
    run.run(ENDLESS if now.answer is Answer.RETREAT else LONGEST)
    check(run)
    check_reached(
        run, last_seen(now.sensor, now.onset) + now.staleness, now.answer, now.period, until=now.onset + length
    )
    if now.answer is Answer.RETREAT:
        assert run.loop.report.stopped
        np.testing.assert_allclose(run.robot.sent[-1][1].positions[-1], now.retreat, atol=2e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sensor_that_bursts_with_nan(model, tmp_path, seed):
    now = Conditions(model, seed)
    bursting = NanBursting(now.partner, [(0.1, 0.04), (now.onset, now.length)])
    run = now.bench(tmp_path / "run.mcap", bursting, policy={"stale_sensors": now.answer})
    run.run(LONGEST)
    check(run)
    check_reached(
        run, last_seen(now.sensor, now.onset) + now.staleness, now.answer, now.period, until=now.onset + now.length
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sensor_that_raises(model, tmp_path, seed):
    now = Conditions(model, seed)

    class Unplugged(Listed):
        def read(self):
            if run.clock.now() > now.onset:
                raise OSError("no such device")
            return super().read()

    run = now.bench(tmp_path / "run.mcap", policy={"stale_sensors": now.answer})
    broken = Unplugged(now.partner)
    run.loop.perception.sensors = (broken,)
    run.run(LONGEST)
    check(run)
    check_reached(run, last_seen(broken) + now.staleness, now.answer, now.period)
    told = [event for event in run.told if event.kind == "sensor"]
    assert len(told) == 1
    assert "no such device" in told[0].reason
    assert told[0].time <= now.onset + 1 / now.rates.sense + 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_a_late_sensor(model, tmp_path, seed):
    """A little late it is followed; later than a reading may be, the robot does not move at all."""
    now = Conditions(model, seed)
    too_late = seed % 2 == 0
    by = now.staleness * (1.2 if too_late else 0.2)
    run = now.bench(tmp_path / "run.mcap", Late(now.partner, by, jitter=0.0 if too_late else 0.01, seed=seed))
    run.run(LONGEST)
    check(run)
    if too_late:
        assert run.states(0.0) == {State.HOLDING}
        assert all(np.array_equal(row, HOME) for _, command, _ in run.robot.sent for row in command.positions)
    else:
        assert State.RUNNING in run.states(0.0)
        assert not any("nothing is read" in event.reason for event in run.safety)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_drifting_sensor(model, tmp_path, seed):
    """A clock of its own, years ahead and wrong by a second in a quarter of an hour, changes nothing much."""
    now = Conditions(model, seed)
    drift, offset = now.rng.uniform(-1e-3, 1e-3), now.rng.uniform(-1e6, 1e6)
    run = now.bench(tmp_path / "run.mcap", Drifting(now.partner, drift, offset), shared_clock=())
    run.run(LONGEST)
    check(run)
    same = Conditions(model, seed)
    well = same.bench(tmp_path / "well.mcap")
    well.run(LONGEST)
    assert run.loop.report.ended == well.loop.report.ended == "the interaction is over"
    ours, theirs = (np.array([e.phase for e in r.recorded().estimates]) for r in (run, well))
    count = min(len(ours), len(theirs))
    np.testing.assert_allclose(ours[:count], theirs[:count], atol=0.02)
    assert abs(len(ours) - len(theirs)) <= 2


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sensor_that_gives_all_twice(model, tmp_path, seed):
    """Not a bit of what is sent changes."""
    now, same = Conditions(model, seed), Conditions(model, seed)
    run = now.bench(tmp_path / "run.mcap", Duplicated(now.partner, now.rng.uniform(0.1, 1.0), seed))
    well = same.bench(tmp_path / "well.mcap")
    for each in (run, well):
        each.run(LONGEST)
    check(run)
    assert len(run.robot.sent) == len(well.robot.sent)
    for (_, command, _), (_, other, _) in zip(run.robot.sent, well.robot.sent, strict=True):
        np.testing.assert_array_equal(command.positions, other.positions)
    assert len(now.sensor.given) > len(same.sensor.given)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sensor_that_gives_some_late(model, tmp_path, seed):
    """All are observed, in the order in which they came, and none twice."""
    now = Conditions(model, seed)
    run = now.bench(
        tmp_path / "run.mcap", Reordered(now.partner, now.rng.uniform(0.2, 0.4), now.rng.uniform(0.05, 0.09), seed)
    )
    run.run(LONGEST)
    check(run)
    recording = run.recorded()
    in_turn = [s for look in now.sensor.looks for s in sorted(look, key=lambda s: s.stamp)]
    expected = np.array([s.values for s in in_turn])
    np.testing.assert_array_equal(recording.values[:, :2], expected[: len(recording.values)])
    assert len(expected) - len(recording.values) <= 1  # one that came with the last look may be of the moment after
    assert any(s.stamp < before.stamp for before, s in itertools.pairwise(in_turn))
    assert not any("nothing is read" in event.reason for event in run.safety)
