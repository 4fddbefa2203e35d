"""Regression: from demonstrations with gaps to weights, against plain least squares."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inphase.basis import Basis, Gaussian, Layout, Periodic, Polynomial, Sigmoid
from inphase.basis.fit import fit_weights, residuals
from inphase.basis.gap import unseen
from inphase.errors import DataError, OptionError

MIXED = Layout((Gaussian(6), Sigmoid(5), Gaussian(6), Polynomial(3), Gaussian(6)))
SEEDS = st.integers(0, 2**32 - 1)


def demonstrations(
    layout: Layout, rng: np.random.Generator, count: int = 3, missing: float = 0.0
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Noisy movements that differ, of different lengths, with single readings missing here and there."""
    common = rng.normal(size=layout.size)
    phases = [np.linspace(0, 1, int(rng.integers(120, 160))) for _ in range(count)]
    values = [layout.predict(p, common + 0.3 * rng.normal(size=layout.size)) for p in phases]
    values = [v + 0.05 * rng.normal(size=v.shape) for v in values]
    return phases, [np.where(rng.random(v.shape) < missing, np.nan, v) for v in values]


def plain_ridge(functions: np.ndarray, readings: np.ndarray, ridge: float, toward: np.ndarray) -> np.ndarray:
    """Least squares of one feature with √(ridge T) I below Φ, by an SVD and without normal equations."""
    size = functions.shape[1]
    below = math.sqrt(ridge * len(functions))
    matrix = np.concatenate([functions, below * np.eye(size)])
    return np.linalg.lstsq(matrix, np.concatenate([readings, below * toward]), rcond=None)[0]


@settings(max_examples=10)
@given(SEEDS, st.sampled_from([1e-6, 1e-3]), st.sampled_from([0.0, 0.2]))
def test_both_stages_are_plain_least_squares(seed: int, ridge: float, missing: float) -> None:
    phases, values = demonstrations(MIXED, np.random.default_rng(seed), missing=missing)
    own, pooled = fit_weights(MIXED, phases, values, ridge, bridge=0.0)
    for feature, basis in enumerate(MIXED.bases):
        seen = [~np.isnan(v[:, feature]) for v in values]
        at = [basis(p[mask]) for p, mask in zip(phases, seen, strict=True)]
        read = [v[mask, feature] for v, mask in zip(values, seen, strict=True)]
        mean = plain_ridge(np.concatenate(at), np.concatenate(read), ridge, np.zeros(basis.size))
        np.testing.assert_allclose(pooled[MIXED.slices[feature]], mean, atol=1e-6)
        for n in range(len(values)):
            expected = plain_ridge(at[n], read[n], ridge, mean)
            np.testing.assert_allclose(own[n, MIXED.slices[feature]], expected, atol=1e-6)


def test_a_bridge_is_a_weak_reading_at_every_hundredth_of_the_gap(rng: np.random.Generator) -> None:
    basis, bridge, ridge = Gaussian(12), 0.3, 1e-5
    layout = Layout((basis,))
    phases, values = demonstrations(layout, rng)
    hidden = [(p > 0.2) & (p < 0.5) & (n < 2 or p < 0.4) for n, p in enumerate(phases)]
    at = [p[~h] for p, h in zip(phases, hidden, strict=True)]
    read = [v[~h] for v, h in zip(values, hidden, strict=True)]
    own, pooled = fit_weights(layout, at, read, ridge, bridge=bridge)

    def plain(p: np.ndarray, v: np.ndarray, toward: np.ndarray, level: np.ndarray, gap: np.ndarray) -> np.ndarray:
        weight = math.sqrt(bridge * len(p) / 100)
        below = math.sqrt(ridge * len(p))
        matrix = np.concatenate([basis(p), weight * basis(gap), below * np.eye(12)])
        goal = np.concatenate([v, weight * level, below * toward])
        return np.linalg.lstsq(matrix, goal, rcond=None)[0]

    together, gap = np.concatenate(at), np.arange(0.205, 0.4, 0.01)
    gap = gap[[np.abs(together - g).min() > 0.02 for g in gap]]
    level = np.full(len(gap), np.concatenate(read).mean())
    mean = plain(together, np.concatenate(read)[:, 0], np.zeros(12), level, gap)
    np.testing.assert_allclose(pooled, mean, atol=1e-6)
    gap = np.arange(0.205, 0.5, 0.01)
    gap = gap[[np.abs(at[0] - g).min() > 0.02 for g in gap]]
    np.testing.assert_allclose(own[0], plain(at[0], read[0][:, 0], mean, basis(gap) @ mean, gap), atol=1e-6)


@settings(max_examples=10)
@given(SEEDS)
def test_a_missing_reading_is_as_good_as_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    phases, values = demonstrations(MIXED, rng, missing=0.3)
    values[1][20:90, 2] = np.nan
    own, pooled = fit_weights(MIXED, phases, values)
    for feature, basis in enumerate(MIXED.bases):
        seen = [~np.isnan(v[:, feature]) for v in values]
        alone = fit_weights(
            Layout((basis,)),
            [p[mask] for p, mask in zip(phases, seen, strict=True)],
            [v[mask][:, [feature]] for v, mask in zip(values, seen, strict=True)],
        )
        np.testing.assert_allclose(own[:, MIXED.slices[feature]], alone[0], atol=1e-9)
        np.testing.assert_allclose(pooled[MIXED.slices[feature]], alone[1], atol=1e-9)


def test_weights_are_linear_in_the_values(rng: np.random.Generator) -> None:
    phases, values = demonstrations(MIXED, rng, missing=0.2)
    values[0][:60, 1] = np.nan
    units = np.array([1000.0, 0.001, -3.0, 1.0, 1e6])
    own, pooled = fit_weights(MIXED, phases, values)
    other, other_pooled = fit_weights(MIXED, phases, [v * units for v in values])
    by_weight = np.repeat(units, [basis.size for basis in MIXED.bases])
    np.testing.assert_allclose(other / by_weight, own, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(other_pooled / by_weight, pooled, rtol=1e-7, atol=1e-9)

    moved, _ = fit_weights(MIXED, phases, [v + np.sin(7 * p)[:, None] for p, v in zip(phases, values, strict=True)])
    shape = [np.where(np.isnan(v), np.nan, np.sin(7 * p)[:, None]) for p, v in zip(phases, values, strict=True)]
    np.testing.assert_allclose(moved - own, fit_weights(MIXED, phases, shape)[0], atol=1e-8)


def test_the_order_of_demonstrations_does_not_matter(rng: np.random.Generator) -> None:
    phases, values = demonstrations(MIXED, rng, count=4, missing=0.1)
    order = [2, 0, 3, 1]
    own, pooled = fit_weights(MIXED, phases, values)
    other, other_pooled = fit_weights(MIXED, [phases[i] for i in order], [values[i] for i in order])
    np.testing.assert_allclose(other, own[order], atol=1e-9)
    np.testing.assert_allclose(other_pooled, pooled, atol=1e-9)


def test_every_reading_twice_says_nothing_new(rng: np.random.Generator) -> None:
    phases, values = demonstrations(MIXED, rng)
    values[1][30:80, 0] = np.nan
    once = fit_weights(MIXED, phases, values, 1e-3)
    twice = fit_weights(MIXED, [np.repeat(p, 2) for p in phases], [np.repeat(v, 2, axis=0) for v in values], 1e-3)
    np.testing.assert_allclose(twice[0], once[0], atol=1e-9)
    np.testing.assert_allclose(twice[1], once[1], atol=1e-9)


@pytest.mark.parametrize("basis", [Gaussian(9), Sigmoid(7), Polynomial(6), Periodic(8)], ids=repr)
def test_known_weights_are_recovered(basis: Basis, rng: np.random.Generator) -> None:
    layout = Layout((basis,) * 2)
    truth = rng.normal(size=(4, layout.size))
    phases = [np.sort(rng.random(500))] * 4
    values = [layout.predict(p, w) for p, w in zip(phases, truth, strict=True)]
    own, pooled = fit_weights(layout, phases, values, 1e-11)
    np.testing.assert_allclose(own, truth, atol=1e-3)
    np.testing.assert_allclose(pooled, truth.mean(0), atol=1e-3)
    for residual in residuals(layout, phases, values, own):
        np.testing.assert_allclose(residual, 0.0, atol=1e-7)


def test_a_feature_not_seen_in_a_demonstration_follows_the_others_exactly(rng: np.random.Generator) -> None:
    phases, values = demonstrations(MIXED, rng)
    values[1][:, [0, 3]] = np.nan
    own, pooled = fit_weights(MIXED, phases, values)
    for feature, there in enumerate(MIXED.slices):
        same = np.array_equal(own[1, there], pooled[there])
        assert same == (feature in (0, 3))
    others = fit_weights(MIXED, [phases[0], phases[2]], [values[0], values[2]])
    np.testing.assert_allclose(pooled[MIXED.slices[3]], others[1][MIXED.slices[3]], atol=1e-9)


def test_a_gap_is_bridged_by_what_the_others_did(rng: np.random.Generator) -> None:
    layout = Layout((Gaussian(20),))
    phases = [np.linspace(0, 1, 200)] * 6
    movement = [np.sin(5 * p) + 0.1 * rng.normal() * np.cos(3 * p) for p in phases]
    values = [(m + 0.05 * rng.normal(size=200))[:, None] for m in movement]
    gap = (phases[0] > 0.4) & (phases[0] < 0.75)
    values[0] = np.where(gap[:, None], np.nan, values[0])

    def error(bridge: float) -> tuple[float, float]:
        own, pooled = fit_weights(layout, phases, values, bridge=bridge)
        inside, mean = layout.predict(phases[0], own[0])[gap, 0], layout.predict(phases[0], pooled)[gap, 0]
        return float(np.abs(inside - movement[0][gap]).max()), float(np.abs(mean - movement[0][gap]).max())

    bridged, by_the_mean = error(0.1)
    assert bridged < by_the_mean + 0.1
    assert error(0.0)[0] > 10 * bridged  # what the ridge alone leaves to the noise on both sides


def test_where_nobody_was_seen_a_feature_keeps_its_level(rng: np.random.Generator) -> None:
    layout = Layout((Gaussian(20), Gaussian(20)))
    phases = [np.linspace(0, 1, 150)] * 3
    values = [np.stack([5 + np.sin(6 * p), 0.05 * rng.normal(size=150)], axis=1) for p in phases]
    values = [np.where((p[:, None] > 0.3) & (p[:, None] < 0.6), np.nan, v) for p, v in zip(phases, values, strict=True)]
    _, pooled = fit_weights(layout, phases, values)
    middle = layout.predict(np.array([0.45]), pooled)[0]
    np.testing.assert_allclose(middle, np.nanmean(np.concatenate(values), axis=0), atol=0.1)


def test_without_gaps_the_bridge_bears_nothing(rng: np.random.Generator) -> None:
    phases, values = demonstrations(MIXED, rng)
    for v in values:
        v[2::3] = np.nan  # one camera frame in three
    for with_bridge, without in zip(
        fit_weights(MIXED, phases, values, bridge=100.0), fit_weights(MIXED, phases, values, bridge=0.0), strict=True
    ):
        np.testing.assert_array_equal(with_bridge, without)


@pytest.mark.parametrize("periodic", [False, True])
def test_gaps_are_where_no_reading_is_near(periodic: bool) -> None:
    phases = np.linspace(0, 1, 201)
    assert len(unseen(phases, periodic)) == 0
    assert len(unseen(phases[::10], periodic)) == 0  # slow, but without a gap
    np.testing.assert_allclose(unseen(np.empty(0), periodic), np.arange(0.005, 1, 0.01))
    middle = unseen(phases[(phases < 0.3) | (phases > 0.6)], periodic)
    assert 0.3 < middle.min() < 0.33
    assert 0.57 < middle.max() < 0.6
    # On the circle, the readings just before 1 speak for what follows 0, and the other way round.
    late, early = phases[20:-2] + 0.001, phases[2:-20] + 0.001  # no distance is just the one that decides
    assert (unseen(late, periodic).min() > 0.01) == periodic
    assert (unseen(early, periodic).max() < 0.99) == periodic
    assert unseen(late, periodic).max() < 0.1
    assert unseen(phases[20:], periodic=False).min() < 0.01  # phase 1 is not phase 0
    np.testing.assert_array_equal(unseen(late + 3.0, periodic=True), unseen(late, periodic=True))


def test_wide_gaussians_stay_sane(rng: np.random.Generator) -> None:
    basis = Gaussian(20, math.sqrt(0.1))  # the condition number of its ΦᵀΦ is beyond what a float resolves
    layout, ridge = Layout((basis,)), 1e-6
    phases = [np.linspace(0, 1, 200) for _ in range(3)]
    values = [np.sin(6 * p + rng.normal())[:, None] + 0.1 * rng.normal(size=(200, 1)) for p in phases]
    own, pooled = fit_weights(layout, phases, values, ridge)
    stacked = np.concatenate(values)[:, 0]
    expected = plain_ridge(basis(np.concatenate(phases)), stacked, ridge, np.zeros(20))
    np.testing.assert_allclose(layout.predict(phases[0], pooled)[:, 0], basis(phases[0]) @ expected, atol=1e-7)
    # No singular value s of Φ makes s / (s² + λT) larger than 1 / 2√(λT).
    assert np.linalg.norm(pooled) <= np.linalg.norm(stacked) / (2 * math.sqrt(ridge * len(stacked)))
    for weights, reading in zip(own, values, strict=True):
        left = np.linalg.norm(reading[:, 0] - basis(phases[0]) @ pooled)
        assert np.linalg.norm(weights - pooled) <= left / (2 * math.sqrt(ridge * 200))


def test_residuals_are_what_the_weights_leave(rng: np.random.Generator) -> None:
    phases, values = demonstrations(MIXED, rng, missing=0.2)
    own, _ = fit_weights(MIXED, phases, values)
    for n, residual in enumerate(residuals(MIXED, phases, values, own)):
        np.testing.assert_array_equal(np.isnan(residual), np.isnan(values[n]))
        for feature, basis in enumerate(MIXED.bases):
            expected = values[n][:, feature] - basis(phases[n]) @ own[n, MIXED.slices[feature]]
            np.testing.assert_allclose(residual[:, feature], expected, atol=1e-12)
        assert 0.04 < np.nanstd(residual) < 0.06


def test_a_feature_that_is_never_seen_is_named(rng: np.random.Generator) -> None:
    phases, values = demonstrations(MIXED, rng)
    for v in values:
        v[:, 3] = np.nan
    with pytest.raises(DataError, match="feature 3: expected readings, got none in any of 3 demonstrations"):
        fit_weights(MIXED, phases, values)
    with pytest.raises(DataError, match="feature 'wrist_x'"):
        fit_weights(MIXED, phases, values, names=["a", "b", "c", "wrist_x", "e"])


def test_arrays_that_do_not_fit_are_refused(rng: np.random.Generator) -> None:
    phases, values = demonstrations(MIXED, rng)
    with pytest.raises(DataError, match="got 2 and 3"):
        fit_weights(MIXED, phases[:2], values)
    with pytest.raises(DataError, match="got 0 and 0"):
        fit_weights(MIXED, [], [])
    with pytest.raises(DataError, match=r"demonstration 1: expected values \(\d+, 5\), got"):
        fit_weights(MIXED, phases, [values[0], values[1][5:], values[2]])
    with pytest.raises(DataError, match=r"demonstration 0: expected values \(\d+, 2\), got"):
        fit_weights(Layout((Gaussian(4),) * 2), phases, values)
    with pytest.raises(DataError, match="demonstration 2: expected finite phases"):
        fit_weights(MIXED, phases, [values[0], values[1], np.full_like(values[2], np.inf)])
    with pytest.raises(DataError, match="weights of 3 demonstrations, got 2"):
        residuals(MIXED, phases, values, np.zeros((2, MIXED.size)))
    for ridge, bridge in [(0.0, 0.1), (-1.0, 0.1), (math.nan, 0.1), (1e-6, -0.1), (1e-6, math.nan)]:
        with pytest.raises(OptionError, match="expected ridge >= 1e-12 and bridge >= 0"):
            fit_weights(MIXED, phases, values, ridge, bridge=bridge)


def test_a_gap_in_a_real_recording_costs_no_more_than_playing_the_mean(shared_data: Path) -> None:
    episodes = sorted((shared_data / "yumi" / "rocket").glob("*.csv"))[:6]
    tables = [np.loadtxt(path, delimiter=",", skiprows=1) for path in episodes]
    phases = [(t[:, 0] - t[0, 0]) / (t[-1, 0] - t[0, 0]) for t in tables]
    scale = np.concatenate(tables)[:, 1:].std(0)
    moving = scale > 1e-6
    truth = [(t[:, 1:] / np.where(moving, scale, 1.0))[:, moving] for t in tables]
    layout = Layout((Gaussian(16),) * int(moving.sum()))
    hidden = (phases[0] > 0.35) & (phases[0] < 0.65)
    values = [np.where(hidden[:, None], np.nan, truth[0]), *truth[1:]]
    own, pooled = fit_weights(layout, phases, values)

    def rms(weights: np.ndarray) -> float:
        return float(np.sqrt(np.mean((layout.predict(phases[0], weights) - truth[0])[hidden] ** 2)))

    assert rms(own[0]) < 1.2 * rms(pooled)
