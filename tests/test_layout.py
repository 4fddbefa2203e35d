"""Layout: block by block, it must equal the dense matrix of Eq. 2.6."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inphase.basis import Basis, Gaussian, Layout, Periodic, Polynomial, Sigmoid
from inphase.errors import OptionError

# Few kinds, many features: some share a basis side by side, some with others between them.
KINDS = [Gaussian(4), Gaussian(4, 0.3), Sigmoid(3), Polynomial(4), Polynomial(0)]
BASES = st.lists(st.sampled_from(KINDS), min_size=1, max_size=9).map(tuple)
CIRCLES = st.lists(st.sampled_from([Periodic(3), Periodic(5)]), min_size=1, max_size=5).map(tuple)
SEEDS = st.integers(0, 2**32 - 1)


def dense(layout: Layout, phase: float) -> np.ndarray:
    """(F, B) the columns of H in Eq. 2.6 that belong to the weights, zeros and all."""
    rows = np.zeros((len(layout.bases), sum(basis.size for basis in layout.bases)))
    start = 0
    for feature, basis in enumerate(layout.bases):
        for k in range(basis.size):
            rows[feature, start + k] = basis(np.array(phase))[k]
        start += basis.size
    return rows


def some_features(layout: Layout, rng: np.random.Generator) -> np.ndarray | None:
    """None, or any subset, the empty one included."""
    return None if rng.random() < 0.2 else np.flatnonzero(rng.random(layout.count) < rng.random())


@settings(max_examples=40)
@given(BASES | CIRCLES, SEEDS)
def test_all_methods_equal_the_dense_matrix(bases: tuple[Basis, ...], seed: int) -> None:
    layout, rng = Layout(bases), np.random.default_rng(seed)
    features = some_features(layout, rng)
    chosen = np.arange(layout.count) if features is None else features
    phases, weights = rng.uniform(-0.2, 1.2, 2), rng.normal(size=layout.size)
    matrices = [dense(layout, phase)[chosen] for phase in phases]

    predicted = layout.predict(phases, weights, features)
    np.testing.assert_allclose(predicted, [matrix @ weights for matrix in matrices], atol=1e-12)

    told, slopes = layout.predict_and_slope(phases, weights, features)
    np.testing.assert_array_equal(told, predicted)
    np.testing.assert_array_equal(slopes, layout.slope(phases, weights, features))

    rows, columns = rng.normal(size=(3, layout.size)), rng.normal(size=(len(chosen), 2))
    told, across = layout.predict_and_project(phases, weights, rows, features)
    np.testing.assert_array_equal(told, predicted)
    np.testing.assert_array_equal(across, layout.project_each(phases, rows, features))
    np.testing.assert_allclose(across, [rows @ matrix.T for matrix in matrices], atol=1e-12)
    root = rng.normal(size=(3, 3))
    var = [np.diag(matrix @ rows.T @ root @ root.T @ rows @ matrix.T) for matrix in matrices]
    np.testing.assert_allclose(layout.variance(phases, rows, root @ root.T, features), var, atol=1e-11)
    for phase, matrix in zip(phases, matrices, strict=True):
        at = float(phase)
        np.testing.assert_allclose(layout.project(at, rows, features), rows @ matrix.T, atol=1e-12)
        np.testing.assert_allclose(layout.lift(at, columns, features), matrix.T @ columns, atol=1e-12)
        jacobian = layout.jacobian(at, weights, features)
        np.testing.assert_allclose(jacobian[:, 1:], matrix, atol=1e-12)
        np.testing.assert_array_equal(jacobian[:, 0], layout.slope(phases[phases == phase][:1], weights, features)[0])


@settings(max_examples=40)
@given(BASES | CIRCLES, SEEDS)
def test_slope_is_the_central_difference_of_predict(bases: tuple[Basis, ...], seed: int) -> None:
    layout, rng = Layout(bases), np.random.default_rng(seed)
    features = some_features(layout, rng)
    phases, weights = rng.uniform(0.01, 0.99, 5), rng.normal(size=layout.size)
    step = 1e-6
    above, below = (layout.predict(phases + d, weights, features) for d in (step, -step))
    np.testing.assert_allclose(layout.slope(phases, weights, features), (above - below) / (2 * step), atol=1e-6)


@settings(max_examples=40)
@given(BASES, SEEDS)
def test_each_member_is_predicted_at_its_own_phases(bases: tuple[Basis, ...], seed: int) -> None:
    layout, rng = Layout(bases), np.random.default_rng(seed)
    features = some_features(layout, rng)
    phases, weights = rng.uniform(-0.2, 1.2, (6, 3)), rng.normal(size=(6, layout.size))
    one_by_one = [layout.predict(p, w, features) for p, w in zip(phases, weights, strict=True)]
    np.testing.assert_allclose(layout.predict_each(phases, weights, features), one_by_one, atol=1e-12)


@settings(max_examples=40)
@given(BASES, SEEDS)
def test_members_may_share_weights_and_features_may_be_split(bases: tuple[Basis, ...], seed: int) -> None:
    layout, rng = Layout(bases), np.random.default_rng(seed)
    weights, which, phases = rng.normal(size=(3, layout.size)), rng.integers(0, 3, 7), rng.uniform(0, 1, (7, 2))
    each = layout.predict_each(phases, weights[which])
    np.testing.assert_array_equal(layout.predict_each(phases, weights, which=which), each)
    if layout.count == 1:
        return
    count = int(rng.integers(1, layout.count))
    first, others = layout.split(count)
    assert first.bases + others.bases == layout.bases
    own = weights[which][:, first.size :]
    np.testing.assert_allclose(others.predict_each(phases, own), each[:, :, count:], atol=1e-12)
    np.testing.assert_allclose(
        first.predict_each(phases, weights[which][:, : first.size]), each[:, :, :count], atol=1e-12
    )


@settings(max_examples=40)
@given(BASES, SEEDS)
def test_lift_is_the_adjoint_of_project(bases: tuple[Basis, ...], seed: int) -> None:
    layout, rng = Layout(bases), np.random.default_rng(seed)
    features = some_features(layout, rng)
    phase, rows = rng.random(), rng.normal(size=(4, layout.size))
    projected = layout.project(phase, rows, features)
    columns = rng.normal(size=(projected.shape[1], 5))
    np.testing.assert_allclose(projected @ columns, rows @ layout.lift(phase, columns, features), atol=1e-11)


@settings(max_examples=40)
@given(BASES, SEEDS)
def test_features_may_be_laid_out_in_any_order(bases: tuple[Basis, ...], seed: int) -> None:
    layout, rng = Layout(bases), np.random.default_rng(seed)
    order = rng.permutation(layout.count)
    other = Layout(tuple(layout.bases[i] for i in order))
    phases, weights = rng.random(4), rng.normal(size=layout.size)
    moved = np.concatenate([weights[layout.slices[i]] for i in order])
    np.testing.assert_allclose(other.predict(phases, moved), layout.predict(phases, weights)[:, order], atol=1e-12)


@given(BASES)
def test_slices_share_out_all_weights_in_order(bases: tuple[Basis, ...]) -> None:
    layout = Layout(bases)
    places = [list(range(layout.size))[s] for s in layout.slices]
    assert [len(place) for place in places] == [basis.size for basis in layout.bases]
    assert sum(places, []) == list(range(layout.size))
    assert layout.count == len(layout.bases)


def test_a_layout_is_a_value_used_or_not() -> None:
    used, fresh = Layout((Gaussian(4), Sigmoid(3))), Layout((Gaussian(4), Sigmoid(3)))
    phases, weights = np.linspace(0, 1, 5), np.arange(7.0)
    before = phases.copy(), weights.copy()
    used.slope(phases, weights)
    used.predict(phases, weights)[:] = 99.0  # the caller's own
    np.testing.assert_array_equal(phases, before[0])
    np.testing.assert_array_equal(weights, before[1])
    assert used == fresh
    assert hash(used) == hash(fresh)
    assert repr(used) == repr(fresh)
    np.testing.assert_array_equal(used.predict(phases, weights), fresh.predict(phases, weights))


def test_subsets_are_never_mistaken_for_each_other(rng: np.random.Generator) -> None:
    layout = Layout(tuple(KINDS[i] for i in rng.integers(len(KINDS), size=10)))
    weights, phases = rng.normal(size=layout.size), rng.random(3)
    whole = layout.predict(phases, weights)
    for _ in range(100):  # more than a layout remembers
        chosen = np.flatnonzero(rng.random(10) < 0.5)
        for features in (chosen, chosen.astype(np.int32)):
            np.testing.assert_allclose(layout.predict(phases, weights, features), whole[:, chosen], atol=1e-12)


@pytest.mark.parametrize("features", [[0, 3], [-1, 0], [1, 0], [1, 1], [0, 7, 1]])
def test_features_must_exist_and_increase(features: list[int]) -> None:
    layout = Layout((Gaussian(4),) * 3)
    with pytest.raises(OptionError, match="increasing features from 0 to 2, got " + ", ".join(map(str, features))):
        layout.predict(np.array([0.5]), np.zeros(12), np.array(features))


def test_weights_of_another_length_are_refused() -> None:
    layout = Layout((Gaussian(4),) * 3)
    for call in (
        lambda: layout.predict(np.array([0.5]), np.zeros(13)),
        lambda: layout.slope(np.array([0.5]), np.zeros(11)),
        lambda: layout.predict_each(np.zeros((2, 1)), np.zeros((2, 16))),
        lambda: layout.project(0.5, np.zeros((2, 16))),
    ):
        with pytest.raises(OptionError, match=r"expected 12 weights, got 1\d"):
            call()


def test_one_phase_is_either_periodic_or_not() -> None:
    assert Layout((Periodic(5), Periodic(3))).periodic
    assert not Layout((Gaussian(5), Polynomial(3))).periodic
    mixed: tuple[Basis, ...] = (Gaussian(5), Periodic(5), Sigmoid(5), Periodic(3))
    with pytest.raises(OptionError, match="of feature 0 is not periodic, of features 1, 3 periodic"):
        Layout(mixed)
    with pytest.raises(OptionError, match="got none"):
        Layout(())
