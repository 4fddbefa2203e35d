"""Bases for sparse signals: orthogonal least squares against the textbook, and what it is good for."""

from __future__ import annotations

import numpy as np
import pytest
from interactions import OBSERVED, dataset, shapes_unchecked, taught
from numpy.testing import assert_allclose, assert_array_equal

import inphase
from inphase.basis import Gaussian, Layout
from inphase.basis.fit import fit_weights
from inphase.training.orthogonal import BINS, NEWS, Curves, choose
from inphase.training.rest import rest


def bumps(
    rng: np.random.Generator, count: int = 12, width: float = 0.05, noise: float = 0.005
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Phases and readings of a contact: in a third of the phase, now earlier, now later, now stronger."""
    phases = [np.linspace(0, 1, int(n)) for n in rng.integers(80, 140, count)]
    values = []
    for at in phases:
        strength, centre = rng.uniform(0.5, 1.5), 0.5 + 0.03 * rng.standard_normal()
        clean = strength * np.exp(-0.5 * ((at - centre) / width) ** 2)
        values.append(clean + noise * rng.standard_normal(len(at)))
    return phases, values


def spread_out(rng: np.random.Generator, count: int = 12) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Phases and readings of signals that are nowhere at rest."""
    phases = [np.linspace(0, 1, int(n)) for n in rng.integers(80, 140, count)]
    smooth = [np.convolve(rng.standard_normal(46), np.ones(7), "valid") for _ in phases]
    return phases, [
        Gaussian(40)(p) @ w + 0.01 * rng.standard_normal(len(p)) for p, w in zip(phases, smooth, strict=True)
    ]


def left_by(basis: inphase.basis.Basis, phases: list[np.ndarray], values: list[np.ndarray]) -> float:
    """The share of the power that a basis leaves, fitted to each demonstration as a model fits it."""
    layout = Layout((basis,))
    weights, _ = fit_weights(layout, phases, [v[:, None] for v in values])
    errors = [v - layout.predict(p, w)[:, 0] for p, v, w in zip(phases, values, weights, strict=True)]
    return float(sum((e**2).sum() for e in errors) / sum((v**2).sum() for v in values))


# ------------------------------------------------------------------------------------------ orthogonal least squares


def textbook(phases, values, centres, width, count):
    """Chen et al. 1991, 3: every candidate made orthogonal to all that were chosen, demonstration by demonstration."""
    power = sum(v @ v for v in values)
    chosen, ratios = [], []
    bases = [[] for _ in phases]
    for _ in range(count):
        found = np.zeros(len(centres))
        for m, centre in enumerate(centres):
            for p, v, orthogonal in zip(phases, values, bases, strict=True):
                q = np.exp(-0.5 * ((p - centre) / width) ** 2)
                whole = q @ q
                for other in orthogonal:
                    q = q - (other @ q) / (other @ other) * other
                if q @ q > NEWS * whole:
                    found[m] += (q @ v) ** 2 / (q @ q) / power
        best = int(found.argmax())
        chosen.append(centres[best])
        ratios.append(found[best])
        for p, orthogonal in zip(phases, bases, strict=True):
            q = np.exp(-0.5 * ((p - centres[best]) / width) ** 2)
            for other in orthogonal:
                q = q - (other @ q) / (other @ other) * other
            orthogonal.append(q)
    return chosen, 1 - np.cumsum(ratios)


def test_the_textbook_chooses_the_same_centres(rng):
    grid = (np.arange(BINS) + 0.5) / BINS  # on the bins: there gathering changes nothing
    phases = [grid[np.sort(rng.choice(BINS, n, replace=False))] for n in (60, 90, 75)]
    values = [np.sin(6 * p + rng.normal()) + 0.1 * rng.standard_normal(len(p)) for p in phases]
    found = choose(Curves.gather(phases, [v[:, None] for v in values]), 0.08, 0.0, False, 6)
    edge = 0.02 * np.floor((1 + 4 * 0.08) / 0.02 - 1e-9) / 2
    centres = 0.5 + np.arange(-edge, edge + 0.01, 0.02)
    expected, left = textbook(phases, values, centres, 0.08, 6)
    assert_allclose(found.centres, sorted(expected), atol=1e-9)
    assert_allclose(found.unexplained, left[-1], rtol=1e-9)


def test_what_is_said_to_be_left_is_left(rng):
    phases, values = bumps(rng)
    for count in (3, 5):
        chosen = choose(Curves.gather(phases, [v[:, None] for v in values]), 0.05, 0.0, False, count)
        assert_allclose(chosen.unexplained, left_by(chosen.basis, phases, values), rtol=0.1, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("size", [6, 9, 15])
def test_where_nothing_is_sparse_it_is_as_good_as_a_uniform_basis_of_that_size(seed, size):
    phases, values = spread_out(np.random.default_rng(seed))
    found = inphase.sparse_basis(phases, values, unexplained=0.0, by_bic=False, most=size)
    assert found.size == size
    assert left_by(found, phases, values) <= left_by(Gaussian(size), phases, values)


@pytest.mark.parametrize("seed", range(5))
def test_a_contact_in_a_third_of_the_phase_needs_a_third_of_the_functions(seed):
    phases, values = bumps(np.random.default_rng(seed))
    found = inphase.sparse_basis(phases, values)
    error = left_by(found, phases, values)
    assert error < 0.01
    assert all(1 / 3 <= centre <= 2 / 3 for centre in found.centres)
    uniform = next(size for size in range(4, 60) if left_by(Gaussian(size), phases, values) <= error)
    assert 3 * found.size <= uniform


def test_all_demonstrations_are_looked_at(rng):
    """One that has its contact elsewhere brings a centre there."""
    phases, values = bumps(rng, noise=0.0)
    values[3] = np.exp(-0.5 * ((phases[3] - 0.9) / 0.05) ** 2)
    found = inphase.sparse_basis(phases, values)
    assert max(found.centres) == pytest.approx(0.9, abs=0.03)


def test_signals_that_share_a_basis(rng):
    phases, early = bumps(rng, noise=0.0)
    late = [np.exp(-0.5 * ((p - 0.85) / 0.05) ** 2) for p in phases]
    both = inphase.sparse_basis(phases, [np.stack(pair, axis=1) for pair in zip(early, late, strict=True)])
    assert max(both.centres) > 0.8
    assert min(both.centres) < 0.55


def test_units_order_and_rate_make_no_difference(rng):
    phases, values = bumps(rng)
    found = inphase.sparse_basis(phases, values)
    assert inphase.sparse_basis(phases[::-1], [-1000 * v for v in values][::-1]) == found
    gone = [np.where(np.arange(len(v)) % 2, v, np.nan) for v in values]
    thinned = inphase.sparse_basis([p[1::2] for p in phases], [v[1::2] for v in values])
    assert inphase.sparse_basis(phases, gone) == thinned


def test_noise_alone_stops_it(rng):
    """Where the share asked for cannot be had, the criterion says when to stop."""
    phases, values = bumps(rng, noise=0.2)
    found = inphase.sparse_basis(phases, values, unexplained=0.001)
    assert found.size <= 6
    assert inphase.sparse_basis(phases, values, unexplained=0.001, by_bic=False).size > 12


def test_more_functions_than_samples(rng):
    phases = [np.linspace(0, 1, 6)] * 3
    values = [np.sin(3 * p) + 0.1 * rng.standard_normal(6) for p in phases]
    assert 2 <= inphase.sparse_basis(phases, values, unexplained=0.0, by_bic=False, most=50).size <= 6
    lonely = [np.array([np.nan, np.nan, 2.0, np.nan, np.nan, np.nan])] * 3
    assert inphase.sparse_basis(phases, lonely).size == 2


def test_one_demonstration(rng):
    phases, values = bumps(rng, count=1)
    assert left_by(inphase.sparse_basis(phases, values), phases, values) < 0.011


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda p, v: (p, [0 * x for x in v]), "not zero everywhere"),
        (lambda p, v: (p, [np.nan * x for x in v]), "not zero everywhere"),
        (lambda p, v: (p, v[:-1]), r"expected phases \(T,\) and values"),
        (lambda p, v: ([], []), "expected phases"),
        (lambda p, v: (p, [v[0] / 0.0, *v[1:]]), "finite"),
        (lambda p, v: ([np.nan * p[0], *p[1:]], v), "finite phases"),
    ],
)
def test_signals_that_cannot_be_used(change, expected, rng):
    with np.errstate(all="ignore"), shapes_unchecked(), pytest.raises(inphase.DataError, match=expected):
        inphase.sparse_basis(*change(*bumps(rng, count=3)))


@pytest.mark.parametrize(
    "option", [{"widths": ()}, {"widths": 0.0}, {"widths": (0.1, 2.0)}, {"most": 1}, {"unexplained": 1.0}]
)
def test_options_that_make_no_sense(option, rng):
    with pytest.raises(inphase.OptionError, match=next(iter(option))):
        inphase.sparse_basis(*bumps(rng, count=3), **option)


# ------------------------------------------------------------------------------------------------------------ data sets


def touching(rng: np.random.Generator, noise: float = 0.3) -> inphase.Dataset:
    """Two sensors that feel a contact, [raw] from 0 to about 200, one that rests high and gives way, and a robot."""
    phases, left = bumps(rng, noise=0.0)
    times, values = [2 * p for p in phases], []
    for p, v in zip(phases, left, strict=True):
        right = np.exp(-0.5 * ((p - 0.7) / 0.04) ** 2) * v.max()
        raw = np.stack([150 * v, 150 * right, 255 - 120 * v, 1000 * np.sin(p + v.max())], axis=1)
        values.append(raw + noise * rng.standard_normal(raw.shape))
    return inphase.Dataset.from_arrays(times, values, ["touch_left", "touch_right", "yields"], ["arm"])


def test_a_basis_for_every_channel_that_fits(rng):
    demos = touching(rng)
    found = inphase.sparse_bases(demos, "touch_*")
    assert list(found) == ["touch_left", "touch_right"]
    assert all(isinstance(basis, Gaussian) and basis.size < 7 for basis in found.values())
    assert abs(np.mean(found["touch_left"].centres) - 0.5) < 0.1
    assert abs(np.mean(found["touch_right"].centres) - 0.7) < 0.1
    shared = inphase.sparse_bases(demos, ["touch_right", "touch_left"], together=True)
    assert shared["touch_left"] == shared["touch_right"]
    model = taught(demos, basis=found)
    assert [basis.size for basis in model.layout.bases[:2]] == [basis.size for basis in found.values()]
    assert model.noise.var[0] < 2 * taught(demos).noise.var[0]


def test_a_channel_that_rests_far_from_its_zero_is_not_sparse(rng):
    """A model has its zero at the lowest reading: what rests elsewhere has to be held there by functions."""
    demos = touching(rng)
    yields = inphase.sparse_bases(demos, "yields")["yields"]
    assert min(yields.centres) < 0.1
    assert max(yields.centres) > 0.9


def test_quaternions_share_one_basis(rng):
    from test_model_file import turning

    found = inphase.sparse_bases(turning(rng), ["head_q*", "arm"])
    assert list(found) == ["arm", "head_qx", "head_qy", "head_qz", "head_qw"]
    assert len({found[f"head_q{axis}"] for axis in "xyzw"}) == 1


def test_channels_that_cannot_be_used(rng):
    times = [np.linspace(0, 1, 20)] * 3
    dead, still, moving = np.full(20, np.nan), np.full(20, 3.0), np.linspace(0, 1, 20)
    demos = inphase.Dataset.from_arrays(times, [np.stack([dead, still, moving], 1)] * 3, ["dead", "still"], ["moving"])
    for name, expected in (("dead", "'dead': expected readings"), ("still", "'still': expected a channel that moves")):
        with pytest.raises(inphase.DataError, match=expected):
            inphase.sparse_bases(demos, name)
    with pytest.raises(inphase.ChannelError, match="no channel fits 'nose'"):
        inphase.sparse_bases(demos, "nose")


def test_doubled_and_collinear_channels_have_the_same_basis(rng):
    demos = touching(rng)
    values = [np.column_stack([d.values[:, :1], d.values[:, 0], 3 * d.values[:, 0] + 1, d.values[:, 3]]) for d in demos]
    doubled = inphase.Dataset.from_arrays([d.times for d in demos], values, ["a", "b", "c"], ["arm"])
    a, b, c = inphase.sparse_bases(doubled, ["a", "b", "c"]).values()
    assert a == b
    assert_allclose(a.centres, c.centres, atol=1e-9)


def test_dataset_of_a_movement_without_rest(rng):
    demos = dataset(rng)
    model = taught(demos, basis=inphase.sparse_bases(demos, list(OBSERVED), unexplained=1e-4))
    usual = taught(demos)
    assert model.layout.size < usual.layout.size
    assert (model.noise.var[:2] < 3 * usual.noise.var[:2]).all()


# ----------------------------------------------------------------------------------------------------------------- rest


def test_rest_is_found_beside_a_contact(rng):
    still = 3 + 0.1 * rng.standard_normal(20_000)
    level, noise = rest(still)
    assert_allclose([level, noise], [3, 0.1], rtol=0.05)
    touched = still.copy()
    touched[:7000] += rng.uniform(1, 50, 7000)
    level, noise = rest(np.concatenate([touched, np.full(100, np.nan)]))
    assert_allclose(level, 3, atol=0.02)
    assert 0.1 < noise < 0.25
    assert_array_equal(rest(np.r_[np.zeros(60), np.arange(40.0)]), [0, 0])
    with pytest.raises(ValueError, match="got none"):
        rest(np.array([np.nan]))
