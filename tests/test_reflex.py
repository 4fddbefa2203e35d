"""The reflex: what the partner's last moments say of the controlled one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from interactions import dataset, recording, shapes_unchecked, taught
from numpy.testing import assert_allclose

import inphase
from inphase.errors import OptionError
from inphase.reflex import Memory, Reflex
from inphase.training.reflex import LAGS, STRENGTH, learn_reflex


def chance_reflex(rng: np.random.Generator, observed: int = 3, controlled: int = 2, share: float = 0.5) -> Reflex:
    size = len(LAGS) * observed + controlled
    root = rng.normal(size=(size, size))
    return Reflex(LAGS, rng.normal(size=size), root @ root.T, observed, share, 0.3)


# ---------------------------------------------------------------------------------------------------- the regression


def test_the_answer_is_that_of_a_conditioned_gaussian(rng: np.random.Generator) -> None:
    reflex, seen = chance_reflex(rng), np.array([True, False, True])
    moments = rng.normal(size=(len(LAGS), 3))
    rows = [lag * 3 + f for lag in range(len(LAGS)) for f in (0, 2)]
    known = [moments[lag, f] for lag in range(len(LAGS)) for f in (0, 2)]
    precision = np.linalg.inv(reflex.cov[np.ix_(rows, rows)])
    expected = [reflex.mean[c] + reflex.cov[c, rows] @ precision @ (known - reflex.mean[rows]) for c in (12, 13)]
    assert_allclose(reflex.answer(moments, seen, reflex.gains(seen)), expected, rtol=1e-8)


def test_what_is_not_seen_has_no_influence(rng: np.random.Generator) -> None:
    reflex, seen = chance_reflex(rng), np.array([True, False, True])
    moments = rng.normal(size=(len(LAGS), 3))
    answer = reflex.answer(moments, seen, reflex.gains(seen))
    moments[:, 1] = 1e6
    assert_allclose(reflex.answer(moments, seen, reflex.gains(seen)), answer)
    size = len(reflex.mean)
    kept = np.array([i for i in range(size) if i >= 12 or i % 3 != 1])
    without = Reflex(LAGS, reflex.mean[kept], reflex.cov[np.ix_(kept, kept)], 2, 0.5, 0.3)
    both = np.array([True, True])
    assert_allclose(without.answer(moments[:, [0, 2]], both, without.gains(both)), answer)


def test_it_is_learned_as_ridge_regression(rng: np.random.Generator) -> None:
    """Where a robot follows a lagged, scaled partner, the regression is the ridge solution of the rows it was shown."""
    times = np.linspace(0, 3, 200)
    partners = [np.cumsum(rng.normal(size=(200, 2)), axis=0) / 10 for _ in range(5)]
    features = [np.column_stack([p, p @ [0.7, -0.2] + 0.1]) for p in partners]
    reflex = learn_reflex([times] * 5, features, 2)
    rows = []
    for f in features:
        now = np.linspace(0, 3, 100)
        for speed in (0.5, 1.0, 2.0):
            moments = [np.interp(now - lag * speed, times, f[:, k]) for lag in LAGS for k in (0, 1)]
            rows.append(np.column_stack([*moments, np.interp(now, times, f[:, 2])]))
    rows = np.concatenate(rows)
    off = (rows - rows.mean(0)) / rows.std(0)
    x, y = off[:, :-1], off[:, -1]
    beta = np.linalg.solve(x.T @ x + STRENGTH * len(x) * np.eye(x.shape[1]), x.T @ y)
    probe = rng.normal(size=(len(LAGS), 2))
    expected = rows[:, -1].mean() + rows[:, -1].std() * beta @ (
        (probe.ravel() - rows[:, :-1].mean(0)) / rows[:, :-1].std(0)
    )
    seen = np.array([True, True])
    assert_allclose(reflex.answer(probe, seen, reflex.gains(seen)), [expected], rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"share": 1.5}, "share"),
        ({"fade": 0.0}, "fade"),
        ({"lags": np.array([0.1, 0.2, 0.3, 0.4])}, "lags"),
        ({"observed": 9}, "features"),
        ({"mean": np.full(14, np.nan)}, "finite"),
    ],
)
def test_what_is_no_reflex_is_refused(change: dict, message: str, rng: np.random.Generator) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match=message):
        dataclasses.replace(chance_reflex(rng), **change)


# --------------------------------------------------------------------------------------------------------- the memory


def test_a_memory_is_linear_between_samples_and_holds_what_was_lost() -> None:
    memory = Memory.empty(2)
    for time, value in ((0.0, 1.0), (1.0, 3.0), (2.0, 2.0)):
        memory = memory.after(time, np.array([0]), np.array([value]), 10.0)
    memory = memory.after(1.5 + 1.0, np.array([1]), np.array([7.0]), 10.0)
    assert_allclose(memory.at(np.array([0.5, 1.5, 2.0, 2.5]))[:, 0], [2.0, 2.5, 2.0, 2.0])
    assert_allclose(memory.at(np.array([-5.0, 0.0, 2.5]))[:, 1], 7.0)  # before its first reading, as it first read
    assert_allclose(memory.at(np.array([-5.0]))[:, 0], 1.0)
    assert_allclose(memory.last_seen, [2.0, 2.5])


def test_a_memory_forgets_what_nobody_asks_for(rng: np.random.Generator) -> None:
    long, short = Memory.empty(3), Memory.empty(3)
    times = np.cumsum(rng.uniform(0.01, 0.2, 300))
    for time in times:
        seen = np.flatnonzero(rng.random(3) < 0.9)
        values = rng.normal(size=len(seen))
        long, short = long.after(time, seen, values, 1e9), short.after(time, seen, values, 0.5)
    assert len(short.times) <= 0.5 / 0.01 + 2
    asked = times[-1] - np.array([0.0, 0.1, 0.3, 0.5])
    assert_allclose(short.at(asked), long.at(asked))


def test_two_samples_of_one_time_are_one() -> None:
    both = Memory.empty(2).after(0.0, np.array([0, 1]), np.array([1.0, 2.0]), 1.0)
    apart = (
        Memory.empty(2).after(0.0, np.array([0]), np.array([1.0]), 1.0).after(0.0, np.array([1]), np.array([2.0]), 1.0)
    )
    for memory in (both, apart):
        assert_allclose(
            memory.after(1.0, np.array([0]), np.array([3.0]), 1.0).at(np.array([0.0, 0.5])), [[1, 2], [2, 2]]
        )


# --------------------------------------------------------------------------------------------------------- the session


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return taught(dataset(np.random.default_rng(3)))


def sharing(model: inphase.Model, share: float) -> inphase.Model:
    assert model.reflex is not None
    return dataclasses.replace(model, reflex=dataclasses.replace(model.reflex, share=share))


def played(model: inphase.Model, count: int = 40) -> inphase.Session:
    session, (times, values) = model.session(), recording(np.random.default_rng(9))
    for time, row in zip(times[:count], values[:count, :2], strict=True):
        session.observe(time, row)
    return session


def test_the_response_is_linear_in_the_share(model: inphase.Model) -> None:
    means = [played(sharing(model, share)).respond(samples=5).mean for share in (0.0, 0.4, 1.0)]
    assert_allclose(means[1], 0.6 * means[0] + 0.4 * means[2], atol=1e-12)
    assert np.abs(means[2] - means[0]).max() > 1e-4


def test_at_once_a_whole_share_is_the_regression_and_later_it_is_not(model: inphase.Model) -> None:
    session = played(sharing(model, 1.0))
    reflex, memory, time = session.model.reflex, session._memory, session.time
    assert reflex is not None
    assert time is not None
    seen = np.ones(2, dtype=bool)
    answer = np.zeros((1, 4))
    answer[0, 2:] = reflex.answer(memory.at(time - reflex.lags), seen, reflex.gains(seen))
    response, plain = session.respond(samples=20), played(sharing(model, 0.0)).respond(samples=20)
    assert_allclose(response.mean[0], model.to_channels(answer, np.zeros((1, 4)))[0][0, 2:], rtol=1e-9)
    moved = np.abs(response.mean - plain.mean)
    assert (np.diff(moved, axis=0) <= 1e-12).all()  # the further ahead the less


def test_out_of_sight_the_filter_answers_alone(model: inphase.Model) -> None:
    sessions = [played(sharing(model, share)) for share in (0.0, 1.0)]
    apart = []
    for _step in range(12):
        for session in sessions:
            session.observe(session.time + 0.08, [np.nan, np.nan])
        off, on = (session.respond(samples=1).mean for session in sessions)
        apart.append(np.abs(off - on).max())
    assert apart[0] > 0
    assert apart[-1] == 0


def test_a_controlled_channel_that_is_seen_is_left_to_the_filter(model: inphase.Model) -> None:
    responses = []
    for share in (0.0, 1.0):
        session, (times, values) = sharing(model, share).session(), recording(np.random.default_rng(9))
        for time, row in zip(times[:40], values[:40], strict=True):
            session.observe(time, {"reach": row[0], "lift": row[1], "grip": row[2]})
        responses.append(session.respond(samples=3).mean)
    grip, turn = (np.abs(responses[1] - responses[0])[:, i] for i in (0, 1))
    assert (grip == 0).all()
    assert turn[0] > 0
