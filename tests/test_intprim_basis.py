"""The basis models of IntPrim are the functions of chapter 4, and the selection finds the one that made the data."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from scipy import stats

import inphase
from inphase.basis import Basis, Gaussian, Sigmoid
from intprim.basis import GaussianModel, MixtureModel, PolynomialModel, Selection, SigmoidalModel

NAMES = ["X", "Y"]
PHASES = np.linspace(0.0, 1.0, 101)


def gaussians(phases, degree, var, end, start=0.0):
    centres = np.linspace(start, end, degree)
    return np.array([[np.exp(-((p - c) ** 2) / (2 * var)) for p in phases] for c in centres])


def steps(phases, degree, scale, end, start=0.0):
    return np.array([[1 / (1 + np.exp(-(p - c) / scale)) for p in phases] for c in np.linspace(start, end, degree)])


MODELS = {
    "gaussian": GaussianModel(8, 0.1, NAMES),
    "gaussian beyond 1": GaussianModel(8, 0.1, NAMES, 0.0, 1.01),
    "gaussian within": GaussianModel(5, 0.002, NAMES, 0.3, 0.6),
    "sigmoid": SigmoidalModel(8, 0.1, NAMES),
    "sigmoid within": SigmoidalModel(5, 0.02, NAMES, 0.3, 0.6),
    "polynomial": PolynomialModel(6, NAMES),
    "mixture": MixtureModel([GaussianModel(9, 0.02, ["X"]), SigmoidalModel(5, 0.1, ["Y"])]),
}
each_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


# --------------------------------------------------------------------------------------------------------- functions


@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (0.0, 1.01), (0.3, 0.8)])
def test_values_are_those_of_the_formulas(start, end):
    gaussian, sigmoid = (family(8, 0.1, NAMES, start, end) for family in (GaussianModel, SigmoidalModel))
    bumps = gaussians(PHASES, 8, 0.1, end, start)
    np.testing.assert_allclose(gaussian.get_basis_functions(PHASES), bumps, atol=1e-13)
    np.testing.assert_allclose(sigmoid.get_basis_functions(PHASES), steps(PHASES, 8, 0.1, end, start), atol=1e-13)
    np.testing.assert_allclose(gaussian.get_basis_functions(0.37), bumps[:, 37], atol=1e-13)
    np.testing.assert_allclose(gaussian.centers, np.linspace(start, end, 8))


def test_polynomials_span_the_powers_below_the_degree():
    functions = PolynomialModel(5, NAMES).get_basis_functions(PHASES)
    assert functions.shape == (5, 101)
    for power in range(5):
        assert np.linalg.lstsq(functions.T, PHASES**power, rcond=None)[1] < 1e-20
    assert np.linalg.lstsq(functions.T, PHASES**5, rcond=None)[1] > 1e-6


def test_functions_of_inphase_are_used_as_they_are():
    centres = tuple(np.linspace(0, 1, 8))
    assert GaussianModel(8, 0.1, NAMES).basis == Gaussian(8, np.sqrt(0.1), centres=centres)
    assert SigmoidalModel(8, 0.1, NAMES).basis == Sigmoid(8, 0.1, centres)
    for model in MODELS.values():
        assert all(isinstance(basis, Basis) for basis in model.layout.bases)


@each_model
def test_slopes_are_those_of_central_differences_and_zero_outside(model, rng):
    weights, step = rng.normal(size=model.layout.size), 1e-6
    inside = np.linspace(0.01, 0.99, 50)
    ahead, behind = (model.apply_coefficients(inside + move, weights) for move in (step, -step))
    slopes = model.apply_coefficients(inside, weights, deriv=True)
    np.testing.assert_allclose(slopes, (ahead - behind) / (2 * step), atol=1e-6)
    assert not model.apply_coefficients([-0.5, 1.5], weights, deriv=True).any()
    np.testing.assert_array_equal(
        model.apply_coefficients([-0.5, 1.5], weights), model.apply_coefficients([0.0, 1.0], weights)
    )
    if not isinstance(model, MixtureModel):
        own = model.get_basis_function_derivatives(inside).T @ weights.reshape(2, -1).T
        np.testing.assert_allclose(own.T, slopes, atol=1e-12)


# --------------------------------------------------------------------------------------------------- fitting, applying


@each_model
def test_nothing_that_the_functions_can_say_is_left_after_a_fit(model, rng):
    values = rng.normal(size=(101, 2)).cumsum(axis=0)
    kept = values.copy()
    weights = model.fit_basis_functions_linear_closed_form(PHASES, values)
    np.testing.assert_array_equal(values, kept)
    residual = values - model.apply_coefficients(PHASES, weights).T
    for dof, basis in enumerate(model.layout.bases):
        np.testing.assert_allclose(basis(PHASES).T @ residual[:, dof], 0, atol=1e-7)


@each_model
def test_a_fit_follows_each_of_its_own_movements(model, rng):
    movement = model.apply_coefficients(PHASES, rng.normal(size=model.layout.size))
    weights = model.fit_basis_functions_linear_closed_form(PHASES, movement.T)
    np.testing.assert_allclose(model.apply_coefficients(PHASES, weights), movement, atol=1e-9)


@each_model
def test_one_phase_reads_as_many_do_and_as_the_block_matrix_does(model, rng):
    weights = rng.normal(size=model.layout.size)
    many = model.apply_coefficients(PHASES, weights)
    assert many.shape == (2, 101)
    one = model.apply_coefficients(0.37, weights)
    np.testing.assert_allclose(one, many[:, 37], atol=1e-13)
    np.testing.assert_allclose(model.get_block_diagonal_basis_matrix(0.37).T @ weights, one, atol=1e-12)


def test_weights_stand_dof_after_dof():
    model = GaussianModel(8, 0.1, NAMES)
    alone = GaussianModel(8, 0.1, ["Y"])
    values = np.stack([np.sin(5 * PHASES), PHASES**2], axis=1)
    both = model.fit_basis_functions_linear_closed_form(PHASES, values)
    np.testing.assert_array_equal(model.observed_to_state_indices([1]), np.arange(8, 16))
    np.testing.assert_array_equal(model.observed_to_state_indices(1), np.arange(8, 16))
    np.testing.assert_allclose(
        alone.apply_coefficients(PHASES, both[8:]),
        alone.apply_coefficients(PHASES, alone.fit_basis_functions_linear_closed_form(PHASES, values[:, 1]))[:],
        atol=1e-9,
    )


def test_the_order_of_the_models_in_a_mixture_matters():
    x, y = GaussianModel(9, 0.1, ["X"]), SigmoidalModel(5, 0.1, ["Y"])
    straight, turned = MixtureModel([x, y]), MixtureModel([y, x])
    assert (straight.observed_dof_names, turned.observed_dof_names) == (["X", "Y"], ["Y", "X"])
    assert [(m._degree, m.num_observed_dof) for m in (straight, turned)] == [(14, 2), (14, 2)]
    np.testing.assert_array_equal(straight.observed_to_state_indices([1]), np.arange(9, 14))
    np.testing.assert_array_equal(turned.observed_to_state_indices([1]), np.arange(5, 14))
    values = np.stack([np.sin(5 * PHASES), PHASES**2], axis=1)
    weights = straight.fit_basis_functions_linear_closed_form(PHASES, values)
    swapped = turned.fit_basis_functions_linear_closed_form(PHASES, values[:, ::-1])
    np.testing.assert_allclose(np.roll(weights, 5), swapped, atol=1e-9 * abs(weights).max())


@each_model
def test_a_deep_copy_is_a_model_of_its_own_that_does_the_same(model, rng):
    weights = rng.normal(size=model.layout.size)
    np.testing.assert_array_equal(
        copy.deepcopy(model).apply_coefficients(PHASES, weights), model.apply_coefficients(PHASES, weights)
    )


# --------------------------------------------------------------------------------------- weights of the old library


def test_old_weights_move_as_they_did():
    old = {
        "gaussian": gaussians(PHASES, 8, 0.1, 1.01),
        "sigmoid": steps(PHASES, 8, 0.1, 1.01),
        "polynomial": np.array([(PHASES - (1 - PHASES)) ** k for k in range(8)]),
    }
    new = {
        "gaussian": GaussianModel(8, 0.1, NAMES),
        "sigmoid": SigmoidalModel(8, 0.1, NAMES),
        "polynomial": PolynomialModel(8, NAMES),
    }
    letter = np.stack([np.sin(7 * PHASES), PHASES**2 - np.cos(5 * PHASES)], axis=1)
    for name, functions in old.items():
        saved = np.linalg.lstsq(functions.T, letter, rcond=None)[0].T.reshape(1, -1)
        moved = (saved.reshape(2, 8) @ functions).reshape(2, -1)
        converted = new[name].convert_old_weights(saved)
        error = np.abs(new[name].apply_coefficients(PHASES, converted) - moved).max()
        assert error < (1e-9 if name == "polynomial" else 2e-3 * np.ptp(moved, axis=1).min()), name
        as_they_are = np.abs(new[name].apply_coefficients(PHASES, saved) - moved).max()
        assert as_they_are > 0.01, f"{name}: there would be no need to convert"
    exact = MixtureModel([GaussianModel(8, 0.1, ["X"], 0.0, 1.01), PolynomialModel(8, ["Y"])])
    saved = np.linspace(-1, 1, 16)
    moved = np.stack([saved[:8] @ old["gaussian"], saved[8:] @ old["polynomial"]])
    converted = exact.convert_old_weights(saved[None])
    np.testing.assert_allclose(exact.apply_coefficients(PHASES, converted), moved, atol=1e-9)


# ---------------------------------------------------------------------------------------------------------- selection


@pytest.fixture(scope="module")
def letters():
    """Fifty noisy letters of different lengths, shifted at random, from eight Gaussians of variance 0.1 (4.2.1)."""
    rng = np.random.default_rng(0)
    x = 2.5 + 3.5 * PHASES + 0.8 * np.sin(4 * np.pi * PHASES) + 0.2 * np.cos(9 * PHASES)
    y = 2.6 + 5.4 * np.exp(-(((PHASES - 0.45) / 0.18) ** 2)) + 0.5 * PHASES * np.sin(8 * PHASES)
    maker = GaussianModel(8, 0.1, NAMES)
    weights = maker.fit_basis_functions_linear_closed_form(PHASES, np.stack([x, y], axis=1))
    lengths = np.maximum(30, rng.normal(95, 30, size=50)).astype(int)
    clean = [maker.apply_coefficients(np.linspace(0, 1, n), weights) + rng.normal(0, 5) for n in lengths]
    return [rng.normal(letter, 0.01) for letter in clean]


def selection_of(letters, **options):
    selection = Selection(np.array(NAMES), **options)
    for letter in letters:
        selection.add_demonstration(letter)
    return selection


def test_the_grid_chooses_nine_gaussians_as_eight_are_not_in_it(letters, capsys):
    """The data are of eight: five and seven cannot say them, nine can, and whatever is beyond costs parameters."""
    selection = selection_of(letters)
    aic, bic = selection.get_information_criteria(np.array([0, 1], dtype=np.int32))
    best = selection.get_best_model(aic, bic)
    assert [(type(m), m._degree, m.scale) for m in best] == [(GaussianModel, 9, 0.1)] * 2
    assert capsys.readouterr().out.count("GaussianModel. Degree: 9. Scale: 0.1") == 2
    assert {m._degree for m in selection.models} == {5, 7, 9, 11, 13}


def test_the_basis_that_made_the_data_is_chosen_where_the_grid_has_it(letters):
    selection = selection_of(letters[:10])
    selection.degree_step, selection.min_degree, selection.max_degree = 1, 7, 10
    best = selection.get_best_model(*selection.get_information_criteria([0, 1]))
    assert [(type(m), m._degree, m.scale) for m in best] == [(GaussianModel, 8, 0.1)] * 2


def test_criteria_are_those_of_a_textbook(letters):
    selection = selection_of(letters[:2])
    selection.min_degree, selection.max_degree, selection.min_scale, selection.max_scale = 5, 6, 0.1, 0.12
    aic, bic = selection.get_information_criteria([1], sample_start_phase=0.2, sample_end_phase=0.7)
    assert [type(m) for m in selection.models] == [PolynomialModel, GaussianModel, SigmoidalModel]
    expected = []
    for letter in letters[:2]:
        phases = np.linspace(0, 1, letter.shape[1])
        inside = (phases >= 0.2) & (phases <= 0.7)
        functions = gaussians(phases[inside], 5, 0.1, 1.0).T
        read = letter[1, inside]
        said = functions @ np.linalg.lstsq(functions, read, rcond=None)[0]
        likelihood = stats.norm.logpdf(read, said, 0.05).sum()
        expected.append([2 * 5 - 2 * likelihood, np.log(len(read)) * 5 - 2 * likelihood])
    np.testing.assert_allclose([aic[1], bic[1]], np.mean(expected, axis=0), rtol=1e-8)


def test_the_error_of_the_basis_that_made_the_data_is_the_noise_less_what_the_fit_takes(letters):
    """E[residual²] = σ² (1 - B/T); a mean of χ² over all samples, so within four of its standard deviations."""
    share = np.mean([1 - 8 / letter.shape[1] for letter in letters])
    samples = sum(letter.shape[1] - 8 for letter in letters)
    mse = selection_of(letters).get_model_mse(GaussianModel(8, 0.1, NAMES), np.array([0, 1]))
    np.testing.assert_allclose(mse, 1e-4 * share, rtol=4 * np.sqrt(2 / samples) * 1.5)
    np.testing.assert_allclose(mse, 9e-5, atol=0.5e-5)  # the figure of 4.2.4
    mixture = MixtureModel([GaussianModel(8, 0.1, ["X"]), SigmoidalModel(8, 0.1, ["Y"])])
    x, y = selection_of(letters).get_model_mse(mixture, np.array([0, 1]))
    assert x == pytest.approx(mse[0], rel=1e-9)
    assert y > 50 * mse[1]


@pytest.mark.parametrize(("groups", "lows"), [([[0, 1]], "both"), ([[0], [1]], "own"), ([[1]], "own of Y")])
def test_the_values_of_a_group_are_brought_to_between_0_and_1(letters, groups, lows):
    everything = np.concatenate(letters, axis=1)
    low, span = everything.min(axis=1, keepdims=True), np.ptp(everything, axis=1)[:, None]
    if lows == "both":
        low, span = everything.min(), np.ptp(everything)
    elif lows == "own of Y":
        low[0], span[0] = 0, 1
    errors = []
    for letter in letters:
        functions, scaled = gaussians(np.linspace(0, 1, letter.shape[1]), 8, 0.1, 1.0).T, ((letter - low) / span).T
        said = functions @ np.linalg.lstsq(functions, scaled, rcond=None)[0]
        errors.append(((scaled - said) ** 2).mean(axis=0))
    mse = selection_of(letters, scaling_groups=groups).get_model_mse(GaussianModel(8, 0.1, NAMES), [0, 1])
    np.testing.assert_allclose(mse, np.mean(errors, axis=0), rtol=1e-8)


# -------------------------------------------------------------------------------------------------- pictures, mistakes


def test_pictures_show_the_functions_without_a_screen():
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.close("all")
    model, weights = GaussianModel(8, 0.1, NAMES), np.arange(16.0).reshape(2, 8)
    model.plot()
    model.plot_derivative()
    model.plot_weighted(weights, np.array(NAMES))
    drawn = [np.array([line.get_ydata() for line in plt.figure(n).axes[0].lines]) for n in plt.get_fignums()]
    domain = np.linspace(0, 1, 100)
    values = gaussians(domain, 8, 0.1, 1.0)
    expected = [values, model.get_basis_function_derivatives(domain), *(values * own[:, None] for own in weights)]
    plt.close("all")
    for got, wanted in zip(drawn, expected, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-12)


def mistakes():
    model = MODELS["gaussian"]
    empty, full = Selection(NAMES), selection_of([np.zeros((2, 9))])
    yield lambda: GaussianModel(8, 0.0, NAMES), r"scale: expected a positive number, got 0\.0"
    yield lambda: SigmoidalModel(8, -0.1, NAMES), r"scale: expected a positive number, got -0\.1"
    yield lambda: GaussianModel(1, 0.1, NAMES), r"degree: expected a whole number from 2, got 1"
    yield lambda: PolynomialModel(0, NAMES), r"degree: expected a whole number from 1, got 0"
    yield lambda: GaussianModel(8, 0.1, []), r"observed_dof_names: expected a name for every DoF"
    yield lambda: GaussianModel(8, 0.1, "XY"), r"observed_dof_names: expected a name for every DoF, got 'XY'"
    yield lambda: GaussianModel(8, 0.1, NAMES, 0.5, 0.5), r"expected start_phase < end_phase, got 0\.5 and 0\.5"
    yield lambda: MixtureModel([]), r"basis_models: expected Gaussian-, .* got none"
    yield lambda: MixtureModel([MODELS["mixture"]]), r"basis_models: expected .* got a MixtureModel"
    fit = model.fit_basis_functions_linear_closed_form
    yield lambda: fit(PHASES, np.zeros((2, 101))), r"y: expected \(T, D\) with T = 101, D = 2, got \(2, 101\)"
    yield lambda: fit(PHASES, np.full((101, 2), np.nan)), r"y: expected finite values"
    yield lambda: fit([[0.1]], np.zeros((1, 2))), r"x: expected \(T,\), got \(1, 1\)"
    yield lambda: model.apply_coefficients(0.1, np.zeros(8)), r"coefficients: expected \(B,\) with B = 16, got \(8,\)"
    yield lambda: model.apply_coefficients(np.nan, np.zeros(16)), r"x: expected a phase or \(T,\) phases, all finite"
    yield lambda: model.observed_to_state_indices([2]), r"observed_indices: .* from 0 to 1, got \[2\]"
    yield lambda: model.observed_to_state_indices(["X"]), r"observed_indices: .* from 0 to 1, got \['X'\]"
    yield lambda: model.convert_old_weights(np.zeros((3, 8))), r"weights: expected \(N, B\) with B = 16, got \(3, 8\)"
    yield (
        lambda: model.plot_weighted(np.zeros(16), NAMES),
        r"expected \(D, degree\) with D = 2, degree = 8, got \(16,\)",
    )
    yield lambda: Selection(NAMES, scaling_groups=[[0, 2]]), r"scaling_groups: .* from 0 to 1, got \[0, 2\]"
    yield lambda: Selection(NAMES, scaling_groups=[[0], [0, 1]]), r"scaling_groups: expected every DoF in one group"
    yield lambda: empty.add_demonstration(np.zeros((9, 2))), r"data: expected \(D, T\) with D = 2, got \(9, 2\)"
    yield (
        lambda: empty.add_demonstration([[1, 2], [3]]),
        r"data: expected numbers \(D, T\) with D = 2, got \[\[1, 2\], \[3\]\]",
    )
    yield lambda: empty.add_demonstration(np.full((2, 9), np.inf)), r"data: expected finite values"
    yield lambda: empty.get_model_mse(model, [0, 1]), r"expected demonstrations, got none"
    yield lambda: empty.get_best_model([1.0], [1.0]), r"expected what get_information_criteria returned"
    yield lambda: full.get_model_mse(model, [0, 3]), r"dofs: .* from 0 to 1, got \[0, 3\]"
    yield lambda: full.get_model_mse(model, [0]), r"y: expected \(T, D\) with T = 9, D = 2, got \(9, 1\)"
    yield lambda: full.get_model_mse(model, [0, 1], 0.51, 0.52), r"samples between phase 0\.51 and 0\.52, got none"


@pytest.mark.parametrize(("mistake", "message"), list(mistakes()))
def test_a_mistake_is_told_in_one_line(mistake, message):
    with pytest.raises(inphase.InphaseError, match=message) as told:
        mistake()
    assert "\n" not in str(told.value)
