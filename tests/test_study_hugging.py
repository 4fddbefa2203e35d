"""The hugging study: bodies obey physics, sensors are what they say, the retargeting converges, hugs are hugs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra [sim] needs Python 3.11")

import mujoco

import inphase
from experiments.hugging import camera, pads
from experiments.hugging.demonstrations import CONTROLLED, people, significant, taught
from experiments.hugging.hug import OBSERVED, Arms
from experiments.hugging.person import Body
from experiments.hugging.retarget import WANTED, Retargeting
from experiments.hugging.showing import partner_alone, partner_now
from experiments.hugging.success import judge
from experiments.hugging.world import FASTEST, REST, world


@pytest.fixture(scope="module")
def room():
    return world(Body())


@pytest.fixture(scope="module")
def made():
    """A hug each of three who teach."""
    return [taught(number, 0) for number in range(3)]


def test_the_arm_is_the_panda_of_its_published_parameters(room):
    """Denavit and Hartenberg after Craig, multiplied out here, against the simulator's kinematics."""
    rows = [  # a, d, alpha
        (0, 0.333, 0),
        (0, 0, -np.pi / 2),
        (0, 0.316, np.pi / 2),
        (0.0825, 0, np.pi / 2),
        (-0.0825, 0.384, -np.pi / 2),
        (0, 0, np.pi / 2),
        (0.088, 0, np.pi / 2),
    ]
    rng, data = np.random.default_rng(0), room.begin()
    for _ in range(5):
        angles = [rng.uniform(*room.model.joint(f"left_{i}").range) for i in range(1, 8)]
        frame = np.eye(4)
        for i, ((a, d, alpha), q) in enumerate(zip(rows, angles, strict=True), 1):
            data.joint(f"left_{i}").qpos = q
            c, s, ca, sa = np.cos(q), np.sin(q), np.cos(alpha), np.sin(alpha)
            step = [[c, -s, 0, a], [s * ca, c * ca, -sa, -d * sa], [s * sa, c * sa, ca, d * ca], [0, 0, 0, 1]]
            frame = frame @ np.array(step)
        mujoco.mj_kinematics(room.model, data)
        base = data.body("left_base")
        place = base.xpos + base.xmat.reshape(3, 3) @ frame[:3, 3]
        np.testing.assert_allclose(data.body("left_link7").xpos, place, atol=1e-9)


def test_arms_at_rest_are_carried_by_their_motors(room):
    data = room.begin()
    for _ in range(60):
        room.run(data)
    for side in ("left", "right"):
        np.testing.assert_allclose([data.joint(f"{side}_{i}").qpos[0] for i in range(1, 8)], REST[side], atol=1e-3)
    # Gravity is carried by the motors, whose torque has limits, and by nothing else.
    pulled = np.array([data.joint(f"left_{i}").qfrc_actuator[0] for i in range(1, 8)])
    weighs = np.array([data.joint(f"left_{i}").qfrc_bias[0] for i in range(1, 8)])
    assert np.abs(weighs).max() > 2
    np.testing.assert_allclose(pulled, weighs, atol=0.1)
    data.actuator("left_5").ctrl = data.joint("left_5").qpos[0] + 2.0
    room.run(data)
    assert abs(data.joint("left_5").qfrc_actuator[0]) <= 12


def test_sixty_one_pads_share_what_presses(room):
    """A contact near sensors is felt whole, and by the body's own sensors alone."""
    assert len(pads.NAMES) == 61 == sum(pads.GROUPS.values())
    assert {count for group, count in pads.GROUPS.items() if group in pads.ARMS} == {4, 5}
    sensors, data = pads.Pads.of(room), room.begin()
    data.joint("person_forward").qpos = 1.80  # into the chest
    mujoco.mj_forward(room.model, data)
    torso = {geom: body for geom, body in sensors.geoms.items() if body == room.model.body("torso").id}
    pressed = sum(force for _, _, force in pads.contacts(room, data, torso))
    felt = sensors.forces(room, data)
    chest = [pads.NAMES.index(name) for group in pads.CHEST for name in pads.SENSORS[group]]
    assert pressed > 10
    assert 0.3 * pressed < felt[chest].sum() <= pressed * (1 + 1e-9)  # what is far from all of them is felt in part
    assert felt.sum() == pytest.approx(felt[chest].sum() + felt[-13:].sum())
    raw = sensors.read(felt, data, np.random.default_rng(0))
    assert raw.min() >= 0
    assert raw.max() <= 255
    assert (raw == np.round(raw)).all()


def test_sensors_lie_on_the_padding_in_pairs(room):
    """Left and right mirror each other, but for the one that the right side of the back has more, as in Fig. 26."""
    sensors, half = pads.Pads.of(room), room.model.geom("torso").size
    where = {name: sensors.places[i] for i, name in enumerate(pads.NAMES)}
    for groups, front in ((pads.CHEST, 1), (pads.BACK, -1)):
        for group in groups:
            for name in pads.SENSORS[group]:
                place, other = where[name], name.replace("left", "right")
                assert place[0] == pytest.approx(front * half[0])
                assert (np.abs(place[1:]) < half[1:]).all()
                np.testing.assert_allclose(where[other], place * [1, -1 if other != name else 1, 1])


def test_what_is_shown_live_is_what_was_learned(made):
    """A row of a taught hug is the same to the model, whether it comes from the data set or from the sensors now."""
    one = made[0]
    shown = partner_alone(inphase.Dataset.from_arrays([one.times], [one.values], OBSERVED, CONTROLLED)).dataset
    for i in range(0, len(one.times), 20):
        now = partner_now(dict(zip(OBSERVED, one.read[i].tolist(), strict=True)))
        assert tuple(now) == shown.observed
        np.testing.assert_allclose(list(now.values()), shown[0].values[i, : len(now)])
    group = [OBSERVED.index(name) for name in pads.SENSORS["back_left_high"]]
    largest = shown[0].values[:, shown.observed.index("group_back_left_high")]
    np.testing.assert_allclose(np.exp(largest) - 1, one.read[:, group].max(1))


def test_the_robots_push_is_the_partners_push(room):
    """Newton's third law, through the model of contacts: what the chest feels is what moves the person."""
    data = room.begin()
    data.joint("person_forward").qpos = 1.80
    for actuator in ("forward", "lean"):
        data.actuator(f"person_{actuator}").ctrl = 1.80 if actuator == "forward" else 0.0
    for _ in range(240):
        room.run(data)
    spring = -float(data.actuator("person_forward").force[0])
    sense = Arms(room, pads.Pads.of(room))
    _, _, together = sense.on_partner(data)
    assert together > 10
    assert -spring == pytest.approx(together, rel=0.05)


@pytest.mark.parametrize("stiffness", [200.0, 1000.0, 5000.0])
def test_contact_becomes_as_strong_as_it_is_wanted(stiffness):
    """A wall at half of what can be changed, in raw units per metre; the sensor is a period late."""
    retargeting, inward, wanted = Retargeting(1), np.array([[0.4]]), np.array([80.0])
    felt, place = np.zeros(1), 0.0
    for _ in range(600):
        place = 0.4 * retargeting.step(wanted, felt, inward, 1 / 60)[0]
        felt = np.array([max(0.0, stiffness * (place - 0.05))])
    reachable = min(80.0, stiffness * (0.4 * retargeting.most - 0.05))
    assert felt[0] == pytest.approx(reachable, abs=2.0)


def test_where_nothing_is_touched_the_change_is_bounded_and_is_forgotten():
    retargeting, inward = Retargeting(3), np.array([[0.4, -0.2, 0.0]])
    for _ in range(2000):
        change = retargeting.step(np.array([200.0]), np.zeros(1), inward, 1 / 60)
    np.testing.assert_allclose(change, [retargeting.most, -retargeting.most, 0.0])
    for _ in range(180):
        change = retargeting.step(np.array([WANTED / 2]), np.zeros(1), inward, 1 / 60)
    assert np.abs(change).max() < 0.01


def test_too_strong_a_contact_gives_way():
    retargeting, inward = Retargeting(1), np.array([[0.4]])
    assert retargeting.step(np.zeros(1), np.array([90.0]), inward, 1 / 60)[0] < 0


def test_the_camera_sees_what_is_not_hidden(room):
    pose, data = camera.Pose(room, np.random.default_rng(0)), room.begin()
    assert not pose.hidden(data).any()
    near = pose.project(data)
    data.joint("person_forward").qpos = 1.5
    mujoco.mj_forward(room.model, data)
    far = pose.project(data)
    assert (far[:, 1] < near[:, 1]).all()  # whoever goes away goes up in the picture
    for name in ("left_swing", "right_swing"):
        data.joint(f"person_{name}").qpos = 0.3
        data.joint(f"person_{name.replace('swing', 'bend')}").qpos = 1.5
        data.joint(f"person_{name.replace('swing', 'twist')}").qpos = -1.0
    mujoco.mj_forward(room.model, data)
    hidden = dict(zip(camera.POINTS, pose.hidden(data), strict=True))
    assert hidden["left_wrist"]
    assert hidden["right_wrist"]
    assert not hidden["neck"]
    frames = [pose.frame(data) for _ in range(30)]
    assert np.abs(np.nanmean([frame[:2] for frame in frames[2:]], axis=0)).max() < 15  # from the first neck
    assert np.isnan(frames[0]).all()
    assert np.isnan(frames[1]).all()
    assert np.isnan(frames[9][2 * camera.POINTS.index("left_wrist")])


def test_hugs_that_are_taught_succeed(made):
    for one in made:
        assert significant(one)
        asked = judge(one)
        assert all(asked.values()), asked
        assert one.values.shape[1] == len(OBSERVED) + len(CONTROLLED) == 14 + 61 + 12 + 8
        np.testing.assert_allclose(np.diff(one.times), 1 / 30, atol=1e-9)
        speed = np.abs(np.diff(one.commanded, axis=0)) * 30
        assert (speed <= np.tile(FASTEST, 2) * (1 + 1e-9)).all()


def test_who_does_not_let_go_or_hold_has_not_succeeded(made):
    one = made[0]
    assert not judge(replace(one, holding=one.holding + 10))["lets go"]
    assert not judge(replace(one, pressing=np.zeros_like(one.pressing)))["holds"]
    assert not judge(replace(one, pressing=one.pressing + 160))["gentle"]
    away = replace(one, visit=one.visit.stilled(kind="nothing"))
    assert not judge(away)["does not hug"]


def test_the_same_seed_is_the_same_hug(made):
    again, other = taught(0, 0), taught(0, 1)
    np.testing.assert_array_equal(again.values, made[0].values)
    assert other.values.shape != again.values.shape or not np.array_equal(other.values, again.values, equal_nan=True)
    assert len({person.body for person in people(0)}) == 6
