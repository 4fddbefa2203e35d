"""Alpha-beta smoothing: what is played turns into a new response without a jump, and lags no further than it says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from inphase.errors import OptionError
from inphase.result import Response
from inphase.runtime.smoothing import AlphaBeta, Motion, wanted_at

shares = st.floats(0.01, 1.0)


def played(smoothing: AlphaBeta, motion: Motion, wanted: np.ndarray) -> np.ndarray:
    return np.array([m.positions for m in smoothing.blend(motion, wanted)])


def textbook(wanted: np.ndarray, position: float, velocity: float, alpha: float, beta: float, period: float) -> list:
    """The alpha-beta filter as it is printed everywhere, of one channel, in seconds."""
    course = []
    for z in wanted:
        position += velocity * period
        residual = z - position
        position += alpha * residual
        velocity += beta * residual / period
        course.append(position)
    return course


@given(shares, shares, st.floats(0.01, 1.0))
def test_it_is_the_textbook_filter(alpha: float, beta: float, period: float) -> None:
    wanted = np.random.default_rng(0).normal(size=30)
    motion = Motion(np.array([0.5]), np.array([0.3 * period]))
    course = played(AlphaBeta(alpha, beta), motion, wanted[:, None])[:, 0]
    assert_allclose(course, textbook(wanted, 0.5, 0.3, alpha, beta, period), rtol=1e-9, atol=1e-9)


def test_with_both_one_the_new_response_is_played_to_the_last_bit(rng: np.random.Generator) -> None:
    wanted = 1e3 * rng.normal(size=(50, 3))
    motion = Motion(rng.normal(size=3), rng.normal(size=3))
    assert_allclose(played(AlphaBeta(1.0, 1.0), motion, wanted), wanted, rtol=0, atol=0)


@given(shares, shares, st.floats(-10.0, 10.0), st.floats(-1.0, 1.0))
def test_a_new_response_moves_the_next_command_by_its_share_of_the_gap_alone(
    alpha: float, beta: float, gap: float, slope: float
) -> None:
    """Continuous: what it adds to a command vanishes with alpha, however far off the new response begins."""
    smoothing, line = AlphaBeta(alpha, beta), slope * np.arange(1, 21)[:, None]
    before = smoothing.blend(Motion(np.zeros(1), np.array([slope])), line[:10])[-1]
    old, new = (smoothing.step(before, line[10] + more) for more in (0.0, gap))
    assert_allclose(new.positions - old.positions, alpha * gap, atol=1e-9)
    assert_allclose(new.steps - old.steps, beta * gap, atol=1e-9)


@given(shares, shares)
def test_a_new_response_that_goes_on_as_the_old_changes_nothing(alpha: float, beta: float) -> None:
    """Whether blended as one, in two parts or command by command."""
    smoothing = AlphaBeta(alpha, beta)
    wanted, start = np.sin(np.arange(40) / 5)[:, None], Motion.at_rest(np.array([0.4]))
    whole = played(smoothing, start, wanted)
    first = smoothing.blend(start, wanted[:15])
    assert_allclose(np.array([m.positions for m in first]), whole[:15], atol=0)
    assert_allclose(played(smoothing, first[-1], wanted[15:]), whole[15:], atol=0)


@settings(max_examples=20)
@given(st.floats(0.2, 1.0), st.floats(0.2, 1.0), st.floats(-1.0, 1.0), st.floats(-0.1, 0.1))
def test_the_lag_is_that_of_its_docstring(alpha: float, beta: float, slope: float, growth: float) -> None:
    k = np.arange(200.0)
    for curve, lag in ((slope * k, 0.0), (slope * k + growth * k**2 / 2, growth * (1 - alpha) / beta)):
        course = played(AlphaBeta(alpha, beta), Motion.at_rest(np.array([3.0])), curve[:, None])[:, 0]
        assert (curve - course)[-1] == pytest.approx(lag, abs=1e-6)


@settings(max_examples=20)
@given(st.floats(0.2, 1.0))
def test_by_itself_it_does_not_swing(alpha: float) -> None:
    """From a jump the error falls and changes its sign once at most: both roots of the filter are equal and real."""
    smoothing = AlphaBeta(alpha)
    beta = smoothing.step_share
    assert_allclose((2 - alpha - beta) ** 2, 4 * (1 - alpha), atol=1e-12)  # the discriminant of the filter's roots
    assert AlphaBeta(1.0).step_share == 1.0
    error = 1 - played(smoothing, Motion.at_rest(np.zeros(1)), np.ones((250, 1)))[:, 0]
    signs = np.sign(error[np.abs(error) > 1e-9])
    assert (np.diff(signs) != 0).sum() <= 1
    assert abs(error[-1]) < 1e-6
    assert np.abs(error).max() <= 1


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=100), shares)
def test_it_goes_no_further_than_twice_what_is_wanted(wanted: list[float], alpha: float) -> None:
    most = np.abs(wanted).max()
    course = played(AlphaBeta(alpha), Motion.at_rest(np.zeros(1)), np.array(wanted)[:, None])
    assert np.abs(course).max() <= 2 * most + 1e-9


@pytest.mark.parametrize("missing", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("alpha", [0.4, 1.0])
def test_a_channel_of_which_nothing_is_wanted_stays_and_disturbs_no_other(missing: float, alpha: float) -> None:
    smoothing = AlphaBeta(alpha)
    motion = Motion(np.array([1.0, 2.0]), np.array([0.5, 0.5]))
    after = smoothing.step(motion, np.array([missing, 3.0]))
    assert after.positions[0] == 1.0
    assert after.steps[0] == 0.0
    assert after.positions[1] == smoothing.step(motion, np.array([7.0, 3.0])).positions[1]


def test_a_response_is_read_at_the_times_of_the_commands(rng: np.random.Generator) -> None:
    times = np.cumsum(rng.uniform(0.1, 0.2, 20))
    mean = np.column_stack([3 * times + 1, -times])
    response = Response(times, np.linspace(0, 1, 20), mean, np.ones((20, 2)), ("a", "b"))
    asked = np.linspace(times[0], times[-1], 77)
    assert_allclose(wanted_at(response, asked), np.column_stack([3 * asked + 1, -asked]))
    assert_allclose(wanted_at(response, np.array([-9.0, 1e9])), mean[[0, -1]])
    single = Response(times[:1], np.zeros(1), mean[:1], np.ones((1, 2)), ("a", "b"))
    assert_allclose(wanted_at(single, asked[:3]), np.tile(mean[0], (3, 1)))


@pytest.mark.parametrize(
    "shares", [(0.0, 0.5), (0.5, 0.0), (1.1, 0.5), (0.5, 2.0), (float("nan"), 0.5), (0.5, float("nan"))]
)
def test_what_is_no_share_is_refused(shares: tuple[float, float]) -> None:
    with pytest.raises(OptionError, match=r"0 < (alpha|beta) <= 1"):
        AlphaBeta(*shares)


def test_a_motion_is_read_only() -> None:
    motion = AlphaBeta().step(Motion.at_rest(np.zeros(2)), np.ones(2))
    for array in (motion.positions, motion.steps):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
