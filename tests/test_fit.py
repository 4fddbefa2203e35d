"""Learning a model: nothing set by hand on any data, each keyword its own part, and the equations of 2.3.2."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from interactions import CONTROLLED, OBSERVED, curves, dataset, taught
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import inphase
from inphase.basis import Gaussian, Periodic, Polynomial, Sigmoid
from inphase.training import leave_one_out, regression_noise


@pytest.fixture
def demos(rng: np.random.Generator) -> inphase.Dataset:
    return dataset(rng, count=6, correlation_time=0.03)


def of(times: list[Any], values: list[Any], **kinds: str) -> inphase.Dataset:
    """A data set of two observed and two controlled channels."""
    return inphase.Dataset.from_arrays(times, values, OBSERVED, CONTROLLED, kinds=kinds)


def parts(model: inphase.Model) -> dict[str, list[np.ndarray]]:
    """The numbers of every part of a model that a keyword of `fit` can replace."""
    return {
        "basis": [np.array([repr(basis) for basis in model.layout.bases])],
        "scaling": [model.scaling.low, model.scaling.high],
        "prior": [model.prior.samples, np.array([getattr(model.prior, n) for n in ("shrinkage", "trust", "partner")])],
        "noise": [model.noise.var, model.noise.correlation_time],
        "phase": [model.phase.mean, model.phase.cov, np.array(model.phase.diffusion)],
        "spread": [model.spread],
        "coordinates": [model.coordinates.references],
    }


def differing(one: inphase.Model, other: inphase.Model) -> set[str]:
    """The names of the parts that are not the same, bit for bit."""
    ours, theirs = parts(one), parts(other)
    return {
        name
        for name in ours
        if any(a.shape != b.shape or a.tobytes() != b.tobytes() for a, b in zip(ours[name], theirs[name], strict=True))
    }


# ---------------------------------------------------------------------------------------------- nothing set by hand


def pair(rng: np.random.Generator) -> inphase.Dataset:
    return dataset(rng, count=2)


def shortest(rng: np.random.Generator) -> inphase.Dataset:
    return of([np.arange(3.0)] * 3, [rng.standard_normal((3, 4)) for _ in range(3)])


def irregular(rng: np.random.Generator) -> inphase.Dataset:
    times = [np.cumsum(rng.exponential(0.05, size)) for size in (30, 41, 25)]
    return of(times, [curves((t - t[0]) / np.ptp(t), rng.standard_normal(2)) for t in times])


def holes(rng: np.random.Generator) -> inphase.Dataset:
    demos = dataset(rng, count=4)
    values = [np.where(rng.random(d.values.shape) < 0.4, np.nan, d.values) for d in demos]
    values[0][:, 1] = np.nan  # a channel that is not there in one demonstration,
    values[1][len(values[1]) // 2 :, 3] = np.nan  # one that is lost half-way,
    values[2][:, 0] = np.nan
    values[2][7, 0] = 0.1  # and one that is seen once
    return of([d.times for d in demos], values)


def lengths(rng: np.random.Generator) -> inphase.Dataset:
    times = [np.linspace(0, duration, 8 + 40 * i) for i, duration in enumerate((0.3, 3.0, 30.0))]
    return of(times, [curves(t / t[-1], rng.standard_normal(2)) for t in times])


def large_and_small(rng: np.random.Generator) -> inphase.Dataset:
    demos = dataset(rng, count=3)
    return of([1e6 + d.times for d in demos], [d.values * [1e9, 1e-9, 1.0, 1e-3] + [0, 0, 1e4, 1.0] for d in demos])


def constant_each(rng: np.random.Generator) -> inphase.Dataset:
    demos = dataset(rng, count=4)
    values = [np.column_stack([d.values[:, :3], np.full(len(d), float(i))]) for i, d in enumerate(demos)]
    return of([d.times for d in demos], values)


def alike(rng: np.random.Generator) -> inphase.Dataset:
    demos = dataset(rng, count=2)
    return of([demos[0].times] * 3, [demos[0].values] * 3)


def many(rng: np.random.Generator) -> inphase.Dataset:
    times = np.linspace(0, 1, 20)
    values = [np.cumsum(rng.standard_normal((20, 30)), axis=0) for _ in range(3)]
    names = [f"c{i}" for i in range(30)]
    return inphase.Dataset.from_arrays([times] * 3, values, names[:25], names[25:])


def turns(rng: np.random.Generator) -> inphase.Dataset:
    times = np.linspace(0, 2, 50)
    values = []
    for _ in range(4):
        angle = (1.5 + 0.2 * rng.standard_normal()) * times
        quaternion = Rotation.from_euler("xyz", np.stack([angle, 0.3 * np.sin(times), 0.1 * times], axis=1)).as_quat()
        values.append(np.column_stack([np.angle(np.exp(1j * (3 + angle))), quaternion, np.cos(angle)]))
    names = ["arm", *(f"head_q{axis}" for axis in "xyzw")]
    return inphase.Dataset.from_arrays([times] * 4, values, names, ["grip"], kinds={"arm": "angle"})


ODD = [pair, shortest, irregular, holes, lengths, large_and_small, constant_each, alike, many, turns]


@pytest.mark.parametrize("filter", ["bip", "ebip"])
@pytest.mark.parametrize("make", ODD, ids=lambda make: make.__name__)
def test_nothing_is_set_by_hand(make, filter, rng):
    """Whatever the data, a model comes out, and it answers with finite numbers and a doubt."""
    demos = make(rng)
    model = taught(demos)
    mean, std = model.distribution(np.linspace(0, 1, 7))
    assert mean.shape == std.shape == (7, len(demos.names))
    assert np.isfinite(mean).all()
    assert np.isfinite(std).all()
    assert (std > 0).all()
    session = model.session(filter=filter)
    demonstration = demos[0]
    for time, row in zip(demonstration.times, demonstration.values[:, : len(demos.observed)], strict=True):
        estimate = session.observe(time, row)
        assert 0 <= estimate.phase <= 1
        assert estimate.phase_std >= 0
    response = session.respond(samples=4)
    assert np.isfinite(response.mean).all()
    assert np.isfinite(response.std).all()
    assert (response.std > 0).all()


def test_learning_takes_nothing_from_chance_and_changes_nothing(demos):
    before = [d.values.tobytes() for d in demos]
    assert differing(taught(demos), taught(demos)) == set()
    assert [d.values.tobytes() for d in demos] == before


def test_the_order_of_demonstrations_does_not_matter(demos):
    model, turned = taught(demos), taught(demos.subset([3, 0, 5, 1, 4, 2]))
    assert_allclose(turned.prior.samples, model.prior.samples[[3, 0, 5, 1, 4, 2]], atol=1e-9)
    for name in ("scaling", "noise", "phase", "spread"):
        for one, other in zip(parts(turned)[name], parts(model)[name], strict=True):
            assert_allclose(one, other, rtol=1e-7)


def test_provenance_says_where_it_came_from(demos):
    named = inphase.Dataset(demos.channels, demos.demonstrations, {"source": "the attic"})
    assert dict(taught(named).provenance) == {"source": "the attic", "demonstrations": "6"}


# ------------------------------------------------------------------------------------------------------- the keywords


def test_a_basis_replaces_the_basis(demos):
    usual, other = taught(demos), taught(demos, basis=Sigmoid(7))
    assert other.layout.bases == (Sigmoid(7),) * 4
    # Weights and what they leave unexplained are in terms of the basis.
    assert differing(usual, other) == {"basis", "prior", "noise"}


def test_a_scaling_replaces_the_scaling(demos):
    scaling = inphase.Scaling(np.array([-1.0, -2.0, 0.0, -3.0]), np.array([1.0, 3.0, 5.0, 3.0]))
    # Polynomials can be constant, and so do not care what is called zero.
    usual, other = (taught(demos, basis=Polynomial(7), scaling=s) for s in (None, scaling))
    assert other.scaling is scaling
    assert differing(usual, other) == {"scaling", "prior", "noise"}
    # What the model says, it says in the units of the channels.
    at = np.linspace(0, 1, 9)
    assert_allclose(other.predict(at), usual.predict(at), atol=1e-4)


def test_a_prior_replaces_the_prior(demos, rng):
    usual = taught(demos)
    prior = inphase.WeightPrior(rng.standard_normal((3, usual.layout.size)), shrinkage=0.5)
    other = taught(demos, prior=prior)
    assert other.prior is prior
    assert differing(usual, other) == {"prior"}


def test_a_noise_replaces_the_noise(demos):
    noise = inphase.Noise(np.full(4, 0.02), np.full(4, 0.3))
    other = taught(demos, noise=noise)
    assert other.noise is noise
    assert differing(taught(demos), other) == {"noise"}


def test_a_bias_adds_its_variance_to_the_noise_of_its_channels(demos):
    plain = inphase.fit(demos, calibrate=False)
    name = plain.names[0]
    biased = inphase.fit(demos, calibrate=False, noise_bias={name: 0.3})
    added = plain.scaling.unscale_var(biased.noise.var) - plain.scaling.unscale_var(plain.noise.var)
    assert_allclose(added, [0.09, *[0.0] * (len(added) - 1)], atol=1e-12)
    everywhere = inphase.fit(demos, calibrate=False, noise_bias={"*": 0.1, name: 0.3})
    assert_allclose(
        plain.scaling.unscale_var(everywhere.noise.var) - plain.scaling.unscale_var(plain.noise.var),
        [0.09, *[0.01] * (len(added) - 1)],
        atol=1e-12,
    )
    with pytest.raises(inphase.OptionError, match=f"noise_bias: expected finite .*, got {name}: -1"):
        inphase.fit(demos, noise_bias={name: -1.0})
    with pytest.raises(inphase.ChannelError, match="elbow"):
        inphase.fit(demos, noise_bias={"elbow": 1.0})


@pytest.mark.parametrize("order", [0, 2])
def test_a_phase_replaces_the_phase(order, demos):
    phase = inphase.learn_phase(demos, order=order)
    other = taught(demos, phase=phase)
    assert other.phase is phase
    assert differing(taught(demos), other) == {"phase"}


def test_a_periodic_phase_brings_a_periodic_basis(demos):
    phase = inphase.learn_phase(demos, periodic=True)
    model = taught(demos, phase=phase)
    assert all(isinstance(basis, Periodic) for basis in model.layout.bases)
    assert_allclose(model.predict([0.0]), model.predict([1.0]), atol=1e-12)
    with pytest.raises(inphase.OptionError, match=r"both periodic or both not, got phase\.periodic=True"):
        taught(demos, phase=phase, basis=Gaussian(9))
    with pytest.raises(inphase.OptionError, match=r"both periodic or both not, got phase\.periodic=False"):
        taught(demos, basis=Periodic(9))


def test_a_basis_by_name_and_pattern(demos):
    usual = taught(demos).layout.bases[0]
    assert isinstance(usual, Gaussian)
    model = taught(demos, basis={"*t": Sigmoid(5), "grip": Polynomial(4)})
    assert model.layout.bases == (usual, Sigmoid(5), Polynomial(4), usual)
    # What comes later is for those that what came before did not mean.
    model = taught(demos, basis={"*": Sigmoid(5), "grip": Polynomial(4)})
    assert model.layout.bases == (Sigmoid(5), Sigmoid(5), Polynomial(4), Sigmoid(5))
    assert taught(demos, basis={}).layout.bases == (usual,) * 4
    with pytest.raises(inphase.ChannelError, match=r"no channel fits 'griper'; the channels are reach, lift, grip"):
        taught(demos, basis={"griper": Sigmoid(5)})


def test_a_basis_for_one_channel_is_nothing_to_the_others(demos):
    usual, other = taught(demos), taught(demos, basis={"grip": Polynomial(4)})
    for name in ("reach", "lift", "turn"):
        i = OBSERVED.index(name) if name in OBSERVED else 2 + CONTROLLED.index(name)
        ours, theirs = (m.prior.samples[:, m.layout.slices[i]] for m in (usual, other))
        assert_allclose(ours, theirs, atol=1e-9)


def test_the_basis_of_a_quaternion_is_that_of_its_channels(rng):
    model = taught(turns(rng), basis={"head_q?": Sigmoid(6), "arm": Polynomial(5)})
    assert model.layout.bases[:4] == (Polynomial(5), Sigmoid(6), Sigmoid(6), Sigmoid(6))


def test_parts_that_do_not_fit(demos):
    with pytest.raises(inphase.OptionError, match="scaling: expected 4 features, got 3"):
        taught(demos, scaling=inphase.Scaling.none(3))
    with pytest.raises(inphase.OptionError, match="features of the noise: expected 4, got 2"):
        taught(demos, noise=inphase.Noise(np.ones(2), np.zeros(2)))
    with pytest.raises(inphase.OptionError, match=r"weights of the prior: expected \d+, got 5"):
        taught(demos, prior=inphase.WeightPrior(np.eye(5)))


# -------------------------------------------------------------------------------------------------------- bad data


def test_one_demonstration_is_too_few(demos):
    with pytest.raises(inphase.DataError, match=r"at least 2 demonstrations to learn from, got 1 \(demonstration 0\)"):
        taught(demos.subset([0]))


def test_both_partners_are_needed(demos):
    times, values = [d.times for d in demos], [d.values for d in demos]
    alone = inphase.Dataset.from_arrays(times, values, [*OBSERVED, *CONTROLLED], [])
    with pytest.raises(inphase.DataError, match="one controlled channel, got none; the channels are reach, lift, grip"):
        taught(alone)
    alone = inphase.Dataset.from_arrays(times, values, [], [*OBSERVED, *CONTROLLED])
    with pytest.raises(inphase.DataError, match="one observed channel, got none; the channels are reach, lift, grip"):
        taught(alone)


@pytest.mark.parametrize("level", [0.0, -3.5, 1e6])
def test_a_channel_that_never_moves_is_named(level, demos):
    values = [np.column_stack([d.values[:, :2], np.full(len(d), level), d.values[:, 3]]) for d in demos]
    values[1][3, 2] = np.nan
    with pytest.raises(inphase.DataError, match=rf"channel 'grip': .* moves, got {re.escape(f'{level:g}')} in every"):
        taught(of([d.times for d in demos], values))


def test_a_channel_that_is_never_seen_is_named(demos):
    values = [np.column_stack([d.values[:, :1], np.full(len(d), np.nan), d.values[:, 2:]]) for d in demos]
    with pytest.raises(inphase.DataError, match=r"channel 'lift': expected readings, got none in any of 6"):
        taught(of([d.times for d in demos], values))


def test_a_hand_that_turns_about_one_axis_only_is_no_channel_that_never_moves(rng):
    times = np.linspace(0, 2, 50)
    values = []
    for _ in range(4):
        angle = (0.8 + 0.1 * rng.standard_normal()) * times
        values.append(np.column_stack([np.sin(times), Rotation.from_euler("z", angle[:, None]).as_quat()]))
    names = [f"hand_q{axis}" for axis in "xyzw"]
    demos = inphase.Dataset.from_arrays([times] * 4, values, ["reach"], names)
    mean, std = taught(demos).distribution(np.linspace(0, 1, 5))
    assert_allclose(np.linalg.norm(mean[:, 1:], axis=1), 1)
    assert_allclose(mean[:, 1:3], 0, atol=2e-3)
    assert np.isfinite(std).all()
    still = [np.column_stack([v[:, :1], np.tile([0.0, 0.0, 0.6, 0.8], (50, 1))]) for v in values]
    dead = inphase.Dataset.from_arrays([times] * 4, still, ["reach"], names)
    with pytest.raises(inphase.DataError, match="hand_q"):
        taught(dead)


# ------------------------------------------------------------------------------------------------------ the equations


def test_the_noise_of_the_regression_is_equation_2_15(demos):
    """R is the mean over demonstrations of the mean squared residual, here in the units of the channels."""
    model = taught(demos)
    naive = np.zeros(4)
    for demonstration, weights in zip(demos, model.prior.samples, strict=True):
        squares = np.zeros(4)
        for t, y in zip(demonstration.phases, demonstration.values, strict=True):
            squares += (y - model.predict([t], weights)[0]) ** 2
        naive += squares / len(demonstration) / len(demos)
    residuals = [
        model.scaling.scale(d.values) - model.scaling.scale(model.predict(d.phases, w))
        for d, w in zip(demos, model.prior.samples, strict=True)
    ]
    regression = regression_noise([d.times for d in demos], residuals)
    assert_allclose(model.scaling.unscale_var(regression.var), naive, rtol=1e-9)
    # What a model is given besides is how far a new interaction lies from the old ones.
    shown, duration = np.array([1.0, 1.0, 0.0, 0.0]), 1 / model.phase.nominal_velocity
    new = leave_one_out(model.layout, model.prior.samples, shown, duration).noise
    assert_allclose(model.scaling.unscale_var(model.noise.var), naive + model.scaling.unscale_var(new.var), rtol=1e-9)


def test_white_noise_is_found_again(rng):
    """Of T readings, a basis of B functions takes away B: the residual is (1 - B / T) of the noise."""
    std, phases = 0.05, np.linspace(0, 1, 100)
    smooth = Polynomial(7)(phases)
    values = [smooth @ rng.standard_normal((8, 4)) + std * rng.standard_normal((100, 4)) for _ in range(10)]
    model = taught(of([phases] * 10, values), basis=Polynomial(7))
    left = [v - model.predict(phases, weights) for v, weights in zip(values, model.prior.samples, strict=True)]
    found = regression_noise([phases] * 10, left)
    assert_allclose(found.var, std**2 * (1 - 8 / 100), rtol=5 * np.sqrt(2 / 1000))


def test_the_tempo_is_equation_2_12(rng):
    durations = [1.0, 2.0, 4.0]
    made = [np.linspace(10, 10 + duration, 30) for duration in durations]
    model = taught(of(made, [curves(np.linspace(0, 1, 30), rng.standard_normal(2)) for _ in made]))
    assert_allclose(model.phase.nominal_velocity, (1 + 1 / 2 + 1 / 4) / 3)
    assert_allclose(model.phase.mean, [0, (1 + 1 / 2 + 1 / 4) / 3])


def test_the_weights_are_those_of_ridge_regression(demos):
    """(ΦᵀΦ + T ridge I)(w - w̄) = Φᵀ(y - Φ w̄), a channel and a demonstration at a time; w̄ of all together alike."""
    ridge, basis = 1e-6, Sigmoid(6)
    model = taught(demos, basis=basis)
    for i in range(4):
        low, high = min(d.values[:, i].min() for d in demos), max(d.values[:, i].max() for d in demos)
        rows = [(basis(d.phases), (d.values[:, i] - low) / (high - low)) for d in demos]
        every, readings = np.concatenate([f for f, _ in rows]), np.concatenate([y for _, y in rows])
        pooled = np.linalg.solve(every.T @ every + len(every) * ridge * np.eye(6), every.T @ readings)
        for (f, y), found in zip(rows, model.prior.samples[:, model.layout.slices[i]], strict=True):
            own = pooled + np.linalg.solve(f.T @ f + len(f) * ridge * np.eye(6), f.T @ (y - f @ pooled))
            assert_allclose(found, own, atol=1e-8)


def test_the_mean_is_the_mean_of_the_demonstrations(rng):
    """And the doubt that is not noise is their standard deviation; for movements that the basis can describe."""
    phases = np.linspace(0, 1, 60)
    clean = [Polynomial(6)(phases) @ rng.standard_normal((7, 4)) for _ in range(5)]
    model = taught(of([2 * phases] * 5, clean), basis=Polynomial(6))
    assert_allclose(model.predict(phases), np.mean(clean, axis=0), atol=1e-4)
    noise_var = model.scaling.unscale_var(model.noise.var)
    std = np.sqrt(np.maximum(model.distribution(phases)[1] ** 2 - noise_var, 0))
    assert_allclose(std, np.std(clean, axis=0, ddof=1), atol=1e-3)


def test_the_spread_is_the_standard_deviation_of_all_readings(rng):
    demos = holes(rng)
    readings = np.concatenate([d.values for d in demos])
    for i, spread in enumerate(taught(demos).spread):
        assert_allclose(spread, np.std(readings[~np.isnan(readings[:, i]), i]))


def test_the_spread_of_an_angle_does_not_know_where_it_wraps(rng):
    times = np.linspace(0, 2, 40)
    angles = [0.3 * np.sin(times) + 0.05 * rng.standard_normal() for _ in range(4)]
    turned = [Rotation.from_euler("zx", np.stack([a, 0.1 * times], axis=1)) for a in angles]
    spreads = []
    for offset in (0.0, np.pi):
        flips = np.where(rng.random((4, 40)) < 0.5 * bool(offset), -1.0, 1.0)
        values = [
            np.column_stack([np.angle(np.exp(1j * (a + offset))), flip[:, None] * q.as_quat(), np.cos(times)])
            for a, q, flip in zip(angles, turned, flips, strict=True)
        ]
        names = ["arm", *(f"hand_q{axis}" for axis in "xyzw")]
        demos = inphase.Dataset.from_arrays([times] * 4, values, names, ["grip"], kinds={"arm": "angle"})
        spreads.append(taught(demos).spread)
    assert_allclose(spreads[0][0], np.std(angles))
    assert_allclose(spreads[1], spreads[0], rtol=1e-9)


# ---------------------------------------------------------------------------------------------------------- the units


def test_the_unit_of_a_channel_does_not_matter(demos):
    factors, offsets = np.array([1000.0, -2.0, 0.01, 180 / np.pi]), np.array([0.0, 5.0, -300.0, 90.0])
    # Polynomials can be constant: what is called zero, and which end is up, is nothing to them.
    model = taught(demos, basis=Polynomial(7))
    turned = of([d.times for d in demos], [d.values * factors + offsets for d in demos])
    other = taught(turned, basis=Polynomial(7))
    at = np.linspace(0, 1, 11)
    (mean, std), (moved, wider) = model.distribution(at), other.distribution(at)
    assert_allclose((moved - offsets) / factors, mean, atol=1e-4)
    assert_allclose(wider / np.abs(factors), std, rtol=1e-3)
    assert_allclose(other.spread / np.abs(factors), model.spread)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_unit_of_time_does_not_matter(order, rng):
    """A clock in milliseconds, and begun in another year, gives the same phases."""
    demos = dataset(rng, count=5, correlation_time=0.03)
    live = demos[4]
    phases = []
    for unit, origin in ((1.0, 0.0), (1000.0, 3e4)):
        clocks = of([unit * d.times + origin for d in demos], [d.values for d in demos])
        model = taught(clocks.without(4), phase=inphase.learn_phase(clocks.without(4), order=order))
        session = model.session(filter="bip")
        seen = zip(unit * live.times + origin, live.values[:, :2], strict=True)
        phases.append([(e.phase, e.phase_std) for e in (session.observe(t, y) for t, y in seen)])
    assert_allclose(phases[1], phases[0], atol=1e-6)


def test_channels_of_a_group_are_scaled_together(rng):
    demos = dataset(rng, count=4)
    names = ["hand_x", "hand_y"], ["tool_x", "turn"]
    data = inphase.Dataset.from_arrays([d.times for d in demos], [d.values for d in demos], *names)
    scaling = taught(data).scaling
    everything = np.concatenate([d.values for d in demos])
    assert_array_equal(scaling.low[:2], everything[:, :2].min(axis=0))
    assert_allclose(scaling.span[:2], [np.ptp(everything[:, :2], axis=0).max()] * 2)
    assert_array_equal(scaling.low[2:], everything[:, 2:].min(axis=0))


def test_a_channel_that_some_never_saw_costs_no_trust(rng):
    """The controlled channel follows from the partner; demonstrations without it prove nothing against that."""
    times = np.linspace(0, 2, 40)
    sizes = rng.uniform(0.5, 1.5, 16)
    values = [np.stack([a * np.sin(times), a * np.cos(times)], axis=1) for a in sizes]
    for curve in values[:6]:
        curve[:, 1] = np.nan
    trusts = [
        taught(inphase.Dataset.from_arrays([times] * len(part), part, ["hand"], ["robot"])).prior.trust
        for part in (values, values[6:])
    ]
    assert trusts == pytest.approx([1.0, 1.0], abs=0.05)
