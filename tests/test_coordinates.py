"""Laws of channels and features: an angle or orientation is what it is, however it is written."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from inphase.channels import make_channels
from inphase.errors import OptionError
from inphase.preprocess.coordinates import Coordinates
from inphase.preprocess.quaternion import average, jacobian, nearest, turned

TAU = 2 * np.pi
NONE = [0.0, 0.0, 0.0, 1.0]  # no rotation


def channels_of(parts):
    """Channels p0, p1, ... of these kinds; a quaternion has four."""
    names = [[f"p{i}"] if kind != "quaternion" else [f"p{i}_q{a}" for a in "xyzw"] for i, kind in enumerate(parts)]
    kinds = {name: kind for group, kind in zip(names, parts, strict=True) for name in group}
    return make_channels([name for group in names for name in group], [], kinds=kinds)


def columns_of(parts):
    """The columns of every part."""
    ends = np.cumsum([4 if kind == "quaternion" else 1 for kind in parts])
    return [list(range(end - (4 if kind == "quaternion" else 1), end)) for kind, end in zip(parts, ends, strict=True)]


def features_of(parts):
    ends = np.cumsum([3 if kind == "quaternion" else 1 for kind in parts])
    return [list(range(end - (3 if kind == "quaternion" else 1), end)) for kind, end in zip(parts, ends, strict=True)]


@dataclass
class Case:
    parts: list[str]
    values: list[np.ndarray]
    rng: np.random.Generator

    @property
    def channels(self):
        # Not made while hypothesis draws: beartype picks what it checks at random, which hypothesis forbids there.
        return channels_of(self.parts)


@st.composite
def recordings(draw, step=1.0):
    """Trajectories of a mixture of kinds that start near each other and go less than `step` [rad] a sample."""
    parts = draw(st.lists(st.sampled_from(["linear", "angle", "quaternion"]), min_size=1, max_size=3))
    lengths = draw(st.lists(st.integers(1, 8), min_size=1, max_size=3))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    size = step / 2
    centre = Rotation.random(rng=rng)
    values = []
    for length in lengths:
        blocks = []
        for kind in parts:
            if kind == "linear":
                block = rng.normal(size=(length, 1)) * 10.0 ** rng.integers(-3, 4)
            elif kind == "angle":
                block = 2.5 + np.cumsum(rng.uniform(-size, size, (length, 1)), axis=0)
            else:
                steps = Rotation.from_rotvec(rng.uniform(-size / 2, size / 2, (length, 3)))
                q, path = centre, []
                for turn in steps:
                    q = q * turn
                    path.append(q.as_quat())
                block = np.array(path)
            blocks.append(block)
        values.append(np.concatenate(blocks, axis=1))
    return Case(parts, values, rng)


def quaternion_columns(case):
    return [columns for kind, columns in zip(case.parts, columns_of(case.parts), strict=True) if kind == "quaternion"]


def angle_columns(case):
    return [columns[0] for kind, columns in zip(case.parts, columns_of(case.parts), strict=True) if kind == "angle"]


@settings(max_examples=40)
@given(recordings())
def test_there_and_back_again(case):
    coordinates = Coordinates.learn(case.channels, case.values)
    for values in case.values:
        features = coordinates.from_channels(values)
        back, var = coordinates.to_channels(features, np.zeros_like(features))
        expected = values.copy()
        for xyzw in quaternion_columns(case):
            # One sign along the way, the one of the reference at the start.
            side = np.sign(expected[0, xyzw] @ coordinates.references[xyzw])
            aligned = np.cumprod(np.sign(np.r_[side, (expected[1:, xyzw] * expected[:-1, xyzw]).sum(axis=1)]))
            expected[:, xyzw] *= aligned[:, None]
        assert_allclose(back, expected, rtol=1e-12, atol=1e-12)
        assert_array_equal(var, 0)


@settings(max_examples=40)
@given(recordings())
def test_the_sign_of_a_quaternion_means_nothing(case):
    flipped = [v.copy() for v in case.values]
    for xyzw in quaternion_columns(case):
        for v in flipped:
            v[:, xyzw] *= case.rng.choice([-1.0, 1.0], (len(v), 1))
    one, other = (Coordinates.learn(case.channels, values) for values in (case.values, flipped))
    assert_array_equal(one.references, other.references)
    for a, b in zip(case.values, flipped, strict=True):
        assert_array_equal(one.from_channels(a), other.from_channels(b))
        near = case.rng.normal(size=one.count)
        assert_array_equal(one.sample(a[0], near), other.sample(b[0], near))


def test_the_sign_means_nothing_even_half_a_turn_away():
    coordinates = Coordinates(channels_of(["quaternion"]), np.array(NONE))
    for q in ([1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, -0.6, 0.8, 0]):
        one, other = (coordinates.from_channels(np.array([sign * np.array(q)])) for sign in (1, -1))
        assert_array_equal(one, other)
        assert np.linalg.norm(one) == pytest.approx(np.pi)


@settings(max_examples=40)
@given(recordings())
def test_whole_turns_of_an_angle_mean_nothing(case):
    shifted = [v.copy() for v in case.values]
    for i in angle_columns(case):
        for v in shifted:
            v[:, i] += TAU * case.rng.integers(-3, 4, len(v))
    one, other = (Coordinates.learn(case.channels, values) for values in (case.values, shifted))
    for a, b in zip(case.values, shifted, strict=True):
        assert_allclose(one.from_channels(a), other.from_channels(b), atol=1e-12)


@settings(max_examples=40)
@given(recordings(step=0.1))
def test_what_is_missing_is_missing_and_changes_nothing_else(case):
    coordinates = Coordinates.learn(case.channels, case.values)
    for values in case.values:
        holes = values.copy()
        holes[case.rng.random(values.shape) < 0.4] = np.nan
        if len(values) > 2:
            for xyzw in quaternion_columns(case):
                holes[1, xyzw] = 0.0  # what a tracker writes that has lost its target
        untouched = holes.copy()
        expected = coordinates.from_channels(values)
        for columns, features in zip(columns_of(case.parts), features_of(case.parts), strict=True):
            lost = np.isnan(holes[:, columns]).any(axis=1) | (len(columns) == 4) & (holes[:, columns] == 0).all(axis=1)
            expected[np.ix_(lost, features)] = np.nan
        found = coordinates.from_channels(holes)
        assert_allclose(found, expected, atol=1e-12)
        assert_array_equal(holes, untouched)
        back = coordinates.to_channels(found, np.zeros_like(found))[0]
        for columns, features in zip(columns_of(case.parts), features_of(case.parts), strict=True):
            gone = np.isnan(expected[:, features[:1]]).repeat(len(columns), axis=1)
            assert_array_equal(np.isnan(back[:, columns]), gone)
    learned = Coordinates.learn(case.channels, [np.full_like(v, np.nan) for v in case.values])
    neutral = np.concatenate([NONE if kind == "quaternion" else [0.0] for kind in case.parts])
    assert_array_equal(learned.references, neutral)
    assert_array_equal(Coordinates.learn(case.channels, []).references, neutral)


@settings(max_examples=40)
@given(recordings(), st.floats(0, 0.5))
def test_live_samples_read_as_the_whole_trajectory_does(case, missing):
    coordinates = Coordinates.learn(case.channels, case.values)
    for values in case.values:
        values = values.copy()
        values[case.rng.random(values.shape) < missing] = np.nan
        near = np.zeros(coordinates.count)
        for sample, expected in zip(values, coordinates.from_channels(values), strict=True):
            found = coordinates.sample(sample, near)
            assert_allclose(found, expected, atol=1e-12)
            near = np.where(np.isnan(found), near, found)


def spin(turns, samples=200):
    """An angle and a rotation about a skew axis that go through several turns, written as a sensor would."""
    angle = np.linspace(0.0, turns * TAU, samples)
    axis = np.array([1.0, -2.0, 2.0]) / 3
    start = Rotation.from_rotvec([0.4, 0.3, -1.0])
    written = (start * Rotation.from_rotvec(angle[:, None] * axis)).as_quat(canonical=True)
    values = np.column_stack([np.angle(np.exp(1j * angle)), written])
    return Coordinates(channels_of(["angle", "quaternion"]), np.r_[0.0, start.as_quat()]), values, angle, axis


@pytest.mark.parametrize(("turns", "first"), [(0.9, 0), (-0.9, 0), (2.3, 0), (-3.4, 0), (0.6, 165), (-0.6, 165)])
def test_angles_and_rotations_go_on_through_several_turns(turns, first):
    coordinates, values, angle, axis = spin(turns)
    # From `first` on: the seam may lie between the first two samples.
    values, angle = values[first:], angle[first:]
    expected = np.column_stack([angle, angle[:, None] * axis])
    assert_allclose(coordinates.from_channels(values), expected, atol=1e-12)
    live = [coordinates.sample(values[i], expected[max(i - 1, 0)]) for i in range(len(values))]
    assert_allclose(live, expected, atol=1e-12)
    back, _ = coordinates.to_channels(expected, expected)
    assert (np.abs(np.diff(back, axis=0)) < 0.5).all()
    assert_allclose(np.linalg.norm(back[:, 1:], axis=1), 1)
    assert back[0, 1:] @ coordinates.references[1:] > 0
    late, _ = coordinates.to_channels(expected[-1:], expected[-1:])
    assert late[0, 1:] @ coordinates.references[1:] >= 0


@given(st.integers(0, 2**32 - 1), st.integers(-3, 3))
def test_the_branch_nearest_to_the_prediction_is_taken(seed, turns):
    rng = np.random.default_rng(seed)
    vector = rng.normal(size=3)
    vector *= rng.uniform(0.01, np.pi) / np.linalg.norm(vector)
    axis = vector / np.linalg.norm(vector)
    near = vector + turns * TAU * axis + rng.normal(size=3)
    candidates = [vector + k * TAU * axis for k in range(-8, 9)]
    best = min(candidates, key=lambda candidate: np.linalg.norm(candidate - near))
    assert_allclose(nearest(vector[None], near[None])[0], best, atol=1e-12)
    # Without any rotation the nearest are whole turns about the axis of the prediction.
    still = nearest(np.zeros((1, 3)), near[None])[0]
    length = np.linalg.norm(near)
    assert_allclose(still, near / length * TAU * np.round(length / TAU), atol=1e-12)
    assert_array_equal(nearest(np.zeros((1, 3)), np.zeros((1, 3))), 0)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_a_rotation_vector_is_the_logarithm_of_the_rotation_from_the_reference(seed):
    rng = np.random.default_rng(seed)
    reference, other = Rotation.random(2, rng=rng)
    coordinates = Coordinates(channels_of(["quaternion"]), reference.as_quat())
    x, y, z = coordinates.from_channels(other.as_quat()[None])[0]
    assert x * x + y * y + z * z <= np.pi**2 + 1e-9
    turn = expm(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]))
    assert_allclose(reference.as_matrix() @ turn, other.as_matrix(), atol=1e-12)


@settings(max_examples=40)
@given(recordings(step=0.3), st.integers(0, 2**32 - 1))
def test_turning_the_world_turns_no_feature(case, seed):
    world = Rotation.random(rng=np.random.default_rng(seed))
    rotated = [v.copy() for v in case.values]
    for xyzw in quaternion_columns(case):
        for v in rotated:
            v[:, xyzw] = (world * Rotation.from_quat(v[:, xyzw])).as_quat()
    one, other = (Coordinates.learn(case.channels, values) for values in (case.values, rotated))
    a, b = (
        np.concatenate([coordinates.from_channels(v) for v in values])
        for coordinates, values in ((one, case.values), (other, rotated))
    )
    for features in features_of(case.parts):
        distances = [np.linalg.norm(f[:, None, features] - f[None, :, features], axis=2) for f in (a, b)]
        assert_allclose(*distances, atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-9, 1e-3, 1.0, 3.0, 5.0, 9.0]))
def test_jacobian_is_the_central_difference(seed, length):
    rng = np.random.default_rng(seed)
    reference = Rotation.random(rng=rng).as_quat()
    vector = rng.normal(size=3)
    vector *= length / np.linalg.norm(vector)
    step = 1e-5
    nearby = np.concatenate([[vector], *([vector + step * e, vector - step * e] for e in np.eye(3))])
    path = turned(nearby, reference)
    path *= np.sign(path[0] @ (Rotation.from_quat(reference) * Rotation.from_rotvec(vector)).as_quat())
    slopes = (path[1::2] - path[2::2]).T / (2 * step)
    found = jacobian(vector[None], reference)[0]
    assert_allclose(found if np.sum(found * slopes) > 0 else -found, slopes, atol=1e-9)


def test_variance_is_that_of_sampled_orientations(rng):
    reference = Rotation.random(rng=rng)
    coordinates = Coordinates(channels_of(["linear", "angle", "quaternion"]), np.r_[0.0, 2.0, reference.as_quat()])
    mean, std = np.array([[5.0, -1.0, 0.7, -1.1, 0.5]]), np.array([[3.0, 0.2, 0.01, 0.03, 0.02]])
    centre, var = coordinates.to_channels(mean, std**2)
    samples = mean + std * rng.normal(size=(100_000, 5))
    drawn = (reference * Rotation.from_rotvec(samples[:, 2:])).as_quat()
    drawn *= np.sign(drawn @ centre[0, 2:])[:, None]
    spread = np.column_stack([samples[:, 0], samples[:, 1], drawn]).var(axis=0)
    # The variance of N samples is off by a factor 1 ± sqrt(2 / N); five of these.
    assert_allclose(var[0], spread, rtol=5 * np.sqrt(2 / 100_000))
    assert_allclose(centre[0, :2], [5.0, 1.0])


def test_references_are_the_mean_angle_and_orientation(rng):
    channels = channels_of(["angle", "quaternion"])
    axis = np.array([0.0, 0.6, 0.8])
    base = Rotation.from_rotvec([1.0, 0, 0])
    swing = np.array([-0.3, -0.1, 0.1, 0.3])
    written = (base * Rotation.from_rotvec(swing[:, None] * axis)).as_quat()
    values = np.column_stack([np.angle(np.exp(1j * (np.pi + swing))), written])  # across the seam at ±π
    found = Coordinates.learn(channels, [values[:2], values[2:]]).references
    assert abs(np.exp(1j * found[0]) + 1) < 1e-12
    assert_allclose(found[1:], base.as_quat() * np.sign(base.as_quat()[3]), atol=1e-12)
    for turn in Rotation.random(20, rng=rng):
        mean = average(np.tile(turn.as_quat(), (3, 1)))
        assert abs(mean @ turn.as_quat()) == pytest.approx(1)
        assert mean[3] > 0
    # Half a turn apart there is no middle, and the first start serves, of whatever sign.
    apart = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]])
    assert average(apart) is None
    for sign in (1, -1):
        found = Coordinates.learn(channels_of(["quaternion"]), [sign * apart[:1] + 0.0, apart[1:]]).references
        assert_array_equal(found, apart[0])


@pytest.mark.parametrize("start", [0.0, 1.0, 2.0, 3.0, -1.0, -2.0])
def test_an_angle_that_goes_all_round_is_measured_from_where_it_starts(start):
    angle = start + np.linspace(0.0, TAU, 50, endpoint=False)
    found = Coordinates.learn(channels_of(["angle"]), [angle[:, None]]).references
    assert_allclose(found, start, atol=1e-9)


@pytest.mark.parametrize("reach", [1.0, 0.85, 0.75, 0.5, 0.25])
@pytest.mark.parametrize("base", [0.0, 2.0, np.pi, -0.5])
def test_demonstrations_that_start_alike_stay_on_one_branch_however_far_they_turn(reach, base):
    """Also where an angle turns all the way round and has no mean."""
    axis = np.array([0.0, 0.6, 0.8])
    starts = base + np.linspace(-0.8, 0.8, 8)
    paths = [start + np.linspace(0.0, reach * TAU, 60) for start in starts]
    turned_by = [Rotation.from_rotvec(path[:, None] * axis).as_quat() for path in paths]
    values = [np.column_stack([np.angle(np.exp(1j * p)), q]) for p, q in zip(paths, turned_by, strict=True)]
    coordinates = Coordinates.learn(channels_of(["angle", "quaternion"]), values)
    features = np.stack([coordinates.from_channels(v) for v in values])
    apart = np.abs(starts[:, None] - starts[None, :])
    assert_allclose(
        np.abs(features[:, None, :, 0] - features[None, :, :, 0]), apart[..., None] * np.ones(60), atol=1e-9
    )
    along = features[..., 1:] @ axis
    side = np.sign(along[0, 1] - along[0, 0])
    assert_allclose(
        side * (along[:, None] - along[None, :]), (starts[:, None] - starts)[..., None] * np.ones(60), atol=1e-9
    )


def test_an_angle_comes_back_on_the_branch_it_was_recorded_on():
    values = [np.array([[3.4], [4.5]]), np.array([[3.6], [5.0]]), np.array([[3.5 - TAU], [4.5 - TAU]])]
    coordinates = Coordinates.learn(channels_of(["angle"]), values)
    features = [coordinates.from_channels(v) for v in values]
    back = [coordinates.to_channels(f, f)[0] for f in features]
    assert_allclose(back[:2], values[:2])
    assert_allclose(back[2], values[2] + TAU)


def test_features_stand_where_the_quaternion_begins():
    names = ["hand_x", "head_qw", "hand_y", "head_qz", "head_qx", "wrist", "head_qy"]
    kinds = {"head_q?": "quaternion", "wrist": "angle"}
    channels = make_channels(names, [], kinds=kinds, groups={"wrist": "arm"})
    coordinates = Coordinates.learn(channels, [])
    quaternion = (4, 6, 3, 1)
    assert coordinates.channel_of == ((0,), quaternion, quaternion, quaternion, (2,), (5,))
    assert coordinates.names == ("hand_x", "head_q rot x", "head_q rot y", "head_q rot z", "hand_y", "wrist")
    assert coordinates.groups == ("hand", "head_q", "head_q", "head_q", "hand", "arm")
    assert coordinates.count == 6
    assert not coordinates.flat
    assert_array_equal(coordinates.references, [0, 1, 0, 0, 0, 0, 0])
    assert_array_equal(coordinates.features_of([5, 0]), [0, 5])
    assert_array_equal(coordinates.features_of(np.array([3])), [1, 2, 3])
    assert_array_equal(coordinates.features_of([]), [])
    about_z = [9.0, np.cos(0.1), 8.0, np.sin(0.1), 0.0, 0.5, 0.0]
    assert_allclose(coordinates.from_channels(np.array([about_z])), [[9.0, 0, 0, 0.2, 8.0, 0.5]], atol=1e-15)


def test_quaternions_whose_names_are_nothing_but_an_axis_or_have_no_q():
    channels = make_channels(
        list("xyzw"), [f"rot_{a}" for a in "xyzw"], kinds={"*": "quaternion"}, groups={"?": "head", "rot*": "tool"}
    )
    names = Coordinates.learn(channels, []).names
    assert names == tuple(f"{stem} rot {a}" for stem in ("head", "rot") for a in "xyz")


def test_linear_channels_pass_through(rng):
    coordinates = Coordinates.learn(make_channels(["a", "b_x"], ["c"]), [rng.normal(size=(5, 3))])
    values = rng.normal(size=(4, 3))
    assert coordinates.flat
    assert coordinates.names == ("a", "b_x", "c")
    assert_array_equal(coordinates.references, 0)
    assert coordinates.from_channels(values) is values
    assert coordinates.sample(values[0], values[1]) is not None
    assert_array_equal(coordinates.sample(values[0], values[1]), values[0])
    mean, var = coordinates.to_channels(values, values**2)
    assert_array_equal(mean, values)
    assert_array_equal(var, values**2)


def test_references_are_frozen_and_must_fit_their_channels():
    channels = channels_of(["linear", "angle", "quaternion"])
    good = np.array([0.0, 1.0, *NONE])
    with pytest.raises(ValueError, match="read-only"):
        Coordinates(channels, good).references[1] = 2.0
    with pytest.raises(OptionError, match=r"expected 6 references, got an array of \(5,\)"):
        Coordinates(channels, good[:5])
    with pytest.raises(OptionError, match="reference 0 of the linear channel p0, got 3"):
        Coordinates(channels, np.array([3.0, 1.0, *NONE]))
    with pytest.raises(OptionError, match="finite reference of p1, got nan"):
        Coordinates(channels, np.array([0.0, np.nan, *NONE]))
    with pytest.raises(OptionError, match="p2_qx, p2_qy, p2_qz, p2_qw with norm 1, got 2"):
        Coordinates(channels, np.array([0.0, 1.0, 0, 0, 0, 2.0]))
