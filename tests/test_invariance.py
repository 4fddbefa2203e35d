"""Invariance: what filters must not care about: unseen channels, order, units, clocks, rates, whole turns, signs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from interactions import CONTROLLED, NOISE_STD, OBSERVED, dataset, known_phase, recording, taught
from scipy.spatial.transform import Rotation

import inphase
from inphase.filters import FILTERS, rbpf
from inphase.noise import Noise

NAMES = pytest.mark.parametrize("name", sorted(FILTERS))
ALL = (*OBSERVED, *CONTROLLED)
RATE = 25.0  # [Hz]
MANY = {  # so many that chance is small beside doubt
    "bip": {},
    "ebip": {"members": 400},
    "particle": {"particles": 2000},
    "promp": {},
    "rbpf": {"particles": 2000},
}
Sample = Mapping[str, float] | np.ndarray


@pytest.fixture(scope="module")
def demos() -> inphase.Dataset:
    return dataset(np.random.default_rng(7), rate=RATE, correlation_time=0.05)


@pytest.fixture(scope="module")
def model(demos: inphase.Dataset) -> inphase.Model:
    return taught(demos)


@pytest.fixture(scope="module")
def live() -> tuple[np.ndarray, np.ndarray]:
    """More than half of an interaction that is in no data set."""
    times, values = recording(np.random.default_rng(99), rate=RATE, correlation_time=0.05)
    return times[:28], values[:28]


def named(values: np.ndarray, names: Sequence[str]) -> list[dict[str, float]]:
    """A sample {name: value} of every row of all channels."""
    return [{name: float(row[ALL.index(name)]) for name in names} for row in values]


def follow(
    model: inphase.Model, times: np.ndarray, samples: Sequence[Sample], filter: str, **options: object
) -> tuple[inphase.Session, np.ndarray, np.ndarray]:
    """The session, its estimates (T, 4: phase, its std, velocity, its std) and its log-likelihoods (T,)."""
    session = model.session(filter, seed=11, **options)
    estimates = [session.observe(t, sample) for t, sample in zip(times, samples, strict=True)]
    shown = [(e.phase, e.phase_std, e.phase_velocity, e.phase_velocity_std) for e in estimates]
    return session, np.array(shown), np.array([e.log_likelihood for e in estimates])


def answer(session: inphase.Session, channels: Sequence[str]) -> np.ndarray:
    """(S, 2, C) mean and std of a response, in the order of `channels`."""
    response = session.respond(lookahead=0.02, samples=9, channels=list(channels))
    order = [response.channels.index(name) for name in channels]
    return np.stack([response.mean[:, order], response.std[:, order]], axis=1)


def only(demos: inphase.Dataset, names: Sequence[str]) -> inphase.Dataset:
    """The data set of these channels, in this order."""
    columns = [demos.names.index(name) for name in names]
    return inphase.Dataset.from_arrays(
        [d.times for d in demos],
        [d.values[:, columns] for d in demos],
        [name for name in names if name in OBSERVED],
        [name for name in names if name in CONTROLLED],
    )


def same(got: np.ndarray, expected: np.ndarray, within: float = 1e-9) -> None:
    np.testing.assert_allclose(got, expected, rtol=within, atol=within)


# --------------------------------------------------------------------------------------------------------- masking


@NAMES
@pytest.mark.parametrize("how", ["NaN", "left out"])
@pytest.mark.parametrize("gone", ["lift", "turn"])
def test_a_channel_that_is_never_seen_need_not_be_there(
    name: str,
    how: str,
    gone: str,
    demos: inphase.Dataset,
    model: inphase.Model,
    live: tuple,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # rbpf leaves out directions in which all channels together hardly move; without one channel they are others.
    monkeypatch.setattr(rbpf, "VARIANCE_KEPT", 1.0)
    times, values = live
    kept = [channel for channel in ALL if channel != gone]
    shown = [channel for channel in ("reach", "lift", "turn") if channel != gone]
    samples = named(values, shown)
    # What is learned by holding out demonstrations depends on what else explains them: both get the same.
    rows = [ALL.index(channel) for channel in kept]
    noise = Noise(model.noise.var[rows], model.noise.correlation_time[rows])
    without = taught(only(demos, kept), noise=noise)
    without = dataclasses.replace(without, prior=dataclasses.replace(without.prior, trust=model.prior.trust))
    reduced = follow(without, times, samples, name)
    if how == "NaN":
        samples = [sample | {gone: np.nan} for sample in samples]
    whole = follow(model, times, samples, name)
    same(whole[1], reduced[1])
    same(whole[2], reduced[2])
    same(answer(whole[0], kept), answer(reduced[0], kept))


@NAMES
@pytest.mark.parametrize(("var", "time"), [(1e12, 1e-12), (1e-12, 1e6)])
def test_the_noise_of_a_channel_that_is_never_seen_is_never_asked(
    name: str, var: float, time: float, model: inphase.Model, live: tuple
) -> None:
    times, values = live
    garbage = [
        np.where(np.arange(4) == 1, g, own) for g, own in ((var, model.noise.var), (time, model.noise.correlation_time))
    ]
    other = dataclasses.replace(model, noise=Noise(*garbage))
    (one, estimates, scores), (two, others, other_scores) = (
        follow(m, times, named(values, ["reach"]), name) for m in (model, other)
    )
    np.testing.assert_array_equal(estimates, others)
    np.testing.assert_array_equal(scores, other_scores)
    kept = ["reach", "grip", "turn"]
    np.testing.assert_array_equal(answer(one, kept), answer(two, kept))


# ------------------------------------------------------------------------------------------------- order and units


def test_the_order_of_channels_is_nothing_to_bip(demos: inphase.Dataset, model: inphase.Model, live: tuple) -> None:
    times, values = live
    other = taught(only(demos, ["lift", "reach", "turn", "grip"]))
    one, estimates, scores = follow(model, times, list(values[:, :2]), "bip")
    two, others, other_scores = follow(other, times, list(values[:, [1, 0]]), "bip")
    same(others, estimates)
    same(other_scores, scores)
    same(answer(two, ALL), answer(one, ALL))


def test_the_order_of_channels_is_chance_to_ebip(demos: inphase.Dataset, model: inphase.Model, live: tuple) -> None:
    times, values = live
    other = taught(only(demos, ["lift", "reach", "turn", "grip"]))
    _, estimates, _ = follow(model, times, list(values[:, :2]), "ebip", members=1000)
    _, others, _ = follow(other, times, list(values[:, [1, 0]]), "ebip", members=1000)
    # The perturbations of Eq. 3.7 fall on other channels: two runs of 1000 members differ by their Monte-Carlo error,
    # sqrt(2 / 1000) of the std after one sample, a few times that after 28.
    assert (np.abs(others[:, 0] - estimates[:, 0]) < 0.3 * estimates[:, 1]).all()


@NAMES
def test_units_scale_what_is_answered_and_nothing_else(
    name: str, demos: inphase.Dataset, model: inphase.Model, live: tuple
) -> None:
    times, values = live
    factors, offsets = np.array([1000.0, 1.0, 100.0, 1.0]), np.array([250.0, 0.0, -30.0, 2.0])
    other_demos = inphase.Dataset.from_arrays(
        [d.times for d in demos], [d.values * factors + offsets for d in demos], OBSERVED, CONTROLLED
    )
    one, estimates, scores = follow(model, times, named(values, ALL[:3]), name)
    two, others, other_scores = follow(taught(other_demos), times, named(values * factors + offsets, ALL[:3]), name)
    same(others, estimates)
    # A density per millimetre is a thousandth of one per metre: one factor for each reading.
    same(other_scores, scores - np.log(1000.0 * 100.0))
    expected = answer(one, ALL)
    same(answer(two, ALL), np.stack([expected[:, 0] * factors + offsets, expected[:, 1] * factors], axis=1), 1e-7)


# ----------------------------------------------------------------------------------------------- samples and clocks


def test_a_sample_in_two_is_the_whole_sample(demos: inphase.Dataset, live: tuple) -> None:
    times, values = live
    model = taught(demos, phase=known_phase(0.4, start=0.0))
    whole = model.session("bip")
    parts = model.session("bip")
    for time, sample in zip(times, named(values, ALL[:3]), strict=True):
        once = whole.observe(time, sample)
        first = parts.observe(time, {"lift": sample["lift"]})
        second = parts.observe(time, {"reach": sample["reach"], "grip": sample["grip"]})
        same(first.log_likelihood + second.log_likelihood, once.log_likelihood)
        same(second.phase, once.phase)
    same(answer(parts, ALL), answer(whole, ALL))


@NAMES
def test_a_sample_in_two_is_nearly_the_whole_sample_where_the_phase_is_not_known(
    name: str, model: inphase.Model, live: tuple
) -> None:
    times, values = live
    options = {"members": 2000} if name == "ebip" else MANY[name]
    _, once, _ = follow(model, times, named(values, OBSERVED), name, **options)
    halves = [sample for row in named(values, OBSERVED) for sample in ({"lift": row["lift"]}, {"reach": row["reach"]})]
    _, twice, _ = follow(model, np.repeat(times, 2), halves, name, **options)
    # What is left is where the observation function is linearised, and chance.
    assert (np.abs(twice[1::2, 0] - once[:, 0]) < 0.3 * once[:, 1]).all()


@pytest.mark.parametrize(("seed", "learned"), [(1, True), (2, False)], ids=["noise learned", "noise known"])
@NAMES
def test_the_rate_of_a_recording_does_not_matter(name: str, seed: int, learned: bool) -> None:
    rng = np.random.default_rng(seed)
    demos = dataset(rng, duration=1.0, rate=120.0, correlation_time=0.06)
    model = taught(demos)
    if not learned:
        model = dataclasses.replace(model, noise=Noise((NOISE_STD / model.scaling.span) ** 2, np.full(4, 0.06)))
    times, values = recording(rng, duration=1.1, rate=120.0, correlation_time=0.06)
    if (
        name == "particle"
    ):  # its weights stay those of demonstrations, and which is nearest to another partner is chance
        times, values = demos[0].times, demos[0].values
    at = {step: follow(model, times[::step], list(values[::step, :2]), name, **MANY[name])[1] for step in (1, 2, 4)}
    fastest = at[1][::4]
    for step in (2, 4):
        slower = at[step][:: 4 // step]
        assert (np.abs(slower[:, 0] - fastest[:, 0]) <= np.minimum(slower[:, 1], fastest[:, 1])).all()
        # As sure of itself, too: four times the samples do not make twice the certainty. The start is much the same.
        phase_std, velocity_std = (slower[10:, [1, 3]] / fastest[10:, [1, 3]]).T
        # From tick to tick an alignment may go at any slope: right after a sample that says much it is surer than else.
        assert ((phase_std > (0.6 if name == "promp" else 0.7)) & (phase_std < 1.4)).all()
        assert 0.7 < np.median(velocity_std) < 1.4
    truth = times[::4] / times[-1]
    assert np.abs(fastest[:, 0] - truth).max() < 0.1


@NAMES
def test_when_a_clock_began_does_not_matter(name: str, model: inphase.Model, live: tuple) -> None:
    times, values = np.arange(24) / 32, live[1][:24, :2]  # these times lose no digit beside 100,000 s
    one, estimates, scores = follow(model, times, list(values), name)
    two, others, other_scores = follow(model, times + 1e5, list(values), name)
    np.testing.assert_array_equal(others, estimates)
    np.testing.assert_array_equal(other_scores, scores)
    early, late = one.respond(), two.respond()
    np.testing.assert_array_equal(late.mean, early.mean)
    same(late.times - 1e5, early.times)


# ------------------------------------------------------------------------------------------------ turns and signs

HAND = ("heading", "palm_qx", "palm_qy", "palm_qz", "palm_qw")
ROBOT = ("grip", "wrist")
KINDS = {"heading": "angle", "wrist": "angle"}  # the quaternion is found by its names


def rotation(rng: np.random.Generator, rate: float = RATE) -> tuple[np.ndarray, np.ndarray]:
    """A hand that turns more than all the way round, its palm nearly so about a slanted axis, and a robot beside it."""
    times = np.arange(round(2 * rate) + 1) / rate
    phases, far = times / times[-1], 1 + 0.1 * rng.standard_normal()
    smooth = phases**3 * (10 - 15 * phases + 6 * phases**2)
    heading = 2.0 + 7.0 * far * smooth
    palm = Rotation.from_rotvec(np.outer(4.5 * far * np.sin(0.5 * np.pi * phases), [0.6, 0.0, 0.8])).as_quat()
    grip, wrist = far * np.sin(np.pi * phases), 3.0 - 2.0 * far * smooth
    values = np.column_stack([heading, palm, grip, wrist]) + 0.01 * rng.standard_normal((len(times), 7))
    values[:, 1:5] /= np.linalg.norm(values[:, 1:5], axis=1, keepdims=True)
    values[:, [0, 6]] = (values[:, [0, 6]] + np.pi) % (2 * np.pi) - np.pi
    return times, values


def turning(recordings: Sequence[tuple[np.ndarray, np.ndarray]]) -> inphase.Dataset:
    return inphase.Dataset.from_arrays([t for t, _ in recordings], [v for _, v in recordings], HAND, ROBOT, kinds=KINDS)


@pytest.fixture(scope="module")
def turns() -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(3)
    return [rotation(rng) for _ in range(8)]


@NAMES
def test_whole_turns_change_nothing(name: str, turns: list, rng: np.random.Generator) -> None:
    model, (times, values) = taught(turning(turns)), rotation(rng)
    turned = values.copy()
    turned[:, 0] += 2 * np.pi * rng.integers(-5, 6, len(times))
    (one, estimates, scores), (two, others, other_scores) = (
        follow(model, times, list(v[:, :5]), name) for v in (values, turned)
    )
    same(others, estimates)
    same(other_scores, scores)
    np.testing.assert_allclose(two.respond().mean, one.respond().mean, atol=1e-9)


@NAMES
def test_the_sign_of_a_quaternion_changes_nothing(name: str, turns: list, rng: np.random.Generator) -> None:
    times, values = rotation(rng)
    signs = rng.choice([-1.0, 1.0], (len(times), 1))
    flipped = [(t, v * np.concatenate([[1], np.full(4, rng.choice([-1, 1])), [1, 1]])) for t, v in turns]
    model, other = taught(turning(turns)), taught(turning(flipped))
    one, estimates, scores = follow(model, times, list(values[:, :5]), name)
    two, others, other_scores = follow(
        model, times, [np.concatenate([v[:1], s * v[1:5]]) for v, s in zip(values, signs, strict=True)], name
    )
    np.testing.assert_array_equal(others, estimates)
    np.testing.assert_array_equal(other_scores, scores)
    np.testing.assert_array_equal(two.respond().mean, one.respond().mean)
    _, learned, _ = follow(other, times, list(values[:, :5]), name)
    same(learned, estimates)


@NAMES
def test_a_hand_that_turns_is_followed(name: str, turns: list, rng: np.random.Generator) -> None:
    # The weights of a bootstrap filter stay those of demonstrations: it knows no other partner.
    model, (times, values) = taught(turning(turns)), turns[0] if name == "particle" else rotation(rng)
    session, estimates, _ = follow(model, times[:30], list(values[:30, :5]), name)
    assert np.abs(estimates[10:, 0] - (times / times[-1])[10:30]).max() < 0.05
    # The last two fifths, in phase with what really came; the palm is compared as rotations.
    response = session.respond(samples=21, channels=[*ROBOT, *HAND])
    real = np.stack([np.interp(response.phases, times / times[-1], np.unwrap(v)) for v in values.T], axis=1)
    got = dict(zip(response.channels, response.mean.T, strict=True))
    angle_error = np.angle(np.exp(1j * (np.stack([got["heading"], got["wrist"]]) - real[:, [0, 6]].T)))
    assert np.abs(angle_error).max() < 0.25
    assert np.abs(got["grip"] - real[:, 5]).max() < 0.1
    palm = np.stack([got[channel] for channel in HAND[1:]], axis=1)
    nearest = values[np.abs(times / times[-1] - response.phases[:, None]).argmin(1), 1:5]
    off = (Rotation.from_quat(palm).inv() * Rotation.from_quat(nearest)).magnitude()
    assert off.max() < 0.25


@NAMES
def test_half_a_quaternion_and_an_infinite_angle_were_not_seen(
    name: str, turns: list, rng: np.random.Generator
) -> None:
    model, (times, values) = taught(turning(turns)), rotation(rng)
    blind, odd = values[:12, :5].copy(), values[:12, :5].copy()
    blind[4], blind[7, 1:5] = np.nan, np.nan
    odd[4], odd[7, 3] = [np.inf, 0.1, np.inf, 0.1, 0.1], np.nan
    (_, estimates, scores), (_, others, other_scores) = (follow(model, times[:12], list(v), name) for v in (blind, odd))
    np.testing.assert_array_equal(others, estimates)
    np.testing.assert_array_equal(other_scores, scores)
