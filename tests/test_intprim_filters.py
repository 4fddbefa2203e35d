# ruff: noqa: NPY002 - the scripts that run on the facade seed numpy's old generator
"""The facade's primitive, filters and examples against formulas of the dissertation written out here."""

from __future__ import annotations

import copy
import pickle
import re
from itertools import pairwise

import numpy as np
import pytest
from sklearn.preprocessing import MinMaxScaler

import intprim
from inphase import ModelFileError, OptionError
from inphase.filters import Ebip, Particle
from inphase.observation import Observation
from intprim.filter import KalmanFilter
from intprim.filter.align.dtw import fastdtw
from intprim.filter.cyclical import Cyclical
from intprim.filter.spatiotemporal import EnsembleKalmanFilter, ExtendedKalmanFilter, ParticleFilter

GROUPS = [[0, 1]]
NAMES = ["X", "Y"]
SIZE = 6
Y_ONLY = np.array([1])


def bumps(phase: float) -> np.ndarray:
    """(6,) Gaussians of variance 0.02 and their slopes, as the dissertation writes them (4.2.1)."""
    off = phase - np.linspace(0, 1, SIZE)
    return np.exp(-(off**2) / 0.04), -off / 0.02 * np.exp(-(off**2) / 0.04)


@pytest.fixture(scope="module")
def demonstrations() -> list[np.ndarray]:
    np.random.seed(3)
    return intprim.examples.create_2d_handwriting_data(12, 0.0, 2.0, 0.01, 60, 6)


@pytest.fixture
def primitive(demonstrations: list[np.ndarray]) -> intprim.BayesianInteractionPrimitive:
    model = intprim.basis.GaussianModel(SIZE, 0.02, NAMES)
    return intprim.examples.train_model(intprim.BayesianInteractionPrimitive(model, GROUPS), demonstrations)


def filters(primitive: intprim.BayesianInteractionPrimitive) -> dict[str, object]:
    model, weights = primitive.basis_model, primitive.basis_weights
    mean, cov = primitive.get_basis_weight_parameters()
    phase = ([0.0, 1 / 60], [1e-4, 1e-6], 1e-8)
    np.random.seed(1)
    return {
        "enkf": EnsembleKalmanFilter(model, *phase, weights),
        "ekf": ExtendedKalmanFilter(model, *phase, mean, cov),
        "pf": ParticleFilter(model, *phase, weights),
        "kf": KalmanFilter(model, mean, cov),
    }


# ------------------------------------------------------------------------------------------------------- the filters


def test_the_extended_kalman_filter_is_that_of_the_dissertation(primitive):
    """Eq. 2.4 to 2.10 with dense matrices; the last sample is of both DoFs."""
    weights = primitive.basis_weights
    mean = np.concatenate([[0.3, 0.02], weights.mean(0)])
    cov = np.zeros((2 + 2 * SIZE, 2 + 2 * SIZE))
    cov[:2, :2], cov[2:, 2:] = np.diag([1e-4, 1e-6]), np.cov(weights.T)
    ours = ExtendedKalmanFilter(
        primitive.basis_model, mean[:2], [1e-4, 1e-6], 1e-6, mean_basis_weights=mean[2:], cov_basis_weights=cov[2:, 2:]
    )
    noise, transition, process = np.diag([4e-4, 1e-4]), np.eye(len(mean)), np.zeros_like(cov)
    transition[0, 1], process[:2, :2] = 1.0, 1e-6 * np.array([[1 / 3, 1 / 2], [1 / 2, 1]])
    samples = np.array([[0.4, 0.5], [0.45, 0.55], [0.5, 0.6]])
    for sample, active in zip(samples, ([1], [1], [0, 1]), strict=True):
        mean, cov = transition @ mean, transition @ cov @ transition.T + process
        values, slopes = bumps(mean[0])
        own = np.stack([mean[2 : 2 + SIZE], mean[2 + SIZE :]])
        jacobian = np.zeros((2, len(mean)))
        jacobian[:, 0], jacobian[0, 2 : 2 + SIZE], jacobian[1, 2 + SIZE :] = own @ slopes, values, values
        rows = jacobian[active]
        gain = cov @ rows.T @ np.linalg.inv(rows @ cov @ rows.T + noise[np.ix_(active, active)])
        mean, cov = mean + gain @ (sample - own @ values)[active], cov - gain @ rows @ cov
        phase, got_mean, got_cov = ours.localize(sample[None], noise, np.array(active), return_phase_variance=True)
        np.testing.assert_allclose(got_mean, mean, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(got_cov, cov, atol=1e-8 * np.abs(cov).max())
        assert phase == got_mean[0]


@pytest.mark.parametrize(("name", "kind"), [("enkf", Ebip), ("pf", Particle)])
@pytest.mark.parametrize("seed", [1, 2])
def test_an_ensemble_is_that_of_inphase_to_the_last_bit(primitive, demonstrations, name, kind, seed):
    noise, samples = np.diag([1e-3, 2e-3]), primitive.scaling.scale(demonstrations[0].T)[:20]
    np.random.seed(seed)
    rng = np.random.default_rng(np.random.randint(2**31))
    np.random.seed(seed)
    make = {"enkf": EnsembleKalmanFilter, "pf": ParticleFilter}[name]
    ours = make(primitive.basis_model, [0.0, 1 / 60], [1e-4, 1e-6], 1e-8, primitive.basis_weights)
    theirs = kind(ours.model, len(primitive.basis_weights))
    belief = theirs.init(rng)
    for values in samples:
        belief, _ = theirs.step(belief, Observation(Y_ONLY, values[1:], noise.diagonal()[1:]), 1.0, rng)
    phase, mean, _ = ours.localize(samples, noise, Y_ONLY)
    assert phase == belief.phase_mean[0]
    np.testing.assert_allclose(mean, belief.weights_mean[:-1], rtol=1e-12)
    states = belief.members if name == "enkf" else belief.particles
    np.testing.assert_array_equal(ours.ensemble, states[:, :-1].T)


def test_an_ensemble_starts_as_the_demonstrations(primitive):
    ours = filters(primitive)["enkf"]
    np.testing.assert_array_equal(ours.ensemble[2:], primitive.basis_weights.T)
    np.testing.assert_allclose(ours.get_ensemble_mean()[2:], primitive.basis_weights.mean(0), rtol=1e-12)
    np.testing.assert_allclose(ours.get_ensemble_covariance()[2:, 2:], np.cov(primitive.basis_weights.T), rtol=1e-9)
    np.testing.assert_array_equal(ours.get_ensemble_mean(ours.ensemble[:, :2]), ours.ensemble[:, :2].mean(1))


def test_the_kalman_filter_is_bayesian_regression_at_the_aligned_phases(primitive, demonstrations):
    """Two batches, aligned to 30 % and 50 % by a function of the user's; the posterior is that of all samples."""
    seen = []

    def align(observed, predicted):
        seen.append((observed.shape, predicted.shape))
        return 30 if len(seen) == 1 else 50

    mean, cov = primitive.get_basis_weight_parameters()
    ours = KalmanFilter(primitive.basis_model, mean, cov, align_func=align, num_align_samples=101)
    samples, noise = primitive.scaling.scale(demonstrations[0].T)[:10], np.diag([1e-2, 1e-2])
    ours.localize(samples[:6], noise, Y_ONLY)
    phase, got_mean, got_cov = ours.localize(samples[6:], noise, Y_ONLY)
    assert seen == [((6, 1), (101, 1)), ((10, 1), (101, 1))]
    assert phase == pytest.approx(0.5)
    phases = np.concatenate([0.3 * np.arange(1, 7) / 6, 0.3 + 0.2 * np.arange(1, 5) / 4])
    rows = np.stack([np.concatenate([np.zeros(SIZE), bumps(p)[0]]) for p in phases])
    gain = cov @ rows.T @ np.linalg.inv(rows @ cov @ rows.T + 1e-2 * np.eye(10))
    np.testing.assert_allclose(got_mean, mean + gain @ (samples[:, 1] - rows @ mean), rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(got_cov, cov - gain @ rows @ cov, atol=1e-8 * np.abs(cov).max())


def test_the_kalman_filter_follows_a_partner_like_the_demonstrations(primitive, demonstrations):
    whole = demonstrations[0]
    for iterative in (False, True):
        mean, cov = primitive.basis_weights[0], np.cov(primitive.basis_weights.T)
        primitive.set_filter(KalmanFilter(primitive.basis_model, mean, cov, fastdtw, iterative))
        half = whole.shape[1] // 2
        for begin, end in pairwise(range(0, half + 1, half // 3)):
            phase = primitive.generate_probable_trajectory_recursive(
                whole[:, begin:end], np.diag([1e-4, 1e-4]), np.array([0, 1])
            )[1]
            assert phase == pytest.approx(end / whole.shape[1], abs=0.05)


def test_dynamic_time_warping_takes_the_cheapest_of_all_paths(rng):
    def cheapest(price):
        """By the definition: the cost of the best path to each end, step by step back."""
        total = np.full(price.shape, np.inf)
        for t, n in np.ndindex(price.shape):
            before = [total[i, j] for i, j in ((t - 1, n), (t, n - 1), (t - 1, n - 1)) if i >= 0 and j >= 0]
            total[t, n] = price[t, n] + min(before, default=0.0)
        return int(total[-1].argmin())

    for _ in range(50):
        observed, predicted = rng.standard_normal((rng.integers(1, 9), 2)), rng.standard_normal((7, 2))
        price = np.linalg.norm(observed[:, None] - predicted, axis=2)
        assert fastdtw(observed, predicted) == cheapest(price)
    curve = np.stack([np.cos(np.linspace(0, 6, 100)), np.linspace(0, 6, 100)], axis=1)
    assert fastdtw(curve[:61:2], curve) == 60


def test_a_rhythm_goes_on_after_its_first_cycle():
    """Two and a half cycles of 40 samples; at the end the phase is a half again (4.2.7.3)."""
    np.random.seed(0)
    cycle = 2 * np.pi * np.arange(40) / 40
    model = intprim.basis.GaussianModel(9, 0.02, NAMES)
    primitive = intprim.BayesianInteractionPrimitive(model)
    for _ in range(20):
        shift, size = np.random.normal(0, 0.1), np.random.normal(1, 0.1)
        primitive.add_demonstration(np.stack([size * np.sin(cycle) + shift, size * np.cos(cycle)]))
    samples = np.tile(np.stack([np.sin(cycle), np.cos(cycle)]), (1, 3))[:, :101]
    for name, one in rhythmic(primitive).items():
        primitive.set_filter(one)
        phase = primitive.generate_probable_trajectory_recursive(samples, np.diag([0.01, 0.01]), [0, 1])[1]
        assert phase == pytest.approx(0.5, abs=0.06), name


def test_a_cyclical_basis_begins_again_at_every_whole_phase():
    basis, phases = intprim.basis.GaussianModel(SIZE, 0.02, NAMES).layout.bases[0], np.linspace(0.01, 0.99, 9)
    for turns in (-1.0, 0.0, 2.0):
        for got, expected in zip(
            Cyclical(basis).with_derivative(phases + turns), basis.with_derivative(phases), strict=True
        ):
            np.testing.assert_allclose(got, expected, atol=1e-12)
        np.testing.assert_allclose(Cyclical(basis)(phases + turns), basis(phases), atol=1e-12)


def rhythmic(primitive):
    mean, cov = primitive.get_basis_weight_parameters()
    phase = ([0.0, 1 / 40], [1e-4, 1e-6], 1e-8)
    return {
        "enkf": EnsembleKalmanFilter(primitive.basis_model, *phase, primitive.basis_weights, cyclical=True),
        "ekf": ExtendedKalmanFilter(primitive.basis_model, *phase, mean, cov, cyclical=True),
    }


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_phase_may_have_a_velocity_and_an_acceleration(primitive, order):
    """A time step moves the phase by a Taylor step, and adds proc_var to the variance of the highest derivative."""
    mean, cov = primitive.get_basis_weight_parameters()
    start, var = np.array([0.1, 0.02, 0.001])[: order + 1], np.array([1e-4, 1e-6, 1e-8])[: order + 1]
    ours = ExtendedKalmanFilter(primitive.basis_model, start, var, 1e-9, mean, cov)
    ours.localize(np.full((1, 2), np.nan), np.eye(2), [0, 1])
    taylor = np.array([[1, 1, 0.5], [0, 1, 1], [0, 0, 1]])[: order + 1, : order + 1]
    np.testing.assert_allclose(ours.get_mean()[: order + 1], taylor @ start, rtol=1e-12)
    highest = ours.get_covariance()[order, order]
    assert highest == pytest.approx(var[-1] + 1e-9, rel=1e-12)
    assert (ours.system_order, ours.system_size) == (order, order + 1)


# ----------------------------------------------------------------------------------------------------- the primitive


def test_weights_means_and_distributions_are_those_of_the_formulas(primitive, demonstrations):
    everything = np.concatenate(demonstrations, axis=1)
    low, span = everything.min(), np.ptp(everything)
    weights = []
    for demonstration in demonstrations:
        design = np.stack([bumps(p)[0] for p in np.linspace(0, 1, demonstration.shape[1])])
        weights.append(np.linalg.lstsq(design, (demonstration.T - low) / span, rcond=None)[0].T.ravel())
    np.testing.assert_allclose(primitive.basis_weights, weights, rtol=1e-8, atol=1e-8)
    mean, cov = primitive.get_basis_weight_parameters()
    np.testing.assert_allclose(mean, np.mean(weights, axis=0), atol=1e-8)
    np.testing.assert_allclose(cov, np.cov(np.array(weights).T), atol=1e-8)
    design = np.stack([bumps(p)[0] for p in np.linspace(0, 1, 25)])
    curves = np.array([low + span * (w.reshape(2, SIZE) @ design.T) for w in weights])
    np.testing.assert_allclose(primitive.get_mean_trajectory(num_samples=25), curves.mean(0), atol=1e-8)
    expected = (curves.mean(0), curves.mean(0) + curves.std(0, ddof=1), curves.mean(0) - curves.std(0, ddof=1))
    for got, wanted in zip(primitive.get_probability_distribution(25), expected, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-8)
    approximate = primitive.get_approximate_trajectory(demonstrations[1], 25)
    np.testing.assert_allclose(approximate, curves[1], atol=1e-8)


def test_the_derivative_is_the_slope_of_the_approximation(primitive, demonstrations):
    count = 20001
    curve = primitive.get_approximate_trajectory(demonstrations[0], count)
    slopes = primitive.get_approximate_trajectory_derivative(demonstrations[0], count)
    central = (curve[:, 2:] - curve[:, :-2]) * (count - 1) / 2
    np.testing.assert_allclose(slopes[:, 1:-1], central, atol=1e-3)


def test_a_dof_in_no_group_is_not_scaled(demonstrations):
    model = intprim.basis.GaussianModel(SIZE, 0.02, NAMES)
    primitive = intprim.examples.train_model(intprim.BayesianInteractionPrimitive(model, [[1]]), demonstrations)
    plain = intprim.examples.train_model(intprim.BayesianInteractionPrimitive(model), demonstrations)
    np.testing.assert_allclose(primitive.basis_weights[:, :SIZE], plain.basis_weights[:, :SIZE], rtol=1e-12)
    np.testing.assert_allclose(primitive.get_mean_trajectory()[0], plain.get_mean_trajectory()[0], rtol=1e-12)
    assert np.abs(primitive.basis_weights[:, SIZE:] - plain.basis_weights[:, SIZE:]).max() > 0.1


def test_the_tutorials_partner_is_tracked():
    """Translated by -10 and 145 samples long, of which the filters see y alone (4.2.8)."""
    np.random.seed(213413414)
    training = intprim.examples.create_2d_handwriting_data(50, 0.0, 5.0, 0.01, 95, 30)
    model = intprim.basis.GaussianModel(9, 0.1, NAMES)
    primitive = intprim.examples.train_model(intprim.BayesianInteractionPrimitive(model, GROUPS), training)
    selection = intprim.basis.Selection(np.array(NAMES), scaling_groups=GROUPS)
    for trajectory in training:
        selection.add_demonstration(trajectory)
    noise = np.diag(selection.get_model_mse(model, np.array([0, 1])))
    velocity, velocity_var = intprim.examples.get_phase_stats(training)
    (whole,) = intprim.examples.create_2d_handwriting_data(1, -10.0, 1e-5, 0.01, 145, 1e-5)
    phase_prior = ([0.0, velocity], [1e-4, velocity_var], 1e-8)
    mean, cov = primitive.get_basis_weight_parameters()
    for one in (
        EnsembleKalmanFilter(model, *phase_prior, primitive.basis_weights),
        ExtendedKalmanFilter(model, *phase_prior, mean, cov),
    ):
        primitive.set_filter(one)
        for begin, end in pairwise(range(0, 145, 32)):
            inferred, phase, weights, var = primitive.generate_probable_trajectory_recursive(
                whole[:, begin:end], noise, Y_ONLY, num_samples=145 - end
            )
            assert phase == pytest.approx(end / 145, abs=0.03)
            assert np.abs(inferred - whole[:, end:]).mean() < 0.3  # of a stroke of 3.5 by 5.4
        assert weights.shape == (18,)
        assert var.shape == (18, 18)


@pytest.mark.parametrize("name", ["enkf", "ekf", "pf", "kf"])
def test_what_is_not_active_does_not_exist(primitive, demonstrations, name):
    one, noise = filters(primitive)[name], np.diag([1e-3, 1e-3])
    seen, absurd = demonstrations[0][:, :12].copy(), demonstrations[0][:, :12].copy()
    absurd[0] = [0.0, np.nan, 1e9] * 4
    answers = []
    for trajectory, own_noise in ((seen, noise), (absurd, np.diag([1e4, 1e-3]))):
        primitive.set_filter(copy.deepcopy(one))
        answers.append(primitive.generate_probable_trajectory_recursive(trajectory, own_noise, Y_ONLY))
    for a, b in zip(*answers, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("name", ["enkf", "ekf", "pf", "kf"])
def test_deep_copies_start_afresh_and_in_batches_as_at_once(primitive, demonstrations, name):
    one, noise, trajectory = filters(primitive)[name], np.diag([1e-3, 1e-3]), demonstrations[0][:, :12]
    before, answers = one.get_mean(), []
    for _ in range(2):
        primitive.set_filter(copy.deepcopy(one))
        answers.append(primitive.generate_probable_trajectory_recursive(trajectory, noise, Y_ONLY)[0])
        assert primitive.filter is not one
    np.testing.assert_array_equal(one.get_mean(), before)
    np.testing.assert_array_equal(*answers)
    if name != "kf":  # which aligns at the end of each batch
        primitive.set_filter(copy.deepcopy(one))
        for column in range(12):
            last = primitive.generate_probable_trajectory_recursive(trajectory[:, [column]], noise, Y_ONLY)[0]
        np.testing.assert_array_equal(last, answers[0])


def test_the_response_starts_where_it_is_asked_to(primitive, demonstrations):
    def answer(**options):
        primitive.set_filter(copy.deepcopy(one))
        return primitive.generate_probable_trajectory_recursive(
            demonstrations[0][:, :20], np.diag([1e-3, 1e-3]), Y_ONLY, **options
        )

    one = filters(primitive)["ekf"]
    default, phase, weights, _ = answer()
    assert default.shape == (2, 100)
    for options, start in (
        ({}, phase),
        ({"starting_phase": 0.0}, 0.0),
        ({"starting_phase": 0.7}, 0.7),
        ({"phase_lookahead": 0.1}, phase + 0.1),
        ({"phase_lookahead": 1.0}, 1.0),
    ):
        expected = primitive.basis_inverse_transform(np.linspace(start, 1.0, 7), weights)
        np.testing.assert_allclose(answer(num_samples=7, **options)[0], expected, atol=1e-9)
        np.testing.assert_allclose(answer(num_samples=1, **options)[0], expected[:, :1], atol=1e-9)
    assert answer(num_samples=6.65)[0].shape == (2, 6)
    _, _, mean, var = answer(return_variance=True)
    assert mean.shape == (14,)
    assert var.shape == (14, 14)
    np.testing.assert_array_equal(mean[2:], weights)


def test_a_file_gives_the_same_primitive(primitive, demonstrations, tmp_path):
    path = tmp_path / "some_file_name.bip"
    primitive.export_data(path)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    again = intprim.BayesianInteractionPrimitive(primitive.basis_model)
    again.import_data(str(path))
    np.testing.assert_array_equal(again.basis_weights, primitive.basis_weights)
    np.testing.assert_array_equal(again.get_mean_trajectory(), primitive.get_mean_trajectory())
    again.add_demonstration(demonstrations[0])
    np.testing.assert_array_equal(again.basis_weights[-1], primitive.basis_weights[0])

    for model in (intprim.basis.GaussianModel(7, 0.02, NAMES), intprim.basis.GaussianModel(4, 0.02, ["X", "Y", "Z"])):
        with pytest.raises(ModelFileError, match="DoFs with weights"):
            intprim.BayesianInteractionPrimitive(model).import_data(path)
    for content in (path.read_bytes()[:-30], b"PK", b"", b"weights"):
        path.write_bytes(content)
        with pytest.raises(ModelFileError, match=re.escape(str(path))):
            again.import_data(path)
    with pytest.raises(ModelFileError, match="cannot be read"):
        again.import_data(tmp_path / "absent.bip")


def test_a_file_of_the_old_library_moves_as_it_did(primitive, demonstrations, tmp_path):
    """Written as the old library did, whose last centre was 1.01 where none was named."""
    everything, phases = np.concatenate(demonstrations, axis=1), np.linspace(0, 1, 100)
    scaler = MinMaxScaler().partial_fit(everything.reshape(-1, 1))
    functions = np.exp(-((phases[:, None] - np.linspace(0, 1.01, SIZE)) ** 2) / (2 * 0.02))
    x, y = np.random.default_rng(0).normal(size=(2, SIZE, 3))
    for groups, scalers in ((GROUPS, [scaler]), (None, [])):
        weights = np.concatenate([x, y]).T
        content = {"basis_weights": weights, "scaling_groups": groups, "scalers": scalers}
        (tmp_path / "old.bip").write_bytes(pickle.dumps(content))
        expected = np.stack([functions @ x.mean(1), functions @ y.mean(1)])
        moved = expected if groups is None else scaler.inverse_transform(expected.T).T
        for end_phase, close in ((1.01, 1e-9), (None, 1e-2)):
            model = intprim.basis.GaussianModel(SIZE, 0.02, NAMES, end_phase=end_phase)
            again = intprim.BayesianInteractionPrimitive(model)
            again.import_data(tmp_path / "old.bip")
            np.testing.assert_allclose(again.get_mean_trajectory(), moved, rtol=0, atol=close * np.ptp(moved))


# -------------------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p, d: p.add_demonstration(d[0].tolist()), "trajectory: expected a numpy array .* got a list"),
        (lambda p, d: p.add_demonstration(d[0].T), r"trajectory: expected \(D, T\) with D = 2"),
        (lambda p, d: p.add_demonstration(np.full((2, 5), np.nan)), "trajectory: expected finite"),
        (lambda p, d: p.compute_standardization(d[0]), "before the first is added"),
        (lambda p, d: p.generate_probable_trajectory_recursive(d[0], np.eye(2), Y_ONLY), "call set_filter first"),
        (lambda p, d: run(p, d[0][:1], np.eye(2), Y_ONLY), r"trajectory: expected .* D = 2, got \(1, "),
        (
            lambda p, d: run(p, d[0], np.eye(3), Y_ONLY),
            r"observation_noise: expected \(D, D\) with D = 2, got \(3, 3\)",
        ),
        (lambda p, d: run(p, d[0], np.ones((2, 2)), [0, 1]), "observation_noise: expected a diagonal"),
        (lambda p, d: run(p, d[0], np.zeros((2, 2)), Y_ONLY), "observation_noise: .* variances > 0"),
        (lambda p, d: run(p, d[0], np.eye(2), [2]), "active_dofs: expected indices of DoFs from 0 to 1"),
        (lambda p, d: run(p, d[0], np.eye(2), Y_ONLY, num_samples=0), "num_samples: expected at least 1"),
        (lambda p, d: run(p, d[0], np.eye(2), Y_ONLY, starting_phase=1.5), "starting_phase: expected a phase"),
        (lambda p, d: run(p, d[0], np.eye(2), Y_ONLY, phase_lookahead=-1), "phase_lookahead: expected a phase"),
        (lambda p, d: p.set_filter("enkf"), "filter: expected one of intprim.filter, got a str"),
        (lambda p, d: p.set_filter(other_basis()), "filter: expected one of the primitive's basis model"),
        (
            lambda p, d: EnsembleKalmanFilter(p.basis_model, [0], [1], 0, np.ones((5, 3))),
            r"initial_ensemble: expected \(E, B\) with B = 12, got \(5, 3\)",
        ),
        (lambda p, d: EnsembleKalmanFilter(p.basis_model, [0, 1], [1], 0, p.basis_weights), "initial_phase_var"),
        (lambda p, d: EnsembleKalmanFilter(p.basis_model, [0], [1], -1, p.basis_weights), "proc_var >= 0"),
        (lambda p, d: EnsembleKalmanFilter(p.basis_model, [0], [1], 0, p.basis_weights[:1]), "at least 2 demonstr"),
        (
            lambda p, d: KalmanFilter(p.basis_model, np.ones(12), None),
            r"cov_basis_weights: expected \(B, B\) with B = 12, got None",
        ),
        (lambda p, d: KalmanFilter(p.basis_model, np.ones(12), -np.eye(12)), "cov_basis_weights: expected a covar"),
        (
            lambda p, d: fastdtw(np.ones((3, 2)), np.ones((3, 1))),
            r"observed_trajectory: expected \(T, M\) with M = 1, got \(3, 2\)",
        ),
        (lambda p, d: intprim.examples.get_phase_stats([]), "training_trajectories: expected at least one"),
        (lambda p, d: intprim.examples.create_2d_handwriting_data(1, 0, -1, 0, 9, 1), "standard deviations >= 0"),
        (lambda p, d: untrained(p).get_mean_trajectory(), "at least 1 demonstrations added, got 0"),
        (lambda p, d: untrained(p, GROUPS).add_demonstration(d[0]), "compute_standardization with all"),
    ],
)
def test_a_mistake_is_told_in_one_line_that_names_the_argument(primitive, demonstrations, call, message):
    with pytest.raises((OptionError, ValueError, TypeError), match=message) as caught:
        call(primitive, demonstrations)
    assert "\n" not in str(caught.value)


def run(primitive, *arguments, **options):
    primitive.set_filter(filters(primitive)["ekf"])
    return primitive.generate_probable_trajectory_recursive(*arguments, **options)


def other_basis():
    model = intprim.basis.GaussianModel(SIZE, 0.03, NAMES)
    return EnsembleKalmanFilter(model, [0.0], [1e-4], 1e-8, np.eye(12))


def untrained(primitive, groups=None):
    return intprim.BayesianInteractionPrimitive(primitive.basis_model, groups)


# ---------------------------------------------------------------------------------------------------------- examples


def test_handwriting_has_the_length_place_and_noise_that_were_asked_for():
    np.random.seed(5)
    strokes = intprim.examples.create_2d_handwriting_data(40, -10.0, 1e-5, 0.01, 145, 1e-5)
    assert {stroke.shape for stroke in strokes} == {(2, 145)}
    assert np.std(strokes, axis=0, ddof=1).mean() == pytest.approx(0.01, rel=0.05)
    still = intprim.examples.create_2d_handwriting_data(1, 0.0, 0.0, 0.0, 145, 0)[0]
    np.testing.assert_allclose(np.mean(strokes, axis=0), still - 10.0, atol=0.01)
    np.random.seed(5)
    (again,) = intprim.examples.create_2d_handwriting_data(1, -10.0, 1e-5, 0.01, 145, 1e-5)
    np.testing.assert_array_equal(again, strokes[0])
    short = intprim.examples.create_2d_handwriting_data(30, 0.0, 1.0, 0.1, 2, 3)
    assert min(stroke.shape[1] for stroke in short) == 2


def test_phase_velocities_are_counted_in_samples():
    stats = intprim.examples.get_phase_stats([np.zeros((2, 50)), np.zeros((2, 100))])
    assert stats == pytest.approx((0.015, 0.000025))  # Eq. 2.12: 1/50 and 1/100
