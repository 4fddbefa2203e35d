"""What goes wrong with the robot, the program and the people around it, injected into a whole loop, 20 times each."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from injected import ENDLESS, LONGEST, SEEDS, Conditions, check, check_reached, last_seen, quick_model, quickly
from rigs import Bench, Listed

import inphase
from inphase.runtime.safety import Answer, State


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return quick_model()


@pytest.fixture(autouse=True)
def _quick() -> Iterator[None]:
    with quickly():
        yield


def carried_away(now: Conditions, back: float) -> Callable[[float], np.ndarray]:
    """By somebody, while it was off; still within its limits."""
    middle = (now.limits.low + now.limits.high) / 2
    way = now.rng.uniform(0.2, 0.5, 2) * (middle - now.retreat)
    return lambda time: way if time >= back else np.zeros(2)


def answered(run: Bench, before: float) -> float:
    """The time of the last answer before a time [s]."""
    return max(received for at, _, received in run.robot.stood if at < before)


# --------------------------------------------------------------------------------------------------------- the robot


@pytest.mark.parametrize("seed", SEEDS)
def test_a_robot_that_stops_answering(model, tmp_path, seed):
    """And comes back elsewhere, or not at all: it goes on from where it stands, at rest."""
    now = Conditions(model, seed)
    answer = Answer.HOLD if seed % 2 else Answer.STOP
    silence, back = now.rng.uniform(0.1, 0.2), now.onset + (now.length if seed % 4 > 1 else np.inf)
    run = now.bench(tmp_path / "run.mcap", policy={"lost_robot": answer}, silence=silence)
    run.robot.silent = lambda time: now.onset <= time < back
    run.robot.carried = carried_away(now, back)
    run.run(LONGEST)
    check(run)
    check_reached(run, answered(run, now.onset) + silence, answer, now.period, until=back)
    if answer is Answer.STOP:
        assert run.loop.report.stopped
    elif back < run.loop.report.duration:
        _check_begun_where_it_stands(run, back)


def _check_begun_where_it_stands(run: Bench, back: float) -> None:
    time, command, _ = next(sent for sent in run.robot.sent if sent[0] >= back)
    standing = next(values for at, values, _ in run.robot.stood if at == time)
    np.testing.assert_array_equal(command.positions[0], standing)
    assert any(event.kind == "robot" and "answers again" in event.reason for event in run.told)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_robot_that_raises(model, tmp_path, seed):
    """Whatever it is asked, or only commands, for good, for some time, or once."""
    now = Conditions(model, seed)
    answer = Answer.HOLD if seed % 3 else Answer.STOP
    length = (np.inf, now.length, now.period)[seed % 3]
    silence, back = now.rng.uniform(0.1, 0.2), now.onset + length
    run = now.bench(tmp_path / "run.mcap", policy={"lost_robot": answer}, silence=silence)
    failing = "raises" if seed % 2 else "refuses"
    setattr(run.robot, failing, lambda time: now.onset <= time < back)
    if length > silence:
        run.robot.carried = carried_away(now, back)
    run.run(LONGEST)
    check(run)
    first = next(time for time, _, _ in run.robot.sent if time >= now.onset)
    check_reached(run, first, answer, now.period, until=max(back, first + 2 * now.period))
    assert any("ConnectionError" in event.reason for event in run.safety)
    if length == now.length and back < run.loop.report.duration:
        _check_begun_where_it_stands(run, back)


# --------------------------------------------------------------------------------------------------------- the program


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("part", ["observe", "respond", "wanted"])
def test_a_crash(model, tmp_path, seed, part):
    now = Conditions(model, seed)
    run = now.bench(tmp_path / "run.mcap", policy={"crash": now.answer})
    owner = run.loop.player if part == "wanted" else run.loop.perception.session
    whole, failed, done = getattr(owner, part), list[float](), list[float]()

    def failing(*given):
        if (given[0] if part == "observe" else run.clock.now()) >= now.onset:  # not with the first of a look
            failed.append(run.clock.now())
            raise ZeroDivisionError(f"in {part}")
        answer = whole(*given)
        done.append(run.clock.now())
        return answer

    setattr(owner, part, failing)
    with pytest.raises(ZeroDivisionError, match=part):
        run.run(ENDLESS)
    check(run)
    check_reached(run, failed[0], now.answer, now.period)
    assert len(failed) == 1
    if part == "observe":  # those before it, of the same look too
        assert len(run.recorded().estimates) == len(done)
    assert run.robot.sent[-1][0] < ENDLESS  # it did not wait for anybody


@pytest.mark.parametrize("seed", SEEDS)
def test_a_loop_that_stands_still(model, tmp_path, seed):
    """Meanwhile the watchdog brakes."""
    now = Conditions(model, seed)
    stalls = now.rng.uniform(0.2, 0.7)
    seen = []

    class Stalling(Listed):
        def read(self):
            if run.clock.now() >= now.onset and not seen:
                seen.append(run.clock.now())
                run.clock.advance(stalls)
            return super().read()

    run = now.bench(tmp_path / "run.mcap", policy={"missed_deadlines": now.answer})
    run.loop.perception.sensors = (Stalling(now.partner),)
    dog = run.loop.actuation.watchdog

    def watch() -> None:
        if run.robot.running:
            run.clock.at(run.clock.now() + max(dog.check(), 1e-4), watch)

    run.clock.at(0.001, lambda: (dog.feed(), watch()))
    run.run(LONGEST)
    check(run)
    resumed = seen[0] + stalls
    after = [time for time, _, _ in run.robot.sent if time >= resumed - 1e-9]
    check_reached(run, resumed, now.answer, 0.0, until=after[3] if now.answer is Answer.HOLD else np.inf)
    assert any("too slow" in event.reason for event in run.safety)
    last = max(time for time, _, _ in run.robot.sent if time <= seen[0])
    barks = [(time, command) for time, command, _ in run.robot.sent if last < time < seen[0] + stalls - 1e-9]
    moving = run.robot.sent[[time for time, _, _ in run.robot.sent].index(last)][1]
    if np.ptp(moving.positions, axis=0).max() > 0 and moving.times[-1] > last + dog.patience:
        assert barks  # by the first bark at the latest it is sent to rest
    if barks:
        assert barks[0][0] <= last + dog.patience + 1e-3
        ends = barks[0][1].times[-1]
        braking = (now.limits.velocity / now.limits.acceleration).max() + 3 * now.period
        assert ends <= barks[0][0] + braking + now.period
    assert run.loop.report.overruns >= 1
    assert run.loop.report.missed >= np.floor(stalls * now.rates.command) - 1


# ---------------------------------------------------------------------------------------------------------- and people


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("twice", [False, True])
def test_an_interrupt(model, tmp_path, seed, twice):
    now = Conditions(model, seed)
    run = now.bench(tmp_path / "run.mcap", policy={"interrupt": now.answer})
    run.clock.at(now.onset, run.loop.interrupt)
    if twice:
        run.clock.at(now.onset + 0.1, run.loop.interrupt)
    report = run.run(ENDLESS if now.answer is Answer.RETREAT else LONGEST)
    check(run)
    check_reached(run, now.onset, now.answer, now.period)
    if twice:  # at rest as soon as it may
        braking = (now.limits.velocity / now.limits.acceleration).max() + now.period * 4
        assert report.duration <= now.onset + 0.1 + braking
    elif now.answer is Answer.RETREAT:
        np.testing.assert_allclose(run.robot.sent[-1][1].positions[-1], now.retreat, atol=2e-6)
    elif now.answer is Answer.HOLD:
        assert report.ended in ("3 s have passed", "the interaction is over")
        assert run.states(now.onset + now.period) == {State.HOLDING}


@pytest.mark.parametrize("seed", SEEDS)
def test_a_new_interaction_on_the_way(model, tmp_path, seed):
    now = Conditions(model, seed)
    run = now.bench(tmp_path / "run.mcap")
    for after in (0.0, 0.2):
        run.clock.at(now.onset + after, run.loop.reset)
    run.run(LONGEST)
    check(run)
    recording = run.recorded()
    resets = [event.time for event in recording.events if event.kind == "reset"]
    assert len(resets) == 2
    begins = recording.times.searchsorted(resets, side="right")
    phases = np.array([estimate.phase for estimate in recording.estimates])
    assert phases[begins[0] - 1] > 0.1 > phases[begins].max()
    assert last_seen(now.sensor) > resets[-1]
