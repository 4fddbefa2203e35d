"""The cooperation study's world: bodies, forces, sensors and demonstrations that obey their laws."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("mink")

import mujoco

from experiments.bodies.person import SHARES
from experiments.cooperation import demonstrations
from experiments.cooperation.demonstrations import distorted, without
from experiments.cooperation.guide import RATE, frame, led
from experiments.cooperation.people import Track, someone
from experiments.cooperation.plan import plan
from experiments.cooperation.posture import posture, weight_middle
from experiments.cooperation.sensors import CONTROLLED, OBSERVED, TICK, TRACKED, Moment, Sensors, hidden
from experiments.cooperation.tasks import WORN
from experiments.cooperation.trial import Hand, Trial, demonstrated
from experiments.cooperation.world import HANDOVER, LIFT, STEP, Place, World
from experiments.study import Settings
from inphase.trajectory import Demonstration

FEET = np.array([[0.0, -0.12, 0.0], [0.0, 0.12, 0.0]])
HANGING = np.array([[0.07, -0.25, 0.80], [0.07, 0.25, 0.80]])
PLAIN = replace(
    someone(0, 0),
    mounts=np.stack([np.eye(3)] * 2),
    electrodes=np.ones((2, 4, 3)),
    soles=np.ones((2, 4)),
)


@pytest.fixture(scope="module", params=[HANDOVER, LIFT], ids=lambda place: place.name)
def shown(request: pytest.FixtureRequest) -> tuple[Place, Trial]:
    return request.param, demonstrated(plan(request.param, 0, 3), np.random.default_rng(0))


def standing(palms: np.ndarray = HANGING) -> dict[str, np.ndarray]:
    return posture(PLAIN.height, 0.5, np.zeros(2), FEET, palms, ease=0.06)


def moment(joints: dict[str, np.ndarray], load: np.ndarray | None = None) -> Moment:
    nothing = np.zeros((2, 3))
    return Moment(joints, nothing if load is None else load, np.zeros(2), np.zeros(2), np.zeros(len(TRACKED), bool))


def columns(pattern: str) -> list[int]:
    return [i for i, name in enumerate(OBSERVED) if pattern in name]


def test_there_are_74_channels():
    assert len(set(OBSERVED + CONTROLLED)) == 74


# --------------------------------------------------------------------------------------------------------- bodies


@pytest.mark.parametrize("reach", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("back", [0.3, 0.9])
def test_limbs_keep_their_lengths_and_palms_are_where_they_are_to_be(reach, back):
    palms = np.array([[reach, -0.2, 0.9], [0.1, 0.25, 0.8]])
    joints, h = posture(1.75, back, np.zeros(2), FEET, palms), 1.75
    for i, side in enumerate(("right", "left")):
        for begin, end, part in (("shoulder", "elbow", "upper_arm"), ("elbow", "wrist", "forearm")):
            length = np.linalg.norm(joints[f"{side}_{end}"] - joints[f"{side}_{begin}"])
            assert length == pytest.approx(SHARES[part] * h, abs=1e-6)
        forearm = joints[f"{side}_wrist"] - joints[f"{side}_elbow"]
        palm = joints[f"{side}_wrist"] + forearm / np.linalg.norm(forearm) * SHARES["hand"] * h
        assert palm == pytest.approx(palms[i], abs=1e-6)
        thigh = np.linalg.norm(joints[f"{side}_knee"] - joints[f"{side}_hip"])
        assert thigh == pytest.approx(SHARES["thigh"] * h, abs=1e-6)


def test_who_bends_with_the_knees_is_lower_and_more_upright():
    low = np.array([[0.45, -0.3, 0.5], [0.45, 0.3, 0.5]])
    knees, back = (posture(1.75, share, np.zeros(2), FEET, low) for share in (0.2, 0.95))
    assert knees["right_hip"][2] < back["right_hip"][2] - 0.05
    ahead = [joints["neck"][0] - joints["right_hip"][0] for joints in (knees, back)]
    assert ahead[0] < ahead[1] - 0.05


@pytest.mark.parametrize("place", [HANDOVER, LIFT], ids=lambda place: place.name)
def test_nothing_about_a_body_jerks(place):
    acted = plan(place, 0, 3)
    times = np.arange(0.0, acted.duration, TICK)
    moved = [
        posture(acted.person.height, acted.back, acted.pelvis(t), acted.feet(t), acted.palms(t), ease=0.06)
        for t in times
    ]
    for name in ("right_wrist", "left_elbow", "neck", "head", "left_knee"):
        pushed = np.diff([joints[name] for joints in moved], 2, axis=0) / TICK**2
        assert np.abs(pushed).max() < 20.0  # [m/s²]


def test_a_track_stands_at_its_points_and_is_half_way_at_half_time():
    track = Track([0.0, 1.0, 3.0], [[0.0], [2.0], [-2.0]])
    assert [track(t)[0] for t in (-1.0, 0.0, 1.0, 2.0, 3.0, 9.0)] == pytest.approx([0, 0, 2, 0, -2, -2])
    assert abs(track(1.001)[0] - track(0.999)[0]) < 1e-7  # at rest there


# --------------------------------------------------------------------------------------------------------- forces


def test_what_falls_falls_as_galilei_says():
    world = World(HANDOVER)
    world.put(np.array([0.6, 0.0, 2.0]))
    for _ in range(120):
        mujoco.mj_step(world.model, world.data)
    assert world.data.xpos[world.thing][2] == pytest.approx(2.0 - 9.81 * (120 * STEP) ** 2 / 2, abs=0.01)


def test_a_hand_that_holds_the_can_carries_its_weight():
    world, hand, palm = World(HANDOVER), Hand(), np.array([0.3, -0.4, 1.2])
    world.put(palm + np.array([0.05, 0.0, 0.0]))
    hand.at, hand.turn = np.array([-0.05, 0.0, 0.0]), np.eye(3)
    for _ in range(1500):
        world.data.qfrc_applied[:] = 0
        force = hand.pull(world, palm, np.zeros(3), alone=True)
        mujoco.mj_step(world.model, world.data)
    assert force == pytest.approx([0, 0, HANDOVER.mass * 9.81], abs=0.05)


def test_the_tool_goes_where_it_is_led():
    way, acted = led(shorter := replace(plan(LIFT, 0, 1), duration=4.0)), World(LIFT)
    for i in range(0, len(way), 60):
        acted.data.qpos[acted.arm] = way[i]
        mujoco.mj_kinematics(acted.model, acted.data)
        *at, pitch = shorter.tool(i / RATE)
        turn = acted.data.site_xmat[acted.pinch].reshape(3, 3)
        assert acted.data.site_xpos[acted.pinch] == pytest.approx(np.array(at), abs=3e-3)
        assert turn == pytest.approx(frame(np.array(at), pitch, LIFT), abs=0.02)


# -------------------------------------------------------------------------------------------------------- sensors


def taken(moments: list[Moment]) -> np.ndarray:
    sensors = Sensors(PLAIN, np.random.default_rng(1))
    return np.array([row for m in moments if (row := sensors.take(m)) is not None])


def test_rows_are_at_30_hz():
    assert len(taken([moment(standing())] * 120)) == 30


def test_shoes_feel_the_weight_and_what_is_carried():
    pull = np.array([[0.0, 0.0, -50.0], [0.0, 0.0, -50.0]])
    alone, loaded = (
        taken([moment(standing(), load)] * 240)[
            10:, columns("heel") + columns("inner") + columns("outer") + columns("toes")
        ]
        .sum(1)
        .mean()
        for load in (None, pull)
    )
    assert alone == pytest.approx(PLAIN.weight * 9.81, rel=0.1)
    assert loaded - alone == pytest.approx(100.0, abs=5.0)


def test_an_imu_at_rest_feels_gravity_and_one_that_turns_its_rate():
    still = taken([moment(standing())] * 120)[5:]
    assert np.linalg.norm(still[:, columns("right_accel")].mean(0)) == pytest.approx(9.81, abs=0.3)
    rate, moments = 1.5, []
    for i in range(120):
        joints, angle = standing(), rate * i * TICK
        for side in ("right", "left"):
            elbow = joints[f"{side}_elbow"]
            joints[f"{side}_wrist"] = elbow + 0.25 * np.array([np.sin(angle), 0.0, -np.cos(angle)])
        moments.append(moment(joints))
    turning = taken(moments)[5:, columns("right_gyro")].mean(0)
    assert np.linalg.norm(turning) == pytest.approx(rate, abs=0.1)


def test_the_camera_is_late():
    before, after = standing(), standing()
    after["head"] = after["head"] + np.array([0.5, 0.0, 0.0])
    rows = taken([moment(before)] * 40 + [moment(after)] * 40)[:, OBSERVED.index("head_x")]
    jumped = int(np.argmax(rows > before["head"][0] + 0.25)) * 4
    assert 40 + 6 <= jumped <= 40 + 6 + 8  # its delay, and at most a picture and a row more


def test_what_is_behind_the_box_is_hidden_and_what_is_above_it_is_seen():
    world = World(LIFT)
    world.put(np.array([0.62, 0.35, 1.1]))
    mujoco.mj_forward(world.model, world.data)
    joints = {name: np.array([0.2, 0.35, 2.2]) for name in TRACKED}
    joints["right_hip"] = np.array([0.2, 0.35, 1.05])
    unseen = hidden(world.model, world.data, joints, LIFT)
    assert [name for name, u in zip(TRACKED, unseen, strict=True) if u] == ["right_hip"]


def test_hidden_joints_are_given_up_or_guessed_badly():
    joints = standing()
    true = np.array([joints[name] for name in TRACKED]).ravel()
    moments = [Moment(joints, np.zeros((2, 3)), np.zeros(2), np.zeros(2), np.arange(13) < 3)] * 1200
    off = taken(moments)[20:, :39] - true
    assert np.isnan(off[:, :9]).any() or np.nanstd(off[:, :9]) > 0.08
    assert np.isfinite(off[:, 9:]).all()
    assert off[:, 9:].std() < 0.02


# -------------------------------------------------------------------------------------------------- demonstrations


def test_demonstrations_end_as_they_are_to(shown):
    place, trial = shown
    assert trial.done
    assert trial.values.shape == (len(trial.times), 74)
    assert np.diff(trial.times) == pytest.approx(1 / 30)
    assert np.isfinite(trial.values[:, 39:]).all()  # only the camera loses anything
    assert trial.hid.max() > (0.5 if place is LIFT else 0.0)


def test_the_same_seed_gives_the_same_bytes():
    short = replace(plan(HANDOVER, 0, 2), duration=0.7)
    first, again, other = (demonstrated(short, np.random.default_rng(seed)).values for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes() != other.tobytes()


def test_middle_of_the_body_is_in_it():
    joints = standing()
    assert abs(weight_middle(joints)[0]) < 0.15
    assert 0.5 < weight_middle(joints)[2] / PLAIN.height < 0.65


@pytest.mark.parametrize("ratio", [0.25, 0.5, 1.5, 4.0])
def test_samples_are_deleted_and_doubled_in_their_order(ratio):
    demonstration = Demonstration(np.arange(80) / 30, np.zeros((80, 2)))
    kept, times = distorted(demonstration, ratio, np.random.default_rng(0))
    assert len(kept) == len(times) == round(80 * ratio)
    assert (np.diff(kept) >= (1 if ratio < 1 else 0)).all()
    assert np.diff(times) == pytest.approx(1 / 30)
    assert ratio < 1 or set(kept) == set(range(80))


@pytest.mark.parametrize(("worn", "read"), [("all", 67), ("skeleton", 39), ("wearables", 28)])
def test_of_what_is_not_worn_nothing_is_read(shown, worn, read):
    """39 channels of the camera's, 28 of what is worn; the robot's own are left as they are."""
    _, trial = shown
    demonstration = Demonstration(trial.times, np.nan_to_num(trial.values))
    left = without(demonstration, WORN[worn]).values
    seen = np.isfinite(left[:, : len(OBSERVED)])
    assert (seen.all(0) == seen.any(0)).all()
    assert seen.all(0).sum() == read
    np.testing.assert_array_equal(left[np.isfinite(left)], demonstration.values[np.isfinite(left)])
    np.testing.assert_array_equal(left[:, len(OBSERVED) :], demonstration.values[:, len(OBSERVED) :])


def test_a_demonstration_that_is_not_done_is_made_anew(monkeypatch):
    """With another plan; else one trial would be missing, and others be taken for it."""
    whole, plans = demonstrations.demonstrated, []

    def fails_first(plan, rng):
        plans.append(plan)
        return replace(whole(plan, rng), done=len(plans) > 1)

    monkeypatch.setattr(demonstrations, "demonstrated", fails_first)
    found = demonstrations.record(Settings(True, 0, Path()), "lift", [3])
    assert (int(found["tried3"]), len(plans)) == (1, 2)
    assert not np.array_equal(plans[0].thing, plans[1].thing)
