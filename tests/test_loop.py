"""The live loop in good weather, with stand-ins and a clock that is told: it follows, counts, and ends at rest."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from injected import quickly
from interactions import OBSERVED, taught
from rigs import HOME, JOINTS, Bench, Listed, bench, learned, violations

import inphase
from inphase.channels import make_channels
from inphase.errors import OptionError
from inphase.replay import identical
from inphase.runtime import FakeClock, Signal
from inphase.runtime.devices import Dead, Late, ReplaySensor, SimulatedPartner, SimulatedRobot
from inphase.runtime.limits import Limits
from inphase.runtime.loop import Rates
from inphase.runtime.perception import Sight
from inphase.runtime.playing import Play
from inphase.runtime.safety import Answer, Policy, State
from inphase.runtime.smoothing import AlphaBeta

AT_ONCE = AlphaBeta(1.0, 1.0)  # what is wanted is sent as it is
PATIENT = {"policy": Policy(good_cycles=1), "smoothing": AT_ONCE}


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return learned()


@pytest.fixture(autouse=True)
def _quick(request: pytest.FixtureRequest) -> Iterator[None]:
    with nullcontext() if "checked" in request.fixturenames else quickly():
        yield


@pytest.fixture
def checked() -> None:
    """With a look at the shape of every array."""


def sent_points(run: Bench) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) [s] and where the robot was sent (T, D), of single points."""
    return (
        np.array([command.times[0] for _, command, _ in run.robot.sent]),
        np.array([command.positions[0] for _, command, _ in run.robot.sent]),
    )


def truth(partner: SimulatedPartner, times: np.ndarray) -> np.ndarray:
    """(T, D) what all channels of the model should read at these times [s]."""
    return partner.truth([float(time) for time in times])


def observed_by(run: Bench) -> list[tuple[float, np.ndarray, inphase.Estimate]]:
    """All that its session observes from now on."""
    session, taken = run.loop.perception.session, []
    observe = session.observe

    def spy(time, values):
        estimate = observe(time, values)
        taken.append((time, np.array(values), estimate))
        return estimate

    session.observe = spy
    return taken


# --------------------------------------------------------------------------------------------------------- following


def test_the_robot_is_sent_what_this_partner_needs_and_not_what_they_need_on_average(model):
    """With the truth at hand: closer than the mean response, played at the phase the partner truly has."""
    led, mean = [], []
    for seed in range(5):
        partner = SimulatedPartner(model, seed, rate=50.0, tempo=[0.6, 0.8, 1.0, 1.3, 1.6][seed])
        run = bench(model, partner=partner, **PATIENT)
        run.run()
        times, sent = sent_points(run)
        within = [i for i, t in enumerate(times) if 0.1 < partner.phase(t) < 0.99]
        true = truth(partner, times[within])[:, 2:]
        at_phase = model.predict(np.array([partner.phase(t) for t in times[within]]))[:, 2:]
        led.append(np.mean((sent[within] - true) ** 2))
        mean.append(np.mean((at_phase - true) ** 2))
    assert np.mean(led) < 0.5 * np.mean(mean)


def driven(model: inphase.Model, lag: float, tau: float = 0.1, **play) -> tuple[float, Bench]:
    """How far the robot itself was from where it should have been (root of the mean of squares), and the run."""
    partner = SimulatedPartner(model, 3, rate=50.0, tempo=1.0)
    robot = SimulatedRobot(JOINTS, HOME, time_constant=tau, step=0.002)
    run = bench(model, partner=partner, robot=robot, play=Play(control_lag=lag, **play), **PATIENT)
    run.run()
    times = np.array([time for time, _, _ in run.robot.stood])
    stood = np.array([values for _, values, _ in run.robot.stood])
    within = [i for i, t in enumerate(times) if 0.2 < partner.phase(t) < 0.95]
    return float(np.sqrt(np.mean((stood[within] - truth(partner, times[within])[:, 2:]) ** 2))), run


def test_with_the_lag_that_was_measured_the_robot_is_where_it_should_be(model):
    behind, run = driven(model, 0.0)
    lag = run.loop.report.lag
    ahead, _ = driven(model, lag)
    assert ahead < 0.4 * behind
    for other in (0.5 * lag, 1.5 * lag):  # and no other lag is better
        assert driven(model, other)[0] > ahead


@pytest.mark.parametrize("tau", [0.03, 0.1])
@pytest.mark.parametrize("horizon", [None, 0.2])
def test_the_lag_of_the_simulated_robot_is_found(model, tau, horizon):
    """Its time constant; it gets single points half a cycle late on average, as each is held for one."""
    _, run = driven(model, 0.0, tau, horizon=horizon)
    expected = tau + (0.5 / run.loop.rates.command if horizon is None else 0)
    assert run.loop.report.lag == pytest.approx(expected, abs=0.008)


def test_the_robot_waits_for_the_start_phase_and_goes_no_further_than_the_stop_phase(model):
    partner = SimulatedPartner(model, 1, rate=50.0, tempo=1.0, noise=0.001)
    run = bench(model, partner=partner, play=Play(start=0.3, stop=0.6, samples=100), **PATIENT)
    report = run.run()
    times, sent = sent_points(run)
    before = [partner.phase(t) < 0.28 for t in times]
    np.testing.assert_array_equal(sent[before], np.tile(HOME, (sum(before), 1)))
    between = [0.4 < partner.phase(t) < 0.58 for t in times]
    np.testing.assert_allclose(sent[between], truth(partner, times[between])[:, 2:], atol=0.05)
    at_stop = run.loop.perception.session.respond(samples=2, start=0.6).mean[0]
    np.testing.assert_allclose(sent[-1], at_stop, atol=1e-3)
    assert report.ended == "the interaction is over"
    assert partner.phase(report.duration) < 0.8  # it did not wait for the end


# ----------------------------------------------------------------------------------------------- what is done when


def test_rates_need_not_be_multiples_of_each_other(model):
    run = bench(model, rates=Rates(sense=61.7, respond=13.3, command=47.9), **PATIENT)
    report = run.run(1.5)
    assert violations(run) == []
    for stage, rate in (("sense", 61.7), ("observe", 61.7), ("respond", 13.3)):
        assert report.timings[stage].count == pytest.approx(1.5 * rate, abs=2 + 0.3 * rate)
    times, _ = sent_points(run)
    np.testing.assert_allclose(times, np.arange(len(times)) / 47.9, atol=1e-9)
    assert (report.overruns, report.missed, report.skipped, report.late) == (0, 0, 0, 0)


def test_every_sample_is_observed_once_as_it_was_read(model):
    partner = Listed(SimulatedPartner(model, 1, rate=83.0, tempo=1.0))
    run = bench(model, sensors=[partner], rates=Rates(sense=29.0, respond=10.0, command=30.0))
    taken = observed_by(run)
    run.run(1.5)
    given = [s for s in partner.given if s.received <= taken[-1][0]]
    assert len(given) > 100
    assert len(partner.given) - len(given) <= 83 / 29 + 1
    np.testing.assert_array_equal([values for _, values, _ in taken], [s.values for s in given])
    np.testing.assert_array_equal([time for time, _, _ in taken], [s.stamp for s in given])
    assert run.loop.report.samples == {"partner": {"came in order": len(partner.given)}}


def two_sensors(model: inphase.Model, slow: float = 0.05) -> tuple[list[ReplaySensor], dict[float, dict[str, float]]]:
    """One that reads the first channel 50 times a second and one for the second, and all readings by their time."""
    partner = SimulatedPartner(model, 4, tempo=1.0, noise=0.0)
    channels, sensors, readings = make_channels(OBSERVED, []), [], {}
    for column, step in enumerate((0.02, slow)):
        steps = np.arange(int(2.2 / step))
        times = np.round(steps * step, 10)  # where both read, they read at one time
        partner.start(FakeClock())
        values = truth(partner, times)[:, column : column + 1]
        name = OBSERVED[column]
        sensors.append(
            ReplaySensor(inphase.Demonstration(times, values), channels[column : column + 1], name=f"of {name}")
        )
        for time, value in zip(times, values[:, 0], strict=True):
            readings.setdefault(float(time), {})[name] = float(value)
    return sensors, readings


def test_two_sensors_of_other_rates_are_one_session_fed_by_hand(model):
    sensors, readings = two_sensors(model)
    run = bench(
        model, sensors=sensors[::-1], rates=Rates(200.0, None, 10.0, 30.0), shared_clock=tuple(s.name for s in sensors)
    )
    taken = observed_by(run)
    run.run(1.5)
    by_hand = model.session("bip")
    assert len(taken) > 80
    expected = sorted(readings)[: len(taken)]
    np.testing.assert_array_equal([time for time, _, _ in taken], expected)
    for (_, _, estimate), time in zip(taken, expected, strict=True):
        assert identical(estimate, by_hand.observe(time, readings[time]))


def test_who_waits_for_a_slow_sensor_observes_all_in_turn(model):
    """A delay of more than it is late, and nothing comes too late; what is wanted is still what is due now."""
    late = Listed(Late(SimulatedPartner(model, 1, rate=50.0, tempo=1.0), by=0.02, jitter=0.01, seed=3))
    run = bench(model, sensors=[late], sight=Sight(delay=0.12), **PATIENT)
    taken, healthy = observed_by(run), SimulatedPartner(model, 1, rate=50.0, tempo=1.0)
    report = run.run(2.0)
    healthy.start(FakeClock())
    given = sorted(late.given, key=lambda s: s.stamp)[: len(taken)]
    assert given != late.given[: len(taken)]
    np.testing.assert_array_equal([values for _, values, _ in taken], [s.values for s in given])
    np.testing.assert_array_equal([time for time, _, _ in taken], [s.stamp for s in given])
    assert report.late == 0
    assert taken[-1][0] == pytest.approx(report.duration - 0.12, abs=0.05)
    times, sent = sent_points(run)
    within = [i for i, t in enumerate(times) if 0.3 < healthy.phase(t) < 0.9]
    error = np.abs(sent[within] - truth(healthy, times[within])[:, 2:]).mean()
    stale = np.abs(sent[within] - truth(healthy, times[within] - 0.12)[:, 2:]).mean()
    assert error < 0.5 * stale


@pytest.mark.parametrize(("needed", "moves"), [((), True), (("lift",), False), (("reach",), True), (("*",), True)])
def test_without_a_channel_that_is_needed_the_partner_is_not_seen(model, needed, moves):
    sensors, _ = two_sensors(model)
    run = bench(
        model,
        sensors=[sensors[0], Dead(sensors[1], after=0.5)],
        sight=Sight(staleness=0.15, needed=needed),
        shared_clock=tuple(s.name for s in sensors),
        policy=Policy(good_cycles=1),
    )
    run.run(1.5)
    assert run.states(0.2, 0.6) == {State.RUNNING}
    assert (State.RUNNING in run.states(0.7, 1.5)) == moves
    assert any("lift" in event.reason for event in run.safety) == (not moves)


def test_a_run_is_the_same_once_more(model):
    runs = [bench(model, filter="rbpf") for _ in range(2)]
    for run in runs:
        run.run(1.0)
    (times, sent), (others, also) = map(sent_points, runs)
    np.testing.assert_array_equal(times, others)
    np.testing.assert_array_equal(sent, also)


# ----------------------------------------------------------------------------------------------------------- counting


class Busy(Listed):
    """A sensor that takes its time, once: `of` [s] at the first look after `at` [s]."""

    def __init__(self, sensor, clock: FakeClock, at: float, of: float) -> None:
        super().__init__(sensor)
        self._clock, self._at, self._of = clock, at, of

    def read(self):
        if self._clock.now() >= self._at:
            self._at = np.inf
            self._clock.advance(self._of)
        return super().read()


def test_overruns_are_counted_and_so_is_what_is_left_out(model):
    clock = FakeClock()
    busy = Busy(SimulatedPartner(model, 1, rate=50.0, tempo=1.0), clock, at=0.49, of=0.11)
    run = bench(model, sensors=[busy], clock=clock, policy=Policy(good_cycles=1))
    report = run.run(1.0)  # at 50 looks and commands a second, from 0.5 s to 0.61 s
    assert report.overruns == 1
    times, _ = sent_points(run)
    np.testing.assert_allclose(times[24:29], [0.48, 0.61, 0.62, 0.64, 0.66], atol=1e-9)
    assert report.missed == 5  # of 0.50 … 0.60, less the one that is sent late
    assert report.timings["sense"].max == pytest.approx(0.11)
    assert report.timings["cycle"].max == pytest.approx(0.11)
    assert report.timings["late"].max == pytest.approx(0.09)  # the cycle of 0.52 s
    assert len(busy.given) == len({s.stamp for s in busy.given})
    assert [event.reason for event in run.safety if event.after == "HOLDING"] == [
        "the loop is too slow: 5 commands were not sent"
    ]


def test_a_report_is_for_people_and_machines(model):
    report = bench(model).run(0.5)
    told = json.loads(report.as_json)
    assert told["commands"] == report.commands > 20
    assert told["lag"] is None  # too short a time
    assert "0 missed" in report.lines[0]
    assert np.isfinite(replace(report, lag=0.1).lag)
    assert "100 ms behind" in replace(report, lag=0.1).lines[-1]


# ------------------------------------------------------------------------------------------------- beginning and ending


class Interrupting(Listed):
    """A sensor that is interrupted at its looks after some times [s]."""

    def __init__(self, sensor, clock: FakeClock, times: list[float], how) -> None:
        super().__init__(sensor)
        self._clock, self._times, self._how = clock, list(times), how

    def read(self):
        if self._times and self._clock.now() >= self._times[0]:
            self._times.pop(0)
            self._how()
        return super().read()


def by_keyboard() -> None:
    raise KeyboardInterrupt


def by_signal() -> None:
    os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize("how", [by_keyboard, by_signal])
@pytest.mark.parametrize("answer", [Answer.STOP, Answer.HOLD])
def test_an_interrupt_in_the_middle_of_a_stage_is_answered_and_a_second_ends_the_run(model, how, answer):
    clock = FakeClock()
    sensor = Interrupting(SimulatedPartner(model, 1, tempo=0.5), clock, [0.5, 0.8], how)
    run = bench(model, sensors=[sensor], clock=clock, policy=Policy(good_cycles=1, interrupt=answer))
    before = signal.getsignal(signal.SIGINT)
    report = run.run()
    assert signal.getsignal(signal.SIGINT) is before
    assert violations(run) == []
    assert run.loop.actuation.at_rest
    assert run.states(0.2, 0.5) == {State.RUNNING}
    if answer is Answer.STOP:
        assert report.stopped
        assert report.ended == "someone interrupted"
    else:
        assert run.states(0.53, 0.8) == {State.HOLDING}
        assert report.ended == "it was interrupted"
        assert report.duration < 1.0


def test_who_was_interrupted_goes_on_when_told_to(model):
    run = bench(model, policy=Policy(good_cycles=1, interrupt=Answer.HOLD))
    run.clock.at(0.4, run.loop.interrupt)
    run.clock.at(0.7, run.loop.go_on)
    run.run(1.2)
    assert run.states(0.43, 0.7) == {State.HOLDING}
    assert run.states(0.75, 1.19) == {State.RUNNING}


def test_a_run_ends_when_it_is_told_to_and_always_at_rest(model):
    by_duration, by_word = bench(model), bench(model)
    by_word.clock.at(0.7, lambda: by_word.loop.finish("enough"))
    for run, reason in ((by_duration, "0.7 s have passed"), (by_word, "enough")):
        report = run.run(0.7 if run is by_duration else None)
        assert report.ended == reason
        assert 0.7 <= report.duration < 1.0
        assert run.loop.actuation.at_rest
        _, sent = sent_points(run)
        np.testing.assert_array_equal(sent[-1], sent[-2])
        assert violations(run) == []


@pytest.mark.parametrize(
    ("units", "joints", "told"),
    [
        ({"grip": "m"}, [Signal("grip", "mm"), Signal("turn")], "'grip' is in 'm' in the model and in 'mm' from robot"),
        ({}, [Signal("grip")], "no device offers turn"),
        ({"reach": "m"}, list(JOINTS), "'reach' is in 'm' in the model and in '' from partner"),
    ],
)
def test_devices_that_do_not_fit_are_named_before_anything_is_started(model, units, joints, told):
    fitting = replace(
        model, channels=tuple(replace(channel, unit=units.get(channel.name, "")) for channel in model.channels)
    )

    class Untouched(Listed):
        def __init__(self, sensor) -> None:
            super().__init__(sensor)
            self.start = self.fail

        def fail(self, clock) -> None:
            pytest.fail("it was started")

    robot = SimulatedRobot(joints, np.zeros(len(joints)))
    with pytest.raises(OptionError, match=told):
        bench(fitting, sensors=[Untouched(SimulatedPartner(model))], robot=robot)
    assert robot.state() is None


def test_a_robot_without_an_answer_is_named_and_no_sensor_is_started(model):
    run = bench(model)
    run.robot.silent = lambda now: True
    with pytest.raises(OptionError, match=r"robot: expected an answer within 5 s, got none$"):
        run.run()
    assert run.partner.read() == []
    other = bench(model)
    other.robot.raises = lambda now: True
    with pytest.raises(OptionError, match="ConnectionError: no route"):
        other.run()


def test_where_a_sensor_does_not_start_all_is_stopped_again(model):
    class Broken(Listed):
        def __init__(self, sensor) -> None:
            super().__init__(sensor)
            self.name, self.start = "broken", self.fail

        def fail(self, clock) -> None:
            raise OSError("no such device")

    sensors, _ = two_sensors(model)
    run = bench(model, sensors=[sensors[0], Broken(sensors[1])])
    with pytest.raises(OSError, match="no such device"):
        run.run()
    assert sensors[0].read() == []


def test_devices_that_do_not_stop_are_told_of_and_keep_no_other_from_it(model):
    sensors, _ = two_sensors(model)

    def fail() -> None:
        raise OSError("stuck")

    first = Listed(sensors[0])
    first.stop = fail
    run = bench(model, sensors=[first, sensors[1]])
    stop = run.robot.stop
    run.robot.stop = lambda: (stop(), fail())
    report = run.run(0.3)
    assert report.ended == "0.3 s have passed"
    assert sensors[1].read() == []
    stuck = [event for event in run.told if "stuck" in event.reason]
    assert [event.kind for event in stuck] == ["robot", "sensor"]


def test_inside_a_run_there_is_one_thread_for_the_algebra(model):
    import scipy.linalg  # noqa: F401 - it brings a BLAS of its own
    from threadpoolctl import threadpool_info, threadpool_limits

    found: list[int] = []
    clock = FakeClock()
    look = Interrupting(SimulatedPartner(model), clock, [0.1], lambda: found.extend(_threads(threadpool_info())))
    with threadpool_limits(limits=2, user_api="blas"):  # wherever the tests run with one
        before = _threads(threadpool_info())
        bench(model, sensors=[look], clock=clock).run(0.2)
        assert _threads(threadpool_info()) == before
    assert set(before) == {2}
    assert set(found) == {1}


def _threads(pools) -> list[int]:
    return [pool["num_threads"] for pool in pools if pool["user_api"] == "blas"]


# -------------------------------------------------------------------------------------------------------- other robots


@pytest.mark.parametrize("horizon", [None, 0.1])
def test_all_arrays_have_the_shapes_that_are_said_of_them(model, checked, horizon):
    run = bench(model, play=Play(horizon=horizon), filter="rbpf")
    run.clock.at(0.5, run.loop.reset)
    run.clock.at(0.7, run.loop.interrupt)
    assert run.run(1.0).stopped


def test_what_no_channel_controls_is_held(model):
    names = ("elbow", "turn", "grip")
    robot = SimulatedRobot([Signal(name) for name in names], [0.3, 0.0, 0.8], step=0.002)
    run, usual = bench(model, robot=robot), bench(model)
    for each in (run, usual):
        each.run(1.5)
    _, sent = sent_points(run)
    _, expected = sent_points(usual)
    assert (sent[:, 0] == 0.3).all()
    np.testing.assert_allclose(sent[:, [2, 1]], expected, atol=1e-12)  # whatever the order


@pytest.mark.parametrize("turns", [0, 1, -1])
def test_an_angle_that_passes_half_a_turn_does_not_make_a_full_one(rng, turns):
    """The robot stands some turns away from where the demonstrations were: it stays with those."""
    times = np.arange(101) / 50
    smooth = (1 - np.cos(np.pi * times / 2)) / 2
    values = []
    for _ in range(6):
        angle = np.pi - 0.6 + (1.2 + 0.1 * rng.standard_normal()) * smooth  # on both sides of half a turn
        angle = (angle + np.pi) % (2 * np.pi) - np.pi + 0.01 * rng.standard_normal(101)
        values.append(np.stack([smooth + 0.01 * rng.standard_normal(101), angle], axis=1))
    demos = inphase.Dataset.from_arrays([times] * 6, values, ["reach"], ["turn"], kinds={"turn": "angle"})
    model, begin = taught(demos), np.pi - 0.6 + 2 * np.pi * turns
    robot = SimulatedRobot([Signal("turn")], [begin], step=0.002)
    run = bench(model, robot=robot, partner=SimulatedPartner(model, 1, tempo=1.0), limits=Limits.none(1), **PATIENT)
    run.run()
    _, sent = sent_points(run)
    assert sent.min() > begin - 0.3
    assert sent.max() == pytest.approx(begin + 1.2, abs=0.3)
    assert np.abs(np.diff(sent[:, 0])).max() < 0.2


def test_a_reset_begins_a_new_interaction_as_a_new_session_would(model):
    clock = FakeClock()
    one, two = (SimulatedPartner(model, seed, rate=50.0, tempo=1.2) for seed in (1, 2))

    class Following(Listed):
        """The second partner comes when the first has gone."""

        def read(self):
            return super().read() if clock.now() < 1.2 else two.read()

    run = bench(model, sensors=[Following(one)], clock=clock, policy=Policy(good_cycles=1))
    taken = observed_by(run)

    def change() -> None:
        two.start(clock)
        two.read()
        run.loop.reset()

    clock.at(1.2, change)
    run.run(2.5)
    assert violations(run) == []
    times = [time for time, _, _ in taken]
    begins = int(np.searchsorted(times, 1.2 + 1e-9))
    by_hand = model.session("bip")
    assert len(times) - begins > 30
    for time, values, estimate in taken[begins:]:
        assert identical(estimate, by_hand.observe(time, values))
    assert [event.kind for event in run.told].count("reset") == 1


def test_what_was_read_before_a_reset_and_comes_after_it_is_of_the_interaction_before(model):
    late = Late(SimulatedPartner(model, 1, rate=50.0, tempo=1.0), by=0.1)
    run = bench(model, sensors=[late])
    taken = observed_by(run)
    run.clock.at(0.5, run.loop.reset)
    run.run(1.0)
    (at,) = [event.time for event in run.told if event.kind == "reset"]
    before, after = [t for t, _, _ in taken if t <= at], [t for t, _, _ in taken if t > at]
    assert at == pytest.approx(0.5)
    assert before == sorted(before)
    assert max(before) == pytest.approx(0.38, abs=0.03)
    assert min(after) == pytest.approx(0.52)


def test_nor_is_it_put_together_with_what_is_read_after_a_reset(model):
    """The second sensor reads at 0.55 s, just after a reset, and the first at 0.54 s and 0.56 s."""
    sensors, _ = two_sensors(model)
    clocks, rates = tuple(sensor.name for sensor in sensors), Rates(sense=50.0, respond=25.0, command=200.0)
    run = bench(model, sensors=sensors, sight=Sight(delay=0.105), rates=rates, shared_clock=clocks)
    taken = observed_by(run)
    run.clock.at(0.544, run.loop.reset)
    run.run(0.8)
    after = [(t, values) for t, values, _ in taken if t > 0.54]
    assert after[0][0] == pytest.approx(0.55)
    np.testing.assert_array_equal(np.isnan(after[0][1]), [True, False])
