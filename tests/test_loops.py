"""The filters against the plain loops of the benchmark: the same equations and draws, so the same numbers."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from interactions import chance_model, dataset, phase_model, taught

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from loops import LOOPS

import inphase
from inphase.basis import Gaussian
from inphase.filters import FILTERS, make
from inphase.observation import NOTHING, Observation

STEPS = 15
COUNT = {"ebip": {"members": 12}, "particle": {"particles": 60}, "rbpf": {"particles": 40}}


@pytest.fixture(scope="module")
def learned() -> inphase.Model:
    return taught(dataset(np.random.default_rng(0)), basis=Gaussian(8))


def samples(model: inphase.Model, rng: np.random.Generator) -> list[tuple[Observation, float]]:
    """A partner to the end: the first two samples at once, then some channels missing, in one all; two are odd."""
    weights, phase, count, steps = model.prior.draw(1, rng)[0], 0.05, model.layout.count, []
    for i in range(STEPS):
        dt = 0.0 if i < 2 else rng.exponential(0.09) / model.phase.nominal_velocity
        phase += dt * model.phase.nominal_velocity
        features = np.arange(count) if i < 2 else np.flatnonzero(rng.random(count) < 0.6)
        noise_var = model.noise.var[features] * rng.uniform(1, 10, len(features))
        odd = 0.5 * (i in (4, 9))  # of the scaled range
        off = odd + np.sqrt(noise_var) * rng.standard_normal(len(features))
        values = model.layout.predict(np.array([min(phase, 1.0)]), weights, features)[0] + off
        steps.append((Observation(features, values, noise_var) if i != 6 else NOTHING, dt))
    return steps


def assert_equal_all_along(model: inphase.Model, name: str, seed: int) -> None:
    """After every step, to a share of the largest entry, or to rounding where few particles leave no doubt at all."""
    options = COUNT.get(name, {})
    filter, loop = make(name, model, **options), LOOPS[name](model, *options.values())
    one, other = (np.random.default_rng(seed) for _ in range(2))
    belief, state = filter.init(one), loop.init(other)
    for step, (seen, dt) in enumerate(samples(model, np.random.default_rng(100 + seed))):
        belief, info = filter.step(belief, seen, dt, one)
        state = loop.step(state, seen, dt, other)
        assert info.healthy
        got = belief.phase_mean, belief.phase_cov, belief.weights_mean
        for what, a, b in zip(("phase mean", "phase covariance", "weights"), got, loop.believed(state), strict=True):
            share = 1e-8 * np.abs(b).max() + 1e-15
            np.testing.assert_allclose(a, b, rtol=0, atol=share, err_msg=f"{what} at step {step}")
    assert one.random() == other.random()  # as many draws


def test_every_filter_has_a_loop() -> None:
    assert sorted(LOOPS) == sorted(FILTERS)


@pytest.mark.parametrize("name", sorted(LOOPS))
@pytest.mark.parametrize("seed", [0, 1])
def test_a_filter_is_its_loop(learned: inphase.Model, name: str, seed: int) -> None:
    assert_equal_all_along(learned, name, seed)


@pytest.mark.parametrize("name", sorted(LOOPS))
@pytest.mark.parametrize("seed", [0, 1])
def test_with_several_bases_too(name: str, seed: int) -> None:
    model = chance_model(np.random.default_rng(seed), phase_model(), white=False)
    assert_equal_all_along(model, name, seed)


@pytest.mark.parametrize("name", ["bip", "ebip", "particle"])
@pytest.mark.parametrize("order", [0, 2])
def test_with_another_order_of_phase(name: str, order: int) -> None:
    assert_equal_all_along(chance_model(np.random.default_rng(0), phase_model(order)), name, 0)
