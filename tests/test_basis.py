"""Basis functions: their definitions, their derivatives, and what happens at the ends of the phase."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inphase.basis import FAMILIES, Basis, Gaussian, Periodic, Polynomial, Sigmoid, make
from inphase.errors import OptionError

PLACED = (-0.1, 0.2, 0.25, 0.9, 1.01)
SIZES = st.integers(3, 25)
WIDTHS = st.none() | st.floats(0.03, 2.0)
OPEN = {
    "gaussian": st.builds(Gaussian, SIZES, WIDTHS)
    | st.sampled_from([Gaussian(5, w, None, PLACED) for w in (0.1, 1.0)]),
    "sigmoid": st.builds(Sigmoid, SIZES, WIDTHS) | st.sampled_from([Sigmoid(5, w, PLACED) for w in (None, 1.0)]),
    "polynomial": st.builds(Polynomial, st.integers(0, 20)),
}
ANY = st.one_of(*OPEN.values(), st.builds(Periodic, SIZES, WIDTHS))
EXAMPLES = [Gaussian(7), Sigmoid(7), Polynomial(6), Periodic(7)]
INSIDE = st.lists(st.floats(0.001, 0.999), min_size=1, max_size=8).map(np.array)
TURNS = st.lists(st.floats(-3, 3), min_size=1, max_size=8).map(np.array)


def differences(basis: Basis, phases: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """The slopes by central differences."""
    return (basis(phases + step) - basis(phases - step)) / (2 * step)


@given(st.one_of(*OPEN.values()), INSIDE)
def test_slopes_are_central_differences(basis: Basis, phases: np.ndarray) -> None:
    values, slopes = basis.with_derivative(phases)
    np.testing.assert_array_equal(values, basis(phases))
    np.testing.assert_allclose(slopes, differences(basis, phases), atol=1e-6)


@given(st.builds(Periodic, SIZES, WIDTHS), TURNS)
def test_slopes_around_the_circle_are_central_differences(basis: Periodic, phases: np.ndarray) -> None:
    values, slopes = basis.with_derivative(phases)
    np.testing.assert_array_equal(values, basis(phases))
    np.testing.assert_allclose(slopes, differences(basis, phases), atol=1e-6)


@given(st.one_of(*OPEN.values()), st.floats(1e-9, 1e3))
def test_outside_the_phase_nothing_moves(basis: Basis, beyond: float) -> None:
    ends, outside = np.array([0.0, 1.0]), np.array([-beyond, 1 + beyond])
    values, slopes = basis.with_derivative(outside)
    np.testing.assert_array_equal(values, basis(ends))
    np.testing.assert_array_equal(basis(outside), basis(ends))
    np.testing.assert_array_equal(slopes, 0.0)


@pytest.mark.parametrize("basis", EXAMPLES[:3], ids=repr)
def test_slopes_at_the_ends_are_those_of_the_inside(basis: Basis) -> None:
    step, ends = 1e-7, np.array([0.0, 1.0])
    _, slopes = basis.with_derivative(ends)
    inward = (basis(np.array([step, 1.0])) - basis(np.array([0.0, 1 - step]))) / step
    np.testing.assert_allclose(slopes, inward, atol=1e-4)
    assert (np.abs(slopes).max(-1) > 0.1).all()


@given(st.builds(Periodic, SIZES, WIDTHS), TURNS, st.integers(-5, 5))
def test_whole_turns_make_no_difference(basis: Periodic, phases: np.ndarray, turns: int) -> None:
    for here, there in zip(basis.with_derivative(phases), basis.with_derivative(phases + turns), strict=True):
        np.testing.assert_allclose(here, there, atol=1e-9)


@given(st.builds(Periodic, SIZES, WIDTHS), TURNS)
def test_every_periodic_bump_is_the_first_one_moved_on(basis: Periodic, phases: np.ndarray) -> None:
    first = np.stack([basis(phases - k / basis.size)[:, 0] for k in range(basis.size)], axis=-1)
    np.testing.assert_allclose(basis(phases), first, atol=1e-9)
    assert basis(np.array(0.0))[0] == 1.0


@given(SIZES, st.floats(0.03, 2.0), st.floats(0, 1))
def test_definitions(size: int, width: float, phase: float) -> None:
    at = np.array(phase)
    steps = [k / (size - 1) for k in range(size)]
    gaussian = [math.exp(-((phase - c) ** 2) / (2 * width**2)) for c in steps]
    sigmoid = [1 / (1 + math.exp(-(phase - c) / width)) for c in steps]
    kappa = 1 / (2 * math.pi * width) ** 2
    periodic = [math.exp(kappa * (math.cos(2 * math.pi * (phase - k / size)) - 1)) for k in range(size)]
    polynomial = [math.comb(size - 1, k) * phase**k * (1 - phase) ** (size - 1 - k) for k in range(size)]
    np.testing.assert_allclose(Gaussian(size, width, margin=0.0)(at), gaussian, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(Sigmoid(size, width)(at), sigmoid, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(Periodic(size, width)(at), periodic, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(Polynomial(size - 1)(at), polynomial, rtol=1e-9, atol=1e-15)


@given(ANY)
def test_any_shape_of_phases(basis: Basis) -> None:
    grid = np.linspace(0, 1, 12)
    flat_values, flat_slopes = basis.with_derivative(grid)
    for shape in [(12,), (3, 4), (2, 3, 2), (12, 1)]:
        values, slopes = basis.with_derivative(grid.reshape(shape))
        np.testing.assert_array_equal(values, flat_values.reshape(*shape, basis.size))
        np.testing.assert_array_equal(slopes, flat_slopes.reshape(*shape, basis.size))
    np.testing.assert_array_equal(basis(np.array(grid[5])), flat_values[5])
    assert basis(np.empty((0, 3))).shape == (0, 3, basis.size)


@pytest.mark.parametrize("basis", EXAMPLES, ids=repr)
def test_phases_are_left_alone_and_nan_stays_nan(basis: Basis) -> None:
    phases = np.array([-0.5, 0.2, np.nan, 1.5])
    before = phases.copy()
    values, slopes = basis.with_derivative(phases)
    np.testing.assert_array_equal(phases, before)
    np.testing.assert_array_equal(np.isnan(values).any(-1), np.isnan(phases))
    np.testing.assert_array_equal(np.isnan(slopes).any(-1), np.isnan(phases))


@pytest.mark.parametrize("size", [5, 12, 40])
def test_default_gaussians_add_up_to_a_flat_line_and_stay_apart(size: int) -> None:
    basis = Gaussian(size)
    assert basis.width == pytest.approx(1 / (size - 3))  # the outer centres lie one distance beyond the ends
    values = basis(np.linspace(0, 1, 2000))
    assert np.linalg.cond(values.T @ values) < 1e5
    wide = Gaussian(41)(np.linspace(0.3, 0.7, 500)).sum(-1)  # far from the ends, where there are fewer neighbours
    assert np.ptp(wide) / wide.mean() < 2e-8


def test_gaussians_hold_still_at_the_ends() -> None:
    phases = np.linspace(0, 1, 500)
    still = np.ones(500)
    errors = [
        np.abs(basis(phases) @ np.linalg.lstsq(basis(phases), still, rcond=None)[0] - still).max()
        for basis in (Gaussian(12), Gaussian(12, margin=0.0))
    ]
    assert errors[0] < 0.005 < 0.02 < errors[1]


def test_default_sigmoid_slopes_are_bumps_as_wide_as_the_distance_between_centres() -> None:
    basis = Sigmoid(21)
    phases = np.linspace(0, 1, 20001)
    bump = basis.with_derivative(phases)[1][:, 10]
    std = math.sqrt((bump * (phases - 0.5) ** 2).sum() / bump.sum())
    assert std == pytest.approx(1 / 20, rel=1e-3)


@given(st.integers(0, 20))
def test_bernstein_spans_the_monomials_and_adds_up_to_one(degree: int) -> None:
    phases = np.linspace(0, 1, 200)
    basis = Polynomial(degree)(phases)
    monomials = phases[:, None] ** np.arange(degree + 1)
    weights = np.linalg.lstsq(basis, monomials, rcond=None)[0]
    np.testing.assert_allclose(basis @ weights, monomials, atol=1e-9)
    np.testing.assert_allclose(basis.sum(-1), 1.0, rtol=1e-12)
    assert basis.shape == (200, degree + 1)


def test_intprim_names_the_variance() -> None:
    phases = np.linspace(0, 1, 50)
    theirs = np.exp(-((phases[:, None] - np.linspace(0, 1, 8)) ** 2) / (2.0 * 0.1))
    np.testing.assert_allclose(Gaussian(8, math.sqrt(0.1), margin=0.0)(phases), theirs, rtol=1e-12)


@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (0.0, 1.01), (0.3, 0.8)])
def test_functions_stand_where_their_centres_are_placed(start: float, end: float) -> None:
    phases, centres = np.linspace(0, 1, 50), np.linspace(start, end, 6)
    off = phases[:, None] - centres
    at = tuple(centres.tolist())
    np.testing.assert_allclose(Gaussian(6, 0.3, centres=at)(phases), np.exp(-(off**2) / (2 * 0.09)), rtol=1e-12)
    np.testing.assert_allclose(Sigmoid(6, 0.1, at)(phases), 1 / (1 + np.exp(-off / 0.1)), rtol=1e-12)


@pytest.mark.parametrize("centres", [(0.1, 0.2), (0.1, math.nan, 0.3), [0.1, 0.2, math.inf], ()])
def test_centres_that_are_not_as_many_phases_are_refused(centres: object) -> None:
    for kind in (Gaussian, Sigmoid):
        with pytest.raises(OptionError, match=rf"{kind.__name__} centres: expected 3 finite phases"):
            kind(3, 0.2, centres=centres)


def test_centres_leave_nothing_to_a_margin_and_need_a_width() -> None:
    for more in ({"margin": 0.0, "width": 0.1}, {}):
        with pytest.raises(OptionError, match="expected a width and no margin beside them, got width="):
            Gaussian(3, centres=(0.0, 0.5, 1.0), **more)


@given(ANY)
def test_a_basis_is_made_again_from_its_parameters(basis: Basis) -> None:
    family = next(name for name, kind in FAMILIES.items() if isinstance(basis, kind))
    described = json.loads(json.dumps({"family": family, **basis.parameters()}))
    again = make(**described)
    assert again == basis
    assert hash(again) == hash(basis)
    assert repr(again) == repr(basis)
    assert isinstance(basis, Basis)


def test_equal_bases_are_equal_whether_the_width_was_named_or_not() -> None:
    assert Gaussian(8) == Gaussian(8, 1 / 5) == Gaussian(8, margin=1.0)
    assert Periodic(8) == Periodic(8, 1 / 8)
    assert len({Gaussian(8), Gaussian(8, 1 / 5), Gaussian(9), Sigmoid(8), Periodic(8), Polynomial(7)}) == 5
    assert [basis.periodic for basis in EXAMPLES] == [False, False, False, True]


@pytest.mark.parametrize("basis", EXAMPLES, ids=repr)
def test_bases_are_frozen(basis: Basis) -> None:
    name = next(iter(basis.parameters()))
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(basis, name, 5)


@pytest.mark.parametrize("width", [0.0, -0.1, math.nan, math.inf, 1e-300])
@pytest.mark.parametrize("kind", [Gaussian, Sigmoid, Periodic])
def test_widths_that_are_not_positive_are_refused(kind: type, width: float) -> None:
    with pytest.raises(OptionError, match=rf"{kind.__name__} width: expected a positive number .* got {width}"):
        kind(8, width)


@pytest.mark.parametrize(("kind", "least"), [(Gaussian, 2), (Sigmoid, 2), (Periodic, 3), (Polynomial, 0)])
def test_sizes_that_make_no_sense_are_refused(kind: type, least: int) -> None:
    assert kind(least).size >= 1
    for size in (least - 1, -5, 10**12):
        with pytest.raises(OptionError, match=rf"{kind.__name__} \w+: expected a whole number from {least} .* {size}"):
            kind(size)


def test_the_largest_polynomial_is_still_finite() -> None:
    values, slopes = Polynomial(999).with_derivative(np.linspace(0, 1, 50))
    np.testing.assert_allclose(values.sum(-1), 1.0, rtol=1e-9)
    assert np.isfinite(slopes).all()


def test_make_names_what_is_wrong() -> None:
    with pytest.raises(OptionError, match="'fourier'; one of gaussian, sigmoid, polynomial, periodic"):
        make("fourier", size=3)
    with pytest.raises(OptionError, match="arguments are size, width, margin, centres, got size, degree"):
        make("gaussian", size=3, degree=2)
    with pytest.raises(OptionError, match="'size'; its arguments are size, width, margin, centres, got none"):
        make("gaussian")
    with pytest.raises(OptionError, match="arguments are degree, got size"):
        make("polynomial", size=3)
