"""Ensemble filter: its square-root update against the Kalman formulas, and its priors of any size."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interactions import chance_model, known_phase, phase_model, shapes_unchecked
from scipy.stats import multivariate_normal

import inphase
from inphase.errors import OptionError
from inphase.filters import Course, EnsembleBelief, make
from inphase.filters.belief import ensemble
from inphase.filters.gaussian import spread_score
from inphase.observation import Observation

PRIORS = pytest.mark.parametrize("prior", ["demonstrations", "gaussian", "mixture"])
UPDATES = pytest.mark.parametrize("update", ["stochastic", "square-root"])
SEEDS = st.integers(0, 2**32 - 1)
ANYONE = np.random.default_rng(1)  # for steps that are to use no chance


def some_members(model: inphase.Model, count: int, rng: np.random.Generator) -> EnsembleBelief:
    """Members around the middle of the interaction, so that no phase is clipped."""
    moving = np.array([0.5, 0.8]) + np.array([0.01, 0.1]) * rng.standard_normal((count, 2))
    return EnsembleBelief(model, np.concatenate([moving, model.prior.draw(count, rng)], axis=1))


def readings_of(belief: EnsembleBelief, features: np.ndarray) -> np.ndarray:
    """(E, M) what every member reads, one after the other."""
    layout, members = belief.model.layout, belief.members
    return np.array([layout.predict(x[:1], x[2:], features)[0] for x in members])


def seen_near(
    belief: EnsembleBelief, features: np.ndarray, noise_var: np.ndarray, rng: np.random.Generator
) -> Observation:
    """A sample as it may be expected."""
    readings = readings_of(belief, features)
    spread = np.sqrt(readings.var(0, ddof=1) + noise_var)
    return Observation(features, readings.mean(0) + 0.5 * spread * rng.standard_normal(len(features)), noise_var)


def kalman(belief: EnsembleBelief, seen: Observation) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean, covariance and log-likelihood of Eq. 2.7 to 2.10, from the ensemble's own, a reading at a time."""
    size, readings = belief.members.shape[1], readings_of(belief, seen.features)
    joint = np.concatenate([belief.members, readings], axis=1)
    mean, cov, total = joint.mean(0), np.cov(joint, rowvar=False), 0.0
    for i, (value, noise_var) in enumerate(zip(seen.values, seen.noise_var, strict=True)):
        row = np.eye(len(mean))[size + i]
        innovation_var = row @ cov @ row + noise_var
        total += float(multivariate_normal.logpdf(value, row @ mean, innovation_var))
        gain = cov @ row / innovation_var
        rest = np.eye(len(mean)) - np.outer(gain, row)
        mean = mean + gain * (value - row @ mean)
        cov = rest @ cov @ rest.T + noise_var * np.outer(gain, gain)
    return mean[:size], cov[:size, :size], total


def moments(belief: EnsembleBelief) -> tuple[np.ndarray, np.ndarray]:
    return belief.members.mean(0), np.cov(belief.members, rowvar=False)


def assert_moments(got: EnsembleBelief, mean: np.ndarray, cov: np.ndarray, stds: np.ndarray, share: float) -> None:
    """Equal to a share of the standard deviations that were before."""
    got_mean, got_cov = moments(got)
    assert (np.abs(got_mean - mean) / stds).max() < share
    assert (np.abs(got_cov - cov) / np.outer(stds, stds)).max() < share


def two_ways(rng: np.random.Generator, phase: inphase.PhaseModel, count: int = 40) -> inphase.Model:
    """A model of interactions that go one of two ways, far apart."""
    model = chance_model(rng, phase, demonstrations=count)
    side = np.where(np.arange(count) % 3 == 0, 4.0, -2.0)
    apart = model.prior.samples + np.outer(side, rng.standard_normal(model.layout.size))
    return dataclasses.replace(model, prior=inphase.WeightPrior(apart))


# ------------------------------------------------------------------------------------------------- square-root update


@settings(max_examples=25)
@given(SEEDS, st.integers(2, 40), st.integers(1, 4), st.floats(0, 6))
def test_the_square_root_update_has_the_moments_of_the_kalman_filter(
    seed: int, count: int, seen_count: int, span: float
) -> None:
    """With more members than readings and fewer, and with variances up to twelve orders of magnitude apart."""
    rng = np.random.default_rng(seed)
    model = chance_model(rng, phase_model())
    before = some_members(model, count, rng)
    features = np.sort(rng.permutation(4)[:seen_count])
    seen = seen_near(before, features, 10 ** rng.uniform(-span, span, seen_count), rng)
    mean, cov, log_likelihood = kalman(before, seen)
    after, info = make("ebip", model, update="square-root").step(before, seen, 0.0, ANYONE)
    assert info.log_likelihood == pytest.approx(log_likelihood, rel=1e-9, abs=1e-9)
    assert_moments(after, mean, cov, before.members.std(0, ddof=1), 1e-10)


@settings(max_examples=25)
@given(SEEDS)
def test_readings_of_any_precision_leave_an_ensemble(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = chance_model(rng, phase_model())
    before = some_members(model, 10, rng)
    seen = seen_near(before, np.arange(4), 10 ** rng.uniform(-20, 20, 4), rng)
    after, _ = make("ebip", model, update="square-root").step(before, seen, 0.0, ANYONE)
    mean, cov, _ = kalman(before, seen)
    assert_moments(after, mean, cov, before.members.std(0, ddof=1), 1e-3)


@settings(max_examples=25)
@given(SEEDS, st.integers(2, 30))
def test_the_members_move_as_little_as_they_have_to(seed: int, count: int) -> None:
    """Of all roots, the symmetric one: what each member is moved by is a symmetric matrix times the deviations."""
    rng = np.random.default_rng(seed)
    model = chance_model(rng, phase_model())
    before = some_members(model, count, rng)
    seen = seen_near(before, np.arange(4), rng.uniform(0.01, 1.0, 4), rng)
    after, _ = make("ebip", model, update="square-root").step(before, seen, 0.0, ANYONE)
    deviations = readings_of(before, np.arange(4)) - readings_of(before, np.arange(4)).mean(0)
    inside = np.eye(count) + deviations / seen.noise_var @ deviations.T / (count - 1)
    value, vector = np.linalg.eigh(inside)
    expected = vector / np.sqrt(value) @ vector.T @ (before.members - before.members.mean(0))
    np.testing.assert_allclose(after.members - after.members.mean(0), expected, atol=1e-10)


@settings(max_examples=25)
@given(SEEDS, st.integers(2, 30))
def test_members_are_told_apart_by_nothing_but_their_state(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    model = chance_model(rng, phase_model())
    before, order = some_members(model, count, rng), rng.permutation(count)
    seen = seen_near(before, np.array([0, 3]), np.array([0.01, 1.0]), rng)
    filter = make("ebip", model, update="square-root")
    after, _ = filter.step(before, seen, 0.0, ANYONE)
    shuffled, _ = filter.step(EnsembleBelief(model, before.members[order]), seen, 0.0, ANYONE)
    np.testing.assert_allclose(shuffled.members, after.members[order], atol=1e-10)


@UPDATES
@pytest.mark.parametrize("features", [[0, 1], [0, 3], [2, 3]])
def test_how_the_controlled_weights_are_carried_makes_no_difference(
    update: str, features: list[int], rng: np.random.Generator
) -> None:
    model = chance_model(rng, phase_model())
    plain = some_members(model, 5, rng)
    mixed = ensemble(model, plain.members)
    assert mixed.roots is not None
    assert mixed.carried.shape[1] < plain.carried.shape[1]
    filter, everything = make("ebip", model, update=update), np.arange(model.layout.count)
    for step in range(5):
        seen = seen_near(plain, np.array(features), np.array([0.1, 0.3]), rng)
        plain, mixed = (filter.step(b, seen, 0.01, np.random.default_rng(step))[0] for b in (plain, mixed))
        np.testing.assert_allclose(mixed.members, plain.members, atol=1e-11)
        np.testing.assert_allclose(mixed.weights_mean, plain.weights_mean, atol=1e-11)
        course = Course(np.array([1.0, 0.5]), np.array([0.0, 0.5]))
        for told in (everything, everything[:2], everything[-1:]):
            for got, expected in zip(mixed.trajectory(course, told), plain.trajectory(course, told), strict=True):
                np.testing.assert_allclose(got, expected, atol=1e-11)


@settings(max_examples=50)
@given(SEEDS, st.integers(1, 8), st.integers(1, 8), st.floats(-6, 2))
def test_a_sample_is_scored_in_the_smaller_of_members_and_readings(
    seed: int, members: int, readings: int, noise: float
) -> None:
    rng = np.random.default_rng(seed)
    spread, noise_var = rng.standard_normal((members, readings)), 10**noise * rng.uniform(0.5, 2.0, readings)
    cov = spread.T @ spread + np.diag(noise_var)
    innovation = np.linalg.cholesky(cov) @ rng.standard_normal(readings)
    score = spread_score(innovation, spread, noise_var)
    assert score is not None
    expected = multivariate_normal.logpdf(innovation, np.zeros(readings), cov, allow_singular=False)
    assert score.log_likelihood == pytest.approx(expected, abs=1e-6)
    assert score.surprise == pytest.approx(innovation @ np.linalg.solve(cov, innovation), abs=1e-6)
    columns = rng.standard_normal((readings, 3))
    for right in (columns, columns[:, 0]):
        np.testing.assert_allclose(cov @ score.solve(right), right, atol=1e-6)


def test_chance_has_no_part_in_a_square_root_update(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    before = some_members(model, 20, rng)
    seen = seen_near(before, np.arange(4), np.full(4, 0.1), rng)
    for update, uses_chance in (("square-root", False), ("stochastic", True)):
        filter, state = make("ebip", model, update=update), rng.bit_generator.state
        one, _ = filter.step(before, seen, 0.0, rng)
        assert (rng.bit_generator.state != state) is uses_chance
        other, _ = filter.step(before, seen, 0.0, rng)
        assert (one.members.tobytes() != other.members.tobytes()) is uses_chance


def test_on_average_the_perturbed_members_are_those_of_the_square_root(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    before = some_members(model, 20, rng)
    seen, runs = seen_near(before, np.array([0, 2]), np.array([0.05, 0.2]), rng), 500
    mean, cov, _ = kalman(before, seen)
    filter = make("ebip", model)
    each = [moments(filter.step(before, seen, 0.0, rng)[0]) for _ in range(runs)]
    means, covs = np.array([m for m, _ in each]), np.array([c for _, c in each])
    assert (np.abs(means.mean(0) - mean) < 5 * means.std(0) / np.sqrt(runs)).all()
    assert (np.abs(covs.mean(0) - cov) < 5 * covs.std(0) / np.sqrt(runs)).all()


@pytest.mark.parametrize("members", [25, 60])
def test_members_with_the_moments_of_the_prior_are_the_kalman_filter(members: int, rng: np.random.Generator) -> None:
    """With the phase known, step for step, and not only as members become many."""
    model = chance_model(rng, known_phase())
    exact, filter = make("bip", model), make("ebip", model, update="square-root")
    drawn = rng.standard_normal((members, len(model.prior.factor)))
    drawn -= drawn.mean(0)
    drawn = drawn @ np.linalg.inv(np.linalg.cholesky(np.cov(drawn, rowvar=False))).T
    phase = np.tile(model.phase.mean, (members, 1))
    expected = exact.init(rng)
    belief = EnsembleBelief(model, np.concatenate([phase, model.prior.mean + drawn @ model.prior.factor], axis=1))
    stds = np.sqrt(np.diag(expected.weights_cov))
    for _ in range(40):
        features = np.flatnonzero(rng.random(4) < 0.5)
        seen = Observation(features, rng.standard_normal(len(features)), rng.uniform(0.01, 0.2, len(features)))
        expected, told = exact.step(expected, seen, 0.02, rng)
        belief, info = filter.step(belief, seen, 0.02, rng)
        assert info.log_likelihood == pytest.approx(told.log_likelihood, rel=1e-9)
        assert info.surprise == pytest.approx(told.surprise, rel=1e-9)
        assert (np.abs(belief.weights_mean - expected.weights_mean) / stds).max() < 1e-10
        cov = np.cov(belief.members[:, 2:], rowvar=False)
        assert (np.abs(cov - expected.weights_cov) / np.outer(stds, stds)).max() < 1e-10


@settings(max_examples=25)
@given(SEEDS)
def test_a_sample_in_two_is_the_whole_sample_where_readings_are_linear(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = chance_model(rng, known_phase(start=0.5))
    filter = make("ebip", model, members=12, prior="gaussian", update="square-root")
    before = filter.init(rng)
    seen = seen_near(before, np.arange(4), rng.uniform(0.01, 1.0, 4), rng)
    whole, info = filter.step(before, seen, 0.0, ANYONE)
    first, second = (
        Observation(seen.features[part], seen.values[part], seen.noise_var[part]) for part in (slice(0, 1), slice(1, 4))
    )
    half, told_first = filter.step(before, first, 0.0, ANYONE)
    both, told_second = filter.step(half, second, 0.0, ANYONE)
    assert info.log_likelihood == pytest.approx(told_first.log_likelihood + told_second.log_likelihood, abs=1e-8)
    stds = np.maximum(before.members.std(0, ddof=1), 1e-9)
    assert_moments(both, *moments(whole), stds, 1e-9)


def test_a_reading_that_is_worth_nothing_does_nothing(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    before = some_members(model, 20, rng)
    filter = make("ebip", model, update="square-root")
    good = seen_near(before, np.array([1]), np.array([1e-4]), rng)
    beside = Observation(np.array([0, 1]), np.array([3.0, good.values[0]]), np.array([1e20, 1e-4]))
    alone, together = (filter.step(before, seen, 0.0, ANYONE)[0] for seen in (good, beside))
    np.testing.assert_allclose(together.members, alone.members, atol=1e-8)
    worthless = Observation(np.array([0]), np.array([3.0]), np.array([1e20]))
    np.testing.assert_allclose(filter.step(before, worthless, 0.0, ANYONE)[0].members, before.members, atol=1e-12)


@pytest.mark.parametrize("size", [1e3, 1e10, 1e60, 1e140, 1e160, 1e308])
def test_no_reading_is_too_large_to_survive(size: float, rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    filter = make("ebip", model, members=10, update="square-root")
    belief = filter.init(rng)
    for values in ([0.1, 0.1], [size, -size], [0.1, 0.1], [size, size], [0.1, 0.1]):
        seen = Observation(np.array([0, 1]), np.array(values), np.array([0.1, 0.1]))
        belief, _ = filter.step(belief, seen, 0.02, rng)
        assert np.isfinite(belief.members).all()


def test_a_square_root_ensemble_follows_for_long(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model(periodic=True), demonstrations=4)  # where no end of the phase stops it
    filter = make("ebip", model, members=10, update="square-root")
    belief = filter.init(rng)
    for i in range(500):
        noise_var = np.full(2, 1e-4 if i % 100 == 0 else 1.0)
        seen = Observation(np.array([0, 2]), 3 * rng.standard_normal(2), noise_var)
        belief, info = filter.step(belief, seen, 0.01, rng)
        assert info.healthy
    assert np.isfinite(belief.members).all()
    assert np.ptp(belief.members[:, 0]) <= 1
    assert np.linalg.eigvalsh(belief.phase_cov).min() > 0


# -------------------------------------------------------------------------------------------------------------- priors


@PRIORS
@UPDATES
def test_with_the_phase_known_every_prior_comes_to_the_kalman_filter(
    prior: str, update: str, rng: np.random.Generator
) -> None:
    """However far from Gaussian the members are: an ensemble filter looks at their first two moments only."""
    model = two_ways(rng, known_phase())
    exact, filter = make("bip", model), make("ebip", model, members=20_000, prior=prior, update=update)
    belief, expected = filter.init(rng), exact.init(rng)
    course, everything = Course(np.zeros(9), np.linspace(0, 1, 9)), np.arange(4)
    _, before = expected.trajectory(course, everything)
    features, weights = np.array([0, 2]), model.prior.samples[0]
    for phase in (0.3, 0.5, 0.7, 0.9):
        values = model.layout.predict(np.array([phase]), weights, features)[0]
        seen = Observation(features, values, np.array([0.1, 0.3]))
        belief, expected = filter.step(belief, seen, 0.25, rng)[0], exact.step(expected, seen, 0.25, rng)[0]
    mean, var = belief.trajectory(course, everything)
    expected_mean, expected_var = expected.trajectory(course, everything)
    assert (expected_var < 0.5 * before).any()
    # 5 standard errors of 20,000 draws; demonstrations vary by 1/40 less than the density they were drawn from.
    np.testing.assert_array_less(np.abs(mean - expected_mean) / np.sqrt(before), 0.035)
    np.testing.assert_array_less(np.abs(var - expected_var) / before, 0.035)


@PRIORS
@pytest.mark.parametrize("demonstrations", [2, 3, 8, 30])
@pytest.mark.parametrize("members", [2, 7, 64])
def test_an_ensemble_has_any_size_from_any_number_of_demonstrations(
    prior: str, demonstrations: int, members: int, rng: np.random.Generator
) -> None:
    model = chance_model(rng, phase_model(), demonstrations=demonstrations)
    filter = make("ebip", model, members=members, prior=prior)
    one, same, other = (filter.init(np.random.default_rng(seed)) for seed in (0, 0, 1))
    assert one.members.shape == (members, 2 + model.layout.size)
    np.testing.assert_array_equal(one.members, same.members)
    assert (one.members != other.members).any()
    # Members are mixtures of demonstrations: they leave the plane these lie in as little as any of them does.
    centred = model.prior.samples - model.prior.mean
    _, size, plane = np.linalg.svd(centred, full_matrices=False)
    plane = plane[size > 1e-9 * size[0]]
    off = one.members[:, 2:] - model.prior.mean
    assert np.abs(off - off @ plane.T @ plane).max() < 1e-10 * np.abs(centred).max()


def test_a_mixture_keeps_to_the_ways_that_were_shown_and_a_gaussian_does_not(rng: np.random.Generator) -> None:
    model = two_ways(rng, phase_model())
    samples = model.prior.samples
    apart = samples[::3].mean(0) - np.delete(samples, np.s_[::3], axis=0).mean(0)
    shown = np.sort(samples @ apart)
    low, high = shown[np.diff(shown).argmax()], shown[np.diff(shown).argmax() + 1]
    between = {}
    for prior in ("demonstrations", "gaussian", "mixture"):
        along = make("ebip", model, members=2000, prior=prior).init(rng).members[:, 2:] @ apart
        between[prior] = np.mean((along > low + 0.25 * (high - low)) & (along < high - 0.25 * (high - low)))
    assert between["demonstrations"] == 0
    assert between["mixture"] < 0.02
    assert between["gaussian"] > 0.1


@PRIORS
def test_partners_are_as_correlated_as_they_are_trusted(prior: str, rng: np.random.Generator) -> None:
    plain = two_ways(rng, phase_model())
    samples = plain.prior.samples[:, [0, 1, -2, -1]]
    shrinkage = 0.0 if prior == "demonstrations" else 0.3
    believed = inphase.WeightPrior(samples, shrinkage, trust=0.5, partner=2, blocks=(2, 2))
    count = 20_000
    whole = np.zeros((len(samples), plain.layout.size))
    whole[:, [0, 1, -2, -1]] = samples
    split = plain.layout.slices[2].start
    model = dataclasses.replace(
        plain, prior=inphase.WeightPrior(whole, shrinkage, 0.5, split, tuple(b.size for b in plain.layout.bases))
    )
    members = make("ebip", model, members=count, prior=prior).init(rng).members[:, 2:][:, [0, 1, -2, -1]]
    stds = np.sqrt(np.diag(believed.cov))
    wrong = np.abs(np.cov(members, rowvar=False) - believed.cov) / np.outer(stds, stds)
    assert wrong.max() < 0.06  # demonstrations have 39/40 of it, and 20,000 draws a chance of 0.02
    assert (np.abs(members.mean(0) - believed.mean) / stds).max() < 0.04


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"update": "sqrt"}, "unknown update 'sqrt'; one of stochastic, square-root"),
        ({"prior": "normal"}, "unknown prior 'normal'; one of demonstrations, gaussian, mixture"),
        ({"members": 1}, "at least 2 members, got 1"),
        ({"members": 2.5}, "at least 2 members, got 2.5"),
    ],
)
def test_an_option_that_is_none_is_refused_with_those_there_are(options: dict, message: str) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match=message):
        make("ebip", chance_model(np.random.default_rng(0), phase_model()), **options)
