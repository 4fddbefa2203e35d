"""Ball catching: what physics, people, sensors and the expert have to keep to, so that the study means anything."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs mujoco: pip install 'inphase[sim]'")
pytest.importorskip("mink", reason="needs mink: pip install 'inphase[sim]'")
sys.path.insert(0, str(Path(__file__).parents[1]))

import inphase
from experiments.bodies.arm import JOINTS, TORQUE, VELOCITY
from experiments.bodies.person import SHARES, bent
from experiments.catching import flight, motion
from experiments.catching.demonstrations import demonstrated, gathered, make, thrown
from experiments.catching.expert import demonstrate, plan
from experiments.catching.felt import imu
from experiments.catching.sensors import KINDS, MODALITIES, OBSERVED, Watch, watches
from experiments.catching.thrower import Throw
from experiments.catching.trial import held_before, played, unmoved
from experiments.catching.world import HOME, World, built
from inphase.runtime import FakeClock, Journal, Sensor


@pytest.fixture(scope="module")
def caught() -> tuple[Throw, World]:
    """A throw that the expert caught."""
    happens, rng = thrown(0, 1, 0)
    planned = plan(happens, rng)
    assert planned is not None
    return happens, demonstrate(happens, planned)


# ------------------------------------------------------------------------------------------------------------ physics


def test_a_ball_without_air_flies_a_parabola(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flight, "DRAG", 0.0)
    begin, velocity, t = np.array([3.0, 0.1, 1.0]), np.array([-3.0, 0.2, 4.0]), 0.9
    place, then = flight.fly(begin, velocity, t)
    np.testing.assert_allclose(place, begin + velocity * t - [0, 0, flight.GRAVITY * t**2 / 2], atol=1e-12)
    np.testing.assert_allclose(then, velocity - [0, 0, flight.GRAVITY * t], atol=1e-12)


def test_a_ball_falls_no_faster_than_its_weight_and_the_air_allow() -> None:
    _, velocity = flight.fly(np.zeros(3), np.zeros(3), 30.0, 3000)
    assert velocity[2] == pytest.approx(-np.sqrt(flight.MASS * flight.GRAVITY / flight.DRAG), rel=1e-6)


def test_an_aimed_ball_arrives_and_is_found_where_it_passes() -> None:
    begin, target = np.array([3.0, 0.1, 1.0]), np.array([0.6, -0.4, 0.9])
    velocity = flight.aimed(begin, target, 0.95)
    np.testing.assert_allclose(flight.fly(begin, velocity, 0.95)[0], target, atol=1e-4)
    passed = flight.crossing(begin, velocity, lambda place: place[0] - 0.6)
    assert passed is not None
    assert passed[0] == pytest.approx(0.95, abs=1e-3)
    np.testing.assert_allclose(passed[1], target, atol=1e-3)
    assert flight.crossing(begin, -velocity, lambda place: place[0] - 0.6) is None


def test_the_simulated_ball_flies_as_it_was_thrown(caught: tuple[Throw, World]) -> None:
    happens, world = caught
    assert world.entered is not None
    seen = [moment for moment in world.log if np.isfinite(moment.ball).all() and moment.time < world.entered - 0.05]
    assert seen[0].time == pytest.approx(happens.release, abs=0.005)
    for moment in (seen[len(seen) // 2], seen[-1]):
        place, _ = flight.fly(happens.position, happens.velocity, moment.time - happens.release)
        np.testing.assert_allclose(moment.ball, place, atol=0.02)  # Euler's steps of 2 ms


def test_an_arm_at_rest_carries_itself_and_its_box_within_its_torque() -> None:
    happens, _ = thrown(0, 2, 0)
    world = World(happens)
    for _ in range(300):
        world.step()
    np.testing.assert_allclose(world.joints, HOME, atol=0.01)
    carries = world.data.qfrc_actuator[: len(JOINTS)]
    assert (np.abs(carries) < TORQUE).all()
    np.testing.assert_allclose(carries, world.data.qfrc_bias[: len(JOINTS)], atol=1.0)  # nobody else carries it


def test_an_arm_is_no_stronger_than_the_data_sheet_says() -> None:
    happens, _ = thrown(0, 2, 0)
    world = World(happens)
    world.target = HOME + 1.5
    most = np.zeros(len(JOINTS))
    for _ in range(100):
        world.step()
        most = np.maximum(most, np.abs(world.data.qfrc_actuator[: len(JOINTS)]))
    np.testing.assert_array_less(most, TORQUE + 1e-6)
    assert (most > 0.9 * TORQUE).any()


def test_the_arm_is_as_long_as_its_parameters_say() -> None:
    import mujoco

    model = built()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)  # all joints at 0
    base, flange = data.body("ur5_base"), data.site("ur5_flange")
    frame = base.xmat.reshape(3, 3)
    a2, a3, d1, d4, d5, d6 = -0.425, -0.3922, 0.1625, 0.1333, 0.0997, 0.0996  # Denavit and Hartenberg, as published
    np.testing.assert_allclose(frame.T @ (flange.xpos - base.xpos), [a2 + a3, -d4 - d6, d1 - d5], atol=1e-6)


# ------------------------------------------------------------------------------------------------------------- people


@pytest.mark.parametrize("number", range(4))
def test_a_body_stays_in_one_piece_and_its_ball_leaves_as_the_hand_moves(number: int) -> None:
    happens, _ = thrown(5, number, 0)
    h = happens.style.height
    for side in ("left", "right"):
        for limb, begin, end in (("upper_arm", "shoulder", "elbow"), ("forearm", "elbow", "wrist")):
            long = np.linalg.norm(happens.joints[f"{side}_{end}"] - happens.joints[f"{side}_{begin}"], axis=1)
            np.testing.assert_allclose(long, SHARES[limb] * h, rtol=0.03)
    i = round(happens.release / motion.STEP)
    moves = (happens.hand[i + 1] - happens.hand[i - 1]) / (2 * motion.STEP)
    assert np.linalg.norm(happens.velocity - moves) < 0.3  # fingers
    assert 3.5 < np.linalg.norm(happens.velocity) < 8
    fastest = {n: np.linalg.norm(np.diff(p, axis=0), axis=1).max() / motion.STEP for n, p in happens.joints.items()}
    assert max(fastest[name] for name in fastest if "elbow" not in name) < 12  # [m/s] nothing jumps
    assert max(fastest.values()) < 20  # an arm that is nearly straight snaps


def test_shoes_carry_the_person() -> None:
    happens, _ = thrown(5, 0, 0)
    felt = (happens.pressures / happens.style.cells).sum(1)
    assert felt.mean() == pytest.approx(happens.style.weight * flight.GRAVITY, rel=0.05)


def test_an_imu_at_rest_feels_its_weight() -> None:
    happens, _ = thrown(5, 0, 0)
    assert np.linalg.norm(happens.imu[-1, :3]) == pytest.approx(flight.GRAVITY, rel=1e-3)
    np.testing.assert_allclose(happens.imu[-1, 3:], 0, atol=1e-6)


def test_a_limb_bends_between_its_ends() -> None:
    ends = np.array([[0.3, 0.0, -0.2], [0.1, 0.2, -0.4]])
    joint = bent(np.zeros(3), ends, 0.3, 0.25, (-1, 0, 0))
    np.testing.assert_allclose(np.linalg.norm(joint, axis=1), 0.3)
    np.testing.assert_allclose(np.linalg.norm(joint - ends, axis=1), 0.25)


def test_throws_differ_and_are_the_same_with_one_seed() -> None:
    one, again, other = thrown(0, 3, 1)[0], thrown(0, 3, 1)[0], thrown(0, 9, 1)[0]
    np.testing.assert_array_equal(one.imu, again.imu)
    assert one.style.height == other.style.height  # persons take turns
    assert np.linalg.norm(one.velocity - other.velocity) > 0.01


# ------------------------------------------------------------------------------------------------------------ sensors


def test_sensors_read_at_their_rates_late_and_see_no_ball_in_a_hand(caught: tuple[Throw, World]) -> None:
    happens, world = caught
    assert world.entered is not None
    clock, until = FakeClock(), world.entered + 0.2
    for sensor in watches(world, [0]):
        assert isinstance(sensor, Sensor)
        assert sensor.read() == []
        sensor.start(clock)
        clock.advance(max(until - clock.now(), 0))
        samples, kind = sensor.read(), KINDS[sensor.name]
        assert len(samples) == pytest.approx((until - kind.delay) * kind.rate, abs=1.01)
        assert all(b.stamp - a.stamp == pytest.approx(1 / kind.rate) for a, b in pairwise(samples))
        assert all(s.received == pytest.approx(s.stamp + kind.delay) for s in samples)
        assert samples[-1].received <= clock.now() + 1e-9
        if sensor.name == "ball":
            hidden = [s.stamp for s in samples if np.isnan(s.values).all()]
            assert sum(s < happens.release - 0.002 for s in hidden) == pytest.approx(
                happens.release * kind.rate, abs=1.01
            )
            inside = [s for s in samples if s.stamp > world.entered + 0.002]
            assert inside
            assert all(np.isnan(s.values).all() for s in inside)
        if sensor.name == "head":
            np.testing.assert_allclose([np.linalg.norm(s.values) for s in samples], 1.0)


def test_a_sensor_that_falls_silent_says_nothing_more(caught: tuple[Throw, World]) -> None:
    _, world = caught
    clock = FakeClock()
    imu = Watch("imu", world, np.random.default_rng(0), silent=0.5)
    imu.start(clock)
    clock.advance(1.0)
    assert 0.48 < imu.read()[-1].stamp <= 0.5


def test_nothing_is_felt_before_it_happens(caught: tuple[Throw, World]) -> None:
    happens, _ = caught
    i = round(happens.release / motion.STEP)
    later = {name: np.where(np.arange(len(p))[:, None] < i, p, p[i]) for name, p in happens.joints.items()}
    felt = [imu(happens.style, joints) for joints in (happens.joints, later)]
    np.testing.assert_array_equal(felt[0][: i - 3], felt[1][: i - 3])
    assert np.abs(felt[0] - felt[1])[i + 20 :].max() > 1.0


def test_all_that_is_drawn_for_a_throw_is_drawn_from_seeds_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """A seed that ends in 0 draws what the one without it draws, so that two lists that differ may be the same."""
    states, make = [], np.random.default_rng

    def noted(seed: list[int]) -> np.random.Generator:
        states.append(tuple(np.random.SeedSequence(seed).generate_state(4)))
        return make(seed)

    monkeypatch.setattr(np.random, "default_rng", noted)
    demonstrated(0, 0)
    assert len(states) == len(set(states)) >= 2 + len(KINDS)


# ------------------------------------------------------------------------------------------------------- the expert


def test_the_expert_catches_what_it_shows_without_hurry(caught: tuple[Throw, World]) -> None:
    _, world = caught
    assert world.inside
    joints = np.array([moment.joints for moment in world.log])
    assert np.abs(np.diff(joints, axis=0)).max() / (world.log[1].time - world.log[0].time) < 1.05 * VELOCITY


def test_demonstrations_are_whole_and_the_same_with_one_seed() -> None:
    one, _ = demonstrated(3, 4)
    again, _ = demonstrated(3, 4)
    np.testing.assert_array_equal(one.values, again.values)
    assert one.values.shape[1] == len(OBSERVED) + len(JOINTS)
    assert 1.2 < one.duration < 2.2
    ball = np.isfinite(one.values[:, OBSERVED.index("ball_x")])
    assert 0.3 < one.phases[ball][0] < 0.6  # 43 % as in 3.4.1
    assert one.phases[ball][-1] > 0.95
    assert set(MODALITIES) == {"body", "imu", "shoes", "head", "ball"}


# ----------------------------------------------------------------------------------------------------------- the loop


def test_a_robot_that_is_held_on_the_way_is_counted() -> None:
    """By safety, and before the ball has passed: afterwards there is nothing more to be seen."""
    journal = Journal()
    journal.tell(0.0, "safety", "all is well", before="HOLDING", after="RUNNING")
    assert not held_before(2.0, journal)
    journal.tell(1.0, "safety", "nothing is read of the partner", before="RUNNING", after="HOLDING")
    assert held_before(1.1, journal)
    assert not held_before(0.9, journal)


def test_ctrl_c_ends_a_study_in_the_middle_of_a_throw(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is not taken for a wish that the robot stop, whose throw would be counted."""
    session = inphase.fit(gathered({"some": make(0, range(3))}), calibrate=False).session()
    go_on, presses = World.to, iter([False] * 60 + [True])

    def interrupted(self: World, time: float) -> None:
        if next(presses, False):
            raise KeyboardInterrupt
        go_on(self, time)

    monkeypatch.setattr(World, "to", interrupted)
    with pytest.raises(KeyboardInterrupt):
        played(session, 0, "ball alone", 0)


def test_a_robot_that_never_moves_catches_what_falls_into_its_box() -> None:
    caught = unmoved(range(12), 0)["caught"]
    assert 0 < caught.sum() < 12
