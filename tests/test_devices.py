"""The stand-ins keep their word, and each fault of a sensor does to the values at hand what is written of it."""

from __future__ import annotations

import numpy as np
import pytest
from interactions import shapes_unchecked, taught

import inphase
from inphase.channels import make_channels
from inphase.errors import ChannelError, OptionError
from inphase.runtime import Command, FakeClock, Fate, Robot, Sensor, Signal, Synchroniser
from inphase.runtime.devices import (
    Dead,
    Drifting,
    Duplicated,
    Late,
    NanBursting,
    Reordered,
    ReplaySensor,
    SimulatedPartner,
    SimulatedRobot,
)

CHANNELS = make_channels(["a", "b"], ["c"], units={"a": "m"})
SEEDS = range(20)  # times that each fault is injected
RATE, STALE = 100.0, 0.05
TIMES = np.arange(160) / RATE


def line(times: np.ndarray) -> np.ndarray:
    """(T, 3) that interpolation gives back exactly."""
    return np.stack([times, -2 * times, 5 * times], axis=1)


def healthy(name: str = "replay") -> ReplaySensor:
    return ReplaySensor(inphase.Demonstration(TIMES, line(TIMES)), CHANNELS, name=name)


def watched(sensor: Sensor, behind: float = 0.0):
    """Ticks (T,) of a loop, what was at hand `behind` [s] the present at each, (T, 2), and the synchroniser."""
    clock = FakeClock()
    together = Synchroniser({sensor.name: sensor.signals}, STALE, shared_clock=[sensor.name])
    sensor.start(clock)
    ticks, values = np.arange(1, 107) * 0.0171 - behind, []
    for tick in ticks:
        clock.wait_until(float(tick) + behind)
        together.take(sensor.name, sensor.read())
        values.append(together.at(float(tick)))
    sensor.stop()
    assert sensor.read() == []
    return ticks, np.array(values), together


# ------------------------------------------------------------------------------------------------------------ replay


def test_a_replay_gives_every_sample_once_at_its_time_and_never_before():
    clock, sensor = FakeClock(7.0), healthy()
    assert isinstance(sensor, Sensor)
    assert sensor.signals == (Signal("a", "m"), Signal("b"))
    assert sensor.read() == []
    sensor.start(clock)
    seen = []
    while not sensor.finished:
        clock.advance(0.0173)
        for sample in sensor.read():
            assert sample.received <= clock.now() < sample.received + 0.0173 + 1e-9
            seen.append(sample)
    np.testing.assert_array_equal([s.values for s in seen], line(TIMES)[:, :2])
    np.testing.assert_allclose([s.stamp for s in seen], TIMES)
    np.testing.assert_allclose([s.received for s in seen], 7.0 + TIMES)


def test_a_replay_runs_faster_or_slower_and_offers_what_is_asked_for():
    clock = FakeClock()
    sensor = ReplaySensor(inphase.Demonstration(TIMES, line(TIMES)), CHANNELS, only=["c"], speed=4.0)
    sensor.start(clock)
    clock.advance(0.5)
    samples = sensor.read()
    assert len(samples) == 160
    assert samples[-1].received == samples[-1].stamp == TIMES[-1] / 4
    np.testing.assert_array_equal(samples[-1].values, [5 * TIMES[-1]])
    sensor.start(clock)  # once more
    assert len(sensor.read()) == 1


def test_a_recording_is_replayed_with_its_own_channels():
    recording = inphase.Recording("r", CHANNELS, TIMES, line(TIMES), (), ())
    clock, sensor = FakeClock(), ReplaySensor(recording)
    sensor.start(clock)
    clock.advance(10.0)
    np.testing.assert_array_equal([s.values for s in sensor.read()], line(TIMES)[:, :2])


# ------------------------------------------------------------------------------------------------------------ faults


def test_without_a_fault_the_values_are_the_truth():
    ticks, values, together = watched(healthy())
    within = ticks < TIMES[-1] + STALE
    held = np.minimum(np.floor(ticks * RATE + 1e-9) / RATE, TIMES[-1])  # the last that has come
    np.testing.assert_allclose(values[within], line(held)[within, :2], atol=1e-9)
    assert together.counts == {"replay": {Fate.TAKEN: len(TIMES)}}
    assert np.isnan(values[ticks > TIMES[-1] + STALE + 0.01]).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_late_samples_are_in_their_place_once_they_are_there(seed):
    ticks, values, together = watched(Late(healthy(), by=0.02, jitter=0.01, seed=seed), behind=0.2)
    inside = (ticks >= 0) & (ticks <= TIMES[-1] - 0.01)
    seen = ~np.isnan(values).any(axis=1)
    assert seen[inside].all()
    np.testing.assert_allclose(values[inside], line(ticks)[inside, :2], atol=1e-9)
    assert together.counts["replay"][Fate.REORDERED] > 10


def test_a_sensor_later_than_the_staleness_is_not_seen_and_one_a_little_late_is_held():
    ticks, values, _ = watched(Late(healthy(), by=STALE + 0.011))
    assert np.isnan(values).all()
    ticks, values, _ = watched(Late(healthy(), by=0.03))
    held = np.floor((ticks - 0.03) * RATE + 1e-9) / RATE
    within = (held >= 0) & (held < TIMES[-1])
    np.testing.assert_allclose(values[within], line(held)[within, :2], atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_dead_sensor_is_missing_once_it_is_stale_and_seen_when_it_comes_back(seed):
    after, length = np.random.default_rng(seed).uniform([0.2, 0.2], [0.8, 0.5])
    ticks, values, _ = watched(Dead(healthy(), after, length))
    blind = np.isnan(values).any(axis=1)
    gone = (ticks > after + STALE) & (ticks < after + length)
    back = (ticks > after + length + 1 / RATE) & (ticks < TIMES[-1])
    assert blind[gone].all()
    assert not blind[back].any()
    assert not blind[(ticks < after)].any()
    ticks, values, _ = watched(Dead(healthy(), after))
    assert np.isnan(values[ticks > after + STALE]).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_drifting_clock_and_its_offset_are_found_again_through_jitter(seed):
    rng = np.random.default_rng(seed)
    drift, offset = rng.uniform(-1e-3, 1e-3), rng.uniform(-1e6, 1e6)
    times = np.arange(501) / 25.0
    replay = ReplaySensor(inphase.Demonstration(times, line(times)), CHANNELS)
    sensor = Drifting(Late(replay, by=0.0, jitter=0.005, seed=seed), drift, offset)
    clock = FakeClock(50.0)
    together = Synchroniser({"replay": sensor.signals}, 0.1)
    sensor.start(clock)
    for tick in range(101):
        clock.wait_until(50.0 + 0.2 * tick)
        together.take("replay", sensor.read())
        since = 0.2 * tick - 0.1
        if since > 6.0:  # once a drift can be told, the clocks are matched to 1 ms
            np.testing.assert_allclose(together.at(50.0 + since), [since, -2 * since], atol=2e-3)
    found = together.clocks["replay"]
    assert found.drift == pytest.approx(drift, abs=5e-5)
    assert found.offset == pytest.approx(offset + drift * 20 - 50.0, abs=1e-3)


@pytest.mark.parametrize("seed", SEEDS)
def test_duplicated_samples_change_nothing_but_their_count(seed):
    _, values, together = watched(Duplicated(healthy(), share=0.3, seed=seed))
    _, expected, _ = watched(healthy())
    np.testing.assert_array_equal(values, expected)
    assert 20 < together.counts["replay"][Fate.DUPLICATED] < 80
    assert together.counts["replay"][Fate.TAKEN] == len(TIMES)


@pytest.mark.parametrize("seed", SEEDS)
def test_reordered_samples_change_nothing_a_moment_later(seed):
    _, values, together = watched(Reordered(healthy(), share=0.2, by=0.03, seed=seed), behind=0.1)
    _, expected, _ = watched(healthy(), behind=0.1)
    np.testing.assert_array_equal(values, expected)
    assert together.counts["replay"][Fate.REORDERED] > 10


@pytest.mark.parametrize("seed", SEEDS)
def test_a_burst_of_nan_blinds_its_channel_alone_once_it_is_stale(seed):
    begin, length = np.random.default_rng(seed).uniform([0.2, 0.2], [0.8, 0.5])
    ticks, values, _ = watched(NanBursting(healthy(), [(begin, length)], only="a"))
    inside = (ticks > begin + STALE) & (ticks < begin + length)
    outside = (ticks < begin) | (ticks > begin + length + 1 / RATE)
    assert np.isnan(values[inside, 0]).all()
    assert not np.isnan(values[outside & (ticks < TIMES[-1]), 0]).any()
    assert not np.isnan(values[ticks < TIMES[-1], 1]).any()


def test_a_short_burst_is_not_noticed():
    _, values, _ = watched(NanBursting(healthy(), [(0.5, 0.03)]), behind=0.1)
    _, expected, _ = watched(healthy(), behind=0.1)
    np.testing.assert_allclose(values, expected, atol=1e-12)


# ------------------------------------------------------------------------------------------------------------- robot


JOINTS = (Signal("grip", "m"), Signal("turn", "rad"))


def moved(robot: SimulatedRobot, clock: FakeClock, seconds: float) -> np.ndarray:
    clock.advance(seconds)
    state = robot.state()
    assert state is not None
    return state.values


def test_a_robot_follows_with_a_lag_of_first_order():
    clock, robot = FakeClock(3.0), SimulatedRobot(JOINTS, [0.0, 1.0], time_constant=0.1)
    assert isinstance(robot, Robot)
    robot.start(clock)
    robot.command(Command(np.array([3.0]), np.array([[1.0, 0.0]])))
    for _ in range(30):
        values = moved(robot, clock, 0.02)
        left = np.exp(-(clock.now() - 3.0) / 0.1)
        np.testing.assert_allclose(values, [1 - left, left], atol=0.011)  # of a step of 1 ms


def test_a_robot_is_never_faster_or_further_than_it_can(rng):
    clock, robot = FakeClock(), SimulatedRobot(JOINTS, [0, 0], time_constant=0.0, low=-0.5, high=[0.5, 1], velocity=2.0)
    robot.start(clock)
    before = np.zeros(2)
    for _ in range(500):
        robot.command(Command(np.array([clock.now()]), rng.normal(0, 3, (1, 2))))
        values = moved(robot, clock, 0.01)
        assert (np.abs(values - before) <= 2.0 * 0.01 + 2.0 * 0.001 + 1e-12).all()  # a tick holds up to 11 steps
        assert ((values >= -0.5) & (values <= [0.5, 1.0])).all()
        before = values


def test_a_trajectory_is_followed_point_by_point_and_the_last_holds():
    clock, robot = FakeClock(), SimulatedRobot(JOINTS, [0.0, 0.0], time_constant=0.0)
    robot.start(clock)
    robot.command(Command(np.array([1.0, 2.0, 3.0]), np.array([[1.0, 0.0], [2.0, 4.0], [0.0, 4.0]])))
    for time, expected in ((0.5, [0, 0]), (1.5, [1.5, 2.0]), (2.5, [1.0, 4.0]), (3.5, [0, 4]), (9.0, [0, 4])):
        clock.wait_until(time)
        np.testing.assert_allclose(robot.state().values, expected, atol=0.005)


def test_how_often_a_robot_is_asked_does_not_matter():
    rare, often = (SimulatedRobot(JOINTS, [0.0, 0.0], velocity=1.0) for _ in range(2))
    clock = FakeClock()
    for robot in (rare, often):
        robot.start(clock)
        robot.command(Command(np.array([0.2]), np.array([[1.0, -1.0]])))
    for _ in range(100):
        clock.advance(0.0037)
        often.state()
    np.testing.assert_array_equal(rare.state().values, often.state().values)


def test_a_robot_that_does_not_answer_takes_nothing_and_moves_on():
    clock, robot = FakeClock(), SimulatedRobot(JOINTS, [0.0, 0.0])
    assert robot.state() is None
    robot.start(clock)
    robot.command(Command(np.array([0.0]), np.array([[1.0, 1.0]])))
    robot.answers = False
    robot.command(Command(np.array([0.0]), np.array([[9.0, 9.0]])))
    clock.advance(5.0)
    assert robot.state() is None
    robot.answers = True
    np.testing.assert_allclose(robot.state().values, [1.0, 1.0])
    robot.stop()
    assert robot.state() is None


# ----------------------------------------------------------------------------------------------------------- partner


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    from interactions import dataset

    return taught(dataset(np.random.default_rng(0)))


def test_a_partner_is_an_interaction_of_the_model_at_its_tempo(model):
    clock, partner = FakeClock(2.0), SimulatedPartner(model, 3, tempo=0.5, noise=0.0, rate=50.0)
    assert [s.name for s in partner.signals] == list(model.observed)
    partner.start(clock)
    clock.advance(1.0)
    samples = partner.read()
    np.testing.assert_allclose([s.stamp for s in samples], 2.0 + np.arange(51) / 50)
    phases = np.arange(51) / 50 * 0.5 * model.phase.nominal_velocity
    np.testing.assert_allclose([s.values for s in samples], model.predict(phases, partner.weights)[:, :2])
    clock.advance(100.0)
    assert partner.phase(clock.now()) == 1.0
    assert partner.read()[-1].received <= clock.now()


def test_a_partner_stands_still_in_its_pauses(model):
    partner = SimulatedPartner(model, pauses=[(0.5, 0.3), (0.6, 0.3), (1.5, 0.1)], tempo=1.0, noise=0.0)
    partner.start(FakeClock(10.0))
    velocity = model.phase.nominal_velocity
    for since, moving in ((0.5, 0.5), (0.7, 0.5), (0.9, 0.5), (1.0, 0.6), (1.55, 1.1), (1.7, 1.2)):
        assert partner.phase(10.0 + since) == pytest.approx(moving * velocity)


def test_partners_of_one_seed_are_one_and_those_of_others_differ_as_the_model_says(model):
    one, same = SimulatedPartner(model, 1), SimulatedPartner(model, 1)
    for partner in (one, same):
        clock = FakeClock()
        partner.start(clock)
        clock.advance(0.5)
    np.testing.assert_array_equal([s.values for s in one.read()], [s.values for s in same.read()])
    many = [SimulatedPartner(model, seed) for seed in range(400)]
    assert np.std(np.log([p.tempo for p in many])) == pytest.approx(model.tempo.usual_std, rel=0.15)
    spread, expected = np.std([p.weights for p in many], axis=0), np.sqrt(np.diag(model.prior.cov))
    large = expected > 0.1 * expected.max()
    np.testing.assert_allclose(spread[large], expected[large], rtol=0.2)


def test_a_session_follows_a_simulated_partner(model):
    clock, partner = FakeClock(), SimulatedPartner(model, 5, tempo=1.1)
    session = model.session()
    partner.start(clock)
    clock.advance(1.0)
    for sample in partner.read():
        estimate = session.observe(sample.received, sample.values)
    assert estimate.phase == pytest.approx(partner.phase(clock.now()), abs=0.05)


# ------------------------------------------------------------------------------------------------------- bad options


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: ReplaySensor(inphase.Demonstration(TIMES, line(TIMES))), "expected 3 channels.* got none"),
        (lambda: ReplaySensor(inphase.Demonstration(TIMES, line(TIMES)), CHANNELS[:2]), "got 2"),
        (lambda: ReplaySensor(inphase.Demonstration(TIMES, line(TIMES)), CHANNELS, speed=0.0), "speed > 0"),
        (lambda: ReplaySensor(inphase.Demonstration(TIMES, line(TIMES)), CHANNELS, only="d"), "no channel fits 'd'"),
        (lambda: SimulatedRobot(JOINTS, [0.0]), "home of 2 joints"),
        (lambda: SimulatedRobot(JOINTS, [0.0, 9.0], high=1.0), "low <= home <= high"),
        (lambda: SimulatedRobot(JOINTS, [0.0, 0.0], velocity=-1.0), "velocities >= 0"),
        (lambda: SimulatedRobot(JOINTS, [0.0, 0.0], step=0.0), "step > 0"),
        (lambda: Late(healthy(), by=-1.0), "by >= 0"),
        (lambda: Dead(healthy(), after=float("nan")), "after >= 0"),
        (lambda: Duplicated(healthy(), share=1.5), "share between 0 and 1"),
        (lambda: NanBursting(healthy(), [], only="c"), "no channel fits 'c'"),
    ],
)
def test_bad_options_are_named(make, told):
    with pytest.raises((OptionError, ChannelError), match=told):
        make()


@pytest.mark.parametrize("options", [{"rate": 0.0}, {"tempo": -1.0}, {"noise": -1.0}, {"pauses": [(-1.0, 1.0)]}])
def test_bad_options_of_a_partner_are_named(model, options):
    with pytest.raises(OptionError, match=next(iter(options))):
        SimulatedPartner(model, **options)


def test_a_command_for_another_robot_is_refused():
    robot = SimulatedRobot(JOINTS, [0.0, 0.0], name="arm")
    with shapes_unchecked(), pytest.raises(OptionError, match=r"arm: expected 2 positions \(grip, turn\), got 1"):
        robot.command(Command(np.array([0.0]), np.array([[1.0]])))
