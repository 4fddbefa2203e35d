"""Filters: against textbook versions of fifteen lines, in the limits where the answer is known, and in the long run."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interactions import CONTROLLED, OBSERVED, chance_model, known_phase, phase_model
from scipy.stats import multivariate_normal

import inphase
from inphase.filters import FILTERS, Course, EnsembleBelief, Filter, GaussianBelief, make, rbpf, tempo
from inphase.filters.motion import begin, root
from inphase.mixture import Mixture
from inphase.observation import NOTHING, Observation
from inphase.phase import PhaseModel
from inphase.tempo import Tempo

Steps = Sequence[tuple[Observation, float]]
PHASES = pytest.mark.parametrize(("order", "periodic"), [(0, False), (1, False), (2, False), (1, True), (2, True)])
NAMES = pytest.mark.parametrize("name", sorted(FILTERS))


def samples(model: inphase.Model, rng: np.random.Generator, count: int = 50, mean_dt: float = 0.025) -> Steps:
    """Observations of a movement of the model's own, partial, at irregular times, every fifth at the same time."""
    weights, phase, steps = model.prior.draw(1, rng)[0], 0.05, []
    for i in range(count):
        dt = 0.0 if i % 5 == 0 else rng.exponential(mean_dt)
        phase += 0.8 * dt
        features = np.flatnonzero(rng.random(4) < 0.5)
        noise_var = rng.uniform(0.01, 0.2, len(features))
        values = model.layout.predict(np.array([phase]), weights, features)[0]
        steps.append(
            (Observation(features, values + np.sqrt(noise_var) * rng.standard_normal(len(features)), noise_var), dt)
        )
    return steps


def wrapped(model: inphase.Model, phase: float) -> float:
    return phase % 1.0 if model.phase.periodic else min(max(phase, 0.0), 1.0)


def textbook_h(model: inphase.Model, state: np.ndarray) -> np.ndarray:
    """(F, K + B) H of Eq. 2.6, dense, at the state [φ, φ̇, …, w]."""
    size, rows = len(model.phase.mean), np.zeros((4, len(state)))
    for f, (basis, place) in enumerate(zip(model.layout.bases, model.layout.slices, strict=True)):
        values, slopes = basis.with_derivative(np.array(state[0]))
        rows[f, 0] = slopes @ state[size:][place]
        rows[f, size:][place] = values
    return rows


def textbook_ekf(model: inphase.Model, steps: Steps) -> tuple[np.ndarray, np.ndarray, float]:
    """Fig. 5 as it is printed: mean (K + B,), covariance (K + B, K + B), summed log-likelihood."""
    phase, weights = model.phase, model.prior.samples
    size, total = len(phase.mean), 0.0
    mean = np.concatenate([phase.mean, weights.mean(0)])
    cov, move, noise = np.zeros((len(mean),) * 2), np.eye(len(mean)), np.zeros((len(mean),) * 2)
    cov[:size, :size], cov[size:, size:] = phase.cov, np.cov(weights, rowvar=False)
    for seen, dt in steps:
        move[:size, :size], noise[:size, :size] = phase.transition(dt), phase.process_cov(dt)
        mean, cov = move @ mean, move @ cov @ move.T + noise
        mean[0] = wrapped(model, mean[0])
        rows = textbook_h(model, mean)[seen.features]
        innovation = seen.values - rows[:, size:] @ mean[size:]
        innovation_cov = rows @ cov @ rows.T + np.diag(seen.noise_var)
        gain = cov @ rows.T @ np.linalg.inv(innovation_cov)
        mean, cov = mean + gain @ innovation, cov - gain @ rows @ cov
        mean[0] = wrapped(model, mean[0])
        total += multivariate_normal.logpdf(innovation, cov=innovation_cov) if len(seen) else 0.0
    return mean, cov, total


def textbook_enkf(model: inphase.Model, steps: Steps, count: int, prior: str, seed: int) -> tuple[np.ndarray, float]:
    """Fig. 23 as it is printed, member by member: members (E, K + B) and the summed log-likelihood.

    It draws in the order of the filter. A covariance has many roots; that the filter's is one is a test of its own,
    and so is where members begin.
    """
    phase, rng, total = model.phase, np.random.default_rng(seed), 0.0
    size, start = len(phase.mean), begin(phase, count, rng)
    demonstrations = model.prior
    sources = {"gaussian": demonstrations, "mixture": Mixture.learn(demonstrations.samples)}
    weights = sources[prior].draw(count, rng) if prior in sources else demonstrations.resample(count, rng)
    members = [np.concatenate(parts) for parts in zip(start, weights, strict=True)]
    members = confined(model, members)
    for seen, dt in steps:
        if dt > 0:
            for x, z in zip(members, rng.standard_normal((count, size)), strict=True):
                x[:size] = phase.transition(dt) @ x[:size] + root(phase.process_cov(dt)) @ z
            members = confined(model, members)
        if len(seen) == 0:
            continue
        readings = [textbook_h(model, x)[seen.features, size:] @ x[size:] for x in members]
        both = np.cov(np.array(members), np.array(readings), rowvar=False)
        innovation_cov = both[-len(seen) :, -len(seen) :] + np.diag(seen.noise_var)
        gain = both[: -len(seen), -len(seen) :] @ np.linalg.inv(innovation_cov)
        total += multivariate_normal.logpdf(seen.values, np.mean(readings, axis=0), innovation_cov)
        for x, z, reading in zip(members, rng.standard_normal((count, len(seen))), readings, strict=True):
            x += gain @ (seen.values + np.sqrt(seen.noise_var) * z - reading)
        members = confined(model, members)
    return np.array(members), total


def confined(model: inphase.Model, members: list[np.ndarray]) -> list[np.ndarray]:
    """Members whose phases lie in [0, 1], or have their mean there when the phase is periodic."""
    turns = np.floor(np.mean([x[0] for x in members]))
    for x in members:
        x[0] = x[0] - turns if model.phase.periodic else min(max(x[0], 0.0), 1.0)
    return members


def run(filter: Filter, steps: Steps, seed: int = 0) -> tuple[object, float]:
    """The last belief and the summed log-likelihood."""
    rng = np.random.default_rng(seed)
    belief, total = filter.init(rng), 0.0
    for seen, dt in steps:
        belief, info = filter.step(belief, seen, dt, rng)
        assert info.healthy
        total += info.log_likelihood
    return belief, total


def assert_close(got: np.ndarray, expected: np.ndarray, relative: float) -> None:
    """Equal to a share of the largest entry: what is small beside others is known no better than they are."""
    np.testing.assert_allclose(got, expected, rtol=0, atol=relative * np.abs(expected).max())


# ------------------------------------------------------------------------------------------------- naive references


@PHASES
@pytest.mark.parametrize("seed", [0, 1])
def test_bip_is_the_textbook_filter(order: int, periodic: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = chance_model(rng, phase_model(order, periodic))
    steps = samples(model, rng)
    belief, total = run(make("bip", model), steps)
    mean, cov, expected = textbook_ekf(model, steps)
    got_mean, got_cov = belief.state_moments
    assert_close(got_mean, mean, 1e-10)
    assert_close(got_cov, cov, 1e-10)
    assert total == pytest.approx(expected, rel=1e-10)


@PHASES
@pytest.mark.parametrize("prior", ["demonstrations", "gaussian", "mixture"])
def test_ebip_is_the_textbook_filter(order: int, periodic: bool, prior: str) -> None:
    rng = np.random.default_rng(order)
    model = chance_model(rng, phase_model(order, periodic))
    steps = samples(model, rng)
    belief, total = run(make("ebip", model, members=6, prior=prior), steps, seed=3)
    members, expected = textbook_enkf(model, steps, 6, prior, seed=3)
    assert_close(belief.members, members, 1e-10)
    assert total == pytest.approx(expected, rel=1e-10)
    assert_close(belief.weights_mean, members[:, order + 1 :].mean(0), 1e-10)
    assert_close(belief.phase_cov, np.cov(members[:, : order + 1], rowvar=False).reshape(order + 1, order + 1), 1e-9)


@given(st.integers(1, 3), st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_the_root_squared_is_the_covariance(size: int, seed: int, singular: float) -> None:
    half = np.random.default_rng(seed).normal(size=(size, size))
    half[:, 0] *= singular  # down to a covariance of less than full rank
    cov = half @ half.T
    np.testing.assert_allclose(root(cov) @ root(cov).T, cov, atol=1e-14 * np.trace(cov))
    np.testing.assert_array_equal(root(0 * cov), 0 * cov)
    # What differs by rounding has roots that do: draws with the same seed stay the same.
    blurred = cov * (1 + 1e-15 * np.random.default_rng(seed).choice([-1, 1], (size, 1)))
    blurred = (blurred + blurred.T) / 2
    np.testing.assert_allclose(root(blurred), root(cov), atol=1e-6 * np.sqrt(np.trace(cov)))


def test_members_start_as_the_demonstrations_and_the_prior_over_phase(rng: np.random.Generator) -> None:
    phase = phase_model(2)
    model = chance_model(rng, PhaseModel(phase.mean + np.array([0.4, 0, 0]), phase.cov, 0.0, 1.0))
    members = make("ebip", model, members=20_000).init(rng).members
    variances = np.diag(phase.cov)
    tolerance = 4.5 * np.sqrt((np.outer(variances, variances) + phase.cov**2) / 20_000)  # of a sample covariance
    assert (np.abs(np.cov(members[:, :3], rowvar=False) - phase.cov) < tolerance).all()
    assert (np.abs(members[:, :3].mean(0) - model.phase.mean) < 4.5 * np.sqrt(variances / 20_000)).all()
    assert len(np.unique(members[:, 3:], axis=0)) == len(model.prior.samples)
    assert len(make("ebip", model).init(rng).members) == 100


# --------------------------------------------------------------------------------------------------- known phase


def closed_form(
    model: inphase.Model, steps: Steps, start: float, velocity: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Bayesian linear regression of all readings at once: weights' mean, covariance, and the log-density of all."""
    rows, readings, noise_var, phase = [], [], [], start
    for seen, dt in steps:
        phase += velocity * dt
        state = np.concatenate([[phase, velocity], model.prior.mean])
        rows.append(textbook_h(model, state)[seen.features, 2:])
        readings.append(seen.values)
        noise_var.append(seen.noise_var)
    design, y, prior_cov = np.concatenate(rows), np.concatenate(readings), np.cov(model.prior.samples, rowvar=False)
    all_cov = design @ prior_cov @ design.T + np.diag(np.concatenate(noise_var))
    gain = np.linalg.solve(all_cov, design @ prior_cov).T
    mean = model.prior.mean + gain @ (y - design @ model.prior.mean)
    return (
        mean,
        prior_cov - gain @ design @ prior_cov,
        multivariate_normal.logpdf(y, design @ model.prior.mean, all_cov),
    )


def test_with_the_phase_known_bip_is_linear_regression(rng: np.random.Generator) -> None:
    model = chance_model(rng, known_phase(0.8, start=0.1))
    steps = samples(model, rng, count=40, mean_dt=0.02)
    mean, cov, log_likelihood = closed_form(model, steps, 0.1, 0.8)
    belief, total = run(make("bip", model), steps)
    assert_close(belief.weights_mean, mean, 1e-8)
    assert_close(belief.weights_cov, cov, 1e-8)
    assert total == pytest.approx(log_likelihood, rel=1e-8)
    np.testing.assert_array_equal(belief.phase_cov, np.zeros((2, 2)))


def test_with_the_phase_known_rbpf_is_linear_regression(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempo, "PHASE_JITTER", 0.0)
    monkeypatch.setattr(rbpf, "VARIANCE_KEPT", 1.0)
    steady = Tempo(usual_std=0.0, other_std=0.0, momentary_std=0.0, stop_rate=0.0, leap_rate=0.0)
    model = dataclasses.replace(chance_model(rng, known_phase(0.8, start=0.1)), tempo=steady)
    steps = samples(model, rng, count=40, mean_dt=0.02)
    mean, cov, log_likelihood = closed_form(model, steps, 0.1, 0.8)
    belief, total = run(make("rbpf", model, particles=10), steps)
    assert_close(belief.weights_mean, mean, 1e-8)
    assert total == pytest.approx(log_likelihood, rel=1e-8)
    phases = np.linspace(0, 1, 7)
    _, var = belief.trajectory(Course(np.zeros(7), phases), np.arange(4))
    designs = [textbook_h(model, np.concatenate([[phase, 0.8], mean]))[:, 2:] for phase in phases]
    assert_close(var, np.array([np.diag(design @ cov @ design.T) for design in designs]), 1e-8)


def test_who_stands_is_not_believed_the_more_for_standing_longer(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempo, "PHASE_JITTER", 0.0)
    monkeypatch.setattr(tempo, "WAITING", 0.0)
    standing = Tempo(stop_rate=1e9, go_rate=0.0, leap_rate=0.0)
    model = dataclasses.replace(chance_model(rng, known_phase(0.8, start=0.4)), tempo=standing)
    reading = Observation(np.arange(2), np.array([0.3, 0.9]), np.full(2, 0.01))
    filter, named = make("rbpf", model, particles=20), Course(np.zeros(3), np.array([0.1, 0.4, 0.8]))
    belief, _ = filter.step(filter.init(rng), reading, 0.0, rng)
    mean, (_, var) = belief.weights_mean, belief.trajectory(named, np.arange(4))
    assert np.abs(mean - model.prior.mean).max() > 0.01
    for _ in range(20):
        belief, info = filter.step(belief, reading, 0.05, rng)
        assert info.log_likelihood != 0  # it is still asked who foresaw it
    assert belief.motion.waiting.all()
    assert_close(belief.weights_mean, mean, 1e-9)
    assert_close(belief.trajectory(named, np.arange(4))[1], var, 1e-9)


def test_leaps_are_as_many_and_as_far_as_is_said(rng: np.random.Generator) -> None:
    phase, kinds = known_phase(0.5, start=0.1), Tempo(stop_rate=1e9, go_rate=0.0, leap_rate=3.0, leap=0.1)
    begun, _ = tempo.begin(phase, kinds, 20_000, rng)
    leapt = tempo.advance(begun, phase, kinds, 0.2, rng).phase - begun.phase  # of a tenth of an interaction: 0.3 each
    assert leapt.mean() == pytest.approx(0.3 * 0.1 / 2, rel=0.08)
    assert leapt.std() == pytest.approx(np.sqrt(0.3 * 0.1**2 / 3), rel=0.08)


@pytest.mark.parametrize(
    ("prior", "update"), [("gaussian", "stochastic"), ("gaussian", "square-root"), ("mixture", "stochastic")]
)
def test_with_the_phase_known_ebip_comes_as_close_as_its_members_are_many(
    prior: str, update: str, rng: np.random.Generator
) -> None:
    model = chance_model(rng, known_phase(0.8, start=0.1))
    steps = samples(model, rng, count=8, mean_dt=0.1)
    mean, cov, log_likelihood = closed_form(model, steps, 0.1, 0.8)
    stds = np.sqrt(np.diag(cov))

    def errors(members: int) -> np.ndarray:
        """Root mean square errors of mean, variance and log-likelihood over 12 seeds, in units of 1 / sqrt(E)."""
        filter = make("ebip", model, members=members, prior=prior, update=update)
        runs = [run(filter, steps, seed) for seed in range(12)]
        weights = np.array([belief.members[:, 2:] for belief, _ in runs])
        return np.sqrt(members) * np.array(
            [
                np.sqrt(np.mean(((weights.mean(1) - mean) / stds) ** 2)),
                np.sqrt(np.mean((weights.var(1, ddof=1) / stds**2 - 1) ** 2)),
                np.sqrt(np.mean([(total - log_likelihood) ** 2 for _, total in runs])),
            ]
        )

    few, many = errors(100), errors(6400)
    # Errors shrink by sqrt(64) = 8, which is by nothing in these units, give or take the chance of 12 seeds.
    assert (many < 2 * few).all()
    assert (few < 2.5 * many).all()
    assert many[0] < 4  # 4 standard errors of a mean of E draws


# ----------------------------------------------------------------------------------------------------- Theorem 1


def test_time_and_space_become_correlated_as_proved(rng: np.random.Generator) -> None:
    """Theorem 1 of 2.3.3: what is correlated after a prediction, after channel 1, and after channel 2."""
    prior = PhaseModel(np.array([0.3, 0.8]), np.diag([0.01, 0.04]), diffusion=0.05, nominal_velocity=0.8)
    model = chance_model(rng, prior, shrinkage=1.0)
    bip, first, second, third = make("bip", model), *(slice(2 + s.start, 2 + s.stop) for s in model.layout.slices[:3])

    def block(belief: GaussianBelief, rows: slice, columns: slice) -> float:
        """The largest correlation in a block of the covariance."""
        cov = belief.state_moments[1]
        stds = np.sqrt(np.diag(cov))
        return float(np.abs(cov / np.outer(stds, stds))[rows, columns].max())

    phase, velocity, none, some = slice(0, 1), slice(1, 2), 1e-14, 1e-4
    parts = (phase, velocity, first, second, third)
    start = bip.init(rng)
    assert all(block(start, a, b) < none for i, a in enumerate(parts) for b in parts[:i])

    predicted = bip.predict(start, 0.1, rng)
    assert block(predicted, phase, velocity) > some
    assert all(block(predicted, a, b) < none for i, a in enumerate(parts[2:], 2) for b in parts[:i])

    after_first, _ = bip.step(predicted, Observation(np.array([0]), np.array([0.5]), np.array([0.02])), 0.0, rng)
    assert all(block(after_first, a, b) > some for i, a in enumerate(parts[:3]) for b in parts[:i])
    assert all(block(after_first, a, b) < none for i, a in enumerate(parts[3:], 3) for b in parts[:i])
    # Proposition 1: Σ^{φ,w} = -Σ^{φ,φ} H^φᵀ S⁻¹ H^w Σ^{w,w}.
    mean, cov = predicted.state_moments
    row = textbook_h(model, mean)[:1]
    innovation_var = (row @ cov @ row.T)[0, 0] + 0.02
    expected = -cov[:1, :1] * row[0, 0] / innovation_var @ row[:, first] @ cov[first, first]
    np.testing.assert_allclose(after_first.state_moments[1][:1, first], expected, rtol=1e-10, atol=1e-14)

    after_second, _ = bip.step(after_first, Observation(np.array([1]), np.array([0.5]), np.array([0.02])), 0.05, rng)
    assert all(block(after_second, a, b) > some for i, a in enumerate(parts[:4]) for b in parts[:i])
    assert all(block(after_second, third, b) < none for b in parts[:4])  # no Theorem for what was not observed


# -------------------------------------------------------------------------------------------------------- no-ops


def arrays(value: object) -> list[np.ndarray]:
    """All arrays that a belief is made of, wherever they are; not those of the model behind it."""
    if isinstance(value, np.ndarray):
        return [value]
    if not dataclasses.is_dataclass(value) or isinstance(value, inphase.Model):
        return []
    return [array for field in dataclasses.fields(value) for array in arrays(getattr(value, field.name))]


def numbers(belief: object) -> np.ndarray:
    """All that a belief knows."""
    return np.concatenate([np.ravel(array).astype(float) for array in arrays(belief)])


@NAMES
@PHASES
def test_no_time_and_nothing_seen_is_nothing(name: str, order: int, periodic: bool, rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model(order, periodic))
    filter, steps = make(name, model), samples(model, rng, count=6)
    belief, _ = run(filter, steps)
    state = rng.bit_generator.state
    after, info = filter.step(belief, NOTHING, 0.0, rng)
    assert numbers(after).tobytes() == numbers(belief).tobytes()
    assert numbers(filter.predict(belief, 0.0, rng)).tobytes() == numbers(belief).tobytes()
    assert (info.log_likelihood, info.surprise, info.healthy) == (0.0, 0.0, True)
    assert rng.bit_generator.state == state  # so that an empty sample cannot change what comes after


@NAMES
@PHASES
def test_time_alone_moves_the_phase_alone(name: str, order: int, periodic: bool, rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model(order, periodic))
    filter = make(name, model)
    belief, _ = run(filter, samples(model, rng, count=6))
    after, info = filter.step(belief, NOTHING, 0.1, rng)
    assert info.log_likelihood == 0.0
    np.testing.assert_array_equal(after.weights_mean, belief.weights_mean)
    # What would be read at a phase that is named is known as well as before, to the last bit.
    named, features = Course(np.zeros(5), np.linspace(0, 1, 5)), np.arange(4)
    for one, other in zip(after.trajectory(named, features), belief.trajectory(named, features), strict=True):
        np.testing.assert_array_equal(one, other)
    if name == "bip":
        expected = model.phase.transition(0.1) @ belief.phase_cov @ model.phase.transition(0.1).T
        assert_close(after.phase_cov, expected + model.phase.process_cov(0.1), 1e-14)
    assert after.phase_cov[0, 0] > belief.phase_cov[0, 0]


@PHASES
def test_a_gap_in_two_is_the_whole_gap_to_bip(order: int, periodic: bool, rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model(order, periodic))
    bip = make("bip", model)
    belief, _ = run(bip, samples(model, rng, count=6))
    whole = bip.predict(belief, 0.5, rng)
    halves = bip.predict(bip.predict(belief, 0.2, rng), 0.3, rng)
    assert_close(halves.mean, whole.mean, 1e-14)
    assert_close(halves.cov, whole.cov, 1e-14)


@PHASES
@pytest.mark.parametrize(("name", "count"), [("ebip", "members"), ("particle", "particles"), ("rbpf", "particles")])
def test_a_gap_in_two_is_the_whole_gap_to_those_who_draw(
    name: str, count: str, order: int, periodic: bool, rng: np.random.Generator
) -> None:
    # In the middle of the interaction, where clipping has no say; 20,000 draws tell a covariance to a percent.
    prior = phase_model(order, periodic)
    model = chance_model(rng, PhaseModel(prior.mean + np.eye(order + 1)[0] * 0.3, prior.cov, 0.02, 0.8, periodic))
    filter = make(name, model, **{count: 20_000})
    belief = filter.init(rng)
    whole = filter.predict(belief, 0.2, rng)
    halves = filter.predict(filter.predict(belief, 0.15, rng), 0.05, rng)
    variances = np.diag(whole.phase_cov)
    tolerance = 4.5 * np.sqrt(2 * (np.outer(variances, variances) + whole.phase_cov**2) / 20_000)
    # A tempo with long tails: the variance of its sample variance is that of its fourth moment, not of a Gaussian's.
    tolerance = 3 * tolerance if name == "rbpf" else tolerance
    assert (np.abs(halves.phase_cov - whole.phase_cov) < tolerance).all()
    assert (np.abs(halves.phase_mean - whole.phase_mean) < 4.5 * np.sqrt(2 * variances / 20_000)).all()


# ---------------------------------------------------------------------------------------------------- invariants


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(0, 2), st.booleans(), st.floats(-9, 3), st.floats(-2, 2))
def test_a_covariance_stays_one_and_readings_never_add_doubt(
    seed: int, order: int, periodic: bool, noise: float, size: float
) -> None:
    rng = np.random.default_rng(seed)
    model = chance_model(rng, phase_model(order, periodic), shrinkage=float(rng.random()))
    bip, belief = make("bip", model), None
    belief = bip.init(rng)
    for _ in range(4):
        features = np.flatnonzero(rng.random(4) < 0.7)
        values = 10**size * rng.normal(size=len(features))
        predicted = bip.predict(belief, 0.1, rng)
        belief, info = bip.step(predicted, Observation(features, values, np.full(len(features), 10**noise)), 0.0, rng)
        assert info.healthy
        assert np.isfinite(belief.mean).all()
        np.testing.assert_array_equal(belief.cov, belief.cov.T)
        # In units of each entry's own spread before the reading: what is lost to rounding is lost beside that.
        stds = np.sqrt(np.diag(predicted.cov))
        after, less = (cov / np.outer(stds, stds) for cov in (belief.cov, predicted.cov - belief.cov))
        assert np.linalg.eigvalsh(after).min() > -1e-12
        assert np.linalg.eigvalsh(less).min() > -1e-7 if noise > -6 else True
        assert 0 <= belief.phase_mean[0] <= 1


@NAMES
@PHASES
def test_nothing_that_goes_in_is_changed_and_nothing_that_comes_out_can_be(
    name: str, order: int, periodic: bool, rng: np.random.Generator
) -> None:
    model = chance_model(rng, phase_model(order, periodic))
    filter = make(name, model)
    seen = Observation(np.array([0, 2]), np.array([0.1, 0.2]), np.array([0.1, 0.1]))
    before = filter.init(rng)
    kept, inputs = numbers(before).copy(), [a.copy() for a in (seen.features, seen.values, seen.noise_var)]
    after, _ = filter.step(before, seen, 0.1, rng)
    np.testing.assert_array_equal(numbers(before), kept)
    for array, copy in zip((seen.features, seen.values, seen.noise_var), inputs, strict=True):
        np.testing.assert_array_equal(array, copy)
    for belief in (before, after):
        for array in arrays(belief):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0
        views = [getattr(belief, part) for part in dir(belief) if not part.startswith("_")]
        kept = numbers(belief).copy()
        phase, weights = np.array(belief.phase_mean), np.array(belief.weights_mean)
        for part in views:  # what is computed is either read-only or the caller's own
            if isinstance(part, np.ndarray) and part.flags.writeable:
                part[...] = 0.5
        np.testing.assert_array_equal(numbers(belief), kept)
        np.testing.assert_array_equal(belief.phase_mean, phase)
        np.testing.assert_array_equal(belief.weights_mean, weights)


@NAMES
def test_a_step_that_cannot_be_made_is_told_and_leaves_a_prediction(name: str, rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    filter = make(name, model)
    belief, _ = run(filter, samples(model, rng, count=6))
    wrong = Observation(np.array([0, 1]), np.array([0.1, 1e300]), np.array([0.1, 0.1]))
    after, info = filter.step(belief, wrong, 0.1, np.random.default_rng(5))
    assert not info.healthy
    assert info.log_likelihood == 0.0
    np.testing.assert_array_equal(numbers(after), numbers(filter.predict(belief, 0.1, np.random.default_rng(5))))


@NAMES
@pytest.mark.parametrize("size", [1e3, 1e10, 1e60, 1e140, 1e152, 1e160, 1e308])
def test_no_reading_is_too_large_to_survive(name: str, size: float, rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    filter = make(name, model)
    belief = filter.init(rng)
    for values in ([0.1, 0.1], [size, -size], [0.1, 0.1], [size, size], [0.1, 0.1], [0.1, 0.1]):
        belief, _ = filter.step(
            belief, Observation(np.array([0, 1]), np.array(values), np.array([0.1, 0.1])), 0.02, rng
        )
        assert np.isfinite(numbers(belief)).all()
        assert 0 <= belief.phase_mean[0] <= 1


@PHASES
def test_the_band_of_a_belief_is_what_its_own_draws_read(order: int, periodic: bool, rng: np.random.Generator) -> None:
    """Along a course, the doubt about the phase counts as far as the course depends on it."""
    model, features = chance_model(rng, phase_model(order, periodic)), np.array([0, 1, 3])
    # So little doubt about the phase that curves are straight within it; correlated with all the rest.
    stds = np.concatenate([[0.02, 0.1, 0.1][: order + 1], np.full(len(model.prior.factor), 0.3)])
    root = rng.standard_normal((len(stds), 2 * len(stds)))
    root = stds[:, None] * root / np.linalg.norm(root, axis=1, keepdims=True)
    start = np.concatenate([[0.4, 0.8, 0.0][: order + 1], rng.standard_normal(len(model.prior.factor))])
    belief = GaussianBelief(model, start, root @ root.T)
    course = Course(np.array([1.0, 0.5, 0.0]), np.array([0.0, 0.3, 0.7]))
    mean, var = belief.trajectory(course, features)
    draws = rng.multivariate_normal(belief.mean, belief.cov, size=20_000, method="eigh")
    weights = model.prior.mean + draws[:, order + 1 :] @ model.prior.factor
    readings = model.layout.predict_each(draws[:, :1] * course.share + course.offset, weights, features)
    # Chance is 1 / sqrt(40,000) of a standard deviation; the bend of the curves is the rest.
    np.testing.assert_allclose(mean, readings.mean(0), atol=0.03 * readings.std())
    np.testing.assert_allclose(np.sqrt(var), readings.std(0), rtol=0.04)
    # The members of an ensemble are its draws.
    states = np.concatenate([draws[:, : order + 1], weights], axis=1)
    mean, var = EnsembleBelief(model, states).trajectory(course, features)
    np.testing.assert_allclose(mean, readings.mean(0), rtol=1e-12)
    np.testing.assert_allclose(var, readings.var(0, ddof=1), rtol=1e-9)


LONG_RUN = """
import json, sys
import numpy as np
from interactions import chance_model, phase_model
from inphase.filters import Course, make
from inphase.observation import Observation

name, periodic, options = json.loads(sys.argv[1])
rng = np.random.default_rng(0)
model = chance_model(rng, phase_model(periodic=periodic), demonstrations=4)
filter = make(name, model, **options)
belief = filter.init(rng)
kinds = [([], 0.01), ([], 0.02), ([0, 2], 0.01), ([], 0.01), ([], 0.01), ([2], 0.0)]
kinds = [(np.array(features, dtype=int), dt) for features, dt in kinds]
low, high = (-0.5, 1.5) if periodic else (-1e-12, 1 + 1e-12)
course = Course(np.array([0.0, 0.0, 1.0]), np.array([0.1, 0.9, 0.0]))
for i, values in enumerate(3 * rng.standard_normal((100_000, 2))):
    features, dt = kinds[i % 6]
    noise_var = np.full(len(features), 1e-4 if i % 600 == 2 else 1.0)
    belief, info = filter.step(belief, Observation(features, values[: len(features)], noise_var), dt, rng)
    assert info.healthy, i
    if i % 100 == 0 or i % 600 in (2, 3, 5):
        mean, var = belief.trajectory(course, np.arange(4))
        assert np.isfinite(mean).all() and np.isfinite(belief.weights_mean).all(), i
        assert (var >= 0).all(), i
        assert low <= belief.phase_mean[0] <= high, i
        stds = np.maximum(np.sqrt(np.diag(belief.phase_cov)), 1e-150)
        assert np.linalg.eigvalsh(belief.phase_cov / np.outer(stds, stds)).min() > -1e-12, i
if name == "bip":
    assert (belief.cov == belief.cov.T).all()
    stds = np.sqrt(np.diag(belief.cov))
    assert np.linalg.eigvalsh(belief.cov / np.outer(stds, stds)).min() > 0
"""
FEW = {"ebip": {"members": 10}, "particle": {"particles": 10}, "rbpf": {"particles": 10}}


@pytest.mark.parametrize(("name", "periodic"), [(name, i % 2 == 0) for i, name in enumerate(sorted(FILTERS))])
def test_in_the_long_run_nothing_falls_apart(name: str, periodic: bool) -> None:
    # In a process of its own, where array shapes are not checked: that would take ten times as long.
    path = [p for p in sys.path if p]
    command = [sys.executable, "-W", "error", "-c", f"import sys; sys.path[:0] = {path!r}\n{LONG_RUN}"]
    case = json.dumps([name, periodic, FEW.get(name, {})])
    done = subprocess.run([*command, case], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_models_of_these_tests_have_all_channels(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    assert model.names == (*OBSERVED, *CONTROLLED)
    mean, var = make("bip", model).init(rng).trajectory(Course(np.zeros(3), np.array([0.0, 0.5, 1.0])), np.arange(4))
    np.testing.assert_allclose(mean, model.layout.predict(np.array([0.0, 0.5, 1.0]), model.prior.mean))
    assert (var > 0).all()
