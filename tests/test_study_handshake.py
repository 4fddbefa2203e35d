"""The handshake's world: muscles that do the work their air does, air that is kept, people, and demonstrations."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="pip install 'inphase[sim]'")

from experiments.handshake.anatomy import ARMS, SIZES, STILL, contraction
from experiments.handshake.demonstrations import follow
from experiments.handshake.encounter import Encounter, Told
from experiments.handshake.measures import apart, at_end, completion, gone
from experiments.handshake.muscle import AIR, DEAD, MEGA, Pneumatics
from experiments.handshake.partner import STEP, Partner, Style
from experiments.handshake.robot import Arm
from experiments.handshake.sensors import CAMERA_LATE, RATE, Camera
from experiments.handshake.trajectories import start, training
from experiments.handshake.trial import leading

COUNT = len(SIZES.length)


def test_a_muscle_pulls_as_much_as_its_air_works() -> None:
    """F dL = -p dV (Chou and Hannaford): the force is the slope of the volume."""
    short = np.full(COUNT, 0.15)
    small = 1e-6
    slope = (SIZES.volume(short + small) - SIZES.volume(short - small)) / (2 * small * SIZES.length)
    np.testing.assert_allclose(SIZES.pull(short), MEGA * slope, rtol=1e-6)


def test_air_that_cannot_leave_keeps_pressure_times_volume() -> None:
    begun = np.full(COUNT, 0.2)
    air = Pneumatics(SIZES, begun, np.full(COUNT, 0.05))
    air._valve = lambda absolute, dt: np.zeros(COUNT)  # type: ignore[method-assign]
    for share in np.linspace(0.05, 0.2, 100):
        air.step(np.full(COUNT, share), 0.002)
    before, after = SIZES.volume(np.full(COUNT, 0.05)) + DEAD, SIZES.volume(np.full(COUNT, 0.2)) + DEAD
    np.testing.assert_allclose((air.pressure + AIR) * after, (begun + AIR) * before, rtol=1e-9)


def test_a_muscle_that_is_stretched_to_its_threads_keeps_room_for_its_air() -> None:
    """A cylinder has no negative volume: further than its threads are long, nothing of it changes."""
    volume = np.array([SIZES.volume(np.full(COUNT, short)) for short in np.linspace(0.1, -0.4, 51)])
    assert (volume > 0).all()
    assert (np.diff(volume, axis=0) <= 0).all()


def test_the_valves_reach_what_they_are_told_and_not_at_once() -> None:
    held = np.full(COUNT, 0.1)
    air = Pneumatics(SIZES, np.full(COUNT, 0.2), held)
    air.reference = np.full(COUNT, 0.4)
    air.step(held, 0.002)
    assert (np.abs(air.pressure - 0.2) < 0.01).all()
    for _ in range(1500):
        air.step(held, 0.002)
    assert (np.abs(air.pressure - 0.4) < 0.01).all()


def test_a_muscle_pulls_more_while_it_lengthens_than_while_it_shortens() -> None:
    """Hysteresis: at the same pressure and length, whatever the speed."""
    forces = []
    for way in (np.linspace(0.05, 0.12, 400), np.linspace(0.19, 0.12, 400)):
        air = Pneumatics(SIZES, np.full(COUNT, 0.3), np.full(COUNT, way[0]))
        air._valve = lambda absolute, dt: np.zeros(COUNT)  # type: ignore[method-assign]
        for share in way:
            air.pressure = np.full(COUNT, 0.3)
            force = air.step(np.full(COUNT, share), 0.002)
        forces.append(force / (air.pressure * SIZES.pull(np.full(COUNT, 0.12))))
    assert (forces[1] > 1.05 * forces[0]).all()


def test_the_simulation_has_the_lengths_that_the_muscles_have() -> None:
    arm = Arm(start())
    arm.data.qpos[arm.joints] = np.linspace(-0.3, 0.4, len(arm.joints))
    import mujoco

    mujoco.mj_forward(arm.model, arm.data)
    lengths = np.array([arm.data.actuator(i).length[0] for i in arm.motors])
    np.testing.assert_allclose(lengths, ARMS @ arm.angles, atol=1e-12)  # gear -1: what it has contracted
    np.testing.assert_allclose(contraction(arm.angles), 0.12 + lengths / SIZES.length, atol=1e-12)


def test_the_arm_hangs_still_and_its_muscles_carry_it() -> None:
    """Once it has settled, muscles, limits and dry friction together balance gravity."""
    arm = Arm(start())
    arm.settle(6.0)
    dofs = [arm.model.joint(i).dofadr[0] for i in range(len(arm.joints))]
    data = arm.data
    assert np.abs(data.qvel[dofs]).max() < 0.05
    left = data.qfrc_actuator + data.qfrc_constraint + data.qfrc_passive - data.qfrc_bias
    assert np.abs(left[dofs]).max() < 0.5
    assert np.abs(data.qfrc_actuator[dofs]).max() > 2.0


def test_the_same_pressures_leave_the_arm_at_different_places() -> None:
    """It depends on whence it came: up from hanging, or down from above."""
    places = []
    for through in (training()[8].start, training()[10].end):
        arm = Arm(start())
        for reference in (through, training()[8].end):
            arm.air.reference = reference
            for _ in range(1500):
                arm.step()
        places.append(arm.hand)
    assert 0.005 < np.linalg.norm(places[0] - places[1]) < 0.15


def test_a_camera_is_late_and_sees_nothing_where_it_has_lost_the_hand() -> None:
    camera, seen, true = Camera(np.random.default_rng(3)), [], []
    steps = round(1 / RATE / STEP * 2000)
    read = 0
    for i in range(steps):
        camera.watch(np.full(3, 0.5 * i * STEP))
        if i * STEP * RATE >= read:
            seen.append(camera.read())
            true.append(0.5 * i * STEP)
            read += 1
    error = np.array(seen)[50:] - np.array(true)[50:, None]
    assert 0.005 < np.isnan(error[:, 0]).mean() < 0.08
    np.testing.assert_allclose(np.nanmean(error), -0.5 * CAMERA_LATE, atol=0.012)


def test_who_leads_reaches_their_own_place_in_a_bell_of_speed() -> None:
    """Without tremor: the least jerk of Flash and Hogan, whose greatest speed is 1.875 of the mean, half way."""
    ends = np.random.default_rng(0).normal([0.5, -0.1, 1.0], 0.1, (50, 3))
    partner, _ = leading(4, "normal", 0, ends, 0)
    object.__setattr__(partner.style, "tremor", 0.0)
    object.__setattr__(partner.style, "sway", 0.0)
    partner._sway = np.zeros(3)
    places = np.array([partner.step(i * STEP, np.zeros(3), np.ones(3)) for i in range(600)])
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / STEP
    way, takes = np.linalg.norm(places[-1] - places[0]), partner.arrives - partner.began
    np.testing.assert_allclose(speed.max(), 1.875 * way / takes, rtol=0.02)
    np.testing.assert_allclose(np.argmax(speed) * STEP, partner.began + takes / 2, atol=0.03)


@pytest.fixture(scope="module")
def met() -> Told:
    return follow(1, training()[5], (9, 9), 0)[1]


def test_a_demonstration_ends_hand_in_hand(met: Told) -> None:
    assert apart(met.truth)[0] > 0.5
    assert at_end(met.truth) < 0.05
    assert met.read.shape == (301, 30)
    np.testing.assert_allclose(met.times, np.arange(301) / RATE, atol=0.002)


def test_muscles_that_are_never_commanded_hardly_change(met: Told) -> None:
    moved = np.ptp(met.read[:, 3:], axis=0)
    assert moved[STILL].max() < 0.03 < 0.1 < moved[~STILL].max()


def test_the_same_seed_is_the_same_encounter_and_another_is_not(met: Told) -> None:
    again, other = follow(1, training()[5], (9, 9), 0)[1], follow(1, training()[5], (9, 9), 1)[1]
    np.testing.assert_array_equal(again.read, met.read)
    assert np.nanmax(np.abs(other.truth - met.truth)) > 0.01


def test_a_still_partner_stays_where_they_are() -> None:
    rng = np.random.default_rng(5)
    encounter = Encounter(Partner(Style.of(6, 0, False), rng, still=True), rng)
    encounter.until(3.0, training()[0].at)
    truth = encounter.told.truth
    assert np.linalg.norm(truth[:, 3:] - truth[0, 3:], axis=1).max() < 0.05
    assert np.linalg.norm(truth[-1, :3] - truth[0, :3]) > 0.1


def test_completion_is_when_the_last_channel_comes_to_rest() -> None:
    """A step at 3 s is in all windows that begin before it."""
    read = np.zeros((301, 30))
    read[91:, 0] = 0.5
    assert completion(read) == pytest.approx(91 / RATE / 10, abs=0.004)
    assert completion(np.zeros((301, 30))) == 0
    read[:, 7] = 0.2 * np.sin(np.arange(301))
    assert completion(read) == 1


def test_how_much_of_the_way_is_gone_is_of_the_way_and_not_of_the_axes() -> None:
    """A reach of three seconds at one speed, begun after one: so much of it after so much time."""
    share = np.clip(np.arange(301) / 30 - 1, 0, 3)[:, None] / 3
    hand = np.array([0.9, -0.2, 1.1]) + share * [-0.4, 0.3, 0.0]
    assert [gone(hand, part) for part in (0.1, 0.5, 0.9)] == pytest.approx([1.3, 2.5, 3.7], abs=1 / 30)
