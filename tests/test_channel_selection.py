"""Which channels say something: the estimators against textbook and truth, and the selection made with them."""

from __future__ import annotations

import numpy as np
import pytest
from interactions import dataset
from numpy.testing import assert_allclose
from scipy.special import digamma

import inphase
from inphase.training.information import A_CELL, ESTIMATORS, NEIGHBOURS, binned, neighbours

BOTH = pytest.mark.parametrize("estimator", ESTIMATORS.values(), ids=ESTIMATORS)


def pairs(rng: np.random.Generator, correlation: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(1, N) draws of two Gaussians."""
    x, other = rng.standard_normal((2, 1, count))
    return x, correlation * x + np.sqrt(1 - correlation**2) * other


# ------------------------------------------------------------------------------------------------------- information


@BOTH
@pytest.mark.parametrize("conditional", [False, True])
def test_what_is_independent_says_nothing(estimator, conditional, rng):
    found = []
    for _ in range(150):
        x, y, z = rng.standard_normal((3, 1, 60))
        found.append(estimator(x, y, z[0] if conditional else None)[0, 0])
    bias = 0.03 if conditional else 0.002  # what is left of it where cells hold two draws
    assert abs(np.mean(found)) < 3 * np.std(found) / np.sqrt(len(found)) + bias
    assert np.std(found) < 0.08


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.8, -0.9])
def test_neighbours_tell_the_information_of_gaussians(correlation, rng):
    found = [neighbours(*pairs(rng, correlation, 300))[0, 0] for _ in range(20)]
    assert_allclose(np.mean(found), -0.5 * np.log(1 - correlation**2), atol=0.04)


def test_bins_tell_the_information_of_coins(rng):
    """A coin that is copied, and now and then the wrong way."""
    found = []
    for _ in range(50):
        x = rng.integers(0, 2, (1, 300)).astype(float)
        y = np.where(rng.random(x.shape) < 0.1, 1 - x, x)
        found.append(binned(x, y)[0, 0])
    assert_allclose(np.mean(found), np.log(2) + 0.1 * np.log(0.1) + 0.9 * np.log(0.9), atol=0.02)


@BOTH
def test_what_both_have_from_a_third_is_nothing_new(estimator, rng):
    z = rng.standard_normal(400)
    x, y = z + 0.3 * rng.standard_normal((2, 400))
    alone, given = (estimator(x[None], y[None], g)[0, 0] for g in (None, z))
    assert alone > 0.4
    assert given < 0.2 * alone


@BOTH
def test_given_itself_nothing_is_new(estimator, rng):
    x, y = pairs(rng, 0.8, 80)
    for same in (x[0], 3 * x[0] + 7, np.exp(x[0])):
        assert_allclose(estimator(x, y, same), 0, atol=1e-12 if estimator is binned else 0.05)


@BOTH
def test_units_make_no_difference(estimator, rng):
    x, y = pairs(rng, 0.6, 80)
    z = rng.standard_normal(80)
    expected = estimator(x, y, z)
    assert_allclose(estimator(1e-6 * x + 5, np.exp(y), 1000 * z), expected, atol=1e-12)
    order = rng.permutation(80)
    assert_allclose(estimator(x[:, order], y[:, order], z[order]), expected, atol=1e-12)


def test_a_histogram_counted_by_hand(rng):
    x, y, z = rng.standard_normal((3, 100))
    y = y + x
    bins = round((100 / A_CELL) ** (1 / 3))

    def coded(values):
        edges = np.quantile(values, np.arange(1, bins) / bins)
        return np.array([sum(v >= edge for edge in edges) for v in values])

    a, b, c = coded(x), coded(y), coded(z)

    def information(a, b):
        """Of two columns, and its degrees of freedom."""
        found = 0.0
        for i in set(a):
            for j in set(b):
                share = np.mean((a == i) & (b == j))
                if share > 0:
                    found += share * np.log(share / np.mean(a == i) / np.mean(b == j))
        return found, (len(set(a)) - 1) * (len(set(b)) - 1)

    alone, free = information(a, b)
    assert_allclose(binned(x[None], y[None]), [[alone - free / 200]])
    parts = [(np.mean(c == k), *information(a[c == k], b[c == k])) for k in set(c)]
    given = sum(share * says - free / 200 for share, says, free in parts)
    assert_allclose(binned(x[None], y[None], z), [[given]])


def test_neighbours_counted_by_hand(rng):
    """On draws that are their own normal scores."""
    from scipy.special import ndtri

    count = 50
    scores = ndtri((np.arange(count) + 0.5) / count)
    x, y, z = (rng.permutation(scores) for _ in range(3))
    near, plain = [], []
    for i in range(count):
        dx, dy, dz = (np.abs(v - v[i]) for v in (x, y, z))
        for others, found in (([dx, dy, dz], near), ([dx, dy], plain)):
            joint = np.max(others, axis=0)
            joint[i] = -1
            eps = np.sort(joint)[NEIGHBOURS]
            within = [np.delete(d, i) < eps * (1 - 1e-12) for d in others]
            if len(others) == 3:
                a, b, c = within
                found.append([(a & c).sum(), (b & c).sum(), c.sum()])
            else:
                found.append([within[0].sum(), within[1].sum()])
    n = np.array(near)
    given = digamma(NEIGHBOURS) - (digamma(n[:, 0] + 1) + digamma(n[:, 1] + 1) - digamma(n[:, 2] + 1)).mean()
    assert_allclose(neighbours(x[None], y[None], z), [[given]])
    p = np.array(plain)
    alone = digamma(NEIGHBOURS) + digamma(count) - (digamma(p[:, 0] + 1) + digamma(p[:, 1] + 1)).mean()
    assert_allclose(neighbours(x[None], y[None]), [[alone]])


# --------------------------------------------------------------------------------------------------------- selection


def squeezes(rng: np.random.Generator, count: int = 60) -> inphase.Dataset:
    """A robot that answers two squeezes as hard as they are, and sensors that feel one, none, or their own joke."""
    times, values = np.linspace(0, 2, 41), []
    bump = np.exp(-0.5 * ((times - 1) / 0.2) ** 2)
    for _ in range(count):
        one, two, joke = rng.uniform(0.5, 1.5, 3)
        columns = [20 * one * bump, 5 * two * bump, 20 * one * bump, joke * bump, 0 * bump + 3, 0 * bump]
        columns += [one * bump, 100 * two * bump]
        noise = 0.02 * np.array([20, 5, 20, 1, 0, 1, 1, 100])
        values.append(np.stack(columns, axis=1) + noise * rng.standard_normal((41, 8)))
        values[-1][:, 2] = 3 * values[-1][:, 0] - 1  # collinear
    observed = ["first", "second", "again", "joke", "still", "silent"]
    return inphase.Dataset.from_arrays([times] * count, values, observed, ["answer_one", "answer_two"])


@pytest.fixture(scope="module")
def demos() -> inphase.Dataset:
    return squeezes(np.random.default_rng(4))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_those_that_say_something_new_are_chosen(name, demos):
    found = inphase.select_channels(demos, estimator=name)
    assert set(found.chosen) in ({"first", "second"}, {"again", "second"})
    assert set(found.names) == set(found.chosen)
    says = {row.channel: row for row in found.table}
    assert [row.channel for row in found.table][:2] == list(found.chosen)
    assert set(says) == set(demos.observed)
    assert says["still"].alone == says["still"].information == 0
    for name in ("joke", "silent"):
        assert says[name].alone < max(found.chance, 0.07)
    twice = ({"first", "again"} - set(found.chosen)).pop()
    assert says[twice].alone > 0.3
    assert abs(says[twice].information) < 0.05
    assert "again" in str(found)
    assert found.table[0].information == found.table[0].alone


def test_where_nothing_says_anything_nothing_is_chosen(rng):
    chosen = 0
    for seed in range(20):
        made = squeezes(np.random.default_rng(seed), count=24)
        lies = [made[i].values[:, :6] for i in np.random.default_rng(seed).permutation(24).tolist()]
        parts = [np.column_stack([lie, d.values[:, 6:]]) for lie, d in zip(lies, made, strict=True)]
        other = inphase.Dataset.from_arrays([d.times for d in made], parts, made.observed, made.controlled)
        chosen += bool(inphase.select_channels(other, threshold=0.0).chosen)
    assert chosen <= 5  # one in twenty, give or take


def test_units_and_the_order_of_channels_and_demonstrations_make_no_difference(demos, rng):
    expected = {row.channel: row.alone for row in inphase.select_channels(demos).table}
    order, factor = [5, 2, 0, 1, 4, 3], np.array([1, 1e-3, 7, 1e4, 2, 1, 1e-2, 50.0])
    parts = [(d.values * factor + 3)[:, [*order, 6, 7]] for d in demos]
    parts = [parts[i] for i in rng.permutation(len(parts))]
    other = inphase.Dataset.from_arrays(
        [d.times for d in demos], parts, [demos.observed[i] for i in order], demos.controlled
    )
    found = inphase.select_channels(other)
    assert_allclose([row.alone for row in found.table], [expected[row.channel] for row in found.table], atol=1e-9)
    assert set(found.chosen) in ({"first", "second"}, {"again", "second"})


def test_what_is_asked_about(demos):
    assert inphase.select_channels(demos, about="answer_two").chosen == ("second",)
    found = inphase.select_channels(demos, channels=["second", "joke"])
    assert found.chosen == ("second",)
    assert found.kept == ("first", "again", "still", "silent")
    assert found.names == (*found.kept, "second")
    assert inphase.select_channels(demos, threshold=10.0).chosen == ()


def test_the_data_set_of_what_was_chosen(demos):
    found = inphase.select_channels(demos, channels=["second", "joke"])
    smaller = demos.select(found.names)
    assert smaller.observed == ("first", "second", "again", "still", "silent")
    assert smaller.controlled == demos.controlled
    assert_allclose(smaller[3].values, demos[3].values[:, [0, 1, 2, 4, 5, 6, 7]])
    assert smaller[3].name == demos[3].name
    assert demos.select("s*").observed == ("second", "still", "silent")
    with pytest.raises(inphase.ChannelError, match="no channel fits 'nose'"):
        demos.select(["nose"])


def test_readings_that_lack(demos):
    parts = [d.values.copy() for d in demos]
    for i, values in enumerate(parts):
        values[:, 4] = np.nan  # never seen
        values[i % 40 : i % 40 + 8, 1] = np.nan
    parts[7][:, 0] = np.nan
    other = inphase.Dataset.from_arrays([d.times for d in demos], parts, demos.observed, demos.controlled)
    found = inphase.select_channels(other)
    assert "second" in found.chosen
    assert {row.channel: row.alone for row in found.table}["still"] == 0


def test_a_quaternion_is_chosen_whole(rng):
    from scipy.spatial.transform import Rotation

    times, values = np.linspace(0, 1, 30), []
    for nod in rng.uniform(0.3, 1.2, 40):
        head = Rotation.from_euler("y", nod * np.sin(3 * times)[:, None]).as_quat()
        noise = rng.standard_normal((30, 2))
        values.append(np.column_stack([noise[:, :1], head, nod * times + 0.01 * noise[:, 1]]))
    names = [f"head_q{axis}" for axis in "xyzw"]
    demos = inphase.Dataset.from_arrays([times] * 40, values, ["joke", *names], ["arm"])
    found = inphase.select_channels(demos)
    assert list(found.chosen) == names
    assert len({row.information for row in found.table if row.chosen}) == 1
    assert demos.select(found.names).observed == tuple(names)
    with pytest.raises(inphase.ChannelError, match="quaternion"):
        demos.select(names[:2])


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"estimator": "guess"}, "unknown estimator 'guess'; one of binned, neighbours"),
        ({"threshold": -1.0}, "threshold"),
        ({"threshold": np.nan}, "threshold"),
        ({"channels": "answer_one"}, "channels: expected observed channels, got answer_one"),
        ({"about": ["first", "answer_one"]}, "about: expected controlled channels, got first"),
        ({"about": "nose"}, "no channel fits 'nose'"),
    ],
)
def test_options_that_make_no_sense(options, expected, demos):
    with pytest.raises((inphase.OptionError, inphase.ChannelError), match=expected):
        inphase.select_channels(demos, **options)


def test_data_that_cannot_be_used(demos, rng):
    for count in (1, 7):
        with pytest.raises(inphase.DataError, match=f"at least 8 demonstrations .* got {count}"):
            inphase.select_channels(demos.subset(range(count)))
    same = inphase.Dataset.from_arrays(
        [d.times for d in demos],
        [np.column_stack([d.values[:, :6], demos[0].values[:, 6:]]) for d in demos],
        demos.observed,
        demos.controlled,
    )
    with pytest.raises(inphase.DataError, match="controlled channels that differ"):
        inphase.select_channels(same)
    assert inphase.select_channels(dataset(rng, count=8)).threshold == 0.07
