"""Scores and differences: against loops, distributions whose answer is known, and the manifolds of the channels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from interactions import dataset, taught
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from scipy.stats import norm

import inphase
from inphase.channels import make_channels
from inphase.evaluation import Scores, difference, replay
from inphase.evaluation.replay import MARKS, fitting
from inphase.metrics import NINETY
from inphase.training.rehearsal import by_the_clock

NUMBERS = st.floats(-1e3, 1e3)


def columns(count: int) -> st.SearchStrategy[np.ndarray]:
    return arrays(np.float64, (5, count), elements=NUMBERS)


# ------------------------------------------------------------------------------------------------------------- scores


def naive(error: np.ndarray, std: np.ndarray, spread: np.ndarray) -> tuple[float, float, float]:
    """The three scores, a reading at a time."""
    squares, inside, surprise, count = 0.0, 0, 0.0, 0
    for row, doubt in zip(error.tolist(), std.tolist(), strict=True):
        for e, s, unit in zip(row, doubt, spread.tolist(), strict=True):
            if e != e:
                continue
            squares += e * e / (unit * unit)
            low, high = norm.interval(0.9, loc=e, scale=s)
            inside += low <= 0 <= high
            surprise -= norm.logpdf(e / unit, scale=s / unit)
            count += 1
    return squares / count, inside / count, surprise / count


@pytest.mark.parametrize("missing", [0.0, 0.5])
def test_scores_are_those_of_a_loop(missing, rng):
    spread = np.array([0.1, 3.0, 40.0])
    std = spread * rng.uniform(0.2, 2, (50, 3))
    error = std * rng.standard_normal((50, 3))
    error[rng.random((50, 3)) < missing] = np.nan
    scores = Scores.of(error, std, spread)
    assert_allclose([scores.nmse, scores.coverage, scores.nll], naive(error, std, spread), rtol=1e-12)


def test_a_gaussian_predictor_covers_nine_of_ten(rng):
    std = rng.uniform(0.1, 10, (5000, 4))
    scores = Scores.of(std * rng.standard_normal(std.shape), std, np.ones(4))
    assert scores.coverage == pytest.approx(0.9, abs=5 * np.sqrt(0.9 * 0.1 / std.size))
    assert pytest.approx(norm.ppf(0.95), abs=1e-4) == NINETY


def test_the_nll_of_a_gaussian_predictor_is_its_entropy(rng):
    std = rng.uniform(0.1, 10, (5000, 4))
    scores = Scores.of(std * rng.standard_normal(std.shape), std, np.ones(4))
    # The negative log density of a standard normal has variance 1/2.
    assert scores.nll == pytest.approx(norm.entropy(scale=std).mean(), abs=5 * np.sqrt(0.5 / std.size))


@pytest.mark.parametrize("factor", [0.3, 0.8, 1.3, 5.0])
def test_nobody_gains_by_a_wrong_doubt(factor, rng):
    std = rng.uniform(0.1, 10, (2000, 4))
    error = std * rng.standard_normal(std.shape)
    assert Scores.of(error, factor * std, np.ones(4)).nll > Scores.of(error, std, np.ones(4)).nll


def test_the_mean_of_all_readings_scores_one(rng):
    readings = rng.standard_normal((100, 3)) * [1, 10, 0.01]
    spread = readings.std(axis=0)
    assert Scores.of(readings.mean(axis=0) - readings, np.ones((100, 3)), spread).nmse == pytest.approx(1)


def test_units_do_not_matter(rng):
    error, std, spread = rng.standard_normal((20, 3)), rng.uniform(0.5, 2, (20, 3)), rng.uniform(0.5, 2, 3)
    factors = np.array([1000, 0.01, 57.3])
    one, other = Scores.of(error, std, spread), Scores.of(error * factors, std * factors, spread * factors)
    assert_allclose([one.nmse, one.coverage, one.nll], [other.nmse, other.coverage, other.nll])


def test_nothing_to_score_is_no_score():
    scores = Scores.of(np.full((4, 2), np.nan), np.ones((4, 2)), np.ones(2))
    assert np.isnan([scores.nmse, scores.coverage, scores.nll]).all()


def test_a_channel_without_doubt_is_a_finite_score():
    scores = Scores.of(np.array([[0.0, 1.0]]), np.zeros((1, 2)), np.ones(2))
    assert np.isfinite([scores.nmse, scores.coverage, scores.nll]).all()
    assert scores.coverage == 0.5


# -------------------------------------------------------------------------------------------------------- differences


@given(mean=columns(3), truth=columns(3))
def test_numbers_are_subtracted(mean, truth):
    channels = make_channels(["a"], ["b", "c"])
    before = mean.copy(), truth.copy()
    assert_array_equal(difference(channels, mean, truth), mean - truth)
    assert_array_equal(mean, before[0])
    assert_array_equal(truth, before[1])


@given(mean=columns(2), truth=columns(2), turns=arrays(np.int64, (2, 5), elements=st.integers(-50, 50)))
def test_angles_go_the_shorter_way_round(mean, truth, turns):
    channels = make_channels(["a"], ["b"], kinds={"b": "angle"})
    plain = difference(channels, mean, truth)
    assert (np.abs(plain[:, 1]) <= np.pi).all()
    # As far as the chord between the two directions says.
    chord = np.abs(np.exp(1j * mean[:, 1]) - np.exp(1j * truth[:, 1]))
    assert_allclose(np.abs(plain[:, 1]), 2 * np.arcsin(np.clip(chord / 2, 0, 1)), atol=1e-6)
    turned = difference(
        channels,
        mean + 2 * np.pi * np.column_stack([np.zeros(5), turns[0]]),
        truth + 2 * np.pi * np.column_stack([np.zeros(5), turns[1]]),
    )
    # Half a turn may be called either.
    assert_allclose(np.abs(turned[:, 1]), np.abs(plain[:, 1]), atol=1e-9)
    assert_array_equal(turned[:, 0], plain[:, 0])


def test_an_angle_a_little_over_and_a_little_under_half_a_turn():
    channels = make_channels([], ["b"], kinds={"b": "angle"})
    found = difference(channels, np.array([[np.pi - 0.1], [0.1], [3.0]]), np.array([[-np.pi + 0.1], [2.5], [-3.0]]))
    assert_allclose(found[:, 0], [-0.2, -2.4, 6 - 2 * np.pi])


QUATERNION = make_channels(["a"], [f"head_q{axis}" for axis in "xyzw"], kinds={"head_q?": "quaternion"})


def test_quaternions_are_compared_up_to_their_sign(rng):
    one, other = (Rotation.random(200, random_state=seed).as_quat() for seed in (1, 2))
    mean, truth = (np.column_stack([np.zeros(200), q]) for q in (one, other))
    plain = difference(QUATERNION, mean, truth)
    signs = rng.choice([-1.0, 1.0], 200)
    flipped = truth * np.column_stack([np.ones(200), *[signs] * 4])
    before = flipped.copy()
    assert_allclose(difference(QUATERNION, mean, flipped), plain, atol=1e-15)
    assert_array_equal(flipped, before)
    # The chord between the nearer of q and -q: 2 sin of a quarter of the angle between the rotations.
    angle = (Rotation.from_quat(one).inv() * Rotation.from_quat(other)).magnitude()
    assert_allclose(np.linalg.norm(plain[:, 1:], axis=1), 2 * np.sin(angle / 4), atol=1e-12)


def test_the_order_of_the_parts_of_a_quaternion_does_not_matter():
    names = [f"head_q{axis}" for axis in "wzyx"]
    channels = make_channels([], names, kinds={"*": "quaternion"})
    one, other = Rotation.random(2, random_state=0).as_quat()[:, None]
    plain = difference(QUATERNION, np.column_stack([[0.0], one]), np.column_stack([[0.0], -other]))
    assert_allclose(difference(channels, one[:, ::-1], other[:, ::-1]), plain[:, :0:-1], atol=1e-15)


def test_what_was_not_seen_is_not_compared():
    truth = np.array([[1.0, np.nan, 0.0, 0.0, -1.0], [np.nan, 0.0, 0.0, 0.0, -1.0]])
    found = difference(QUATERNION, np.array([[0.5, 0.0, 0.0, 0.0, 1.0]] * 2), truth)
    assert_allclose(found[1, 1:], 0)
    assert np.isnan(found[1, 0])
    assert found[0, 0] == -0.5
    assert np.isnan(found[0, 1])


def test_one_sample_alone():
    assert difference(QUATERNION, np.array([0.0, 0, 0, 0, 1]), np.array([0.0, 0, 0, 0, -1])).tolist() == [0.0] * 5


# ------------------------------------------------------------------------------------------------------------- replay


@pytest.fixture(scope="module")
def demos() -> inphase.Dataset:
    return dataset(np.random.default_rng(1), count=6)


@pytest.fixture(scope="module")
def model(demos: inphase.Dataset) -> inphase.Model:
    return taught(demos.without(-1))


def test_a_replay_is_a_session_that_is_shown_the_partner_alone(demos, model):
    last = demos[-1]
    played = replay(model, last, filter="ebip", seed=5)
    session = model.session(filter="ebip", seed=5)
    errors, stds, ends, log_likelihood = [], [], [], 0.0
    for time, row in zip(last.times, last.values, strict=True):
        log_likelihood += session.observe(time, {"reach": row[0], "lift": row[1]}).log_likelihood
        response = session.respond(samples=2)
        errors.append(response.mean[0] - row[2:])
        stds.append(response.std[0])
        ends.append(response.mean[1] - last.values[-1, 2:])
    now = naive(np.array(errors), np.array(stds), model.spread[2:])
    assert_allclose([played.now.nmse, played.now.coverage, played.now.nll], now, rtol=1e-9)
    assert played.log_likelihood == pytest.approx(log_likelihood)
    for mark in MARKS:
        end = ends[int(mark * len(last))] / model.spread[2:]
        assert played.final_pose(mark) == pytest.approx(np.mean(end**2))
    previews = [m.preview for m in played.moments if m.preview is not None]
    assert [p.times[0] for p in previews] == [last.times[int(mark * len(last))] for mark in MARKS]
    assert all(len(p) > 2 for p in previews)


def test_a_replay_without_the_truth_is_followed_and_not_scored(demos, model):
    last = demos[-1]
    blind = inphase.Demonstration(last.times, np.column_stack([last.values[:, :2], np.full((len(last), 2), np.nan)]))
    seen, unscored = replay(model, last), replay(model, blind)
    assert [m.estimate for m in seen.moments] == [m.estimate for m in unscored.moments]
    assert np.isnan([unscored.now.nmse, unscored.now.coverage, unscored.final_pose(0.5)]).all()


def test_the_clock_plays_the_mean_at_the_mean_tempo(demos, model):
    last = demos[-1]
    errors, stds = [], []
    for time, row in zip(last.times, last.values, strict=True):
        phase = min((time - last.times[0]) * model.phase.nominal_velocity, 1.0)
        mean, std = model.distribution([phase])
        errors.append(mean[0, 2:] - row[2:])
        stds.append(std[0, 2:])
    found = by_the_clock(model, last)
    expected = naive(np.array(errors), np.array(stds), model.spread[2:])
    assert_allclose([found.nmse, found.coverage, found.nll], expected, rtol=1e-9)


def test_columns_are_put_as_the_model_has_them(demos, model):
    values = [d.values[:, [3, 0, 1]] for d in demos]
    other = inphase.Dataset.from_arrays([d.times for d in demos], values, ["turn", "reach", "lift"], [])
    for one, demonstration in zip(fitting(model, other), demos, strict=True):
        assert_array_equal(one.values[:, [0, 1, 3]], demonstration.values[:, [0, 1, 3]])
        assert np.isnan(one.values[:, 2]).all()
    stranger = inphase.Dataset.from_arrays([d.times for d in demos], values, ["turn", "reach", "height"], [])
    with pytest.raises(inphase.DataError, match=r"demonstration 0: .* expected channels lift; got turn, reach, height"):
        fitting(model, stranger)
