"""The correlation of channels and weights: numpy's own of many interactions drawn, whoever believes in them."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from interactions import chance_model, phase_model, wide_model
from numpy.testing import assert_allclose

import inphase
from inphase.basis import Gaussian, Layout
from inphase.channels import make_channels
from inphase.errors import ChannelError, OptionError
from inphase.filters import FILTERS, Course, rbpf
from inphase.noise import Noise
from inphase.preprocess.coordinates import Coordinates
from inphase.report.correlation import PHASES, channel_correlation, weight_correlation
from inphase.weight_prior import WeightPrior

OPTIONS = {"bip": {}, "ebip": {"members": 60}, "particle": {"particles": 300}, "promp": {}, "rbpf": {"particles": 60}}


def believed(prior: WeightPrior, model: inphase.Model) -> inphase.Model:
    return replace(model, prior=prior)


def drawn_from(cov: np.ndarray, model: inphase.Model, rng: np.random.Generator) -> np.ndarray:
    """Weights whose sample mean and covariance are exactly the mean of the prior and `cov`."""
    size = len(cov)
    raw = rng.standard_normal((4 * size, size))
    raw -= raw.mean(0)
    white = raw @ np.linalg.inv(np.linalg.cholesky(np.cov(raw, rowvar=False))).T
    value, vector = np.linalg.eigh(cov)
    return model.prior.mean + white @ (np.sqrt(np.maximum(value, 0))[:, None] * vector.T)


def assert_correlation(got: np.ndarray, names: int) -> None:
    assert got.shape == (names, names)
    assert_allclose(got.diagonal(), 1.0)
    assert_allclose(got, got.T)
    assert np.abs(got).max() <= 1
    assert np.linalg.eigvalsh(got).min() > -1e-9


@pytest.fixture
def model(rng: np.random.Generator) -> inphase.Model:
    return chance_model(rng, phase_model())


@pytest.mark.parametrize(("shrinkage", "trust"), [(0.0, 1.0), (0.3, 0.6), (1.0, 1.0), (0.2, 0.0)])
@pytest.mark.parametrize("blocks", [(), (5, 4, 5, 4), (9, 9)])
def test_of_the_prior_it_is_numpys_of_interactions_drawn(model, rng, shrinkage, trust, blocks):
    prior = WeightPrior(model.prior.samples, shrinkage, trust, partner=9, blocks=blocks)
    model = believed(prior, model)
    weights = drawn_from(prior.cov, model, rng)
    readings = np.stack([model.predict(np.array([0.3]), w)[0] for w in weights])
    got = channel_correlation(model, phase=0.3)
    assert_correlation(got, 4)
    assert_allclose(got, np.corrcoef(readings, rowvar=False), atol=1e-9)


def test_over_a_whole_interaction_all_its_phases_count(model, rng):
    phases = (np.arange(PHASES) + 0.5) / PHASES
    weights = drawn_from(model.prior.cov, model, rng)
    off = np.concatenate([model.predict(phases, w) - model.predict(phases) for w in weights])
    got = channel_correlation(model)
    assert_correlation(got, 4)
    scale = np.sqrt((off**2).mean(0))
    assert_allclose(got, (off / scale).T @ (off / scale) / len(off), atol=1e-9)


def test_quaternions_to_first_order(rng):
    """Close to the mean that is all there is."""
    channels = make_channels(["hand"], ["tool_qx", "tool_qy", "tool_qz", "tool_qw"], kinds={"tool_q?": "quaternion"})
    reference = rng.standard_normal(4)
    references = np.concatenate([[0.0], reference / np.linalg.norm(reference)])
    layout = Layout((Gaussian(4),) * 4)
    low = np.array([-1.0, -0.5, -0.6, -0.7])
    samples = rng.normal(size=layout.size) + 1e-4 * rng.normal(size=(12, layout.size))
    model = inphase.Model(
        channels, Coordinates(channels, references), inphase.Scaling(low, low + np.array([2.0, 1.0, 3.0, 1.5])),
        layout, WeightPrior(samples), Noise(np.full(4, 0.01), np.zeros(4)), phase_model(), np.ones(5),
    )  # fmt: skip
    weights = drawn_from(model.prior.cov, model, rng)
    readings = np.stack([model.predict(np.array([0.6]), w)[0] for w in weights])
    got = channel_correlation(model, phase=0.6)
    assert_correlation(got, 5)
    assert_allclose(got, np.corrcoef(readings, rowvar=False), atol=2e-3)


@pytest.mark.parametrize("name", FILTERS)
def test_of_a_belief_it_is_that_of_its_weights(model, name):
    """And they have just the variance that the belief's own trajectory has at a phase that is named."""
    session = model.session(name, seed=1, **OPTIONS[name])
    if name in ("bip", "promp", "rbpf"):  # the others draw
        factor = session.belief.weights_factor()
        assert_allclose(factor.T @ factor, model.prior.cov, atol=1e-9)
    for time in np.arange(8) / 20:
        session.observe(time, model.predict([0.05 + 0.8 * time])[0, :2] + 0.02)
    belief, phase = session.belief, 5 / 99  # one that rbpf has in its table
    layout, everything = model.layout, np.arange(4)
    rows = layout.project(phase, belief.weights_factor())
    mean, var = belief.trajectory(Course(np.zeros(1), np.array([phase])), everything)
    assert_allclose((rows**2).sum(0), var[0], rtol=1e-6)
    assert_allclose(layout.predict(np.array([phase]), belief.weights_mean), mean, rtol=1e-6)
    got = channel_correlation(model, belief, phase)
    assert_correlation(got, 4)
    assert_allclose(got, np.corrcoef(np.concatenate([rows, -rows]), rowvar=False), atol=1e-9)
    names, weights = weight_correlation(model, belief)
    assert len(names) == layout.size
    # What one seen weight correlates with, another does: the two matrices are of one covariance.
    factor = belief.weights_factor()
    assert_allclose(weights, np.corrcoef(np.concatenate([factor, -factor]), rowvar=False), atol=1e-9)


def test_what_rbpf_leaves_unfiltered_is_believed_as_before(model, monkeypatch):
    monkeypatch.setattr(rbpf, "MOST_DIRECTIONS", 2)
    session = model.session("rbpf", seed=1, particles=20)
    factor = session.belief.weights_factor()
    assert_allclose(factor.T @ factor, model.prior.cov, atol=1e-9)
    session.observe(0.0, model.predict([0.1])[0, :2])
    belief, phase = session.belief, 40 / 99
    assert belief.directions.rest.max() > 0
    _, var = belief.trajectory(Course(np.zeros(1), np.array([phase])), np.arange(4))
    rows = model.layout.project(phase, belief.weights_factor())
    assert_allclose((rows**2).sum(0), var[0], rtol=1e-6)


@pytest.mark.parametrize("phase", ["alignment", "candidates"])
def test_both_kinds_of_promp_keep_their_variance(model, phase):
    session = model.session("promp", phase=phase)
    for time in np.arange(6) / 20:
        session.observe(time, model.predict([0.8 * time])[0, :2])
    belief, everything = session.belief, np.arange(4)
    _, var = belief.trajectory(Course(np.zeros(1), np.array([0.5])), everything)
    rows = model.layout.project(0.5, belief.weights_factor())
    assert_allclose((rows**2).sum(0), var[0], rtol=1e-9)


def test_the_weights_of_some_channels_by_name(model):
    names, got = weight_correlation(model, channels=["lift", "turn"])
    assert names == ("lift 1", "lift 2", "lift 3", "lift 4", "turn 1", "turn 2", "turn 3", "turn 4")
    assert_correlation(got, 8)
    places = [5, 6, 7, 8, 14, 15, 16, 17]
    assert_allclose(got, np.corrcoef(model.prior.samples, rowvar=False)[np.ix_(places, places)], atol=1e-9)
    with pytest.raises(ChannelError, match="nobody"):
        weight_correlation(model, channels="nobody")


@pytest.mark.parametrize(
    ("shrinkage", "trust", "partner"), [(0.3, 0.6, 9), (1.0, 1.0, 9), (0.2, 0.0, 5), (0.3, 0.6, 7)]
)
def test_the_weights_of_some_channels_are_believed_as_those_of_all(model, shrinkage, trust, partner):
    prior = WeightPrior(model.prior.samples, shrinkage, trust, partner, (5, 4, 5, 4))
    _, got = weight_correlation(believed(prior, model), channels=["lift", "turn"])
    places, std = [5, 6, 7, 8, 14, 15, 16, 17], np.sqrt(prior.cov.diagonal())
    assert_allclose(got, (prior.cov / np.outer(std, std))[np.ix_(places, places)], atol=1e-9)


def test_a_channel_that_never_varies_correlates_with_itself_alone(model):
    samples = model.prior.samples.copy()
    samples[:, 5:9] = 0.3
    got = channel_correlation(believed(WeightPrior(samples), model))
    assert_allclose(got[1], [0, 1, 0, 0])
    assert_correlation(got, 4)


def test_of_many_channels_no_matrix_of_all_weights_is_made():
    """500 channels of 15 functions, shrunk: 7,500 weights, whose covariance alone would take 450 MB."""
    model = wide_model(500, functions=15, shrinkage=0.2, trust=0.5)
    tracemalloc.start()
    got = channel_correlation(model)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 50e6
    assert_correlation(got, 500)


def test_a_phase_that_is_none_is_refused(model):
    with pytest.raises(OptionError, match="finite phase, got nan"):
        channel_correlation(model, phase=float("nan"))
