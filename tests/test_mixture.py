"""Mixture of Gaussians: it climbs, it finds what is there and no more, and it breaks on nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interactions import shapes_unchecked
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from inphase.errors import OptionError
from inphase.mixture import Components, Mixture, expectation_maximisation
from inphase.weight_prior import WeightPrior

SEEDS = st.integers(0, 2**32 - 1)


def white(points: np.ndarray) -> np.ndarray:
    """Points moved and turned until their mean is 0 and their covariance I."""
    off = points - points.mean(0)
    return off @ np.linalg.inv(np.linalg.cholesky(np.cov(off, rowvar=False).reshape(off.shape[1], -1))).T


def ways(rng: np.random.Generator, counts: tuple[int, ...], size: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Weights of demonstrations that go one of several ways, and which; ways lie 10 standard deviations apart."""
    which = np.repeat(np.arange(len(counts)), counts)
    corners, _ = np.linalg.qr(rng.standard_normal((size, len(counts))))
    style = rng.standard_normal((len(which), 3)) @ rng.standard_normal((3, size)) / np.sqrt(size)
    return 10 * corners.T[which] + style + 0.05 * rng.standard_normal((len(which), size)), which


def log_density(mixture: Mixture, weights: np.ndarray) -> np.ndarray:
    """Of weights in the span of the demonstrations, less a constant."""
    parts, size = mixture.components, mixture.components.centres.shape[1]
    c = (weights - mixture.mean) @ np.linalg.pinv(mixture.factor)
    leading = [
        np.log(share) + multivariate_normal.logpdf(c[:, :size], centre, cov)
        for share, centre, cov in zip(parts.shares, parts.centres, parts.covs, strict=True)
    ]
    return logsumexp(leading, axis=0) - 0.5 * (c[:, size:] ** 2).sum(1) - 0.5 * np.log(2 * np.pi) * (c.shape[1] - size)


# ----------------------------------------------------------------------------------------- expectation, maximisation


def objective(points: np.ndarray, parts: Components) -> float:
    """The penalised log-likelihood, as the docstring of the climb has it."""
    size = points.shape[1]
    imagined = np.eye(size) * 3.0 ** (-2 / size)
    total, each = 0.0, []
    for share, centre, cov in zip(parts.shares, parts.centres, parts.covs, strict=True):
        each.append(np.log(share) + multivariate_normal.logpdf(points, centre, cov).reshape(-1))
        total += np.log(share) - 0.5 * (np.linalg.slogdet(cov)[1] + np.trace(imagined @ np.linalg.inv(cov)))
    return total + float(logsumexp(each, axis=0).sum())


@settings(max_examples=40)
@given(SEEDS, st.integers(5, 40), st.integers(1, 4), st.integers(1, 4))
def test_every_round_climbs(seed: int, number: int, size: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points = white(rng.standard_normal((number, size)) * rng.choice([0.1, 1.0, 3.0], (number, 1)))
    belonging = rng.dirichlet(np.ones(count), number)
    reached = [objective(points, expectation_maximisation(points, belonging, rounds)) for rounds in (1, 2, 3, 5, 9, 40)]
    assert (np.diff(reached) > -1e-9 * np.abs(reached[:-1])).all()


@settings(max_examples=20)
@given(SEEDS)
def test_the_top_is_a_top(seed: int) -> None:
    """No small change of shares, centres or covariances finds more than the climb did."""
    rng = np.random.default_rng(seed)
    points = white(np.concatenate([rng.standard_normal((12, 2)), rng.standard_normal((12, 2)) + 6]))
    best = expectation_maximisation(points, np.eye(2)[np.repeat([0, 1], 12)], rounds=1000)
    top = objective(points, best)
    for _ in range(20):
        turn = np.eye(2) + 0.01 * rng.standard_normal((2, 2, 2))
        shares = best.shares * np.exp(0.01 * rng.standard_normal(2))
        other = Components(
            shares / shares.sum(),
            best.centres + 0.01 * rng.standard_normal((2, 2)),
            turn @ best.covs @ turn.transpose(0, 2, 1),
        )
        assert objective(points, other) <= top


@settings(max_examples=30)
@given(SEEDS, st.integers(1, 4), st.integers(1, 4))
def test_log_densities_are_those_of_gaussians(seed: int, size: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    roots = rng.standard_normal((count, size, size)) + 2 * np.eye(size)
    parts = Components(
        rng.dirichlet(np.ones(count)), rng.standard_normal((count, size)), roots @ roots.transpose(0, 2, 1)
    )
    points = rng.standard_normal((7, size))
    expected = [
        np.log(share) + multivariate_normal.logpdf(points, centre, cov)
        for share, centre, cov in zip(parts.shares, parts.centres, parts.covs, strict=True)
    ]
    np.testing.assert_allclose(parts.log_densities(points), np.transpose(expected), rtol=1e-8)


# ----------------------------------------------------------------------------------------------------- what is learned


@pytest.mark.parametrize("counts", [(4, 4), (12, 12), (30, 10), (8, 8, 8), (20, 30, 20), (15, 15, 15, 15)])
def test_ways_that_lie_apart_are_told_apart(counts: tuple[int, ...], rng: np.random.Generator) -> None:
    samples, which = ways(rng, counts)
    mixture = Mixture.learn(samples)
    parts = mixture.components
    assert len(parts.shares) == len(counts)
    # As if one more demonstration had been seen in every component.
    expected = (np.sort(counts) + 1) / (sum(counts) + len(counts))
    np.testing.assert_allclose(np.sort(parts.shares), expected, atol=0.01)
    # What is drawn lies on one of the ways, nearly all of it as near to its middle as demonstrations do.
    drawn = mixture.draw(400, rng)
    middles = np.array([samples[which == way].mean(0) for way in range(len(counts))])
    distance = np.linalg.norm(drawn[:, None] - middles, axis=2)
    assert (distance.min(1) < 5).mean() > 0.95
    taken = np.bincount(distance.argmin(1), minlength=len(counts)) / 400
    np.testing.assert_allclose(taken, (np.array(counts) + 1) / (sum(counts) + len(counts)), atol=0.03)


def test_ways_are_more_likely_under_the_mixture_than_under_a_gaussian(rng: np.random.Generator) -> None:
    samples, _ = ways(rng, (20, 20), size=8)
    learned, held_out = samples[::2], samples[1::2]
    mixture = Mixture.learn(learned)
    alone = Mixture(mixture.mean, mixture.factor, Components(np.ones(1), np.zeros((1, 1)), np.ones((1, 1, 1))))
    assert (log_density(mixture, held_out) - log_density(alone, held_out)).mean() > 0.5


@pytest.mark.parametrize("count", [5, 8, 16])
def test_where_there_is_one_gaussian_one_is_found(count: int) -> None:
    """In nine of ten cases at least; in many dimensions, where any split of the demonstrations looks perfect."""
    found = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        samples = rng.standard_normal((count, 6)) @ rng.standard_normal((6, 80)) + rng.standard_normal((count, 80))
        found.append(len(Mixture.learn(samples).components.shares))
    assert found.count(1) >= 9


def test_a_mixture_of_one_is_the_gaussian_draw_for_draw(rng: np.random.Generator) -> None:
    samples = rng.standard_normal((12, 30)) * 10.0 ** rng.uniform(-2, 2, 30)
    mixture = Mixture.learn(samples)
    assert len(mixture.components.shares) == 1
    drawn, expected = (source.draw(50, np.random.default_rng(3)) for source in (mixture, WeightPrior(samples)))
    np.testing.assert_allclose(drawn, expected, atol=1e-10 * np.abs(samples).max())


@settings(max_examples=12)
@given(SEEDS, st.integers(2, 20), st.integers(1, 30), st.integers(1, 4))
def test_mean_and_covariance_are_those_of_the_demonstrations(seed: int, count: int, size: int, modes: int) -> None:
    rng = np.random.default_rng(seed)
    samples = (
        rng.standard_normal((count, size)) + 9 * rng.standard_normal((modes, size))[rng.integers(modes, size=count)]
    )
    mixture = Mixture.learn(samples)
    parts, leading = mixture.components, mixture.components.centres.shape[1]
    mean, cov = np.zeros(len(mixture.factor)), np.eye(len(mixture.factor))
    mean[:leading] = parts.shares @ parts.centres
    cov[:leading, :leading] = sum(
        share * (within + np.outer(centre, centre))
        for share, centre, within in zip(parts.shares, parts.centres, parts.covs, strict=True)
    ) - np.outer(mean[:leading], mean[:leading])
    np.testing.assert_allclose(
        mixture.mean + mean @ mixture.factor, samples.mean(0), atol=1e-12 * np.abs(samples).max()
    )
    expected = np.cov(samples, rowvar=False).reshape(size, size)
    np.testing.assert_allclose(mixture.factor.T @ cov @ mixture.factor, expected, atol=1e-10 * np.trace(expected))


def test_draws_have_these_moments(rng: np.random.Generator) -> None:
    samples, _ = ways(rng, (9, 15), size=4)
    mixture, count = Mixture.learn(samples), 20_000
    drawn, stds = mixture.draw(count, rng), samples.std(0, ddof=1)
    assert len(mixture.components.shares) == 2
    assert (np.abs(drawn.mean(0) - samples.mean(0)) < 4.5 * stds / np.sqrt(count)).all()
    wrong = np.abs(np.cov(drawn, rowvar=False) - np.cov(samples, rowvar=False)) / np.outer(stds, stds)
    assert wrong.max() < 4.5 * np.sqrt(2 / count)


@pytest.mark.parametrize("wanted", [1, 2, 7, 100])
def test_each_component_gives_as_many_as_its_share_give_or_take_one(wanted: int, rng: np.random.Generator) -> None:
    samples, which = ways(rng, (5, 15))
    mixture = Mixture.learn(samples)
    middles = np.array([samples[which == way].mean(0) for way in range(2)])
    for _ in range(20):
        drawn = mixture.draw(wanted, rng)
        taken = (np.linalg.norm(drawn[:, None] - middles, axis=2).argmin(1) == 0).sum()
        assert abs(taken - wanted * 6 / 22) <= 1


# --------------------------------------------------------------------------------------------------------- invariance


@settings(max_examples=6)
@given(SEEDS, st.sampled_from([(3, 3), (8, 16), (5, 5, 5)]), st.floats(-3, 3), st.floats(-100, 100))
def test_units_and_order_make_no_difference(seed: int, counts: tuple[int, ...], power: float, shift: float) -> None:
    rng = np.random.default_rng(seed)
    samples, _ = ways(rng, counts)
    points, mixture = samples.mean(0) + 0.5 * (samples - samples.mean(0)), Mixture.learn(samples)
    expected = log_density(mixture, points)
    other = Mixture.learn((10**power * samples + shift)[rng.permutation(len(samples))])
    np.testing.assert_allclose(log_density(other, 10**power * points + shift), expected, atol=1e-3)


def test_nothing_but_the_seed_decides(rng: np.random.Generator) -> None:
    samples, _ = ways(rng, (10, 10))
    one, other = (Mixture.learn(samples).draw(9, np.random.default_rng(4)) for _ in range(2))
    np.testing.assert_array_equal(one, other)


# --------------------------------------------------------------------------------------------------------- hard cases


@settings(max_examples=40)
@given(SEEDS, st.integers(2, 20), st.integers(1, 50), st.integers(1, 4), st.floats(-8, 8))
def test_whatever_is_shown_what_is_drawn_lies_near_it(
    seed: int, count: int, size: int, different: int, power: float
) -> None:
    """Demonstrations that are the same, weights that never vary, others that are ten orders of magnitude larger."""
    rng = np.random.default_rng(seed)
    distinct = rng.standard_normal((min(different, count), size)) * 10 ** (power * rng.random(size))
    samples = distinct[rng.integers(len(distinct), size=count)]
    samples[:, rng.random(size) < 0.2] = rng.standard_normal()
    mixture = Mixture.learn(samples)
    drawn = mixture.draw(100, rng)
    assert np.isfinite(drawn).all()
    scale = np.abs(samples).max(0)
    assert (np.abs(drawn - samples.mean(0)) <= 6 * samples.std(0, ddof=1) + 1e-9 * scale.max()).all()
    off, span = drawn - mixture.mean, np.linalg.svd(samples - samples.mean(0), full_matrices=False)
    plane = span[2][span[1] > 1e-10 * max(span[1][0], 1e-300)]
    assert np.abs(off - off @ plane.T @ plane).max() <= 1e-9 * scale.max()


@pytest.mark.parametrize("count", [2, 3, 9])
def test_demonstrations_that_are_all_the_same_are_all_there_is(count: int) -> None:
    row = np.arange(5.0)
    mixture = Mixture.learn(np.tile(row, (count, 1)))
    np.testing.assert_array_equal(mixture.draw(3, np.random.default_rng(0)), np.tile(row, (3, 1)))


def test_two_demonstrations_draw_on_the_line_between_them(rng: np.random.Generator) -> None:
    rows = rng.standard_normal((2, 6))
    along = rows[1] - rows[0]
    off = Mixture.learn(rows).draw(50, rng) - rows[0]
    assert np.abs(off - np.outer(off @ along / (along @ along), along)).max() < 1e-12


def test_two_points_shown_many_times_over_are_two_narrow_components(rng: np.random.Generator) -> None:
    rows = np.repeat(rng.standard_normal((2, 6)), 10, axis=0)
    parts = Mixture.learn(rows).components
    assert len(parts.shares) == 2
    assert 0 < parts.covs.max() < 0.05  # of a variance of 1 in all


@pytest.mark.parametrize("rows", [np.ones((1, 3)), np.ones(3), np.array([[1.0, np.nan], [0.0, 0.0]])])
def test_what_cannot_be_learned_from_is_refused(rows: np.ndarray) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match="at least 2 demonstrations, got"):
        Mixture.learn(rows)


def test_a_mixture_is_read_only(rng: np.random.Generator) -> None:
    samples, _ = ways(rng, (6, 6))
    mixture = Mixture.learn(samples)
    parts = mixture.components
    for array in (mixture.mean, mixture.factor, parts.shares, parts.centres, parts.covs, parts.roots):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


# --------------------------------------------------------------------------------------- draws that are to be believed


@pytest.mark.parametrize("blocks", [(), (1, 1, 2), (1, 3)])
@pytest.mark.parametrize(("shrinkage", "trust"), [(0.0, 1.0), (0.4, 1.0), (0.0, 0.5), (0.4, 0.5), (1.0, 0.0)])
def test_what_is_drawn_elsewhere_gets_the_covariance_that_is_believed(
    shrinkage: float, trust: float, blocks: tuple[int, ...], rng: np.random.Generator
) -> None:
    samples, _ = ways(rng, (9, 15), size=4)
    prior, count = WeightPrior(samples, shrinkage, trust, partner=2, blocks=blocks), 20_000
    believed = prior.as_believed(Mixture.learn(samples).draw(count, rng), rng)
    stds = np.sqrt(np.diag(prior.cov))
    assert (np.abs(np.cov(believed, rowvar=False) - prior.cov) < 5 * np.outer(stds, stds) * np.sqrt(2 / count)).all()
    assert (np.abs(believed.mean(0) - prior.mean) < 4.5 * stds / np.sqrt(count)).all()
