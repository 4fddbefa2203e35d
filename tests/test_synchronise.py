"""What sensors of other rates, clocks and delays read at one time is what one sensor without faults would have read."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inphase.channels import Channel, Kind, Role, make_channels
from inphase.errors import ChannelError, DataError, ObservationError, OptionError
from inphase.runtime import (
    Command,
    FakeClock,
    Fate,
    Sample,
    SensorRecording,
    Signal,
    SourceClock,
    Synchroniser,
    SystemClock,
    check_signals,
    combine,
)
from inphase.runtime.devices import SimulatedRobot

AB = (Signal("a", "m"), Signal("b", "rad"))


def sample(time: float, *values: float, received: float | None = None) -> Sample:
    return Sample(np.array(values, dtype=float), time, time if received is None else received)


def pair(staleness=0.2, **options) -> Synchroniser:
    """A sensor of two channels that stamps with the loop's clock."""
    return Synchroniser({"s": AB}, staleness, shared_clock=["s"], **options)


# --------------------------------------------------------------------------------------------------------- one sensor


def test_between_two_readings_it_is_their_line_and_after_the_last_it_holds_until_it_is_stale():
    both = pair()
    assert np.isnan(both.at(0.0)).all()
    both.take("s", [sample(1.0, 0.0, 5.0), sample(1.1, 1.0, 7.0)])
    np.testing.assert_allclose(both.at(1.025), [0.25, 5.5])
    np.testing.assert_allclose(both.at(1.1), [1.0, 7.0])
    np.testing.assert_allclose(both.at(1.29), [1.0, 7.0])
    assert np.isnan(both.at(1.31)).all()
    assert np.isnan(both.at(0.99)).all()  # nothing was read by then: no look into the future


def test_readings_further_apart_than_the_staleness_are_not_joined():
    both = pair(staleness={"a": 0.2, "b": 1.0})
    both.take("s", [sample(1.0, 0.0, 0.0), sample(1.5, 1.0, 1.0)])
    np.testing.assert_allclose(both.at(1.1), [0.0, 0.2])
    np.testing.assert_allclose(both.at(1.4), [np.nan, 0.8])
    np.testing.assert_allclose(both.at(1.5), [1.0, 1.0])


def test_a_channel_that_is_blind_for_a_while_is_joined_over_it_or_goes_stale_and_the_other_is_not_touched():
    both = pair(staleness=0.25)
    both.take("s", [sample(t / 10, t if not 3 <= t <= 4 else np.nan, -t) for t in range(7)])
    np.testing.assert_allclose(both.at(0.35), [2.0, -3.5])  # 2 … 5 is 0.3 s: too far to join, and 2 still holds
    np.testing.assert_allclose(both.at(0.46), [np.nan, -4.6])
    np.testing.assert_allclose(both.at(0.55), [5.5, -5.5])
    np.testing.assert_allclose(both.ages(0.7), [0.1, 0.1])


def test_ages_are_infinite_for_what_was_never_read():
    both = pair()
    both.take("s", [sample(1.0, np.nan, 3.0)])
    np.testing.assert_array_equal(both.ages(4.0), [np.inf, 3.0])


@settings(max_examples=40)
@given(order=st.permutations(range(8)), twice=st.lists(st.integers(0, 7)))
def test_order_and_duplicates_do_not_matter(order, twice):
    rows = [sample(0.1 * i, np.sin(i), np.cos(i)) for i in range(8)]
    straight, mixed = pair(), pair()
    straight.take("s", rows)
    mixed.take("s", [rows[i] for i in [*order, *twice]])
    for time in np.linspace(0.0, 0.95, 20):
        np.testing.assert_array_equal(straight.at(time), mixed.at(time))
    counts = mixed.counts["s"]
    assert counts.get(Fate.DUPLICATED, 0) == len(twice)
    ahead = np.maximum.accumulate(order)
    assert counts.get(Fate.REORDERED, 0) == sum(i < most for i, most in zip(order[1:], ahead[:-1], strict=True))


def test_two_samples_of_one_stamp_fill_each_other_and_the_first_stands():
    both = pair()
    both.take("s", [sample(1.0, 1.0, np.nan), sample(1.0, 9.0, 2.0)])
    np.testing.assert_array_equal(both.at(1.0), [1.0, 2.0])


def test_what_cannot_be_used_is_counted_by_its_reason():
    both = pair(history=1.0)
    both.take("s", [sample(10.0, 1.0, 1.0), sample(10.1, np.nan, np.inf), sample(np.nan, 1.0, 1.0)])
    both.take("s", [sample(8.7, 2.0, 2.0, received=10.2), sample(12.0, 3.0, 3.0, received=10.2)])
    fates = [Fate.TAKEN, Fate.EMPTY, Fate.BROKEN, Fate.LATE, Fate.AHEAD]
    assert both.counts == {"s": dict.fromkeys(fates, 1)}
    np.testing.assert_array_equal(both.at(10.15), [1.0, 1.0])


def test_the_past_is_forgotten_after_the_history():
    both = pair(history=1.0, staleness=0.2)
    both.take("s", [sample(0.01 * i, i, i) for i in range(1000)])
    assert not np.isnan(both.at(9.0)).any()
    assert np.isnan(both.at(8.0)).all()
    assert both.span("s")[0] == pytest.approx(9.99 - 1.2, abs=0.011)


# -------------------------------------------------------------------------------------------------- angles and turns


def test_an_angle_goes_the_shorter_way_round():
    channels = make_channels(["a", "b"], ["c"], kinds={"b": "angle"})
    both = Synchroniser({"s": AB}, 1.0, channels, shared_clock=["s"])
    both.take("s", [sample(0.0, 3.0, 3.0), sample(0.5, -3.0, -3.0)])
    linear, angle = both.at(0.25)
    assert linear == pytest.approx(0.0)
    assert np.cos(angle) == pytest.approx(-1.0)


def test_a_quaternion_is_the_same_turn_with_either_sign_and_stays_a_unit():
    names = ["qx", "qy", "qz", "qw"]
    channels = [Channel(name, Role.OBSERVED, kind=Kind.QUATERNION) for name in names]
    turned = Synchroniser({"s": [Signal(n) for n in names]}, 1.0, channels, shared_clock=["s"])
    half = np.deg2rad(40) / 2
    turned.take("s", [sample(0.0, 0, 0, 0, 1), sample(0.5, 0, 0, -np.sin(half), -np.cos(half))])
    np.testing.assert_allclose(turned.at(0.25), [0, 0, np.sin(half / 2), np.cos(half / 2)], atol=1e-12)
    turned.take("s", [sample(0.6, 0, 0, np.nan, 1)])  # three numbers are no turn
    assert turned.counts["s"][Fate.EMPTY] == 1


def test_a_quaternion_of_two_sensors_is_refused():
    channels = [Channel(name, Role.OBSERVED, kind=Kind.QUATERNION) for name in ("qx", "qy", "qz", "qw")]
    with pytest.raises(OptionError, match="all four channels of quaternion"):
        Synchroniser({"s": [Signal("qx"), Signal("qy")], "r": [Signal("qz"), Signal("qw")]}, 1.0, channels)


# ------------------------------------------------------------------------------------------------------------ clocks


@pytest.mark.parametrize("drift", [0.0, 3e-4, -8e-4])
@pytest.mark.parametrize("offset", [-7.0, 1.7e9])
def test_offset_and_drift_are_found_again_under_delays_of_any_size(rng, drift, offset):
    clock, shortest = SourceClock(), 0.004
    times = np.arange(0, 40, 0.01)
    delays = shortest + rng.exponential(0.02, len(times))
    delays[rng.random(len(times)) < 0.05] += 0.5
    stamps = offset + (1 + drift) * times
    for i in np.argsort(times + delays):
        clock.add(float(stamps[i]), float(times[i] + delays[i]))
    assert clock.drift == pytest.approx(drift, abs=3e-5)  # a regression is off by 1e-3
    assert clock.offset == pytest.approx(offset + drift * 40 - shortest, abs=1e-3)
    for time in (35.0, 40.0):
        assert clock.time_of(clock.stamp_at(time)) == pytest.approx(time, abs=1e-6)


def test_no_sample_is_read_after_it_came(rng):
    clock = SourceClock()
    for i in range(3000):
        received = 0.01 * i + rng.exponential(0.01)
        clock.add(0.01 * i * 1.0005, received)
        assert clock.time_of(0.01 * i * 1.0005) <= received + 1e-9


def test_a_delay_that_stays_is_no_offset():
    """Two seconds late for five minutes: still late, as no clock goes wrong so fast."""
    clock = SourceClock()
    for i in range(600):
        clock.add(0.5 * i, 0.5 * i + (2.0 if i > 20 else 0.0))
    assert clock.time_of(0.5 * 599) < 0.5 * 599 + 0.7


def test_a_shared_clock_is_believed_however_late_the_samples_come():
    clock = SourceClock(shared=True)
    for i in range(100):
        clock.add(0.1 * i, 0.1 * i + 0.3)
    assert clock.offset == clock.drift == 0.0
    assert clock.time_of(5.0) == clock.stamp_at(5.0) == 5.0


def test_a_sensor_that_falls_behind_goes_stale_though_its_samples_come():
    both = Synchroniser({"s": AB}, 0.2)
    for i in range(300):
        both.take("s", [sample(0.01 * i, i, i, received=0.01 * i + (0.5 if i >= 200 else 0.0))])
    assert np.isnan(both.at(2.99 + 0.5)).all()
    assert not np.isnan(both.at(2.99)).any()


@pytest.mark.parametrize("to", [-500.0, 500.0])
def test_a_clock_that_was_set_is_followed_after_half_a_second_but_no_single_stamp_is(to):
    both = Synchroniser({"s": AB}, 0.195)
    for i in range(400):
        stamp = 100 + 0.01 * i + (to if i == 100 or i >= 200 else 0.0)
        both.take("s", [sample(stamp, i, i, received=0.01 * i)])
        blind = 199 + 20 <= i < 250
        assert np.isnan(both.at(0.01 * i)).all() == blind, i
    assert both.counts["s"][Fate.RESTARTED] == 1
    assert both.counts["s"][Fate.LATE if to < 0 else Fate.AHEAD] == 51
    np.testing.assert_allclose(both.at(3.5), 350, atol=1e-3)


# ------------------------------------------------------------------------------------------------------- bad options


def test_bad_options_are_named():
    with pytest.raises(OptionError, match=r"staleness .* of every channel, got none of b"):
        pair(staleness={"a": 1.0})
    with pytest.raises(OptionError, match="staleness of 'a': expected a positive"):
        pair(staleness=0.0)
    with pytest.raises(ChannelError, match="no channel fits 'c'"):
        pair(staleness={"c": 1.0})
    with pytest.raises(OptionError, match="no sensor is called t; the sensors are s"):
        Synchroniser({"s": AB}, 1.0, shared_clock=["t"])
    with pytest.raises(ChannelError, match="got twice: a, b"):
        Synchroniser({"s": AB, "t": AB}, 1.0)
    with pytest.raises(OptionError, match="history"):
        pair(history=-1.0)
    with pytest.raises(OptionError, match="window"):
        SourceClock(window=1.0)
    with pytest.raises(ObservationError, match="no sensor is called 't'"):
        pair().take("t", [])
    with pytest.raises(ObservationError, match="s: expected 2 values, got 3"):
        pair().take("s", [sample(0.0, 1, 2, 3)])


# ----------------------------------------------------------------------------------------------------- data sets


SECONDS = 10  # of the recordings


def wave(times: np.ndarray) -> np.ndarray:
    """(T, 3) what there is to read; no second derivative is above 16."""
    return np.stack([np.sin(2 * times), np.cos(3 * times), np.sin(4 * times)], axis=1)


def recorded(rng, rate: float, columns: list[int], drift: float, offset: float) -> SensorRecording:
    times = np.sort(rng.uniform(-0.3, 0.3, int(SECONDS * rate)) / rate + np.arange(int(SECONDS * rate)) / rate)
    received = times + rng.exponential(0.005, len(times))
    signals = tuple(Signal("xyz"[i]) for i in columns)
    return SensorRecording(signals, offset + (1 + drift) * times, wave(times)[:, columns], received)


def test_recordings_of_other_rates_and_clocks_combine_to_one_of_a_common_rate(rng):
    slow, fast = recorded(rng, 60.0, [0], 5e-4, 1e6), recorded(rng, 200.0, [1, 2], -3e-4, -40.0)
    whole = combine({"slow": slow, "fast": fast}, rate=75.0)
    np.testing.assert_allclose(np.diff(whole.times), 1 / 75, atol=1e-9)
    assert whole.duration > SECONDS - 0.1
    longest = np.array([1.6 / 60, 1.6 / 200, 1.6 / 200])
    curvature, speed = np.array([4.0, 9.0, 16.0]), np.array([2.0, 3.0, 4.0])
    bound = curvature * longest**2 / 8 + speed * 1e-3  # of lines between samples, and of clocks that are 1 ms off
    assert (np.abs(whole.values - wave(whole.times)) <= bound).all()


def test_a_common_rate_is_given_back_as_it_was():
    times = np.arange(200) / 50.0
    values = wave(times)
    halves = {"one": (AB[:1], values[:, :1]), "two": ((Signal("y"), Signal("z")), values[:, 1:])}
    whole = combine({name: SensorRecording(s, times, v) for name, (s, v) in halves.items()}, rate=50.0)
    np.testing.assert_allclose(whole.times, times)
    np.testing.assert_allclose(whole.values, values, atol=1e-12)


def test_gaps_and_death_of_a_sensor_are_missing_in_the_whole():
    times = np.arange(101) / 50.0
    gap = (times < 0.5) | (times > 1.0)
    live = SensorRecording(AB[:1], times[gap], np.ones((gap.sum(), 1)))
    dead = SensorRecording(AB[1:], times[times <= 1.5], np.ones(((times <= 1.5).sum(), 1)))
    whole = combine({"live": live, "dead": dead}, rate=50.0)
    assert whole.duration == pytest.approx(2.0)
    blind = np.isnan(whole.values)
    np.testing.assert_array_equal(blind[:, 0], (whole.times > 0.49 + 0.06) & (whole.times < 1.01))
    np.testing.assert_array_equal(blind[:, 1], whole.times > 1.5 + 0.061)


def test_a_sensor_that_sees_nothing_yet_has_begun():
    times = np.arange(101) / 50.0
    hidden = np.where((times < 0.5) | (times > 1.5), np.nan, 1.0)[:, None]  # a ball in a hand, and in a box
    ball = SensorRecording(AB[:1], times, hidden)
    whole = combine({"ball": ball, "hand": SensorRecording(AB[1:], times, np.ones((101, 1)))}, rate=50.0)
    np.testing.assert_allclose(whole.times, times)
    assert np.isfinite(whole.values[:, 1]).all()
    np.testing.assert_array_equal(np.isnan(whole.values[:, 0]), (times < 0.49) | (times > 1.5 + 0.061))


def test_what_cannot_be_combined_is_told():
    one = SensorRecording(AB[:1], np.arange(100) / 50.0, np.ones((100, 1)))
    other = SensorRecording(AB[1:], 100 + np.arange(100) / 50.0, np.ones((100, 1)))
    with pytest.raises(DataError, match="recorded at the same time"):
        combine({"one": one, "other": other}, rate=50.0)
    with pytest.raises(OptionError, match="rate"):
        combine({"one": one}, rate=0.0)
    with pytest.raises(DataError, match="got none that could be used"):
        combine({"one": SensorRecording(AB[:1], np.arange(3.0), np.full((3, 1), np.nan))}, rate=1.0)
    with pytest.raises(DataError, match=r"expected values \(T, D\) = \(3, 1\)"):
        SensorRecording(AB[:1], np.arange(3.0), np.ones((3, 2)))
    stamps = np.arange(300) / 50.0
    with pytest.raises(DataError, match="one that was set on the way"):
        combine({"one": SensorRecording(AB[:1], stamps + 100 * (stamps > 3), np.ones((300, 1)), stamps)}, rate=50.0)


# ------------------------------------------------------------------------------------------- what devices have to offer


def test_the_channels_of_a_model_are_found_in_its_devices():
    channels = make_channels(["b"], ["a"], units={"a": "m"})
    robot = SimulatedRobot(AB, [0.0, 0.0])
    assert check_signals(channels, [robot]) == {"a": ("robot", 0), "b": ("robot", 1)}


def test_all_that_does_not_fit_is_named_at_once():
    channels = make_channels(["a", "b", "c"], ["d"], units={"a": "mm"})
    devices = [SimulatedRobot(AB, [0.0, 0.0], name="arm"), SimulatedRobot(AB[1:], [0.0], name="leg")]
    with pytest.raises(OptionError) as refused:
        check_signals(channels, devices)
    assert str(refused.value) == (
        "the devices do not fit the model: no device offers c, d; offered are a, b; "
        "'a' is in 'mm' in the model and in 'm' from arm; 'b' is offered twice, by arm, leg"
    )


@pytest.mark.parametrize(
    ("times", "positions", "told"),
    [
        ([0.0, 1.0], [[1.0]], "times"),
        ([], np.empty((0, 1)), "times"),
        ([1.0, 1.0], [[1.0], [2.0]], "increase"),
        ([0.0], [[np.nan]], "got nan in column 0 at point 0"),
    ],
)
def test_no_command_is_made_of_what_is_none(times, positions, told):
    from interactions import shapes_unchecked

    with shapes_unchecked(), pytest.raises(OptionError, match=told):
        Command(np.array(times), np.array(positions, dtype=float))


# ------------------------------------------------------------------------------------------------------ the fake clock


def test_a_fake_clock_calls_back_in_order_at_its_times_and_never_runs_back():
    clock, calls = FakeClock(5.0), []
    clock.at(7.0, lambda: calls.append(("late", clock.now())))
    clock.at(6.0, lambda: clock.at(6.5, lambda: calls.append(("nested", clock.now()))))
    clock.at(7.0, lambda: calls.append(("later", clock.now())))
    clock.wait_until(6.9)
    assert (calls, clock.now()) == ([("nested", 6.5)], 6.9)
    clock.advance(1.0)
    clock.wait_until(0.0)
    assert calls[1:] == [("late", 7.0), ("later", 7.0)]
    assert clock.now() == pytest.approx(7.9)
    with pytest.raises(OptionError, match=r"at least 7\.9 s, got 7 s"):
        clock.at(7.0, print)
    with pytest.raises(OptionError, match="seconds >= 0"):
        clock.advance(-1.0)


def test_the_clock_of_the_system_waits_until_the_time_and_not_for_what_has_passed():
    clock = SystemClock()
    begin = clock.now()
    clock.wait_until(begin + 0.01)
    after = clock.now()
    assert after >= begin + 0.01
    clock.wait_until(after - 1000.0)  # would never come back
    assert clock.now() >= after


def test_readings_that_nobody_fetched_in_time_are_counted():
    """Every reading is fetched once, or counted as one that never will be."""
    together = Synchroniser({"hand": [Signal("x")]}, 0.1, shared_clock=["hand"], history=0.4)
    together.take("hand", [Sample(np.array([float(i)]), i / 100, i / 100) for i in range(200)])
    fetched = together.fetch(2.0)
    assert [values[0] for _, values in fetched] == list(range(200 - len(fetched), 200))
    assert len(fetched) + together.unfetched == 200
    assert together.unfetched > 100
    assert together.fetch(2.0) == []
