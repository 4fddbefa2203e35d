"""Particle filter: against a naive version, against answers that are known exactly, and what it can never do."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from interactions import chance_model, known_phase, phase_model, shapes_unchecked
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm
from test_filters import PHASES, Steps, assert_close, closed_form, run, samples, textbook_h

import inphase
from inphase.errors import OptionError
from inphase.filters import Course, WeightedBelief, make, rbpf, tempo
from inphase.filters.motion import begin, root
from inphase.filters.resampling import effective_size, systematic
from inphase.observation import Observation
from inphase.phase import PhaseModel
from inphase.tempo import Tempo

# ------------------------------------------------------------------------------------------------------ resampling

WEIGHTS = st.lists(st.floats(0, 1) | st.just(0.0), min_size=1, max_size=30).filter(lambda w: sum(w) > 1e-6)


@given(WEIGHTS, st.integers(1, 60), st.floats(0, 1, exclude_max=True))
def test_each_is_taken_as_often_as_its_weight_says(given: list[float], count: int, start: float) -> None:
    weights = np.array(given)
    taken = systematic(weights, count, start)
    expected = count * weights / weights.sum()
    times = np.bincount(taken, minlength=len(weights))
    assert times.sum() == count
    assert (np.diff(taken) >= 0).all()
    assert (np.abs(times - expected) < 1 + 1e-9).all()
    assert (times[weights == 0] == 0).all()


def test_over_all_starts_each_is_taken_just_as_often(rng: np.random.Generator) -> None:
    weights = rng.dirichlet(np.ones(7))
    starts = (np.arange(10_000) + 0.5) / 10_000
    times = np.mean([np.bincount(systematic(weights, 5, start), minlength=7) for start in starts], axis=0)
    np.testing.assert_allclose(times, 5 * weights, atol=5 * 1e-4)  # a start on the grid is off by half its distance


@given(WEIGHTS)
def test_the_effective_size_is_that_of_equal_weights(given: list[float]) -> None:
    weights = np.array(given) / sum(given)
    assert 1 - 1e-9 <= effective_size(weights) <= np.count_nonzero(weights) * (1 + 1e-9)
    assert effective_size(np.repeat(weights / 3, 3)) == pytest.approx(3 * effective_size(weights))
    assert effective_size(np.full(8, 1 / 8)) == pytest.approx(8)


# -------------------------------------------------------------------------------------------------- naive reference


def textbook_particles(
    model: inphase.Model, steps: Steps, count: int, prior: str, seed: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Particles (P, K + B), their weights (P,) and the summed log-likelihood, particle by particle.

    It draws in the order of the filter. Periodic phases are not wrapped: the bases are periodic.
    """
    phase, rng, total = model.phase, np.random.default_rng(seed), 0.0
    size, start = len(phase.mean), begin(phase, count, rng)
    drawn = model.prior.draw(count, rng) if prior == "gaussian" else model.prior.resample(count, rng)
    particles = [np.concatenate([moving, w]) for moving, w in zip(start, drawn, strict=True)]
    weights = [1 / count] * count
    for seen, dt in [(None, 0.0), *steps]:
        if dt > 0:
            for x, z in zip(particles, rng.standard_normal((count, size)), strict=True):
                x[:size] = phase.transition(dt) @ x[:size] + root(phase.process_cov(dt)) @ z
        for x in particles:
            x[0] = x[0] if phase.periodic else min(max(x[0], 0.0), 1.0)
        if seen is None or len(seen) == 0:
            continue
        for i, x in enumerate(particles):
            reading = textbook_h(model, x)[seen.features, size:] @ x[size:]
            weights[i] *= multivariate_normal.pdf(seen.values, reading, np.diag(seen.noise_var))
        total += np.log(sum(weights))
        weights = [w / sum(weights) for w in weights]
        if 1 / sum(w**2 for w in weights) < 0.5 * count:
            first = rng.random()
            kept = [next(i for i in range(count) if sum(weights[: i + 1]) > (k + first) / count) for k in range(count)]
            particles, weights = [particles[i].copy() for i in kept], [1 / count] * count
    return np.array(particles), np.array(weights), total


@PHASES
@pytest.mark.parametrize("prior", ["demonstrations", "gaussian"])
def test_it_is_the_textbook_filter(order: int, periodic: bool, prior: str) -> None:
    rng = np.random.default_rng(order)
    model = chance_model(rng, phase_model(order, periodic))
    steps = samples(model, rng, count=30)
    belief, total = run(make("particle", model, particles=12, prior=prior), steps, seed=3)
    particles, weights, expected = textbook_particles(model, steps, 12, prior, seed=3)
    turns = np.round(belief.particles[:, 0] - particles[:, 0]) if periodic else 0
    particles[:, 0] += turns
    assert_close(belief.particles, particles, 1e-10)
    assert_close(belief.weights, weights, 1e-10)
    assert total == pytest.approx(expected, rel=1e-10)
    # And the belief is the weighted mean and covariance of its particles, h(φ, w) and all.
    assert (belief.phase_mean[0] - weights @ particles[:, 0] + 0.5) % 1.0 == pytest.approx(0.5, abs=1e-10)
    assert_close(belief.phase_cov, np.cov(particles[:, : order + 1].T, aweights=weights, ddof=0), 1e-9)
    assert_close(belief.weights_mean, sum(w * x[order + 1 :] for w, x in zip(weights, particles, strict=True)), 1e-10)
    at, features = Course(np.array([0.0, 1.0]), np.array([0.7, 0.0])), np.array([1, 3])
    mean, var = belief.trajectory(at, features)
    for s, phases in enumerate([np.full(12, 0.7), particles[:, 0]]):
        states = np.concatenate([phases[:, None], particles[:, 1:]], axis=1)
        each = np.array([(textbook_h(model, x)[:, order + 1 :] @ x[order + 1 :])[features] for x in states])
        assert_close(mean[s], weights @ each, 1e-10)
        np.testing.assert_allclose(var[s], weights @ (each - weights @ each) ** 2, rtol=1e-9, atol=1e-20)


def test_its_surprise_is_that_of_the_mean_in_the_covariance_of_all_particles(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    filter = make("particle", model, particles=40, prior="gaussian", resample_below=0.0)
    belief = filter.init(rng)
    for _ in range(3):
        seen = Observation(np.array([0, 2]), rng.standard_normal(2), np.array([0.5, 0.7]))
        readings = np.array([(textbook_h(model, x)[:, 2:] @ x[2:])[seen.features] for x in belief.particles])
        cov = np.cov(readings.T, aweights=belief.weights, ddof=0) + np.diag(seen.noise_var)
        off = seen.values - belief.weights @ readings
        belief, info = filter.step(belief, seen, 0.0, rng)
        assert info.surprise == pytest.approx(off @ np.linalg.solve(cov, off))


# ----------------------------------------------------------------------------------------- where the answer is known


def test_with_the_phase_known_it_comes_as_close_as_its_particles_are_many(rng: np.random.Generator) -> None:
    # Two directions in which demonstrations differ: in more, particles that are near enough are too rare.
    model = chance_model(rng, known_phase(0.8, start=0.1), demonstrations=3)
    steps = samples(model, rng, count=8, mean_dt=0.1)
    mean, cov, log_likelihood = closed_form(model, steps, 0.1, 0.8)
    turn = np.linalg.pinv(model.prior.factor)
    exact, stds = (mean - model.prior.mean) @ turn, np.sqrt(np.diag(turn.T @ cov @ turn))

    def errors(particles: int) -> np.ndarray:
        """Root mean square errors of mean, variance and log-likelihood over 12 seeds, in units of 1 / sqrt(M)."""
        found = []
        for seed in range(12):
            belief, total = run(make("particle", model, particles=particles, prior="gaussian"), steps, seed)
            off = (belief.particles[:, 2:] - model.prior.mean) @ turn - exact
            moments = (belief.weights @ off) / stds, (belief.weights @ off**2) / stds**2 - 1
            found.append([*np.concatenate(moments), total - log_likelihood])
        return np.sqrt(particles * np.mean(np.square(found), axis=0))

    few, many = errors(1000), errors(16_000)
    # Errors shrink by sqrt(16) = 4, which is by nothing in these units, give or take the chance of 12 seeds.
    assert (many < 2 * few).all()
    assert (few < 2.5 * many).all()
    assert (many / np.sqrt(16_000) < 0.15).all()


START, VELOCITY = (0.25, 0.03), (0.8, 0.1)  # mean and standard deviation [1], [1/s]
FINE = np.linspace(-4.5, 4.5, 61)  # of the standard deviations: a sum over it misses 1e-5 of a Gaussian


def watched(rng: np.random.Generator, *, doubt: float = 1.0, noise_std: float = 0.1) -> tuple[inphase.Model, Steps]:
    """A model whose phase begins and runs on at an unknown place and tempo, and 0.35 s of two channels.

    The partner is a standard deviation ahead and as much too fast; doubt: what these are multiplied with.
    """
    stds = np.array([START[1], VELOCITY[1]]) * doubt
    phase = PhaseModel(np.array([START[0], VELOCITY[0]]), np.diag(stds**2), 0.0, VELOCITY[0])
    model = chance_model(rng, phase, demonstrations=3)
    weights, features, steps = model.prior.draw(1, rng)[0], np.array([0, 1]), []
    for i in range(8):
        true = START[0] + stds[0] + (VELOCITY[0] + stds[1]) * 0.05 * i
        clean = model.layout.predict(np.array([true]), weights, features)[0]
        seen = Observation(features, clean + noise_std * rng.standard_normal(2), np.full(2, noise_std**2))
        steps.append((seen, 0.05 if i else 0.0))
    return model, steps


def on_a_grid(
    model: inphase.Model, steps: Steps, velocities: np.ndarray, prior: str
) -> tuple[float, float, np.ndarray, float]:
    """Mean and std of the phase now, mean of the weights, and log-likelihood: one exact answer for each path, summed.

    A path is a start and a velocity, each at FINE of its standard deviations; given it, readings are linear in w.
    """
    stds = np.sqrt(np.diag(model.phase.cov))
    starts, velocities = (g.ravel() for g in np.meshgrid(START[0] + stds[0] * FINE, velocities, indexing="ij"))
    log_prior = (norm.logpdf(FINE)[:, None] + norm.logpdf(FINE)).ravel()
    phases = starts[:, None] + velocities[:, None] * np.cumsum([dt for _, dt in steps])
    assert phases.min() > 0  # where none is clipped
    assert phases.max() < 1
    design = np.zeros((*phases.shape, 2, model.layout.size))
    for f in (0, 1):
        design[:, :, f, model.layout.slices[f]] = model.layout.bases[f](phases)
    design = design.reshape(len(phases), -1, model.layout.size)
    y, noise_var = (np.concatenate([getattr(seen, part) for seen, _ in steps]) for part in ("values", "noise_var"))
    if prior == "gaussian":
        mean, cross = model.prior.samples.mean(0), design @ np.cov(model.prior.samples, rowvar=False)
        all_cov, off = cross @ design.transpose(0, 2, 1) + np.diag(noise_var), y - design @ mean
        solved = np.linalg.solve(all_cov, off[..., None])[..., 0]
        log_density = -0.5 * ((off * solved).sum(1) + np.linalg.slogdet(2 * np.pi * all_cov)[1])
        weights = mean + (cross.transpose(0, 2, 1) @ solved[..., None])[..., 0]
    else:
        each = np.array([norm.logpdf(y, design @ w, np.sqrt(noise_var)).sum(1) for w in model.prior.samples])
        log_density = logsumexp(each, axis=0) - np.log(len(each))
        weights = np.exp(each - logsumexp(each, axis=0)).T @ model.prior.samples
    posterior = np.exp(log_prior + log_density - logsumexp(log_prior + log_density))
    phase = posterior @ phases[:, -1]
    phase_std = np.sqrt(posterior @ (phases[:, -1] - phase) ** 2)
    return phase, phase_std, posterior @ weights, logsumexp(log_prior + log_density) - logsumexp(log_prior)


def off_by(
    model: inphase.Model, steps: Steps, exact: tuple[float, float, np.ndarray, float], name: str, **options: object
) -> np.ndarray:
    """(4,) root mean square errors over 12 seeds: phase, its std (in that std), log-likelihood, weights (in theirs)."""
    phase, phase_std, weights, log_likelihood = exact
    found = []
    for seed in range(12):
        belief, total = run(make(name, model, **options), steps, seed)
        phase_off, std_off = (belief.phase_mean[0] - phase) / phase_std, np.sqrt(belief.phase_cov[0, 0]) / phase_std - 1
        spread = np.sqrt(model.prior.samples.var(0).sum())
        found.append(
            [phase_off, std_off, total - log_likelihood, np.linalg.norm(belief.weights_mean - weights) / spread]
        )
    return np.sqrt(np.mean(np.square(found), axis=0))


@pytest.mark.parametrize("prior", ["demonstrations", "gaussian"])
def test_with_the_phase_unknown_it_comes_as_close_as_its_particles_are_many(prior: str) -> None:
    # So much noise that several demonstrations stay possible: which of them counts for how much is an answer too.
    model, steps = watched(np.random.default_rng(1), noise_std=0.4 if prior == "demonstrations" else 0.1)
    exact = on_a_grid(model, steps, VELOCITY[0] + VELOCITY[1] * FINE, prior)
    few, many = (off_by(model, steps, exact, "particle", particles=count, prior=prior) for count in (1000, 16_000))
    assert (many < few / 2).all()
    assert (few < 10 * many).all()
    assert (many < 0.12).all()


def test_rbpf_comes_as_close_to_the_same_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempo, "PHASE_JITTER", 0.0)
    monkeypatch.setattr(rbpf, "VARIANCE_KEPT", 1.0)
    model, steps = watched(np.random.default_rng(1))
    unknown = Tempo(
        usual=1.0, usual_std=0.125, change_rate=0.0, steady=1.0, momentary_std=0.0, stop_rate=0.0, leap_rate=0.0
    )
    model = dataclasses.replace(model, tempo=unknown)
    exact = on_a_grid(model, steps, VELOCITY[0] * np.exp(0.125 * FINE), "gaussian")
    few, many = (off_by(model, steps, exact, "rbpf", particles=count) for count in (100, 1600))
    assert (many < few / 2).all()
    assert (many < 0.05).all()


@pytest.mark.parametrize("update", ["stochastic", "square-root"])
def test_ebip_comes_close_to_it_where_curves_are_nearly_straight(update: str) -> None:
    model, steps = watched(np.random.default_rng(1), doubt=0.4)
    stds = np.sqrt(np.diag(model.phase.cov))
    exact = on_a_grid(model, steps, VELOCITY[0] + stds[1] * FINE, "gaussian")
    few, many = (
        off_by(model, steps, exact, "ebip", members=count, prior="gaussian", update=update) for count in (50, 6400)
    )
    assert (many < few / 2).all()
    assert (many < 0.06).all()


def test_its_likelihood_is_right_on_average_however_few_its_particles_are() -> None:
    """Unbiased (Del Moral, 2004), however often resampled: a law of all bootstrap filters."""
    model, steps = watched(np.random.default_rng(1))
    *_, log_likelihood = on_a_grid(model, steps, VELOCITY[0] + VELOCITY[1] * FINE, "demonstrations")
    for resample_below in (0.5, 1.0):
        filter = make("particle", model, particles=30, resample_below=resample_below)
        ratios = np.array([np.exp(run(filter, steps, seed)[1] - log_likelihood) for seed in range(120)])
        assert abs(ratios.mean() - 1) < 4 * ratios.std() / np.sqrt(120)
        assert ratios.std() < 1.0


# ------------------------------------------------------------------------------------------------ what it never does


def test_its_moments_are_those_of_particles_that_count_by_their_weights(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model(1, False))
    made = make("particle", model, particles=6, resample_below=0.0)
    belief = dataclasses.replace(made.init(rng), log_weights=np.log(rng.dirichlet(np.ones(6))))
    mean, cov = belief.state_moments
    expected = sum(w * x for w, x in zip(belief.weights, belief.particles, strict=True))
    off = belief.particles - expected
    spread = sum(w * np.outer(x, x) for w, x in zip(belief.weights, off, strict=True))
    assert_close(mean, expected, 1e-12)
    assert_close(cov, spread, 1e-12)
    size = len(belief.phase_mean)
    assert_close(cov[:size, :size], belief.phase_cov, 1e-12)
    assert_close(mean[size:], belief.weights_mean, 1e-12)


def test_nothing_but_choice_moves_its_weights(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    filter = make("particle", model, particles=60)
    belief = filter.init(rng)
    left = [len(model.prior.samples)]
    for seen, dt in samples(model, rng, count=60):
        belief, _ = filter.step(belief, seen, dt, rng)
        weights = np.unique(belief.particles[:, 2:], axis=0)
        assert all((model.prior.samples == w).all(1).any() for w in weights)
        left.append(len(weights))
    assert (np.diff(left) <= 0).all()
    assert left[-1] == 1  # and then there is no doubt about them, right or wrong
    assert belief.trajectory(Course(np.zeros(3), np.array([0.1, 0.5, 0.9])), np.arange(4))[1].max() < 1e-25


def test_it_resamples_when_it_is_told_to(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    steps = [(seen, dt) for seen, dt in samples(model, rng, count=30) if len(seen)]
    for resample_below in (0.0, 0.3, 0.9, 1.0):
        filter = make("particle", model, particles=50, resample_below=resample_below)
        chance = np.random.default_rng(0)
        belief, resampled = filter.init(chance), 0
        for seen, dt in steps:
            belief, _ = filter.step(belief, seen, dt, chance)
            assert effective_size(belief.weights) >= resample_below * 50 * (1 - 1e-12)
            resampled += np.ptp(belief.log_weights) == 0
        assert (resampled == 0) == (resample_below == 0)
        assert (resampled == len(steps)) == (resample_below == 1)


@pytest.mark.parametrize("noise_std", [1e-3, 1e-7])
def test_a_reading_that_no_particle_foresaw_chooses_the_nearest(noise_std: float, rng: np.random.Generator) -> None:
    """At densities of exp(-1e6) and less, which are 0 to a computer."""
    model = chance_model(rng, phase_model())
    filter = make("particle", model, particles=100, prior="gaussian", resample_below=0.0)
    belief = filter.init(rng)
    reading = model.layout.predict_each(belief.particles[:, :1], belief.particles[:, 2:], np.array([0]))[:, 0, 0]
    seen = Observation(np.array([0]), np.array([reading.max() + 2.0]), np.array([noise_std**2]))
    after, info = filter.step(belief, seen, 0.0, rng)
    assert info.healthy
    assert after.weights.argmax() == reading.argmax()
    assert after.weights.max() == pytest.approx(1.0)
    exponent = -0.5 * (2.0 / noise_std) ** 2 - np.log(noise_std * np.sqrt(2 * np.pi)) - np.log(100)
    assert info.log_likelihood == pytest.approx(exponent, rel=1e-9)


def test_where_likely_phases_lie_on_both_sides_of_the_end_their_mean_is_there() -> None:
    """A circle is cut where nothing is likely, even if most particles, which count for nothing, stand elsewhere."""
    model = chance_model(np.random.default_rng(0), phase_model(periodic=True))
    phases = np.concatenate([[0.98, 0.0, 1.02, 3.01], np.linspace(0.4, 0.6, 20)])
    states = np.zeros((24, 2 + model.layout.size))
    states[:, 0], states[:, 1] = phases, 1.0
    weights = np.where(np.arange(24) < 4, 0.25 - 1e-12, 2e-13)
    belief = WeightedBelief(model, states[:, :2], states[:, 2:], np.arange(24), np.log(weights))
    assert belief.phase_mean[0] == pytest.approx(0.0025, abs=1e-9)
    assert np.sqrt(belief.phase_cov[0, 0]) == pytest.approx(np.std([-0.02, 0.0, 0.02, 0.01]), abs=1e-6)


def test_wrong_options_are_named() -> None:
    model = chance_model(np.random.default_rng(0), phase_model())
    for options, message in (
        ({"particles": 1}, "expected a whole number of at least 2 particles, got 1"),
        ({"prior": "mixture"}, "unknown prior 'mixture'; one of demonstrations, gaussian"),
        ({"resample_below": 1.5}, "expected resample_below between 0 and 1, got 1.5"),
        ({"resample_below": np.nan}, "expected resample_below between 0 and 1, got nan"),
    ):
        with pytest.raises(OptionError, match=message):
            make("particle", model, **options)
    with shapes_unchecked():
        for options, message in (({"particles": 2.5}, "got 2.5"), ({"resample_below": "half"}, "got 'half'")):
            with pytest.raises(OptionError, match=message):
                make("particle", model, **options)
