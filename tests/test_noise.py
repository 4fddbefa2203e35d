"""Noise: how much a reading tells after another, and what is learned of that from residuals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from interactions import shapes_unchecked, wobble

from inphase.basis import Gaussian, Layout, Polynomial
from inphase.errors import OptionError
from inphase.noise import Noise
from inphase.training import discrepancy
from inphase.training.discrepancy import leave_one_out
from inphase.training.noise import both, regression_noise

GAPS = st.lists(st.floats(1e-3, 50.0), min_size=0, max_size=30).map(np.array)


def information(gaps: np.ndarray, var: float, correlation_time: float) -> float:
    """1ᵀ C⁻¹ 1: how precisely samples of an AR(1) process, that far apart, tell the constant they lie around."""
    times = np.concatenate([[0.0], np.cumsum(gaps)])
    cov = var * np.exp(-np.abs(times[:, None] - times) / correlation_time)
    return float(np.linalg.solve(cov, np.ones(len(times))).sum())


def added_up(gaps: np.ndarray, noise: Noise) -> float:
    """The same, as a filter adds it up: 1 / R, sample by sample."""
    return sum(float(1 / noise.at(np.array([gap]))[0]) for gap in [np.inf, *gaps])


# The share tanh(gap / 2τ) follows from the Cholesky factor of the covariance, whatever the gaps: the law is exact. What
# is lost to rounding is what solving a 30 × 30 covariance with neighbours correlated at exp(-0.001) loses.
@given(GAPS, st.floats(0.01, 100.0), st.floats(0.02, 5.0))
def test_readings_add_up_to_the_information_of_a_correlated_process(gaps: np.ndarray, var: float, time: float) -> None:
    noise = Noise(np.array([var]), np.array([time]))
    assert added_up(gaps, noise) == pytest.approx(information(gaps, var, time), rel=1e-9)


@given(st.integers(1, 40), st.floats(1e-3, 1.0), st.floats(0.02, 5.0))
def test_even_samples_tell_what_they_should(count: int, dt: float, time: float) -> None:
    noise, gaps = Noise(np.array([2.0]), np.array([time])), np.full(count - 1, dt)
    assert added_up(gaps, noise) == pytest.approx(information(gaps, 2.0, time), rel=1e-9)


def test_a_stretch_of_time_tells_the_same_at_any_rate() -> None:
    # T seconds about a constant tell (1 + T / 2τ) / var, however fast they are sampled, once that is faster than τ.
    noise = Noise(np.array([1.0]), np.array([0.2]))
    for count in (100, 400):
        assert added_up(np.full(count, 2.0 / count), noise) == pytest.approx(1 + 2.0 / 0.4, rel=1e-3)


@given(st.floats(0.0, 1e6) | st.just(np.inf), st.floats(1e-6, 1e6))
def test_every_reading_of_white_noise_is_new(interval: float, var: float) -> None:
    noise = Noise(np.array([var]), np.zeros(1))
    np.testing.assert_array_equal(noise.at(np.array([interval])), [var])


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_a_repeat_at_once_tells_nothing_and_the_first_all(var: float, time: float) -> None:
    noise = Noise(np.array([var, var]), np.array([time, time]))
    np.testing.assert_array_equal(noise.at(np.array([0.0, np.inf])), [np.inf, var])


@given(st.floats(0, 1e9), st.floats(1e-9, 1e9))
def test_no_gap_and_no_time_makes_trouble(interval: float, time: float) -> None:
    at = Noise(np.array([1.0]), np.array([time])).at(np.array([interval]))
    assert at[0] >= 1.0  # and no warning on the way to infinity


def test_features_do_not_know_each_other() -> None:
    noise = Noise(np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.1, 0.3]))
    intervals = np.array([0.05, np.inf, 0.2])
    alone = [Noise(noise.var[[i]], noise.correlation_time[[i]]).at(intervals[[i]])[0] for i in range(3)]
    np.testing.assert_array_equal(noise.at(intervals), alone)
    np.testing.assert_array_equal(intervals, [0.05, np.inf, 0.2])


@pytest.mark.parametrize(
    ("var", "time"),
    [
        ([0.0], [0.0]),
        ([-1.0], [0.0]),
        ([np.nan], [0.0]),
        ([np.inf], [0.0]),
        ([1.0], [-0.1]),
        ([1.0], [np.nan]),
        ([1.0], [np.inf]),
        ([1.0, 1.0], [0.0]),
        ([[1.0]], [[0.0]]),
    ],
)
def test_what_is_no_noise_is_refused(var: list, time: list) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match="expected"):
        Noise(np.array(var), np.array(time))


def test_noise_is_read_only() -> None:
    noise = Noise(np.ones(2), np.ones(2))
    for array in (noise.var, noise.correlation_time):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_the_variance_is_the_mean_over_demonstrations(rng: np.random.Generator) -> None:
    residuals = [rng.normal(size=(n, 3)) for n in (5, 50, 20)]
    learned = regression_noise([np.arange(len(r)) * 0.01 for r in residuals], residuals)
    np.testing.assert_allclose(learned.var, np.mean([(r**2).mean(0) for r in residuals], axis=0))  # Eq. 2.15


def test_white_residuals_are_white(rng: np.random.Generator) -> None:
    times, stds = [np.arange(1000) * 0.02] * 6, np.array([0.1, 1.0, 5.0])
    learned = regression_noise(times, [wobble(t, 3, 1.0, 0.0, rng) * stds for t in times])
    # A variance from n draws is off by sqrt(2 / n); a correlation that is nothing by 1 / sqrt(1000) of a step.
    np.testing.assert_allclose(learned.var, stds**2, rtol=4 * np.sqrt(2 / 6000))
    assert (learned.correlation_time < 0.02 * 4 / np.sqrt(1000)).all()


@pytest.mark.parametrize("rate", [25.0, 50.0, 100.0])
def test_correlated_residuals_are_as_long_at_any_rate(rate: float, rng: np.random.Generator) -> None:
    times = [np.arange(round(60 * rate)) / rate] * 6
    learned = regression_noise(times, [wobble(t, 3, 0.5, 0.2, rng) for t in times])
    # Six minutes hold about 6 · 60 / (2 · 0.2) = 900 independent samples: sqrt(2 / 900) = 5 % for the variance. The
    # sum of correlations is cut where they drown in chance, and starts half a step late: a quarter may be missing.
    np.testing.assert_allclose(learned.var, 0.25, rtol=0.2)
    np.testing.assert_allclose(learned.correlation_time, 0.2, rtol=0.3)


@pytest.mark.parametrize("pattern", ["a sensor at a third of the rate", "half the samples lost", "one long gap"])
def test_what_was_not_seen_changes_little(pattern: str, rng: np.random.Generator) -> None:
    times = [np.arange(6000) * 0.01] * 6
    residuals = [wobble(t, 2, 0.5, 0.2, rng) for t in times]
    for r in residuals:
        if pattern == "a sensor at a third of the rate":
            r[np.arange(len(r)) % 3 > 0, 1] = np.nan
        elif pattern == "half the samples lost":
            r[rng.random(len(r)) < 0.5, 1] = np.nan
        else:
            r[1000:4000, 1] = np.nan
    learned = regression_noise(times, residuals)
    np.testing.assert_allclose(learned.var, 0.25, rtol=0.2)
    np.testing.assert_allclose(learned.correlation_time, 0.2, rtol=0.3)


def test_a_demonstration_without_the_channel_has_no_say(rng: np.random.Generator) -> None:
    times = [np.arange(1000) * 0.02] * 4
    residuals = [wobble(t, 2, 0.5, 0.2, rng) for t in times]
    expected = regression_noise(times[:2], residuals[:2])
    for r in residuals[2:]:
        r[:, 0] = np.nan
    learned = regression_noise(times, residuals)
    np.testing.assert_allclose(learned.var[0], expected.var[0], rtol=1e-12)
    np.testing.assert_allclose(learned.correlation_time[0], expected.correlation_time[0], rtol=1e-12)


def test_no_residual_is_taken_for_no_noise() -> None:
    times = [np.arange(10) * 0.1] * 2
    learned = regression_noise(times, [np.zeros((10, 1))] * 2)
    assert 0 < learned.var[0] < 1e-6
    assert learned.correlation_time[0] == 0


def test_residuals_are_not_changed(rng: np.random.Generator) -> None:
    times, residuals = [np.arange(20) * 0.1], [rng.normal(size=(20, 2))]
    residuals[0][3] = np.nan
    before = residuals[0].copy()
    regression_noise(times, residuals)
    np.testing.assert_array_equal(residuals[0], before)


def test_what_is_held_out_is_explained_by_the_others_as_a_filter_would(rng: np.random.Generator) -> None:
    layout, shown, grid = Layout((Gaussian(4), Polynomial(2), Gaussian(4))), np.array([1.0, 1.0, 0.0]), 200
    weights = rng.normal(size=(6, layout.size)) + 5.0
    phases = (np.arange(grid) + 0.5) / grid
    functions = np.stack([layout.predict(phases, unit).ravel() for unit in np.eye(layout.size)], axis=1)  # (P F, B)
    held_out = leave_one_out(layout, weights, shown, duration=2.0)
    target, explained = [], []
    for i, own in enumerate(weights):
        others = np.delete(weights, i, axis=0)
        off, cov = own - others.mean(0), np.cov(others, rowvar=False)
        seen = np.tile(shown > 0, grid)  # Bayesian linear regression, in the space of the weights
        design, noise = functions[seen], np.tile(held_out.noise.var, grid)[seen] * grid
        gain = cov @ design.T @ np.linalg.inv(design @ cov @ design.T + np.diag(noise))
        target.append((functions @ off).reshape(grid, 3))
        explained.append((functions @ (gain @ design @ off)).reshape(grid, 3))
    true, said = np.array(target), np.array(explained)
    # What the partner says of the hidden feature is believed as far as it turns out to be so: by least squares.
    trust = min(max((true * said)[..., 2].sum() / (said**2)[..., 2].sum(), 0.0), 1.0)
    assert held_out.trust == pytest.approx(trust, abs=0.02)
    # The variance that this regression takes for the noise is the one it leaves: searched for until it moves by 1 %.
    left = true - said * [1.0, 1.0, held_out.trust]
    np.testing.assert_allclose(held_out.noise.var, (left**2).mean((0, 1)), rtol=0.02)
    longer = leave_one_out(layout, weights, shown, duration=6.0)
    np.testing.assert_array_equal(longer.noise.var, held_out.noise.var)
    np.testing.assert_allclose(longer.noise.correlation_time, 3 * held_out.noise.correlation_time)


def test_where_nothing_was_seen_nothing_counts(rng: np.random.Generator) -> None:
    layout, shown = Layout((Gaussian(20, 0.02), Gaussian(4), Gaussian(4))), np.array([1.0, 1.0, 0.0])
    weights = rng.normal(size=(7, layout.size))
    seen = np.ones((7, 200, 3), dtype=bool)
    seen[:, :100, 0] = False  # a ball before it is thrown
    seen[3, :, 0] = False  # and one that no camera saw
    filled = weights.copy()
    filled[:, :6] += 9 * rng.normal(size=(7, 6))  # what stands in for readings, up to a phase of a third
    one, other = (leave_one_out(layout, w, shown, 2.0, seen) for w in (weights, filled))
    np.testing.assert_allclose(other.noise.var, one.noise.var, rtol=1e-6)
    np.testing.assert_allclose(other.noise.correlation_time, one.noise.correlation_time, rtol=1e-6)
    assert other.trust == pytest.approx(one.trust, rel=1e-6)
    assert leave_one_out(layout, filled, shown, 2.0).noise.var[0] > 10 * one.noise.var[0]


@pytest.mark.parametrize("related", [True, False])
def test_a_partner_is_trusted_as_far_as_it_tells(related: bool, rng: np.random.Generator) -> None:
    layout = Layout((Polynomial(1), Polynomial(1)))
    partner = rng.normal(size=(40, 2))
    robot = partner if related else rng.normal(size=(40, 2))
    trust = leave_one_out(layout, np.concatenate([partner, robot], axis=1), np.array([1.0, 0.0]), 1.0).trust
    # Out of 40 demonstrations, chance makes a correlation of 1 / sqrt(40).
    assert trust > 0.95 if related else trust < 0.5


def test_noises_of_two_sources_add_up() -> None:
    one, other = Noise(np.array([1.0, 2.0]), np.array([0.1, 0.0])), Noise(np.array([3.0, 2.0]), np.array([0.5, 0.2]))
    total = both(one, other)
    np.testing.assert_array_equal(total.var, [4.0, 4.0])
    # The integral of the autocovariance of a sum of independent processes is the sum of theirs.
    np.testing.assert_allclose(total.var * total.correlation_time, [1 * 0.1 + 3 * 0.5, 2 * 0.2])


def test_only_what_a_demonstration_saw_speaks_for_it(rng):
    """Against the regression on the others' directions written out, each demonstration with gaps of its own."""
    count, shown, var = 6, np.array([1.0, 1.0, 0.0]), np.array([0.3, 0.1, 0.2])
    curves, known = rng.normal(size=(count, 20, 3)), rng.random((count, 20, 3)) > 0.3
    target, explained = discrepancy._by_the_others(curves, shown, var, known)
    for i in range(count):
        others = np.delete(curves, i, axis=0)
        mean = others.mean(0)
        directions = (others - mean).reshape(count - 1, -1) / np.sqrt(count - 2)
        precision = (known[i] * shown / var / 20).ravel()
        off = (curves[i] - mean).ravel()
        along = np.linalg.solve(directions * precision @ directions.T + np.eye(count - 1), directions * precision @ off)
        np.testing.assert_allclose(target[i].ravel(), off, atol=1e-12)
        np.testing.assert_allclose(explained[i].ravel(), along @ directions, atol=1e-10)
