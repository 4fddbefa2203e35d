"""Readings that are averaged: steady motion is kept, the noise becomes less, and a turn is a turn."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from inphase.channels import make_channels
from inphase.runtime.averaging import Averaging

LINEAR = make_channels(["a", "b"], [])
ANGLE = make_channels(["t"], [], kinds={"t": "angle"})
TURN = make_channels(["q_x", "q_y", "q_z", "q_w"], [], kinds={"*": "quaternion"})


@given(
    st.lists(st.floats(0, 10), min_size=1, max_size=8),
    st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
)
def test_what_moves_steadily_reads_its_average_at_the_average_time(times, begin, speed):
    readings = [(t, np.array(begin) + t * np.array(speed)) for t in times]
    time, values = Averaging(LINEAR)(readings)
    np.testing.assert_allclose(time, np.mean(times), atol=1e-9)
    np.testing.assert_allclose(values, np.array(begin) + time * np.array(speed), atol=1e-9)


def test_each_channel_is_averaged_over_what_was_seen_of_it():
    readings = [(0.0, np.array([1.0, np.nan])), (1.0, np.array([3.0, np.nan])), (2.0, np.array([np.nan, np.nan]))]
    time, values = Averaging(LINEAR)(readings)
    assert time == 1.0
    np.testing.assert_array_equal(values, [2.0, np.nan])


def test_the_noise_of_n_readings_is_a_root_of_n_less():
    rng = np.random.default_rng(0)
    means = [Averaging(LINEAR)([(0.0, row) for row in rng.standard_normal((9, 2))])[1] for _ in range(4000)]
    assert np.std(means) == pytest.approx(1 / 3, rel=0.03)  # of 8000 draws: three times 1 / √16000


@given(st.floats(-20, 20), st.lists(st.floats(-0.5, 0.5), min_size=1, max_size=6), st.integers(-3, 3))
def test_an_angle_is_averaged_as_a_turn(middle, offsets, turns):
    """Independent truth: the direction of the mean of unit vectors, which for small spreads is the mean angle."""
    angles = middle + np.array(offsets)
    read = np.angle(np.exp(1j * angles)) + 2 * np.pi * turns
    _, values = Averaging(ANGLE)([(0.0, np.array([angle])) for angle in read])
    expected = middle + np.mean(offsets)
    assert np.abs(np.exp(1j * values[0]) - np.exp(1j * expected)) < 1e-9


def test_a_rotation_is_averaged_on_its_sphere_whatever_its_signs():
    rng = np.random.default_rng(1)
    near = Rotation.from_rotvec([0.3, -1.0, 0.5]) * Rotation.from_rotvec(0.05 * rng.standard_normal((7, 3)))
    signs = rng.choice([-1.0, 1.0], 7)
    _, values = Averaging(TURN)([(0.0, sign * q) for sign, q in zip(signs, near.as_quat(), strict=True)])
    assert np.linalg.norm(values) == pytest.approx(1.0)
    assert (Rotation.from_quat(values).inv() * near.mean()).magnitude() < 1e-4  # the chordal mean, of small spreads


def test_one_reading_is_itself():
    row = np.array([1.25, np.nan])
    time, values = Averaging(LINEAR)([(3.0, row)])
    assert time == 3.0
    np.testing.assert_array_equal(values, row)
