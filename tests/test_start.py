"""Where interactions begin: a prior over the phase at the first sample, which every filter has to honour."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from interactions import (
    CONTROLLED,
    OBSERVED,
    chance_model,
    dataset,
    phase_model,
    recording,
    shapes_unchecked,
    taught,
    waves,
)
from scipy.stats import norm, truncnorm

import inphase
from inphase.errors import OptionError
from inphase.filters import FILTERS, make, motion, tempo
from inphase.phase import PhaseModel
from inphase.tempo import Tempo

NAMES = pytest.mark.parametrize("name", sorted(FILTERS))
RATE = 25.0  # [Hz]
ANYWHERE = (0.5, 1.0)  # phase and its standard deviation
PHASES = st.floats(0.0, 1.0)
STDS = st.floats(1e-4, 100.0)


@pytest.fixture(scope="module")
def demos() -> inphase.Dataset:
    return dataset(np.random.default_rng(7), count=16, rate=RATE)


@pytest.fixture(scope="module")
def model(demos: inphase.Dataset) -> inphase.Model:
    return taught(demos)


@pytest.fixture(scope="module")
def rhythm() -> inphase.Model:
    times, values = waves(np.random.default_rng(5))
    demos = inphase.Dataset.from_arrays([times] * len(values), values, OBSERVED, CONTROLLED)
    return taught(demos, phase=inphase.learn_phase(demos, periodic=True))


def cut_off(phase: PhaseModel):
    """The normal distribution of the phase at the start, given that it lies in 0 … 1, as scipy has it."""
    mean, std = float(phase.mean[0]), float(np.sqrt(phase.cov[0, 0]))
    return truncnorm(-mean / std, (1 - mean) / std, loc=mean, scale=std)


# ------------------------------------------------------------------------------------------------------- the prior


@given(PHASES, STDS, st.lists(st.floats(1e-3, 0.999), min_size=1, max_size=9).map(np.array))
def test_starts_are_quantiles_of_the_normal_that_is_cut_off(at: float, std: float, shares: np.ndarray) -> None:
    phase, before = phase_model().starting(at, std), shares.copy()
    np.testing.assert_allclose(phase.starts(shares), cut_off(phase).ppf(shares), rtol=1e-6, atol=1e-9)
    round_and_round = phase_model(periodic=True).starting(at, std)
    np.testing.assert_allclose(round_and_round.starts(shares), norm.ppf(shares, at, std), rtol=1e-12, atol=1e-9)
    np.testing.assert_array_equal(shares, before)


@pytest.mark.parametrize("at", [0.0, 0.4, 1.0])
def test_a_start_without_doubt_is_that_start(at: float) -> None:
    for periodic in (False, True):
        phase = phase_model(2, periodic).starting(at, 0.0)
        np.testing.assert_array_equal(phase.starts(np.array([0.01, 0.5, 0.99])), at)
        drawn = motion.begin(phase, 5, np.random.default_rng(0))[:, 0]
        np.testing.assert_allclose((drawn - at + 0.5) % 1.0, 0.5, atol=1e-12)
        assert len(np.unique(drawn)) == 1


@pytest.mark.parametrize("order", [0, 1, 2])
def test_another_start_is_all_that_changes(order: int) -> None:
    phase = phase_model(order)
    moved = phase.starting(0.4, 0.3)
    assert moved.mean[0] == 0.4
    assert moved.cov[0, 0] == pytest.approx(0.09)
    np.testing.assert_array_equal(moved.mean[1:], phase.mean[1:])
    np.testing.assert_array_equal(moved.cov[1:, 1:], phase.cov[1:, 1:])
    np.testing.assert_array_equal(moved.cov[0, 1:], 0.0)  # where it begins says nothing of how fast it goes
    assert (moved.diffusion, moved.nominal_velocity, moved.periodic) == (0.05, 0.8, False)
    assert phase.mean[0] == 0.05


def test_a_model_and_its_training_take_a_start(demos: inphase.Dataset, tmp_path: Path) -> None:
    model = taught(demos, phase=inphase.learn_phase(demos, 2))
    moved, learned = model.starting(0.4, 0.3), inphase.learn_phase(demos, 2, start=0.4, start_std=0.3)
    moved.save(tmp_path / "moved.inphase")
    for phase in (moved.phase, inphase.Model.load(tmp_path / "moved.inphase").phase, learned):
        np.testing.assert_array_equal(phase.mean, [0.4, *model.phase.mean[1:]])
        np.testing.assert_allclose(phase.cov, np.diag([0.3**2, *np.diag(model.phase.cov)[1:]]), rtol=1e-12)
        assert phase.diffusion == model.phase.diffusion
    assert (moved.prior, moved.noise, moved.tempo) == (model.prior, model.noise, model.tempo)
    assert model.phase.mean[0] == 0.0


@pytest.mark.parametrize(
    ("at", "std", "message"),
    [
        (-0.1, 0.1, "phase between 0 and 1 at the start, got -0.1"),
        (1.5, 0.1, "phase between 0 and 1 at the start, got 1.5"),
        (np.nan, 0.1, "finite mean"),
        (0.5, -0.1, "standard deviation >= 0 of the phase at the start, got -0.1"),
        (0.5, np.nan, "got nan"),
        (0.5, np.inf, "got inf"),
    ],
)
def test_what_is_no_start_is_refused(
    at: float, std: float, message: str, model: inphase.Model, demos: inphase.Dataset
) -> None:
    with shapes_unchecked():
        for attempt in (
            lambda: model.starting(at, std),
            lambda: inphase.learn_phase(demos, start=at, start_std=std),
            lambda: phase_model(periodic=True).starting(at, std),
        ):
            with pytest.raises(OptionError, match=message):
                attempt()


# ------------------------------------------------------------------------------------------------------- the filters


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("std", [0.02, 0.4])
def test_members_begin_as_the_gaussian_of_those_within(order: int, std: float, rng: np.random.Generator) -> None:
    """All derivatives, too: as many draws of the whole Gaussian, without those that begin outside of 0 … 1."""
    turn = np.array([[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [-0.3, 0.5, 1.0]])[: order + 1, : order + 1]
    scale = np.diag([std, 0.3, 0.2][: order + 1])
    prior = PhaseModel(np.array([0.1, 0.8, 0.05])[: order + 1], scale @ turn @ turn.T @ scale, 0.05, 0.8)
    drawn = motion.begin(prior, 40_000, rng)
    everywhere = rng.multivariate_normal(prior.mean, prior.cov, 200_000)
    within = everywhere[(everywhere[:, 0] >= 0) & (everywhere[:, 0] <= 1)]
    stds = within.std(0)
    chance = 5 * np.sqrt(1 / len(drawn) + 1 / len(within))
    assert (np.abs(drawn.mean(0) - within.mean(0)) / stds).max() < chance
    off = np.cov(drawn.T) - np.cov(within.T)
    assert np.abs(off / np.outer(stds, stds)).max() < 1.5 * chance


@pytest.mark.parametrize(("at", "std"), [(0.0, 0.01), (0.4, 0.02), (0.5, 1.0), (1.0, 0.3)])
def test_particles_cover_the_start_evenly_and_none_lie_at_the_ends(
    at: float, std: float, rng: np.random.Generator
) -> None:
    phase = phase_model().starting(at, std)
    moving, log_weights = tempo.begin(phase, Tempo(), 200, rng)
    drawn, usual = moving.phase, log_weights == log_weights[0]
    np.testing.assert_array_equal(np.sort(np.floor(cut_off(phase).cdf(drawn[usual]) * 100)), np.arange(100))
    others = np.sort(cut_off(phase).cdf(drawn[~usual]))
    assert np.abs(others - (np.arange(100) + 0.5) / 100).max() < 0.03
    assert len(np.unique(drawn)) == 200
    assert drawn.min() > 0
    assert drawn.max() < 1


@pytest.mark.parametrize("usual", [0.0, 0.3, 0.9, 1.0])
def test_the_tempos_at_the_start_are_those_of_the_mixture_and_every_seed_has_all(usual: float) -> None:
    mixture = Tempo(usual=usual)
    for seed in range(5):
        moving, log_weights = tempo.begin(phase_model(), mixture, 200, np.random.default_rng(seed))
        weights = np.exp(log_weights)
        assert weights.sum() == pytest.approx(1.0)
        for off in (-0.7, -0.2, -0.03, 0.0, 0.05, 0.4, 1.0):
            expected = usual * norm.cdf(off / mixture.usual_std) + (1 - usual) * norm.cdf(off / mixture.other_std)
            assert weights[moving.own < off].sum() == pytest.approx(expected, abs=0.02)
        for log_tempo in (-np.log(2), np.log(2)):
            near = (np.abs(moving.own - log_tempo) < 0.1).sum()
            assert near >= (5 if usual < 1 else 0)


def test_a_rhythm_may_begin_anywhere(rng: np.random.Generator) -> None:
    phase = phase_model(periodic=True).starting(0.9, 2.0)
    for drawn in (tempo.begin(phase, Tempo(), 2000, rng)[0].phase, motion.begin(phase, 2000, rng)[:, 0]):
        assert np.ptp(drawn) <= 1  # on one turn of the circle
        count, _ = np.histogram(drawn % 1.0, bins=10, range=(0, 1))
        assert np.abs(count - 200).max() < 5 * np.sqrt(200)
    near = phase.starting(0.9, 0.1)
    drawn = tempo.begin(near, Tempo(), 2000, rng)[0].phase
    # Wrapped, not cut off: a sixth begins after the end of the circle, as near to it as the others.
    assert ((drawn - 0.5) % 1.0 > 0.5).mean() == pytest.approx(norm.sf(1.0), abs=0.002)
    assert drawn.std() == pytest.approx(0.1, rel=0.02)


@pytest.mark.parametrize(
    ("name", "options", "off"),
    [
        ("bip", {}, 1e-9),
        ("ebip", {"members": 2500}, 0.1),  # five times the chance of so many draws
        ("particle", {"particles": 2500}, 0.1),
        ("promp", {}, 0.01),
        ("promp", {"phase": "candidates", "starts": 101}, 0.01),
        ("rbpf", {}, 0.03),  # half of its 200 stand for other tempos, and weigh little
    ],
)
def test_every_filter_begins_where_it_is_told(name: str, options: dict, off: float, rng: np.random.Generator) -> None:
    model = chance_model(rng, phase_model())
    for at, std in ((0.4, 0.05), (0.3, 0.4), (0.0, 0.3)):
        told = model.starting(at, std)
        belief = make(name, told, **options).init(rng)
        truth = norm(at, std) if name == "bip" else cut_off(told.phase)  # of a Gaussian, nothing can be cut off
        assert abs(belief.phase_mean[0] - truth.mean()) < off * truth.std()
        assert np.sqrt(belief.phase_cov[0, 0]) == pytest.approx(truth.std(), rel=off)


# -------------------------------------------------------------------------------------------------- from the middle


def from_the_middle(model: inphase.Model, name: str | None, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of the phase (T,), its standard deviations, and errors of the response, seen from phase 0.4 on."""
    times, values = recording(np.random.default_rng(seed), rate=RATE)
    session, found = model.session(name, seed=seed), []
    for i in range(round(0.4 * (len(times) - 1)), len(times)):
        estimate = session.observe(float(times[i]), values[i, :2])
        off = np.abs(session.respond(samples=1).mean[0] - values[i, 2:]).mean()
        found.append((abs(estimate.phase - times[i] / times[-1]), estimate.phase_std, off))
    phase, std, response = np.array(found).T
    return phase, std, response


@pytest.mark.parametrize("seed", range(4))
def test_who_is_first_seen_in_the_middle_is_found(seed: int, model: inphase.Model) -> None:
    wide = from_the_middle(model.starting(*ANYWHERE), None, seed)
    told = from_the_middle(model.starting(0.4, 0.02), None, seed)
    usual = from_the_middle(model, None, seed)
    assert wide[0][10:].max() < 0.05  # after 0.4 s
    assert (wide[0] < 4 * wide[1] + 0.01).all()  # and until then its doubt is as large as its error
    assert told[0].max() < 0.05
    assert (
        usual[0][:10].mean() > 0.2
    )  # who believes in a start at 0 is behind until he takes the partner for a fast one
    assert told[2].mean() < wide[2].mean() + 0.01
    assert wide[2].mean() < 0.2 * usual[2].mean()


@NAMES
def test_every_filter_follows_from_where_it_was_told_to_begin(name: str, model: inphase.Model) -> None:
    for seed in range(2):
        assert from_the_middle(model.starting(0.4, 0.02), name, seed)[0].max() < 0.1


@pytest.mark.parametrize(
    ("name", "at", "prior"),
    [
        *[(name, 0.4, "told") for name in sorted(FILTERS)],
        *[
            (name, 0.4, "wide") for name in sorted(FILTERS) if name != "bip"
        ],  # whose Gaussian is linearised at one place
        ("rbpf", 0.05, "wide"),
        ("rbpf", 0.95, "wide"),
        ("rbpf", 0.4, "usual"),
    ],
)
def test_a_rhythm_is_joined_anywhere(name: str, at: float, prior: str, rhythm: inphase.Model) -> None:
    times, values = waves(np.random.default_rng(1), count=1, rate=20.0, cycles=2)
    model = {"told": rhythm.starting(at, 0.02), "wide": rhythm.starting(*ANYWHERE), "usual": rhythm}[prior]
    session, off = model.session(name), []
    for i in range(round(at * 20), len(times)):
        estimate = session.observe(float(times[i]), values[0][i, :2])
        off.append(abs((estimate.phase - times[i] + 0.5) % 1.0 - 0.5))
    if prior == "usual":
        assert min(off[:5]) > 0.2
    else:
        assert max(off if prior == "told" else off[8:]) < 0.03
