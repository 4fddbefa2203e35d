"""The reflex: what the partner's last moments say of the controlled one."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from interactions import dataset, recording, shapes_unchecked
from numpy.testing import assert_allclose

import inphase
from inphase.errors import OptionError
from inphase.reflex import Memory, Reflex
from inphase.session import NOW
from inphase.training import reflex as training
from inphase.training.reflex import LAGS, learn_reflex

# ---------------------------------------------------------------------------------------------------- the regression


def chance_reflex(rng: np.random.Generator, observed: int = 3, controlled: int = 2, **changes: Any) -> Reflex:
    count = 30
    parts: dict[str, Any] = {
        "lags": LAGS,
        "centre": rng.normal(size=(len(LAGS), observed)),
        "scale": rng.uniform(0.5, 2.0, len(LAGS)),
        "places": rng.normal(size=(count, len(LAGS) * observed)),
        "gains": rng.normal(size=(count, controlled)),
        "mean": rng.normal(size=controlled),
        "error_var": rng.uniform(0.5, 2.0, (count, controlled)),
        "width": 0.7,
        "trend": 0.3,
        "weight": 1.0,
        "fade": 0.3,
    }
    return Reflex(**parts | changes)


def partners(rng: np.random.Generator, count: int = 5) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Times and features of demonstrations: two of a partner who wanders, one of a robot who answers."""
    times = np.linspace(0, 3, 200)
    shown = [np.cumsum(rng.normal(size=(200, 2)), axis=0) / 10 for _ in range(count)]
    return [times] * count, [np.column_stack([p, np.sin(2 * p[:, 0]) - 0.5 * p[:, 1]]) for p in shown]


def pose_and_change(moments: np.ndarray, reflex: Reflex) -> np.ndarray:
    """(P,) a place, written out: where each feature is, and how far it came since the lag before."""
    place = []
    for lag in range(len(LAGS)):
        for feature in range(moments.shape[1]):
            raw = moments[0, feature] if lag == 0 else moments[lag - 1, feature] - moments[lag, feature]
            place.append((raw - reflex.centre[lag, feature]) / reflex.scale[lag])
    return np.array(place) / np.sqrt(len(place))


def test_the_answer_is_kernel_ridge_regression(rng: np.random.Generator) -> None:
    reflex, moments = chance_reflex(rng), rng.normal(size=(len(LAGS), 3))
    here = pose_and_change(moments, reflex)
    expected = reflex.mean.copy()
    for there, gain in zip(reflex.places, reflex.gains, strict=True):
        apart = float(((here - there) ** 2).sum())
        expected += (1 / (1 + apart / (2 * 0.7**2)) + 0.3 * float(here @ there)) * gain
    assert_allclose(reflex.answer(moments)[0], expected, rtol=1e-9)


def test_with_a_kernel_that_tells_no_places_apart_it_is_linear_ridge_regression(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The primal form, with a constant beside the place: the same regression, in six numbers instead of hundreds."""
    monkeypatch.setattr(training, "WIDTHS", (1e5,))
    monkeypatch.setattr(training, "TRENDS", (3.0,))
    monkeypatch.setattr(training, "RIDGES", (0.3,))
    reflex = learn_reflex(*partners(rng), 2)
    inputs = np.column_stack([np.ones(len(reflex.places)), np.sqrt(3.0) * reflex.places])
    # The answers it learned are its own gains, back through the kernel and the ridge.
    kernel = 1.0 + 3.0 * reflex.places @ reflex.places.T
    off = (kernel + 0.3 * np.eye(len(kernel))) @ reflex.gains
    beta = np.linalg.solve(inputs.T @ inputs + 0.3 * np.eye(5), inputs.T @ off)
    for _ in range(5):
        moments = rng.normal(size=(len(LAGS), 2))
        here = np.concatenate([[1.0], np.sqrt(3.0) * pose_and_change(moments, reflex)])
        assert_allclose(reflex.answer(moments)[0], reflex.mean + here @ beta, atol=1e-5)


def test_its_error_is_that_of_demonstrations_it_has_not_seen(rng: np.random.Generator) -> None:
    """Brute force: learn the gains anew without each demonstration, and ask at its places."""
    reflex = learn_reflex(*partners(rng), 2)
    alike = np.array(
        [[1 / (1 + ((a - b) ** 2).sum() / (2 * reflex.width**2)) + reflex.trend * a @ b for b in reflex.places[::7]]
         for a in reflex.places[::7]]
    )  # fmt: skip
    count = len(reflex.places) // 5
    of = np.repeat(np.arange(5), count)[::7]
    off = rng.normal(size=(len(alike), 1))
    inverse = np.linalg.inv(alike + 0.5 * np.eye(len(alike)))
    found = training._held_out(inverse, off, of)
    for one in range(5):
        others, rows = of != one, of == one
        gains = np.linalg.solve(alike[np.ix_(others, others)] + 0.5 * np.eye(others.sum()), off[others])
        assert_allclose(found[rows], off[rows] - alike[np.ix_(rows, others)] @ gains, atol=1e-9)


def test_it_follows_what_is_not_linear(rng: np.random.Generator) -> None:
    """A robot whose hand is the sine of the partner's: new interactions are answered, and the error is as foretold."""
    times, features = partners(rng, count=20)
    reflex = learn_reflex(times[:15], features[:15], 2)
    errors, foretold, truths = [], [], []
    for curve in features[15:]:
        for now in np.linspace(0.3, 3, 50):
            at = [[np.interp(now - lag, times[0], curve[:, f]) for f in (0, 1)] for lag in LAGS]
            mean, var = reflex.answer(np.array(at))
            truths.append(np.interp(now, times[0], curve[:, 2]))
            errors.append(mean[0] - truths[-1])
            foretold.append(var[0])
    assert np.mean(np.square(errors)) < 0.1 * np.var(truths)
    assert 0.2 < np.mean(np.square(errors)) / np.mean(foretold) < 5
    nowhere = reflex.answer(np.full((len(LAGS), 2), 50.0))[1]
    assert_allclose(nowhere, reflex.error_var.mean(0), rtol=1e-2)  # where nobody ever was, the error of everywhere


def test_speed_is_no_place(rng: np.random.Generator) -> None:
    """What is learned of a movement holds when it is slower or faster."""
    times, features = partners(rng, count=12)
    reflex = learn_reflex(times, features, 2)
    for speed in (0.6, 1.0, 1.7):
        error = []
        for now in np.linspace(0.5, 3, 60):
            at = [[np.interp(now - speed * lag, times[0], features[3][:, f]) for f in (0, 1)] for lag in LAGS]
            error.append(reflex.answer(np.array(at))[0][0] - np.interp(now, times[0], features[3][:, 2]))
        assert np.mean(np.square(error)) < 0.02


def test_channels_that_a_demonstration_lacks_stand_still_where_they_usually_are(rng: np.random.Generator) -> None:
    times, features = partners(rng)
    features[2][:, 1] = np.nan
    reflex = learn_reflex(times, features, 2)
    usual = np.nanmean(np.concatenate(features)[:, 1])
    raw = reflex.places.reshape(5, -1, len(LAGS), 2) * 2 * reflex.scale[:, None] + reflex.centre
    assert_allclose(raw[2, :, 0, 1], usual, rtol=1e-9)
    assert_allclose(raw[2, :, 1, 1], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weight": -1.0}, "weight"),
        ({"fade": 0.0}, "fade"),
        ({"width": 0.0}, "width"),
        ({"trend": np.inf}, "trend"),
        ({"lags": np.array([0.1, 0.2])}, "lags"),
        ({"centre": np.zeros((2, 9))}, "shapes"),
        ({"mean": np.full(2, np.nan)}, "finite"),
        ({"error_var": np.full((30, 2), -1.0)}, "negative"),
        ({"scale": np.zeros(2)}, "positive"),
    ],
)
def test_what_is_no_reflex_is_refused(change: dict, message: str, rng: np.random.Generator) -> None:
    with shapes_unchecked(), pytest.raises(OptionError, match=message):
        chance_reflex(rng, **change)


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
    return inphase.fit(dataset(np.random.default_rng(3)), calibrate=False)


def weighing(model: inphase.Model, weight: float) -> inphase.Model:
    assert model.reflex is not None
    return dataclasses.replace(model, reflex=dataclasses.replace(model.reflex, weight=weight))


def played(model: inphase.Model, count: int = 40, **seen: Any) -> inphase.Session:
    session, (times, values) = model.session(**seen), recording(np.random.default_rng(9))
    for time, row in zip(times[:count], values[:count, :2], strict=True):
        session.observe(time, row)
    return session


def last_moments(session: inphase.Session, count: int = 40) -> np.ndarray:
    """(L, 2) what the partner read at each lag, in scaled units."""
    times, values = recording(np.random.default_rng(9))
    lagged = [[np.interp(times[count - 1] - lag, times, values[:, f]) for f in (0, 1)] for lag in LAGS]
    return np.array([session.model.scaling.scale(np.array([*row, 0.0, 0.0]))[:2] for row in lagged])


@pytest.mark.parametrize("weight", [0.0, 0.3, 1.0, 1e9])
def test_filter_and_regression_count_by_their_precision(model: inphase.Model, weight: float) -> None:
    session = played(weighing(model, weight))
    assert session.model.reflex is not None
    answer, error_var = session.model.reflex.answer(last_moments(session))
    believed, var = (part[0] for part in session.belief.trajectory(NOW, np.array([2, 3])))
    var = var + model.noise.var[2:]
    precision = np.array([1 / var, weight / error_var])
    share = precision / precision.sum(0)
    mean, span = share[0] * believed + share[1] * answer, model.scaling.span[2:]
    of_two = share[0] * (var + (believed - mean) ** 2) + share[1] * (error_var + (answer - mean) ** 2)
    response = session.respond(samples=1)
    assert_allclose(response.mean[0], model.scaling.low[2:] + span * mean, rtol=1e-6)
    assert_allclose(response.std[0], span * np.sqrt(of_two), rtol=1e-4)


def test_the_further_ahead_the_less_it_says(model: inphase.Model) -> None:
    response, plain = (played(weighing(model, w)).respond(samples=20) for w in (1.0, 0.0))
    moved = np.abs(response.mean - plain.mean)
    assert moved[0].max() > 1e-5
    assert (np.diff(moved, axis=0) <= 1e-12).all()
    assert (np.abs(response.std - plain.std) / plain.std)[-1].max() < 0.05


def test_a_response_that_begins_later_is_told_as_much_of_each_moment(model: inphase.Model) -> None:
    """What is said of a moment does not depend on which others are asked for."""
    session = played(weighing(model, 1.0))
    whole = session.respond(samples=41)
    late = session.respond(lookahead=float(whole.phases[10] - whole.phases[0]), samples=31)
    assert_allclose(late.phases, whole.phases[10:], atol=1e-9)
    assert_allclose(late.mean, whole.mean[10:], atol=0.02)


def test_out_of_sight_the_filter_answers_alone_in_time(model: inphase.Model) -> None:
    sessions = [played(weighing(model, weight)) for weight in (0.0, 1.0)]
    apart = []
    for _step in range(30):
        for session in sessions:
            session.observe(session.time + 0.08, [np.nan, np.nan])
        off, on = (session.respond(samples=1) for session in sessions)
        apart.append(np.abs(on.mean - off.mean).max())
    assert apart[0] > 1e-4
    assert apart[-1] < 1e-3 * apart[0]
    assert_allclose(on.std, off.std, rtol=1e-2)


def test_a_controlled_channel_that_is_seen_is_left_to_the_filter(model: inphase.Model) -> None:
    responses = []
    for weight in (0.0, 1.0):
        session, (times, values) = weighing(model, weight).session(), recording(np.random.default_rng(9))
        for time, row in zip(times[:40], values[:40], strict=True):
            session.observe(time, {"reach": row[0], "lift": row[1], "grip": row[2]})
        responses.append(session.respond(samples=3).mean)
    grip, turn = (np.abs(responses[1] - responses[0])[:, i] for i in (0, 1))
    assert (grip == 0).all()
    assert turn[0] > 0


def test_a_channel_out_of_sight_stands_where_it_is_believed_to_be(model: inphase.Model) -> None:
    """What it read before it was lost is forgotten, and it counts for as much as is seen."""
    sessions = []
    for lost in (0.0, 0.3):
        session, (times, values) = weighing(model, 1.0).session(), recording(np.random.default_rng(9))
        for i, (time, row) in enumerate(zip(times[:40], values[:40], strict=True)):
            session.observe(time, {"reach": row[0]} if i else {"reach": row[0], "lift": row[1] + lost})
        sessions.append(session)
    assert sessions[0].model.reflex is not None
    session = sessions[0]
    believed = session.belief.trajectory(NOW, np.array([0, 1, 2, 3]))
    moments = last_moments(session)
    velocity = session.belief.phase_mean[1]
    for i, lag in enumerate(LAGS):
        then = session.belief.phase_mean[0] - velocity * lag
        moments[i, 1] = model.layout.predict(np.array([then]), session.belief.weights_mean)[0, 1]
    answer, error_var = session.model.reflex.answer(moments)
    mean, var = believed[0][0, 2:], believed[1][0, 2:] + model.noise.var[2:]
    share = 0.5 * var / (0.5 * var + error_var)
    expected = model.scaling.low[2:] + model.scaling.span[2:] * (mean + share * (answer - mean))
    # The believed curve is averaged over particles, which is not quite that of the mean phase.
    assert_allclose(session.respond(samples=1).mean[0], expected, atol=5e-3)


def test_before_anything_is_seen_there_is_no_reflex(model: inphase.Model) -> None:
    fresh = [weighing(model, weight).session().respond(samples=3).mean for weight in (0.0, 1.0)]
    assert_allclose(fresh[0], fresh[1], atol=0)
