"""Weight prior: the Gaussian of the demonstrations, in as few directions as they span."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from interactions import shapes_unchecked

from inphase.errors import OptionError
from inphase.weight_prior import WeightPrior

COUNTS = st.integers(2, 9)
SIZES = st.integers(1, 12)
SEEDS = st.integers(0, 2**32 - 1)
SHARES = st.floats(0.0, 1.0)


def samples(count: int, size: int, seed: int) -> np.ndarray:
    """Weights (count, size), every one of another magnitude, as those of unlike channels are."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=size) + rng.normal(size=(count, size)) * 10.0 ** rng.uniform(-2, 2, size)


def sample_cov(rows: np.ndarray) -> np.ndarray:
    return np.cov(rows, rowvar=False).reshape(rows.shape[1], rows.shape[1])


def cut(size: int, seed: int) -> tuple[int, ...]:
    """Features of 1 … size weights, together that many."""
    ends = np.flatnonzero(np.random.default_rng(seed).random(size - 1) < 0.4) + 1
    return tuple(np.diff([0, *ends, size]).tolist())


def within(blocks: tuple[int, ...]) -> np.ndarray:
    """(B, B) whether two weights belong to one feature."""
    feature = [i for i, count in enumerate(blocks) for _ in range(count)]
    return np.array([[one == other for other in feature] for one in feature])


def in_proportion(got: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """The difference of two covariances as a share of the standard deviations it lies between."""
    stds = np.sqrt(np.diag(expected))
    return np.abs(got - expected) / np.outer(stds, stds)


@given(COUNTS, SIZES, SEEDS)
def test_the_factor_squared_is_the_sample_covariance(count: int, size: int, seed: int) -> None:
    rows = samples(count, size, seed)
    prior, expected = WeightPrior(rows), sample_cov(rows)
    # Directions below 1e-10 of the largest are dropped: of weights that are 1e-4 of another, (1e-6)² of the variance.
    assert in_proportion(prior.factor.T @ prior.factor, expected).max() < 1e-9
    np.testing.assert_allclose(prior.cov, expected, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(prior.mean, rows.mean(0))


@given(COUNTS, SIZES, SEEDS, SHARES, SHARES)
def test_few_rows_have_the_covariance_of_every_feature_alone(
    count: int, size: int, seed: int, shrinkage: float, trust: float
) -> None:
    rows, blocks = samples(count, size, seed), cut(size, seed)
    partner = int(np.cumsum((0, *blocks))[seed % (len(blocks) + 1)])
    prior = WeightPrior(rows, shrinkage, trust, partner, blocks)
    own = within(blocks)
    assert len(prior.alone) == count
    assert in_proportion(prior.alone.T @ prior.alone, sample_cov(rows))[own].max() < 1e-9
    assert in_proportion(prior.cov, sample_cov(rows))[own].max() < 1e-8


def test_a_partner_who_ends_within_a_feature_takes_all_rows() -> None:
    rows = samples(5, 6, 0)
    for prior in (WeightPrior(rows, 0.3, 0.5, 2, (3, 3)), WeightPrior(rows, 0.3, 0.5, 3)):
        np.testing.assert_array_equal(prior.alone, prior.factor)


@given(COUNTS, SIZES, SEEDS)
def test_there_are_fewer_directions_than_demonstrations(count: int, size: int, seed: int) -> None:
    assert len(WeightPrior(samples(count, size, seed)).factor) <= min(count - 1, size)


@given(COUNTS, SIZES, SEEDS, SHARES)
def test_shrinking_keeps_variances_and_takes_a_share_of_the_rest(
    count: int, size: int, seed: int, shrinkage: float
) -> None:
    rows = samples(count, size, seed)
    whole = sample_cov(rows)
    expected = (1 - shrinkage) * whole + shrinkage * np.diag(np.diag(whole))
    assert in_proportion(WeightPrior(rows, shrinkage).cov, expected).max() < 1e-9


@given(COUNTS, SIZES, SEEDS, SHARES)
def test_shrinking_takes_a_share_of_what_is_between_features_only(
    count: int, size: int, seed: int, shrinkage: float
) -> None:
    rows, blocks = samples(count, size, seed), cut(size, seed)
    whole = sample_cov(rows)
    expected = (1 - shrinkage) * whole + shrinkage * whole * within(blocks)
    assert in_proportion(WeightPrior(rows, shrinkage, blocks=blocks).cov, expected).max() < 1e-9


@given(COUNTS, SIZES, SEEDS, SHARES)
def test_of_one_feature_alone_nothing_shrinks(count: int, size: int, seed: int, shrinkage: float) -> None:
    rows = samples(count, size, seed)
    assert in_proportion(WeightPrior(rows, shrinkage, blocks=(size,)).cov, sample_cov(rows)).max() < 1e-9


@given(COUNTS, st.integers(2, 12), SEEDS, SHARES, SHARES)
def test_a_feature_has_no_more_directions_than_demonstrations_or_weights(
    count: int, size: int, seed: int, shrinkage: float, trust: float
) -> None:
    rows, blocks = samples(count, size, seed), cut(size, seed)
    prior = WeightPrior(rows, shrinkage, trust, sum(blocks[: len(blocks) // 2]), blocks)
    assert len(prior.factor) <= sum(min(count - 1, own) for own in blocks)


@given(COUNTS, st.integers(2, 12), SEEDS, SHARES, SHARES, st.floats(0, 1), st.booleans())
def test_trust_is_the_share_of_the_correlation_between_the_partners(
    count: int, size: int, seed: int, trust: float, shrinkage: float, where: float, features: bool
) -> None:
    rows, partner, blocks = samples(count, size, seed), round(where * size), cut(size, seed) if features else ()
    expected = WeightPrior(rows, shrinkage, blocks=blocks).cov
    expected[:partner, partner:] *= trust
    expected[partner:, :partner] *= trust
    assert in_proportion(WeightPrior(rows, shrinkage, trust, partner, blocks).cov, expected).max() < 1e-9


@given(COUNTS, st.integers(2, 12), SEEDS, SHARES, SHARES)
def test_a_feature_that_is_left_out_is_nothing_to_the_others(
    count: int, size: int, seed: int, shrinkage: float, trust: float
) -> None:
    """However much is believed of them, it is the prior of a model without that feature."""
    rows, blocks = samples(count, size, seed), cut(size, seed)
    of, shown = np.repeat(np.arange(len(blocks)), blocks), len(blocks) // 2
    for left_out in range(len(blocks) if len(blocks) > 1 else 0):
        kept = of != left_out
        others = tuple(own for i, own in enumerate(blocks) if i != left_out)
        partner = int((kept & (of < shown)).sum())
        whole = WeightPrior(rows, shrinkage, trust, sum(blocks[:shown]), blocks).cov[np.ix_(kept, kept)]
        assert in_proportion(WeightPrior(rows[:, kept], shrinkage, trust, partner, others).cov, whole).max() < 1e-9


@pytest.mark.parametrize("trust", [0.0, 0.6, 1.0])
def test_resampled_partners_are_as_correlated_as_they_are_trusted(trust: float, rng: np.random.Generator) -> None:
    rows, count = samples(5, 4, 2), 20_000
    prior = WeightPrior(rows, trust=trust, partner=2)
    taken = prior.resample(count, rng)
    expected = prior.cov * 4 / 5  # of all five, not of a sample of them
    stds = np.sqrt(np.diag(expected))
    assert (np.abs(taken.mean(0) - prior.mean) < 4.5 * stds / np.sqrt(count) + 1e-12).all()
    # The products of two of five values have a kurtosis of their own, below 4: twice the Gaussian's error.
    assert (np.abs(np.cov(taken, rowvar=False) - expected) < 9 * np.outer(stds, stds) * np.sqrt(2 / count)).all()
    assert {tuple(row) for row in taken[:, :2]} == {tuple(row) for row in rows[:, :2]}


@pytest.mark.parametrize("blocks", [(), (1, 3)])
def test_without_demonstrations_that_differ_there_is_no_spread(blocks: tuple[int, ...]) -> None:
    prior = WeightPrior(np.ones((3, 4)), 0.5, blocks=blocks)
    np.testing.assert_array_equal(prior.cov, np.zeros((4, 4)))
    np.testing.assert_array_equal(prior.draw(2, np.random.default_rng(0)), np.ones((2, 4)))


@pytest.mark.parametrize("shrinkage", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("count", [2, 3, 20])
@pytest.mark.parametrize("blocks", [(), (3, 2)])
def test_draws_have_the_mean_and_covariance(
    count: int, shrinkage: float, blocks: tuple[int, ...], rng: np.random.Generator
) -> None:
    prior, draws = WeightPrior(samples(count, 5, 3), shrinkage, blocks=blocks), 20_000
    drawn = prior.draw(draws, rng)
    variances = np.diag(prior.cov)
    # 4.5 standard errors of a mean, and of a covariance: sqrt((Σii Σjj + Σij²) / n).
    assert (np.abs(drawn.mean(0) - prior.mean) < 4.5 * np.sqrt(variances / draws) + 1e-12).all()
    tolerance = 4.5 * np.sqrt((np.outer(variances, variances) + prior.cov**2) / draws)
    assert (np.abs(np.cov(drawn, rowvar=False) - prior.cov) < tolerance).all()


def test_two_demonstrations_draw_on_the_line_between_them(rng: np.random.Generator) -> None:
    rows = samples(2, 6, 1)
    along = rows[1] - rows[0]
    off = WeightPrior(rows).draw(50, rng) - rows[0]
    off = off - np.outer(off @ along / (along @ along), along)
    assert np.abs(off).max() < 1e-12 * np.abs(rows).max()


@given(COUNTS, st.integers(1, 60), SEEDS)
def test_every_demonstration_is_taken_as_often_as_any_other(count: int, wanted: int, seed: int) -> None:
    rows = samples(count, 3, seed)
    taken = WeightPrior(rows).resample(wanted, np.random.default_rng(seed))
    times = np.array([(taken == row).all(axis=1).sum() for row in rows])
    assert taken.shape == (wanted, 3)
    assert times.sum() == wanted
    assert times.max() - times.min() <= 1


def test_the_odd_ones_out_are_drawn_by_lot() -> None:
    prior = WeightPrior(np.arange(8.0)[:, None])
    firsts = {float(prior.resample(1, np.random.default_rng(seed))[0, 0]) for seed in range(200)}
    assert len(firsts) == 8  # each is left out 200 times with probability (7/8)²⁰⁰ < 1e-11


@given(COUNTS, SIZES, SEEDS)
def test_drawing_takes_nothing_but_the_seed(count: int, size: int, seed: int) -> None:
    prior = WeightPrior(samples(count, size, seed), 0.3)
    for method in (prior.draw, prior.resample):
        again = (method(7, np.random.default_rng(seed)) for _ in range(2))
        np.testing.assert_array_equal(*again)


@pytest.mark.parametrize(
    ("rows", "options"),
    [
        (np.ones((1, 3)), {}),
        (np.ones((0, 3)), {}),
        (np.ones(3), {}),
        (np.array([[1.0, np.nan], [0.0, 0.0]]), {}),
        (np.array([[1.0, np.inf], [0.0, 0.0]]), {}),
        *[(np.ones((2, 3)), {name: value}) for name in ("shrinkage", "trust") for value in (-0.1, 1.1, np.nan)],
        (np.ones((2, 3)), {"partner": -1}),
        (np.ones((2, 3)), {"partner": 4}),
        *[(np.ones((2, 3)), {"blocks": blocks}) for blocks in [(2,), (2, 2), (3, 0), (4, -1), (1.5, 1.5)]],
    ],
)
def test_what_is_no_prior_is_refused(rows: np.ndarray, options: dict[str, Any]) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match="expected"):
        WeightPrior(rows, **options)


@pytest.mark.parametrize("rank", [1, 3, 5])
def test_a_prior_of_moments_has_just_these(rank: int, rng: np.random.Generator) -> None:
    mean, root = rng.normal(size=5), rng.normal(size=(rank, 5))
    prior = WeightPrior.from_moments(mean, root.T @ root)
    np.testing.assert_allclose(prior.mean, mean, atol=1e-12)
    np.testing.assert_allclose(prior.cov, root.T @ root, atol=1e-12)
    assert len(prior.factor) == rank
    with pytest.raises(OptionError, match="expected a covariance of the weights"):
        WeightPrior.from_moments(mean, root.T @ root - 2 * np.diag(mean**2 + 1))
    with pytest.raises(OptionError, match="expected a covariance of the weights"):
        WeightPrior.from_moments(mean, root.T @ root + np.triu(np.ones((5, 5)), 1))


def test_a_prior_is_read_only_and_its_own() -> None:
    rows = samples(4, 3, 0)
    prior, mean = WeightPrior(rows), rows.mean(0)
    rows[:] = 0.0
    np.testing.assert_array_equal(prior.mean, mean)
    for array in (prior.samples, prior.mean, prior.factor):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    prior.cov[:] = 0.0  # the caller's own
    assert prior.cov.any()
