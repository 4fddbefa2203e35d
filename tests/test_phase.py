"""Phase: the transition and its noise against the differential equation they come from."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from interactions import shapes_unchecked
from scipy.linalg import expm

import inphase
from inphase.errors import OptionError
from inphase.phase import PhaseModel

ORDERS = pytest.mark.parametrize("order", [0, 1, 2])
STEPS = st.floats(0.0, 20.0, allow_subnormal=False)
DIFFUSIONS = st.floats(0.0, 10.0, allow_subnormal=False)


def model(order: int, diffusion: float = 0.3, periodic: bool = False) -> PhaseModel:
    return PhaseModel(np.arange(order + 1.0), np.eye(order + 1), diffusion, nominal_velocity=1.0, periodic=periodic)


def generator(order: int) -> np.ndarray:
    """A of dx = A x dt: each derivative drives the one below it."""
    return np.eye(order + 1, k=1)


def van_loan(order: int, diffusion: float, dt: float) -> np.ndarray:
    """Q = ∫ expm(A s) G q Gᵀ expm(A s)ᵀ ds by one matrix exponential (Van Loan, 1978)."""
    size = order + 1
    noise = np.zeros((size, size))
    noise[-1, -1] = diffusion
    big = np.block([[-generator(order), noise], [np.zeros((size, size)), generator(order).T]]) * dt
    exponential = expm(big)
    return exponential[size:, size:].T @ exponential[:size, size:]


@given(st.integers(0, 2), STEPS)
def test_the_transition_is_the_matrix_exponential(order: int, dt: float) -> None:
    np.testing.assert_allclose(model(order).transition(dt), expm(generator(order) * dt), rtol=1e-12, atol=1e-14)


@given(st.integers(0, 2), STEPS, DIFFUSIONS)
def test_the_noise_is_the_integral_over_the_step(order: int, dt: float, diffusion: float) -> None:
    expected = van_loan(order, diffusion, dt)
    # expm of the 6 × 6 matrix cancels terms as large as dt⁵: rounding is relative to the largest entry.
    np.testing.assert_allclose(
        model(order, diffusion).process_cov(dt), expected, rtol=1e-9, atol=1e-12 * (1 + np.abs(expected).max())
    )


@ORDERS
def test_the_noise_is_that_of_many_fine_steps(order: int, rng: np.random.Generator) -> None:
    dt, fine, paths, diffusion = 0.7, 200, 20_000, 0.3
    h, state = dt / fine, np.zeros((paths, order + 1))
    for _ in range(fine):
        kick = np.sqrt(diffusion * h) * rng.standard_normal(paths)
        state[:, :-1] += h * state[:, 1:] + (0.5 * h * kick[:, None] if order else 0.0)
        state[:, -1] += kick
    expected, got = model(order, diffusion).process_cov(dt), state.T @ state / paths
    # A covariance from n draws has the variance (Σii Σjj + Σij²) / n; the fine steps add 1/200 of the value at most.
    variances = np.diag(expected)
    tolerance = 4.5 * np.sqrt((np.outer(variances, variances) + expected**2) / paths) + 0.005 * np.abs(expected)
    assert (np.abs(got - expected) < tolerance).all()


@given(st.integers(0, 2), STEPS, STEPS, DIFFUSIONS)
def test_two_steps_are_one_long_step(order: int, first: float, second: float, diffusion: float) -> None:
    phase = model(order, diffusion)
    move, both = phase.transition(second), first + second
    np.testing.assert_allclose(phase.transition(both), move @ phase.transition(first), rtol=1e-12, atol=1e-300)
    np.testing.assert_allclose(
        phase.process_cov(both),
        move @ phase.process_cov(first) @ move.T + phase.process_cov(second),
        rtol=1e-11,
        atol=1e-200,  # dt⁵ of a tiny step falls out of a float
    )


@ORDERS
def test_no_time_is_no_change(order: int) -> None:
    np.testing.assert_array_equal(model(order).transition(0.0), np.eye(order + 1))
    np.testing.assert_array_equal(model(order).process_cov(0.0), 0.0)


@given(st.integers(0, 2), STEPS, DIFFUSIONS)
def test_the_noise_is_a_covariance(order: int, dt: float, diffusion: float) -> None:
    cov = model(order, diffusion).process_cov(dt)
    np.testing.assert_array_equal(cov, cov.T)
    assert np.linalg.eigvalsh(cov).min() >= -1e-15 * np.trace(cov)


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=9).map(np.array))
def test_phases_are_clipped(phases: np.ndarray) -> None:
    before = phases.copy()
    np.testing.assert_array_equal(model(1).confine(phases), [min(max(p, 0.0), 1.0) for p in phases])
    np.testing.assert_array_equal(phases, before)


@given(st.lists(st.floats(-50, 50), min_size=1, max_size=9).map(np.array))
def test_periodic_phases_are_turned_to_where_most_of_them_are(phases: np.ndarray) -> None:
    before = phases.copy()
    confined = model(1, periodic=True).confine(phases)
    turns = phases - confined
    np.testing.assert_array_equal(phases, before)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)  # whole cycles are no difference
    assert np.ptp(confined) <= 1 + 1e-12


@given(st.floats(-50, 50), st.lists(st.floats(-0.2, 0.2), min_size=1, max_size=9).map(np.array))
def test_periodic_phases_that_are_close_keep_their_spread(centre: float, off: np.ndarray) -> None:
    confined = model(1, periodic=True).confine(centre + off)
    np.testing.assert_allclose(confined - confined[0], off - off[0], atol=1e-12)
    assert -0.2 - 1e-12 <= confined.mean() <= 1.2 + 1e-12


@pytest.mark.parametrize(
    ("mean", "cov", "diffusion", "velocity"),
    [
        ([0.0] * 4, np.eye(4), 0.1, 1.0),
        ([], np.eye(0), 0.1, 1.0),
        ([0.0, 1.0], np.eye(3), 0.1, 1.0),
        ([0.0, 1.0], -np.eye(2), 0.1, 1.0),
        ([0.0, 1.0], [[1.0, 2.0], [2.0, 1.0]], 0.1, 1.0),
        ([0.0, 1.0], [[1.0, 0.9], [0.0, 1.0]], 0.1, 1.0),
        ([0.0, np.nan], np.eye(2), 0.1, 1.0),
        ([0.0, 1.0], [[1.0, 0.0], [0.0, np.nan]], 0.1, 1.0),
        ([0.0, 1.0], [[np.inf, 0.0], [0.0, 1.0]], 0.1, 1.0),
        ([0.0, 1.0], np.eye(2), -0.1, 1.0),
        ([0.0, 1.0], np.eye(2), np.nan, 1.0),
        ([0.0, 1.0], np.eye(2), np.inf, 1.0),
        ([0.0, 1.0], np.eye(2), 0.1, 0.0),
        ([0.0, 1.0], np.eye(2), 0.1, np.inf),
    ],
)
def test_what_makes_no_prior_is_refused(mean: list, cov: np.ndarray, diffusion: float, velocity: float) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match="expected"):
        PhaseModel(np.array(mean), np.array(cov), diffusion, velocity)


def test_a_phase_without_doubt_is_a_prior() -> None:
    assert PhaseModel(np.array([0.0, 1.0]), np.zeros((2, 2)), 0.0, 1.0).order == 1


def test_a_prior_is_read_only_and_its_own() -> None:
    mean = np.array([0.0, 1.0])
    phase = PhaseModel(mean, np.eye(2), 0.1, 1.0)
    mean[:] = 9.0
    np.testing.assert_array_equal(phase.mean, [0.0, 1.0])
    for array in (phase.mean, phase.cov):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


@ORDERS
def test_tempo_is_learned_from_the_lengths(order: int) -> None:
    durations = [1.0, 2.0, 4.0]
    times = [np.linspace(5.0, 5.0 + d, 9) for d in durations]
    made = inphase.Dataset.from_arrays(times, [np.random.default_rng(0).normal(size=(9, 2))] * 3, ["a"], ["b"])
    phase = inphase.learn_phase(made, order=order)
    tempos = np.array([1.0, 0.5, 0.25])
    assert phase.order == order
    assert phase.nominal_velocity == pytest.approx(tempos.mean())  # Eq. 2.12: of the tempos, not of the lengths
    assert phase.mean[0] == 0
    if order:
        assert phase.mean[1] == pytest.approx(tempos.mean())
        assert phase.cov[1, 1] == pytest.approx(tempos.var(ddof=1))


@ORDERS
def test_the_unit_of_time_does_not_matter(order: int) -> None:
    times, values = np.linspace(0, 1.7, 9), np.random.default_rng(0).normal(size=(9, 2))
    seconds, minutes = (
        inphase.learn_phase(
            inphase.Dataset.from_arrays([times / u, times / u * 1.3], [values] * 2, ["a"], ["b"]), order
        )
        for u in (1.0, 60.0)
    )
    powers = 60.0 ** np.arange(order + 1)
    np.testing.assert_allclose(minutes.cov, seconds.cov * np.outer(powers, powers), rtol=1e-12)
    np.testing.assert_allclose(
        minutes.process_cov(0.1 / 60), seconds.process_cov(0.1) * np.outer(powers, powers), rtol=1e-12
    )
