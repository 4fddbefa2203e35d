"""The parts of a live loop, each by itself: what is due when, how long it took, what is sent, told and played."""

from __future__ import annotations

import os
import signal
import threading
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from interactions import shapes_unchecked
from rigs import Watched

from inphase.channels import Channel, Kind, Role, make_channels
from inphase.errors import OptionError
from inphase.recording import RecordedEvent
from inphase.result import Estimate, Response, Status
from inphase.runtime import FakeClock, Sample, Signal, Synchroniser
from inphase.runtime.conduct import Conduct
from inphase.runtime.devices import SimulatedRobot
from inphase.runtime.interrupts import interrupts
from inphase.runtime.journal import Journal
from inphase.runtime.lag import lag_of
from inphase.runtime.limits import Limits
from inphase.runtime.playing import Play, Player
from inphase.runtime.recorder import Recorder
from inphase.runtime.safety import Answer, Policy
from inphase.runtime.schedule import Schedule
from inphase.runtime.sender import Sender
from inphase.runtime.smoothing import AlphaBeta
from inphase.runtime.timing import Timing
from inphase.runtime.watchdog import Watchdog
from inphase.session import Session

# ---------------------------------------------------------------------------------------------------------- schedule


@given(
    st.fractions(Fraction(1, 7), 500, max_denominator=7),
    st.floats(-1e5, 1e5),
    st.lists(st.floats(0.0, 3.5), min_size=1, max_size=80),
)
def test_every_time_is_done_once_or_left_out_and_never_before_it_has_come(rate, begin, delays):
    """Against exact arithmetic: after a time, all up to it are done or left out, and none after it."""
    schedule, now, left_out = Schedule(float(rate), begin), begin, 0
    for done, delay in enumerate(delays, start=1):  # in periods
        now = max(schedule.due, now) + delay * schedule.period
        assert schedule.is_due(now)
        left_out += schedule.done(now)
        passed = (Fraction(now) - Fraction(begin)) * rate  # of which 0 is the first
        assert abs((done + left_out - 1) - passed) < 1 + Fraction(1, 10**6)
        assert done + left_out - 1 <= passed + Fraction(1, 10**6)
        assert schedule.due > now - 1e-6 * schedule.period
        assert schedule.due <= now + schedule.period * (1 + 1e-6)


def test_a_schedule_does_not_drift_and_what_comes_in_time_leaves_nothing_out():
    schedule = Schedule(3.0, 100.0)
    for i in range(30_000):
        assert schedule.done(schedule.due) == 0
        assert not schedule.is_due(100.0 + i / 3 + 0.3)
    assert schedule.due == 100.0 + 30_000 / 3


def test_what_is_late_by_several_is_done_once():
    schedule = Schedule(10.0, 0.0)
    assert schedule.done(0.0) == 0
    assert schedule.done(0.55) == 4  # of 0.1, 0.2, 0.3, 0.4 and 0.5 one is done
    assert not schedule.is_due(0.59)
    assert schedule.is_due(0.6)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_schedule_needs_a_rate(rate):
    with pytest.raises(OptionError, match="rate > 0"):
        Schedule(rate, 0.0)


# ------------------------------------------------------------------------------------------------------------- timing


@given(st.integers(0, 2**32 - 1), st.integers(1, 3000), st.floats(-10, 2), st.floats(0.01, 2.0))
@settings(max_examples=50)
def test_quantiles_are_those_of_the_sorted_times_to_two_percent(seed, count, middle, width):
    times = np.exp(np.random.default_rng(seed).normal(middle, width, count)).clip(1e-6, 100.0)
    timing = Timing()
    for time in times:
        timing.add(float(time))
    spread = timing.spread
    assert (spread.count, spread.max) == (count, times.max())
    for found, share in ((spread.p50, 0.5), (spread.p99, 0.99)):
        assert found == pytest.approx(np.quantile(times, share, method="inverted_cdf"), rel=0.02)


def test_times_out_of_range_are_counted_too():
    timing = Timing()
    assert timing.spread.count == timing.spread.max == 0
    for time in (-1e-9, 0.0, 1e-12, 1e6):
        timing.add(time)
    assert (timing.spread.count, timing.spread.max) == (4, 1e6)


# ---------------------------------------------------------------------------------------------------------------- lag


@pytest.mark.parametrize("lag", [0.0, 0.034, 0.2, 0.71])
def test_the_lag_of_what_is_only_late_is_found(rng, lag):
    times = np.sort(rng.uniform(0, 6, 600))
    sent = np.stack([np.sin(2 * times), 100 * np.cos(3 * times), np.ones(600)], axis=1)
    late = np.stack([np.sin(2 * (times - lag)), 100 * np.cos(3 * (times - lag)), np.ones(600)], axis=1)
    late[::7] = np.nan
    assert lag_of(times, sent, late) == pytest.approx(lag, abs=0.003)


def test_a_robot_that_was_sent_nowhere_tells_no_lag():
    times = np.arange(500) / 100
    still = np.ones((500, 2))
    assert np.isnan(lag_of(times, still, still))
    assert np.isnan(lag_of(times[:0], still[:0], still[:0]))
    assert np.isnan(lag_of(times, times[:, None], np.full((500, 1), np.nan)))


# ------------------------------------------------------------------------------------------------------------- sender

PERIOD, SILENCE = 0.02, 0.1
wanted = st.one_of(st.floats(-2, 2), st.just(float("nan")), st.floats(-1e9, 1e9))
cycles = st.lists(
    st.tuples(
        st.one_of(st.just(1.0), st.floats(0.3, 4.0), st.just(30.0)),  # periods since the last
        st.one_of(st.none(), st.tuples(wanted, wanted)),
        st.floats(-5, 5),  # how fast what is wanted moves
    ),
    min_size=1,
    max_size=40,
)


@settings(max_examples=150)
@given(cycles, st.sampled_from([None, 0.01, 0.1]), st.floats(0.1, 1.0), st.integers(0, 1000))
def test_whatever_is_wanted_and_whenever_the_limits_hold(cycles, horizon, alpha, seed):
    rng = np.random.default_rng(seed)
    limits = Limits(np.array([-1.0, -0.5]), np.array([1.0, 2.0]), rng.uniform(0.2, 4, 2), rng.uniform(1, 30, 2))
    robot = _Sink()
    with shapes_unchecked():
        sender = Sender(robot, limits, AlphaBeta(alpha), PERIOD, horizon=horizon, silence=SILENCE)
        now, begun = 5.0, rng.uniform(-0.4, 0.9, 2)
        sender.begin(begun, now)
        path = [(now, begun)]  # all that the robot is sent, in its time
        plan: list = []
        for steps, goal, speed in cycles:
            now += steps * PERIOD

            def course(times, near, goal=goal, speed=speed, now=now):
                return np.array(goal) + speed * (times - now)[:, None]

            command = sender.send(None if goal is None else course, now)
            if horizon is None:
                if now - path[-1][0] > SILENCE:  # it stands where it was sent
                    path.append((now - PERIOD, path[-1][1]))
                path.append((now, command.positions[0]))
                continue
            path += [(t, p) for t, p in plan if t < command.times[0]]
            for t, p in plan:  # on a line that is on the one before
                if t in command.times[:2]:
                    np.testing.assert_array_equal(p, command.positions[list(command.times).index(t)])
            assert command.times[0] <= now
            assert len(command.times) == 1 or np.array_equal(command.positions[-1], command.positions[-2])
            plan = [(t, p) for t, p in zip(command.times, command.positions, strict=True) if t > path[-1][0] + 1e-9]
    path += plan
    times, positions = np.array([t for t, _ in path]), np.array([p for _, p in path])
    dt = np.diff(times)
    velocities = np.diff(positions, axis=0) / dt[:, None]
    accelerations = np.diff(velocities, axis=0, prepend=0) / dt[:, None]
    assert (positions >= limits.low - 1e-12).all()
    assert (positions <= limits.high + 1e-12).all()
    assert (np.abs(velocities) <= limits.velocity * (1 + 1e-6)).all()
    rest = np.abs(dt) > SILENCE + 1e-9  # it stood
    assert (np.abs(accelerations) <= limits.acceleration * (1 + 1e-6) + 1e-7)[~rest].all()
    assert horizon is None or sender.at_rest(now + 1e3)


class _Sink(Watched):
    """A robot that takes everything."""

    def __init__(self) -> None:
        self.name, self.signals = "sink", (Signal("a"), Signal("b"))

    def command(self, command) -> None:
        pass


def test_what_is_sent_is_asked_between_the_points_of_a_trajectory():
    limits = Limits(np.full(2, -9.0), np.full(2, 9.0), np.full(2, 1.0), np.full(2, 1e3))
    sender = Sender(_Sink(), limits, AlphaBeta(1.0), PERIOD, horizon=1.0)
    sender.begin(np.zeros(2), 0.0)
    sender.send(lambda times, near: np.full((len(times), 2), 5.0), 0.0)
    np.testing.assert_allclose(sender.positions(0.33), 0.33)  # 1 unit a second
    sender.send(None, 0.33)
    assert not sender.at_rest(0.33)
    assert sender.at_rest(0.5)


def test_a_look_at_the_clock_before_that_of_another_thread_does_not_send_back_in_time():
    limits = Limits(np.full(2, -9.0), np.full(2, 9.0), np.full(2, 1.0), np.full(2, 1e3))
    sender = Sender(_Sink(), limits, AlphaBeta(1.0), PERIOD)
    sender.begin(np.zeros(2), 0.0)
    times, positions = [], []
    for now in (0.02, 0.04, 0.03, 0.06):
        command = sender.send(lambda times, near: np.full((len(times), 2), 5.0), now)
        times.append(command.times[0])
        positions.append(command.positions[0, 0])
    assert times == [0.02, 0.04, 0.04, 0.06]
    np.testing.assert_allclose(positions, times)  # never faster than 1 unit a second


def test_limits_of_another_robot_are_refused():
    with shapes_unchecked(), pytest.raises(OptionError, match="limits for 2 signals, got them for 3"):
        Sender(_Sink(), Limits.none(3), AlphaBeta(), PERIOD)


# ------------------------------------------------------------------------------------------------------------- player


class _Answers(Session):
    """A session that answers with its phase: 1 s long, from `phase` on at time `at`; asked for a start, from there."""

    def __init__(self, phase: float, at: float = 10.0, first: np.ndarray | None = None) -> None:
        self.phase, self._time, self.first = phase, at, first

    def respond(self, lookahead=0.0, samples=50, *, start=None):
        begin = self.phase + lookahead if start is None else start
        phases = np.linspace(min(begin, 1.0), 1.0, samples)
        mean = phases[:, None] if self.first is None else self.first + np.zeros((samples, 1))
        return Response(self._time + phases - self.phase, phases, mean, np.ones_like(mean), ("c",) * mean.shape[1])


def estimate(phase: float, status: Status = Status.FOLLOWING) -> Estimate:
    return Estimate(10.0, phase, 0.1, 1.0, 0.1, 0.0, status)


CHANNEL = make_channels([], ["c"])


def played(play: Play, phase: float, time: float = 10.0, **options) -> float:
    player = Player(play, CHANNEL, [1], 3, **options)
    player.respond(_Answers(phase), estimate(phase))
    row = player.wanted(np.array([time]), np.zeros(3))[0]
    assert np.isnan(row[[0, 2]]).all()  # what no channel controls
    return float(row[1])


@given(st.floats(0, 0.99), st.floats(0, 0.3), st.floats(0, 0.5))
def test_what_is_wanted_is_ahead_in_phase_or_in_time(phase, ahead, since):
    """Of an interaction that takes a second, with its phase as the response: both are the same."""
    expected = min(phase + since + ahead, 1.0)
    assert played(Play(lookahead=ahead), phase, 10.0 + since) == pytest.approx(expected, abs=1e-9)
    assert played(Play(control_lag=ahead), phase, 10.0 + since) == pytest.approx(expected, abs=1e-9)


@example(phase=0.7, ahead=0.0, since=0.0, by_phase=True)  # beyond it
@example(phase=0.5, ahead=0.2, since=0.0, by_phase=True)  # looking beyond it
@example(phase=0.5, ahead=0.2, since=0.0, by_phase=False)
@example(phase=0.1, ahead=0.2, since=0.0, by_phase=True)
@given(phase=st.floats(0, 1), ahead=st.floats(0, 0.4), since=st.floats(0, 2.0), by_phase=st.booleans())
def test_nothing_beyond_the_stop_is_ever_wanted_and_nothing_before_the_start(phase, ahead, since, by_phase):
    play = Play(start=0.2, stop=0.6, samples=200, **{"lookahead" if by_phase else "control_lag": ahead})
    value = played(play, phase, 10.0 + since)
    if phase < 0.2:
        assert np.isnan(value)
    else:
        assert min(phase, 0.6) - 1e-9 <= value <= 0.6 + 1e-9
        assert value >= min(phase + ahead + since, 0.6) - 1 / 200  # the last sample before it


def test_it_is_over_at_the_stop_and_what_is_left_of_it_ends_there():
    player = Player(Play(stop=0.6), CHANNEL, [0], 1)
    player.respond(_Answers(0.4), estimate(0.4))
    assert not player.over
    assert player.ends == pytest.approx(10.2, abs=0.02)
    player.respond(_Answers(0.7), estimate(0.7))
    assert player.over
    assert player.ends <= 10.0
    player.reset()
    assert (player.over, player.ends) == (False, -np.inf)
    player.respond(_Answers(0.99), estimate(0.3, Status.FINISHED))
    assert player.over
    periodic = Player(Play(stop=0.6, start=0.5), CHANNEL, [0], 1, periodic=True)
    assert periodic.respond(_Answers(0.2), estimate(0.2)) is not None
    assert not periodic.over


@given(st.floats(-20, 20), st.floats(-20, 20))
def test_of_all_turns_that_are_the_same_the_nearest_is_meant(near, angle):
    channels = (Channel("c", Role.CONTROLLED, "rad", Kind.ANGLE),)
    player = Player(Play(), channels, [0], 1)
    player.respond(_Answers(0.1, first=np.array([angle])), estimate(0.1))
    found = player.wanted(np.array([10.0, 10.1]), np.array([near]))[:, 0]
    assert (np.abs(found - near) <= np.pi + 1e-9).all()
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * angle), atol=1e-9)


def test_of_both_signs_of_a_quaternion_the_nearer_is_meant(rng):
    channels = tuple(Channel(f"q{part}", Role.CONTROLLED, "", Kind.QUATERNION) for part in "xyzw")
    player = Player(Play(), channels, [3, 2, 1, 0], 4)
    turn = rng.normal(size=4)
    turn /= np.linalg.norm(turn)
    player.respond(_Answers(0.1, first=turn), estimate(0.1))
    for sign in (1, -1):
        found = player.wanted(np.array([10.0]), sign * turn[::-1])[0]
        np.testing.assert_allclose(found, sign * turn[::-1])


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ({"samples": 1}, "2 to 10000 samples, got 1"),
        ({"lookahead": 1.1}, "between 0 and 1"),
        ({"control_lag": -0.1}, "control_lag >= 0"),
        ({"lookahead": 0.1, "control_lag": 0.1}, "got both"),
        ({"start": 0.5, "stop": 0.5}, "start < stop"),
        ({"horizon": 0.0}, "horizon > 0"),
    ],
)
def test_what_cannot_be_played_is_refused(entries, told):
    with pytest.raises(OptionError, match=told):
        Play(**entries)


# ------------------------------------------------------------------------------------------------------------ journal


def test_all_hear_of_an_event_before_they_hear_that_some_failed_and_those_hear_nothing_more():
    heard: list[tuple[str, str]] = []

    def failing(name: str):
        def listen(event: RecordedEvent) -> None:
            heard.append((name, event.kind))
            raise RuntimeError(f"{name} is gone")

        return listen

    journal = Journal(listeners=[failing("a"), lambda event: heard.append(("b", event.kind)), failing("c")])
    journal.tell(1.0, "start", "")
    journal.tell(2.0, "end", "")
    assert heard == [
        *[("a", "start"), ("b", "start"), ("c", "start")],
        *[("b", "listener"), ("b", "listener"), ("b", "end")],
    ]
    assert [event.kind for event in journal.events] == ["start", "listener", "listener", "end"]
    assert "RuntimeError: a is gone" in journal.events[1].reason


def test_what_lasts_is_told_once():
    journal = Journal()
    for reason in ("full", "full", "broken", "full"):
        journal.tell_once(1.0, "recorder", reason)
    assert [event.reason for event in journal.events] == ["full", "broken"]
    assert (journal.lost, journal.failure) == (0, None)


class Told(Recorder):
    """A recorder that remembers what it was given, in that order."""

    def __init__(self, *given, **options):
        super().__init__(*given, **options)
        self.given = []

    def put_step(self, values, estimate):
        self.given.append(("step", estimate.time))
        return super().put_step(values, estimate)

    def put_event(self, event):
        self.given.append(("event", event.time))
        return super().put_event(event)


def test_an_event_is_recorded_at_once_and_after_all_that_came_before_it(tmp_path):
    """What a cycle leaves waits for its end; of a program that dies, what it did about it is in the file."""
    channels = make_channels(["x"], ["y"])
    with Told(tmp_path / "a.mcap", channels) as recorder:
        journal = Journal(recorder)
        estimate = Estimate(1.0, 0.1, 0.1, 0.5, 0.1, 0.0, Status.FOLLOWING)
        journal.step(np.zeros(1), estimate)
        assert recorder.given == []
        journal.tell(2.0, "safety", "for a reason")
        assert recorder.given == [("step", 1.0), ("event", 2.0)]
        journal.step(np.zeros(1), Estimate(3.0, 0.1, 0.1, 0.5, 0.1, 0.0, Status.FOLLOWING))
        journal.flush()
        journal.flush()
        assert recorder.given == [("step", 1.0), ("event", 2.0), ("step", 3.0)]


# ------------------------------------------------------------------------------------------------------------ conduct


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ({"silence": 0.0}, "silence > 0"),
        ({"late_commands": 0}, "late_commands > 0"),
        ({"watchdog": float("nan")}, "watchdog > 0"),
        ({"retreat": np.zeros(3)}, "retreat of 2 positions"),
        ({"retreat": np.array([0.0, 7.0])}, "within the limits"),
        ({"retreat": np.array([0.0, np.nan])}, "within the limits"),
        ({"policy": Policy(crash=Answer.RETREAT)}, "crash.*pose to retreat to"),
        ({"policy": Policy(crash=Answer.RETREAT), "retreat": np.zeros(2)}, "finite velocity limit"),
    ],
)
def test_conduct_that_could_not_be_kept_is_refused(entries, told):
    limits = Limits(np.full(2, -1.0), np.ones(2), np.array([1.0, np.inf]), np.ones(2))
    with shapes_unchecked(), pytest.raises(OptionError, match=told):
        Conduct(limits, **entries)


# ----------------------------------------------------------------------------------------------------------- watchdog


def test_a_watchdog_barks_again_and_again_until_it_is_fed():
    clock, barks = FakeClock(), []
    dog = Watchdog(0.1, lambda: barks.append(clock.now()), clock.now, again=0.02)
    dog.feed()
    for _ in range(20):
        clock.wait_until(clock.now() + dog.check())
    np.testing.assert_allclose(barks, 0.1 + 0.02 * np.arange(19))
    assert dog.barked
    dog.feed()
    assert not dog.barked
    assert dog.check() == pytest.approx(0.1)
    assert len(barks) == 19


def test_a_watchdog_of_one_bark_barks_once_for_each_lapse():
    clock, barks = FakeClock(), []
    dog = Watchdog(0.1, lambda: barks.append(clock.now()), clock.now)
    for lapse in range(3):
        dog.feed()
        for _ in range(5):
            clock.wait_until(clock.now() + dog.check())
        assert len(barks) == lapse + 1


# ------------------------------------------------------------------------------------------------------------- fetching


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.01, 0.09), st.floats(0.0, 0.2)), min_size=2, max_size=3),
    st.floats(0.0, 0.05),
    st.floats(0.01, 0.15),
    st.integers(0, 1000),
)
def test_every_reading_is_fetched_once_in_turn_and_only_different_channels_are_put_together(steps, within, look, seed):
    rng = np.random.default_rng(seed)
    names = [f"s{i}" for i in range(len(steps))]
    together = Synchroniser({name: (Signal(name),) for name in names}, 10.0, shared_clock=names)
    pending = []
    for name, (step, delay) in zip(names, steps, strict=True):
        times = np.cumsum(rng.uniform(0.3, 1.0, 12)) * step
        pending += [(t + rng.uniform(0, delay), name, float(t)) for t in times]
    pending.sort()
    expected = {name: [t for _, n, t in pending if n == name] for name in names}
    found: dict[str, list[float]] = {name: [] for name in names}
    now, last_look = 0.0, -1.0
    with shapes_unchecked():
        while now < 2.0:
            now += look
            while pending and pending[0][0] <= now:
                at, name, time = pending.pop(0)
                together.take(name, [Sample(np.array([time]), time, at)])  # each reads the time
            fetched = together.fetch(now, within)
            assert [time for time, _ in fetched] == sorted(time for time, _ in fetched)
            for time, values in fetched:
                new = np.flatnonzero(~np.isnan(values))
                assert len(new) > 0
                for i in new:
                    found[names[i]].append(time)
            assert together.fetch(now, within) == []
            last_look = now
    assert not pending
    assert last_look >= 2.0
    for name in names:
        assert len(found[name]) == len(expected[name])  # once
        gaps = np.array(sorted(found[name])) - np.array(sorted(expected[name]))
        assert ((gaps >= -1e-9) & (gaps <= within + 1e-9)).all()  # at the newest of those it is one with


# --------------------------------------------------------------------------------------------------------- interrupts


def thrice(call) -> None:
    for _ in range(3):
        call()


def test_a_signal_is_a_word_twice_and_then_an_end():
    said, before = [], signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), interrupts(lambda number: said.append(1)):
        thrice(lambda: os.kill(os.getpid(), signal.SIGINT))
    assert said == [1, 1]
    assert signal.getsignal(signal.SIGINT) is before


def test_the_handlers_of_others_stay_and_other_threads_have_none():
    said, own = [], []
    before = signal.signal(signal.SIGTERM, lambda number, frame: own.append(number))
    try:
        with interrupts(lambda number: said.append(1)):
            os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert (said, own) == ([], [signal.SIGTERM])

    def inside() -> None:
        with interrupts(lambda number: None):
            said.append(2)

    thread = threading.Thread(target=inside)
    thread.start()
    thread.join()
    assert said == [2]


def test_a_robot_of_the_bench_is_a_robot():
    clock, robot = FakeClock(), Watched(SimulatedRobot([Signal("a")], [0.0]))
    robot.start(clock)
    assert robot.state() is not None
    robot.silent = lambda now: now >= 1.0
    clock.advance(1.0)
    assert robot.state() is None
