"""Interaction ProMPs: where the phase is plain to see, where it is known, and against sums over all candidates."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest
from interactions import chance_model, dataset, known_phase, phase_model, recording, shapes_unchecked, taught
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal, truncnorm

import inphase
from inphase.errors import OptionError
from inphase.filters import Course, promp
from inphase.filters.alignment import CELLS, Alignment
from inphase.filters.candidates import Candidates
from inphase.filters.promp import METHODS, Promp, PrompBelief
from inphase.noise import Noise
from inphase.observation import Observation

METHOD = pytest.mark.parametrize("method", METHODS)
RNG = np.random.default_rng(0)  # never drawn from
FEATURES = np.arange(4)
COURSE = Course(np.array([1.0, 0.5, 0.0]), np.array([0.0, 0.5, 0.9]))


def samples(model: inphase.Model, rng: np.random.Generator, count: int = 20) -> list[tuple[Observation, float]]:
    """Some features at irregular times, of a movement of the model's own."""
    weights, phase, made = model.prior.draw(1, rng)[0], 0.1, []
    for i in range(count):
        dt = 0.0 if i % 5 == 0 else rng.exponential(0.04)
        phase += 0.8 * dt
        features = np.flatnonzero(rng.random(4) < 0.5)
        noise_var = rng.uniform(0.02, 0.2, len(features))
        noise = np.sqrt(noise_var) * rng.standard_normal(len(features))
        made.append(
            (
                Observation(features, model.layout.predict(np.array([phase]), weights, features)[0] + noise, noise_var),
                dt,
            )
        )
    return made


def followed(filter: Promp, steps: list[tuple[Observation, float]]) -> tuple[PrompBelief, float]:
    belief, total = filter.init(RNG), 0.0
    for observation, dt in steps:
        belief, info = filter.step(belief, observation, dt, RNG)
        assert info.healthy
        total += info.log_likelihood
    return belief, total


@dataclass
class Batch:
    """All readings at once: the textbook Gaussian over weights (B,) given y = H w + noise, and the density of y."""

    mean: np.ndarray
    cov: np.ndarray
    log_likelihood: float

    @classmethod
    def of(cls, model: inphase.Model, rows: np.ndarray, y: np.ndarray, noise_cov: np.ndarray) -> Batch:
        prior = cls.before(model)
        mean, prior_cov = prior.mean, prior.cov
        cov = rows @ prior_cov @ rows.T + noise_cov
        gain = prior_cov @ rows.T @ np.linalg.inv(cov)
        density = multivariate_normal.logpdf(y, rows @ mean, cov)
        return cls(mean + gain @ (y - rows @ mean), prior_cov - gain @ rows @ prior_cov, density)

    @classmethod
    def before(cls, model: inphase.Model) -> Batch:
        """No reading at all."""
        return cls(model.prior.samples.mean(0), np.cov(model.prior.samples, rowvar=False), 0.0)

    def at(self, model: inphase.Model, phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(S, F) mean and variance of the features at phases (S,)."""
        rows = [weight_rows(model, phase) for phase in phases]
        return np.stack([h @ self.mean for h in rows]), np.stack([np.diag(h @ self.cov @ h.T) for h in rows])


def weight_rows(model: inphase.Model, phase: float) -> np.ndarray:
    """(F, B) H_w of Eq. 2.6, dense."""
    rows = np.zeros((4, model.layout.size))
    for f, (basis, place) in enumerate(zip(model.layout.bases, model.layout.slices, strict=True)):
        rows[f, place] = basis(np.array(phase))
    return rows


def stacked(
    model: inphase.Model, steps: list[tuple[Observation, float]], phases: list[float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All H (N, B), y (N,) and R (N, N)."""
    rows = [weight_rows(model, phase)[o.features] for (o, _), phase in zip(steps, phases, strict=True)]
    values, var = (np.concatenate([getattr(o, name) for o, _ in steps]) for name in ("values", "noise_var"))
    return np.concatenate(rows), values, np.diag(var)


# --------------------------------------------------------------------------------------------- where it is plain to see


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return taught(dataset(np.random.default_rng(7), count=16, rate=25.0))


def alike(model: inphase.Model, noise_std: float = 0.01) -> inphase.Model:
    """The same model of people who all do nearly the same: a reading tells the phase and nothing else."""
    mean = model.prior.samples.mean(0)
    prior = dataclasses.replace(model.prior, samples=mean + 1e-3 * (model.prior.samples - mean))
    return dataclasses.replace(model, prior=prior, noise=Noise(np.full(4, noise_std**2), np.zeros(4)))


PAUSE = np.concatenate([np.arange(0, 0.4, 0.02), np.full(30, 0.4), np.arange(0.4, 1 + 1e-9, 0.02)])


@pytest.mark.parametrize("tempo", [0.5, 0.75, 1.0, 1.5, 2.0, None], ids=lambda tempo: f"{tempo or 'pause'}")
def test_an_alignment_finds_the_phase_of_the_mean_trajectory_to_a_cell_or_two(
    tempo: float | None, model: inphase.Model
) -> None:
    known = alike(model)
    phases = PAUSE if tempo is None else np.arange(0, 1 + 1e-9, 0.02 * tempo)
    session, interval, found = known.session("promp", phase="alignment"), 0.02 / known.phase.nominal_velocity, []
    for i, phase in enumerate(phases):
        estimate = session.observe(i * interval, known.predict(phase)[0, :2])
        found.append((estimate.phase, session.belief.timing.phase, estimate.phase_velocity))
    expected, cheapest, velocity = np.array(found).T
    assert np.abs(expected - phases).max() * CELLS < (2 if tempo is None else 1.2)
    assert np.abs(cheapest - phases).max() * CELLS < 0.8
    if tempo is not None:  # what is remembered of the prior, 1, fades with the window, 0.3 of a typical interaction
        tempos = tempo + (1 - tempo) * np.exp(-0.02 * np.arange(len(phases)) / 0.3)
        going = phases < 0.9
        np.testing.assert_allclose(velocity[going] / known.phase.nominal_velocity, tempos[going], atol=0.1)


# ------------------------------------------------------------------------------------- against sums over all candidates

KINDS = pytest.mark.parametrize(("order", "periodic"), [(1, False), (2, False), (1, True)], ids=["1", "2", "periodic"])


@KINDS
def test_candidates_are_believed_as_all_readings_at_once_say(
    order: int, periodic: bool, rng: np.random.Generator
) -> None:
    model = chance_model(rng, phase_model(order, periodic))
    filter, steps = Promp(model, "candidates", starts=2, tempos=5), samples(model, rng)
    begun = filter.init(RNG).timing
    belief, total = followed(filter, steps)
    course = Course(np.ones(3), np.array([0.0, 0.1, 0.3])) if periodic else COURSE
    times = np.cumsum([dt for _, dt in steps])
    joint, ends, batches, answers = [], [], [], []
    for start, tempo, share in zip(begun.phases, begun.tempos, begun.weights, strict=True):
        phases = (start + tempo * times) % 1.0 if periodic else np.minimum(start + tempo * times, 1.0)
        batches.append(Batch.of(model, *stacked(model, steps, list(phases))))
        joint.append(np.log(share) + batches[-1].log_likelihood)
        ends.append([phases[-1], tempo])
        at = course.share * phases[-1] + course.offset
        answers.append(batches[-1].at(model, at % 1.0 if periodic else np.minimum(at, 1.0)))
    shares = np.exp(np.array(joint) - max(joint))
    assert total == pytest.approx(max(joint) + np.log(shares.sum()), abs=1e-8)
    shares /= shares.sum()
    assert np.sort(shares)[-2] > 1e-3  # a choice that is open
    np.testing.assert_allclose(belief.timing.weights, shares, atol=1e-9)
    np.testing.assert_allclose(belief.weights_mean, shares @ [batch.mean for batch in batches], atol=1e-8)
    if not periodic:  # whose mean is one on the circle
        mean = shares @ ends
        np.testing.assert_allclose(belief.phase_mean, mean, atol=1e-9)
        np.testing.assert_allclose(belief.phase_cov, (shares * (ends - mean).T) @ (ends - mean), atol=1e-9)
    means, variances = (np.array(part) for part in zip(*answers, strict=True))
    mean = np.tensordot(shares, means, 1)
    var = np.tensordot(shares, variances + means**2, 1) - mean**2
    got_mean, got_var = belief.trajectory(course, FEATURES)
    np.testing.assert_allclose(got_mean, mean, atol=1e-8)
    np.testing.assert_allclose(got_var, var, atol=1e-8)


@pytest.mark.parametrize("start", [0.05, 0.5])
def test_candidates_begin_as_the_phase_prior_has_it(start: float) -> None:
    """Its moments, cut off at 0, for as many candidates as make sums integrals."""
    phase = dataclasses.replace(phase_model(1), mean=np.array([start, 0.8]))
    std, shared = np.sqrt(phase.cov[0, 0]), phase.cov[0, 1] / phase.cov[0, 0]
    cut = truncnorm(-start / std, (1 - start) / std, loc=start, scale=std)
    own = phase.cov[1, 1] - shared * phase.cov[0, 1]
    candidates = Candidates.begin(phase, 201, 201)
    moving = np.stack([candidates.phases, candidates.tempos])
    mean = moving @ candidates.weights
    np.testing.assert_allclose(mean, [cut.mean(), 0.8 + shared * (cut.mean() - start)], atol=1e-4)
    cov = [[cut.var(), shared * cut.var()], [shared * cut.var(), own + shared**2 * cut.var()]]
    off = moving - mean[:, None]
    np.testing.assert_allclose(candidates.weights * off @ off.T, cov, rtol=2e-3)


# ------------------------------------------------------------------------------------------------ with the phase known


def test_with_the_phase_known_candidates_are_linear_regression(rng: np.random.Generator) -> None:
    model = chance_model(rng, known_phase(0.8, start=0.1))
    steps = samples(model, rng, 40)
    belief, total = followed(Promp(model, "candidates"), steps)
    phases = [min(0.1 + 0.8 * time, 1.0) for time in np.cumsum([dt for _, dt in steps])]
    batch = Batch.of(model, *stacked(model, steps, phases))
    assert total == pytest.approx(batch.log_likelihood, abs=1e-8)
    np.testing.assert_allclose(belief.weights_mean, batch.mean, atol=1e-8)
    np.testing.assert_allclose(belief.phase_mean, [phases[-1], 0.8], atol=1e-12)
    np.testing.assert_allclose(belief.phase_cov, 0.0, atol=1e-12)
    for got, expected in zip(
        belief.trajectory(Course(np.zeros(3), np.array([0.2, 0.6, 1.0])), FEATURES),
        batch.at(model, np.array([0.2, 0.6, 1.0])),
        strict=True,
    ):
        np.testing.assert_allclose(got, expected, atol=1e-8)


def test_at_the_phases_it_found_an_alignment_is_linear_regression(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the doubt about the phase makes of a reading is counted as noise that lasts for a window."""
    model, dt = chance_model(rng, phase_model()), 0.02
    weights = model.prior.draw(1, rng)[0]
    steps, filter = [], Promp(model, "alignment")
    for i in range(40):
        noise = np.sqrt(model.noise.var) * rng.standard_normal(4)
        values = model.layout.predict(np.array([0.05 + 0.8 * dt * i]), weights)[0] + noise
        steps.append((Observation(FEATURES, values, model.noise.var), dt if i else 0.0))
    told, plain = [], promp.foresee
    monkeypatch.setattr(promp, "foresee", lambda *args: (told.append(args[2:]), plain(*args))[1])
    belief, phases, covs = filter.init(RNG), [], []
    for i, (observation, passed) in enumerate(steps):
        before = belief
        belief, _ = filter.step(belief, observation, passed, RNG)
        (phase,), _, noise_cov = told[-1]
        assert phase == belief.phase_mean[0]
        ahead, behind = (model.layout.predict(np.array([phase + h]), before.weights_mean)[0] for h in (1e-5, -1e-5))
        slope = (ahead - behind) / 2e-5
        news = np.tanh(0.8 * passed / 0.6) if i else 1.0
        doubt = belief.phase_cov[0, 0] / news * np.outer(slope, slope)
        np.testing.assert_allclose(noise_cov, np.diag(model.noise.var) + doubt, rtol=1e-4, atol=1e-9)
        phases.append(phase)
        covs.append(noise_cov)
    rows, values, _ = stacked(model, steps, phases)
    batch = Batch.of(model, rows, values, block_diag(*covs))
    np.testing.assert_allclose(belief.weights_mean, batch.mean, atol=1e-7)
    at = Course(np.zeros(3), np.array([0.2, 0.6, 1.0]))
    for got, expected in zip(belief.trajectory(at, FEATURES), batch.at(model, at.offset), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-7)


# ------------------------------------------------------------------------------------------------------------ readings


def test_an_alignment_is_with_what_is_expected_of_this_partner_by_now(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reference and its variance are those of the mean trajectory at first, then those of all readings before."""
    model = chance_model(rng, phase_model())
    steps = [step for step in samples(model, rng, 30) if len(step[0])]
    references, taken, plain, foresee = [], [], Alignment.seen, promp.foresee
    monkeypatch.setattr(Alignment, "seen", lambda *args: (references.append(args[2:]), plain(*args))[1])
    monkeypatch.setattr(promp, "foresee", lambda *args: (taken.append(args[2:]), foresee(*args))[1])
    filter, phases, covs = Promp(model, "alignment"), [], []
    belief = filter.init(RNG)
    for i, (observation, dt) in enumerate(steps):
        belief, _ = filter.step(belief, observation, dt, RNG)
        if i in (0, 5, len(steps) - 1):
            batch = (
                Batch.of(model, *stacked(model, steps[:i], phases)[:2], block_diag(*covs)) if i else Batch.before(model)
            )
            (mean, var), seen = references[-1], observation.features
            expected = batch.at(model, np.linspace(0, 1, len(mean)))
            np.testing.assert_allclose(mean, expected[0][:, seen], atol=1e-7)
            np.testing.assert_allclose(var, expected[1][:, seen] + model.noise.var[seen], atol=1e-7)
        (phase,), _, noise_cov = taken[-1]
        phases.append(phase)
        covs.append(noise_cov)


@METHOD
def test_a_lost_sensor_widens_the_doubt_until_it_is_found(method: str, model: inphase.Model) -> None:
    times, values = recording(np.random.default_rng(0), rate=25.0)
    begins, ends = 17, 32
    session, phase_std, std = model.session("promp", phase=method), [], []
    for i, (time, sample) in enumerate(zip(times, values[:, :2], strict=True)):
        seen = not begins <= i < ends
        phase_std.append(session.observe(time, sample if seen else np.full(2, np.nan)).phase_std)
        std.append(session.respond(samples=1).std[0].mean())
    blind = slice(begins - 1, ends)
    assert (np.diff(phase_std[blind]) > 0).all()
    assert phase_std[ends - 1] > 1.5 * phase_std[begins - 1]
    assert std[ends - 1] > 1.25 * std[begins - 1]
    assert phase_std[ends + 3] < 0.5 * phase_std[ends - 1]


def test_a_reading_that_fits_nowhere_is_believed_the_less_the_odder_it_is(model: inphase.Model) -> None:
    times, values = recording(np.random.default_rng(0), rate=25.0)
    session = model.session("promp", phase="alignment")
    for time, sample in zip(times[:25], values[:, :2], strict=False):
        session.observe(time, sample)
    filter, belief = Promp(model, "alignment"), session.belief
    now = model.scaling.scale(values[25])[:2]
    moved = []
    for off in (1.0, 10.0, 100.0):
        strange = Observation(np.array([0, 1]), now + off * np.array([1, -1]), model.noise.var[:2])
        after, info = filter.step(belief, strange, 0.04, RNG)
        assert info.healthy
        moved.append(np.linalg.norm(after.weights_mean - belief.weights_mean))
    assert moved[0] > moved[1] > moved[2] > 0
    assert moved[2] < moved[0] / 10


# ------------------------------------------------------------------------------------------------------------- options


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"phase": "dtw"}, "unknown phase 'dtw'; one of alignment, candidates"),
        ({"starts": 0}, "expected a whole number of at least 1 of starts, got 0"),
        ({"tempos": 2.5}, "expected a whole number of at least 1 of tempos, got 2.5"),
        ({"stiffness": 3}, "no option stiffness; it has phase, starts, tempos"),
    ],
)
def test_a_mistaken_option_is_told_with_what_there_is(
    options: dict[str, object], message: str, model: inphase.Model
) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match=message):
        model.session("promp", **options)


def test_candidates_need_a_tempo(rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model(0))
    with pytest.raises(OptionError, match="of order 1 or 2, got order 0"):
        model.session("promp", phase="candidates")
    model.session("promp", phase="alignment")  # goes at the nominal tempo until it knows better
