"""Shrinkage intensities: the published formulas, written out; what they tend to; and what they are worth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interactions import dataset, shapes_unchecked, taught

from inphase.errors import OptionError
from inphase.training.shrinkage import SHRINKAGES, between, intensity, ledoit_wolf, oas

SEEDS = st.integers(0, 2**32 - 1)
LEARNED = pytest.mark.parametrize("estimate", [ledoit_wolf, oas, lambda samples: between(samples, ())])


def correlated(count: int, size: int, rng: np.random.Generator) -> np.ndarray:
    """Weights (count, size) of movements, neighbours alike, each of another magnitude and mean."""
    place = np.arange(size)
    root = np.linalg.cholesky(np.exp(-np.abs(place[:, None] - place) / 5))
    return rng.normal(size=size) + rng.standard_normal((count, size)) @ root.T * 10.0 ** rng.uniform(-3, 3, size)


# ---------------------------------------------------------------------------------------------------- the formulas


def standardised(samples: np.ndarray) -> list[list[float]]:
    """z of each weight in each demonstration."""
    columns = []
    for column in samples.T.tolist():
        mean = sum(column) / len(column)
        std = (sum((x - mean) ** 2 for x in column) / len(column)) ** 0.5
        columns.append([(x - mean) / std for x in column])
    return [list(row) for row in zip(*columns, strict=True)]


def correlations(rows: list[list[float]]) -> list[list[float]]:
    size = range(len(rows[0]))
    return [[sum(z[i] * z[j] for z in rows) / len(rows) for j in size] for i in size]


def naive_ledoit_wolf(samples: np.ndarray) -> float:
    """b² / d² of Lemma 3.2 to 3.4, norms as they are printed: divided by the dimension."""
    rows = standardised(samples)
    s, count, size = correlations(rows), len(rows), len(rows[0])
    mu = sum(s[i][i] for i in range(size)) / size
    d2 = sum((s[i][j] - mu * (i == j)) ** 2 for i in range(size) for j in range(size)) / size
    b2 = sum((z[i] * z[j] - s[i][j]) ** 2 for z in rows for i in range(size) for j in range(size)) / size / count**2
    return min(b2, d2) / d2


def naive_oas(samples: np.ndarray) -> float:
    """Eq. 23, n being the degrees of freedom that estimating the mean leaves."""
    rows = standardised(samples)
    s, n, p = correlations(rows), len(rows) - 1, len(rows[0])
    trace = sum(s[i][i] for i in range(p))
    trace_of_square = sum(s[i][j] * s[j][i] for i in range(p) for j in range(p))
    above = (1 - 2 / p) * trace_of_square + trace**2
    below = (n + 1 - 2 / p) * (trace_of_square - trace**2 / p)
    return min(above / below, 1.0)


def naive_between(samples: np.ndarray, feature: list[int]) -> float:
    """Σ Var(r) / Σ r² of Schäfer and Strimmer, with their factors and unbiased variances."""
    n, size = len(samples), range(samples.shape[1])
    rows = [[z * ((n - 1) / n) ** 0.5 for z in row] for row in standardised(samples)]
    variances, squares = 0.0, 0.0
    for i in size:
        for j in size:
            if feature[i] != feature[j]:
                w = [z[i] * z[j] for z in rows]
                mean = sum(w) / n
                variances += n / (n - 1) ** 3 * sum((x - mean) ** 2 for x in w)
                squares += (n / (n - 1) * mean) ** 2
    return min(variances / squares, 1.0)


@given(SEEDS, st.integers(3, 12), st.integers(2, 8))
def test_they_are_the_published_formulas(seed: int, count: int, size: int) -> None:
    samples = correlated(count, size, np.random.default_rng(seed))
    assert ledoit_wolf(samples) == pytest.approx(naive_ledoit_wolf(samples), rel=1e-7)
    assert oas(samples) == pytest.approx(naive_oas(samples), rel=1e-7)
    assert between(samples, ()) == pytest.approx(naive_between(samples, list(range(size))), rel=1e-7)
    blocks = (size // 2, size - size // 2)
    feature = [0] * blocks[0] + [1] * blocks[1]
    assert between(samples, blocks) == pytest.approx(naive_between(samples, feature), rel=1e-7)


@LEARNED
@given(SEEDS, st.integers(2, 12), st.integers(2, 8))
def test_units_offsets_and_order_make_no_difference(estimate, seed: int, count: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    samples = rng.standard_normal((count, size))
    other = samples * 10.0 ** rng.uniform(-4, 4, size) * rng.choice([-1, 1], size) + 3 * rng.standard_normal(size)
    other = other[rng.permutation(count)][:, rng.permutation(size)]
    assert 0 <= estimate(samples) <= 1
    assert estimate(other) == pytest.approx(estimate(samples), abs=1e-6)


@LEARNED
@given(SEEDS, st.integers(2, 12), st.integers(0, 6))
def test_a_weight_that_never_varies_is_left_out(estimate, seed: int, count: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    samples, still = rng.standard_normal((count, size)), np.tile(1e6 * rng.standard_normal(3) + 0.1, (count, 1))
    assert estimate(np.concatenate([samples, still], axis=1)) == estimate(samples)
    assert estimate(still) == 0.0


# ------------------------------------------------------------------------------------------------------- the limits


@LEARNED
def test_many_demonstrations_that_are_correlated_need_none(estimate, rng: np.random.Generator) -> None:
    """It falls as 1 / N."""
    few, many = estimate(correlated(400, 20, rng)), estimate(correlated(3000, 20, rng))
    assert many < 0.03
    assert 400 * few == pytest.approx(3000 * many, rel=0.2)


@LEARNED
@pytest.mark.parametrize("count", [20, 200, 2000])
def test_weights_that_have_nothing_to_do_with_each_other_are_shrunk_all_the_way(estimate, count: int) -> None:
    found = [estimate(np.random.default_rng(seed).standard_normal((count, 60))) for seed in range(5)]
    assert np.mean(found) > 0.9


@LEARNED
def test_correlations_of_nothing_are_shrunk_all_the_way(estimate) -> None:
    """Exactly none, which is where the formulas divide by zero."""
    assert estimate(np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])) == 1.0


@LEARNED
def test_two_demonstrations_prove_nothing(estimate, rng: np.random.Generator) -> None:
    assert estimate(rng.standard_normal((2, 30))) == 1.0


# ---------------------------------------------------------------------------------------------- what they are worth


def error(samples: np.ndarray, share: float, kept: np.ndarray, true: np.ndarray) -> float:
    """‖Σ̂ - Σ‖² of the sample covariance of which a share is taken, but for what is kept."""
    cov = np.cov(samples, rowvar=False)
    return float((((1 - share) * cov + share * kept * cov - true) ** 2).sum())


@LEARNED
@pytest.mark.parametrize("count", [8, 24])
def test_the_shrunk_covariance_is_nearer_to_the_true_one(estimate, count: int) -> None:
    """In Frobenius norm, over 60 sets of demonstrations; and nearly as near as the best intensity for each would be."""
    place = np.arange(40)
    true = np.exp(-np.abs(place[:, None] - place) / 4)
    root = np.linalg.cholesky(true)
    errors = []
    for seed in range(60):
        samples = np.random.default_rng(seed).standard_normal((count, 40)) @ root.T
        chosen = error(samples, estimate(samples), np.eye(40), true)
        any_other = [error(samples, share, np.eye(40), true) for share in np.linspace(0, 1, 6)]
        errors.append([chosen, any_other[0], any_other[-1], min(any_other)])
    chosen_error, unshrunk, diagonal, best = np.mean(errors, axis=0)
    assert chosen_error < 0.85 * unshrunk
    assert chosen_error < 0.98 * diagonal
    assert chosen_error < 1.15 * best


# -------------------------------------------------------------------------------------------------- between features


def features(count: int, shared: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Weights (count, 40) of five features, and their true covariance: smooth within, less alike between them."""
    place = np.arange(8)
    true = np.kron(np.full((5, 5), shared) + (1 - shared) * np.eye(5), np.exp(-np.abs(place[:, None] - place) / 4))
    return rng.standard_normal((count, 40)) @ np.linalg.cholesky(true).T, true


EIGHTS = (8,) * 5


@given(SEEDS, st.integers(3, 12))
def test_the_order_of_features_and_of_their_weights_makes_no_difference(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    samples = correlated(count, 6, rng)
    first, second = (
        samples[:, part][:, rng.permutation(part.stop - part.start)] for part in (slice(0, 2), slice(2, 6))
    )
    assert between(samples, (2, 4)) == pytest.approx(between(np.hstack([second, first]), (4, 2)), abs=1e-7)


def test_what_is_within_a_feature_does_not_count(rng: np.random.Generator) -> None:
    """Features that have nothing to do with each other are shrunk all the way, however smooth each of them is."""
    samples, _ = features(200, 0.0, rng)
    assert between(samples, EIGHTS) > 0.9
    assert max(ledoit_wolf(samples), oas(samples), between(samples, ())) < 0.1
    assert between(samples, (40,)) == 0.0  # of one feature, nothing would shrink


@pytest.mark.parametrize("shared", [0.2, 0.6])
@pytest.mark.parametrize("count", [8, 24])
def test_what_is_shrunk_between_features_is_nearer_to_the_truth(count: int, shared: float) -> None:
    """In Frobenius norm, over 60 sets of demonstrations; and nearly as near as the one best intensity for all."""
    errors, kept = [], np.kron(np.eye(5), np.ones((8, 8)))
    for seed in range(60):
        samples, true = features(count, shared, np.random.default_rng(seed))
        shares = [between(samples, EIGHTS), *np.linspace(0, 1, 11)]
        errors.append([error(samples, share, kept, true) for share in shares])
    chosen, *any_other = np.mean(errors, axis=0)
    assert chosen < 0.97 * any_other[0]
    assert chosen < 1.1 * min(any_other)


def test_fit_shrinks_what_is_between_features_only(rng: np.random.Generator) -> None:
    demos = dataset(rng, count=4)
    plain, half = taught(demos), taught(demos, shrinkage=0.5)
    sizes = [basis.size for basis in plain.layout.bases]
    feature = np.repeat(np.arange(len(sizes)), sizes)
    share = np.where(feature[:, None] == feature, 1.0, 0.5)
    np.testing.assert_allclose(half.prior.cov, share * plain.prior.cov, atol=1e-9 * plain.prior.cov.max())
    found = taught(demos, shrinkage="between").prior.shrinkage
    assert found == between(plain.prior.samples, tuple(sizes))


# --------------------------------------------------------------------------------------------------------- the names


def test_a_name_is_a_function_and_a_number_is_itself(rng: np.random.Generator) -> None:
    samples = correlated(8, 5, rng)
    assert list(SHRINKAGES) == ["none", "ledoit-wolf", "oas", "between"]
    assert intensity("none", samples) == 0.0
    assert intensity("ledoit-wolf", samples) == ledoit_wolf(samples)
    assert intensity("oas", samples) == oas(samples)
    assert intensity("between", samples, (2, 3)) == between(samples, (2, 3)) != between(samples, ())
    assert intensity(0.25, samples) == 0.25


@pytest.mark.parametrize(
    ("shrinkage", "message"),
    [
        ("ledoit", "unknown shrinkage 'ledoit'; one of none, ledoit-wolf, oas, between, or a number"),
        (1.5, "between 0 and 1, got 1.5"),
        (float("nan"), "between 0 and 1, got nan"),
    ],
)
def test_what_is_no_shrinkage_is_refused(shrinkage: str | float, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        intensity(shrinkage, np.ones((2, 2)))


@LEARNED
@pytest.mark.parametrize("rows", [np.ones((1, 3)), np.ones(3), np.array([[1.0, np.nan], [0.0, 0.0]])])
def test_what_cannot_be_learned_from_is_refused(estimate, rows: np.ndarray) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match="at least 2 demonstrations, got"):
        estimate(rows)


def test_blocks_that_are_not_all_weights_are_refused(rng: np.random.Generator) -> None:
    with pytest.raises(OptionError, match="expected blocks of 5 weights together, got 2, 2"):
        between(correlated(8, 5, rng), (2, 2))


@settings(max_examples=20)
@given(SEEDS)
def test_samples_are_not_changed(seed: int) -> None:
    samples = np.random.default_rng(seed).standard_normal((4, 3))
    before = samples.copy()
    for name in SHRINKAGES:
        intensity(name, samples)
    np.testing.assert_array_equal(samples, before)
