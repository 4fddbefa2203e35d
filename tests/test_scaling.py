"""Laws of scaling: units do not matter, geometry stays, nothing is divided by zero."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.testing import assert_allclose, assert_array_equal

from inphase.errors import OptionError
from inphase.preprocess.scaling import Scaling

GROUPS = ("hand", "hand", "grip", "hand")


def recordings(rng):
    return [rng.normal(3.0, [1.0, 5.0, 0.01, 2.0], (length, 4)) for length in (20, 7, 31)]


def test_a_group_lies_between_0_and_1_and_reaches_both(rng):
    values = recordings(rng)
    scaled = np.concatenate([Scaling.learn(GROUPS, values).scale(v) for v in values])
    for members in ([0, 1, 3], [2]):
        assert scaled[:, members].min() == pytest.approx(0, abs=1e-12)
        assert scaled[:, members].max() == pytest.approx(1)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3), st.integers(0, 99))
def test_the_unit_of_a_group_does_not_matter(first, second, shift, seed):
    values = recordings(np.random.default_rng(seed))
    units = np.array([first, first, second, first])
    others = [v * units + shift * units for v in values]
    one, other = Scaling.learn(GROUPS, values), Scaling.learn(GROUPS, others)
    for v, w in zip(values, others, strict=True):
        assert_allclose(one.scale(v), other.scale(w), atol=1e-8)
    assert_allclose(other.span, one.span * units, rtol=1e-9)


def test_geometry_is_kept_within_a_group(rng):
    values = recordings(rng)
    scaling = Scaling.learn(GROUPS, values)
    hand = [0, 1, 3]
    corners = values[0][:, hand]
    scaled = scaling.scale(values[0])[:, hand]

    def angles(points):
        a, b = points[1:-1] - points[:-2], points[2:] - points[1:-1]
        return (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)

    assert_allclose(angles(scaled), angles(corners), atol=1e-9)
    assert_allclose(scaling.span[hand], scaling.span[0])  # one unit for the group …
    assert_allclose(
        np.nanmin(np.concatenate([scaling.scale(v) for v in values]), axis=0), 0.0, atol=1e-12
    )  # … from 0 on


def test_where_a_channel_lies_does_not_matter_to_its_group(rng):
    values = recordings(rng)
    far = [v + np.array([0.0, 1e4, 0.0, 0.0]) for v in values]
    for v, w in zip(values, far, strict=True):
        assert_allclose(Scaling.learn(GROUPS, far).scale(w), Scaling.learn(GROUPS, values).scale(v), atol=1e-8)


@given(
    arrays(np.float64, array_shapes(max_dims=3).map(lambda s: (*s, 4)), elements=st.floats(-1e6, 1e6) | st.just(np.nan))
)
def test_there_and_back_again_in_any_shape_with_nan(values):
    scaling = Scaling(np.array([0.0, -5.0, 2.0, 1e3]), np.array([1.0, 5.0, 2.0, 1.001e3]))
    scaled = scaling.scale(values)
    assert scaled.shape == values.shape
    assert_array_equal(np.isnan(scaled), np.isnan(values))
    assert_allclose(scaling.unscale(scaled), values, rtol=1e-12, atol=1e-9)
    assert_allclose(scaling.unscale_var(scaling.scale_var(values)), values, rtol=1e-12, atol=1e-9)


def test_variances_scale_as_those_of_scaled_samples(rng):
    scaling = Scaling(np.array([-1.0, 5.0]), np.array([3.0, 5.5]))
    samples = rng.normal(size=(50, 2))
    assert_allclose(scaling.scale_var(samples.var(axis=0)), scaling.scale(samples).var(axis=0))
    assert_allclose(scaling.unscale_var(samples.var(axis=0)), scaling.unscale(samples).var(axis=0))


def test_what_never_moves_is_named_and_not_stretched():
    nan = np.nan
    groups = ["a", "a", "b", "c", "d", "e"]
    values = [
        np.array([[1.0, 4.0, 7.0, nan, 0.1 + 0.2, nan], [1.0, 6.0, 7.0, nan, 0.3, 2.0]]),
        np.array([[1.0, nan, 7.0, nan, 0.3, 2.5]]),
    ]
    scaling = Scaling.learn(groups, values)
    assert_array_equal(scaling.span, [2.0, 2.0, 1.0, 1.0, 1.0, 0.5])
    assert_array_equal(scaling.offset, [1.0, 4.0, 7.0, 0.0, 0.3, 2.0])
    assert_allclose(scaling.scale(np.array([1.0, 6.0, 7.5, 3.0, 1.3, 2.5])), [0, 1, 0.5, 3, 1, 1])


def test_nothing_to_learn_from_is_no_scaling():
    scaling = Scaling.learn(["a", "b"], [])
    assert_array_equal(scaling.scale(np.array([2.0, -3.0])), [2.0, -3.0])


def test_none_changes_nothing(rng):
    values = rng.normal(size=(3, 5))
    scaling = Scaling.none(5)
    for change in (scaling.scale, scaling.unscale, scaling.scale_var, scaling.unscale_var):
        assert_array_equal(change(values), values)


def test_a_scaling_is_frozen_and_refuses_what_makes_no_sense():
    low, high = np.zeros(2), np.ones(2)
    scaling = Scaling(low, high)
    low[0] = 5.0
    assert scaling.low[0] == 0.0
    for array in (scaling.low, scaling.high, scaling.offset, scaling.span):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(OptionError, match="low <= high for every feature, got others at 1"):
        Scaling(np.array([0.0, 2.0]), np.ones(2))
    with pytest.raises(OptionError, match="got others at 0"):
        Scaling(np.array([np.nan, 0.0]), np.ones(2))
    with pytest.raises(OptionError, match=r"got \(2,\) and \(3,\)"):
        Scaling(np.zeros(2), np.ones(3))
