"""The report's numbers: clouds, densities and correlations are the belief's own; an account is the run it tells of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from interactions import chance_model, dataset, phase_model, taught
from numpy.testing import assert_allclose, assert_array_equal
from rigs import bench

import inphase
from inphase.channels import Kind, make_channels
from inphase.filters.belief import GaussianBelief
from inphase.filters.cloud import Cloud, cloud
from inphase.replay import identical, provenance_of, session_of, steps
from inphase.report import glimpse as looking
from inphase.report.account import FRAMES, SAMPLES, account_of_demonstration, account_of_recording, frame_steps
from inphase.report.glimpse import PHASES, Lens
from inphase.report.steady import beside, steady
from inphase.report.summary import summarise

FILTERS = {
    "bip": ("bip", {}),
    "ebip": ("ebip", {"members": 60}),
    "particle": ("particle", {"particles": 150}),
    "particle, gaussian": ("particle", {"particles": 150, "prior": "gaussian"}),
    "promp": ("promp", {}),
    "promp, candidates": ("promp", {"phase": "candidates", "tempos": 9}),
    "rbpf": ("rbpf", {"particles": 60}),
}


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return taught(dataset(np.random.default_rng(0)))


@pytest.fixture(scope="module")
def episode() -> inphase.Demonstration:
    return dataset(np.random.default_rng(7), count=1, rate=20.0)[0]


def midway(model, kind, episode, share=0.5):
    """A belief after a share of an episode."""
    name, options = FILTERS[kind]
    session = model.session(name, 3, **options)
    for time, values in zip(episode.times, episode.values, strict=True):
        if time <= share * episode.times[-1]:
            session.observe(float(time), values[: len(model.observed)])
    return session.belief


def chance_belief(kind, order=1, periodic=False):
    """A belief of a model of chance, after a few readings."""
    rng = np.random.default_rng(order)
    made = chance_model(rng, phase_model(order, periodic))
    name, options = FILTERS[kind]
    session = made.session(name, 1, **options)
    for i in range(6):
        session.observe(0.05 * i, made.predict(np.array([0.05 + 0.04 * i]))[0, :2] + rng.normal(scale=0.1, size=2))
    return session.belief


def moments(belief):
    """Mean (B,) and covariance (B, B) of the weights, from what the belief itself is made of; no cloud is asked."""
    model, size = belief.model, len(belief.model.phase.mean)
    if hasattr(belief, "state_moments"):
        mean, cov = belief.state_moments
        return mean[size:], cov[size:, size:]
    if hasattr(belief, "timing"):
        shares, means, covs, rows = belief.timing.weights, belief.weights.means, belief.weights.covs, model.prior.factor
    else:
        shares, means, covs, rows = belief.weights, belief.means, belief.covs, belief.directions.rows
    if len(means) == 1:
        shares = np.ones(1)
    each = [model.prior.mean + m @ rows for m in means]
    mean = sum(share * m for share, m in zip(shares, each, strict=True))
    cov = np.zeros((len(mean), len(mean)))
    for share, m, c in zip(shares, each, covs, strict=True):
        cov += share * (rows.T @ c @ rows + np.outer(m - mean, m - mean))
    return mean, cov


def directions_of(size, count=5):
    """Orthonormal rows of chance: not those in which any filter thinks."""
    return np.linalg.qr(np.random.default_rng(8).standard_normal((size, count)))[0].T


# ---------------------------------------------------------------------------------------------------------- the clouds


def spread_of(seen: Cloud) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of phase and tempo of a mixture."""
    mean = seen.weights @ seen.moving
    return mean, seen.weights @ ((seen.moving - mean) ** 2 + seen.moving_var)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("trained", [True, False], ids=["trained", "chance"])
def test_a_cloud_has_the_moments_of_its_belief(kind, trained, model, episode):
    belief = midway(model, kind, episode, 0.1) if trained else chance_belief(kind)
    directions = directions_of(belief.model.layout.size)
    seen = cloud(belief, directions)
    assert_allclose(seen.weights.sum(), 1)
    # an ensemble's covariance is that of a sample, over E - 1; its cloud holds the members as they are
    few = 1 - 1 / len(belief.members) if kind == "ebip" else 1.0
    mean, cov = moments(belief)
    own_mean, own_cov = seen.coordinate_moments
    scale = np.sqrt(np.diag(directions @ belief.model.prior.cov @ directions.T)).max()
    assert np.diag(cov).max() > 1e-6 * scale**2  # there is something to compare
    assert_allclose(own_mean, (mean - belief.model.prior.mean) @ directions.T, rtol=1e-7, atol=1e-7 * scale)
    assert_allclose(own_cov, few * directions @ cov @ directions.T, rtol=1e-6, atol=1e-7 * scale**2)
    moving_mean, moving_var = spread_of(seen)
    assert_allclose(moving_mean, belief.phase_mean[:2], rtol=1e-9)
    assert_allclose(moving_var, few * np.diag(belief.phase_cov)[:2], rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("order", [0, 2])
@pytest.mark.parametrize("kind", ["bip", "ebip", "particle"])
def test_phase_priors_of_other_orders_are_clouds_too(kind, order):
    belief = chance_belief(kind, order)
    mean, var = spread_of(cloud(belief, directions_of(belief.model.layout.size)))
    few = 1 - 1 / len(belief.members) if kind == "ebip" else 1.0
    assert_allclose(mean[0], belief.phase_mean[0], rtol=1e-9)
    assert_allclose(var[0], few * belief.phase_cov[0, 0], rtol=1e-7, atol=1e-12)
    if order == 0:  # without a tempo of its own: that of the demonstrations, and no doubt about it
        assert (mean[1], var[1]) == (pytest.approx(belief.model.phase.nominal_velocity), pytest.approx(0, abs=1e-20))
    else:
        assert_allclose([mean[1], var[1]], [belief.phase_mean[1], few * belief.phase_cov[1, 1]], rtol=1e-7)


def test_what_is_no_belief_has_no_cloud(model):
    with pytest.raises(Exception, match="belief") as error:
        cloud("nothing", directions_of(model.layout.size))
    assert not isinstance(error.value, AttributeError)


# --------------------------------------------------------------------------------------------------------- the glimpses


def test_a_lens_looks_along_the_principal_components_of_the_prior(model):
    lens = Lens.of(model)
    value, vector = np.linalg.eigh(model.prior.cov)
    value, vector = value[::-1][: len(lens.directions)], vector[:, ::-1].T[: len(lens.directions)]
    assert_allclose(lens.directions @ lens.directions.T, np.eye(len(lens.directions)), atol=1e-9)
    assert_allclose(np.abs((lens.directions * vector).sum(1)), 1, rtol=1e-6)  # the same but for the sign
    assert_allclose(lens.shares, value / np.trace(model.prior.cov), rtol=1e-9)
    assert lens.shares.sum() >= 0.99 > lens.shares[:-1].sum()
    own = (model.prior.samples - model.prior.samples.mean(0)) @ lens.directions[:2].T
    assert_allclose(lens.demonstrations, own, atol=1e-9)


@pytest.mark.parametrize("kind", FILTERS)
def test_densities_hold_all_and_stand_where_the_belief_is(kind, model, episode):
    lens, before = Lens.of(model), -1.0
    for share in (0.3, 0.5, 0.7):
        belief = midway(model, kind, episode, share)
        seen = lens.look(belief)
        mean, std = belief.phase_mean[:2], np.sqrt(np.diag(belief.phase_cov))[:2]
        for density, grid, m, s in zip(
            (seen.phase_density, seen.tempo_density), (lens.phases, lens.tempos), mean, std, strict=True
        ):
            assert_allclose(np.trapezoid(density, grid), 1, atol=0.01)
            step = grid[1] - grid[0]
            centre = np.trapezoid(density * grid, grid)
            assert abs(centre - m) < 0.5 * step
            assert s - step < np.sqrt(np.trapezoid(density * (grid - centre) ** 2, grid)) < 1.5 * s + step
        assert seen.phase_density.argmax() / (PHASES - 1) > before  # it goes on as the belief does
        before = seen.phase_density.argmax() / (PHASES - 1)


def test_the_densities_of_a_gaussian_are_gaussian(model):
    from scipy.stats import norm

    lens, typical = Lens.of(model), model.phase.nominal_velocity
    rank = len(model.prior.factor)
    cov = np.eye(2 + rank)
    cov[:2, :2] = np.diag([0.08**2, (0.25 * typical) ** 2])
    belief = GaussianBelief(model, np.concatenate([[0.4, 1.3 * typical], np.zeros(rank)]), cov)
    seen = lens.look(belief)
    for density, grid, law in (
        (seen.phase_density, lens.phases, norm(0.4, 0.08)),
        (seen.tempo_density, lens.tempos, norm(1.3 * typical, 0.25 * typical)),
    ):
        expected = law.pdf(grid)
        assert_allclose(density, expected, atol=0.02 * expected.max())


@pytest.mark.parametrize("kind", ["bip", "ebip", "promp", "rbpf"])
def test_a_circle_of_phases_is_not_cut_where_it_begins(kind):
    belief = chance_belief(kind, periodic=True)
    lens, centre = Lens.of(belief.model), float(belief.phase_mean[0])
    seam = turned(belief, -centre)  # the same belief about as much of the circle before 0 as after it
    there, here = lens.look(turned(belief, 0.5 - centre)).phase_density, lens.look(seam).phase_density
    assert_allclose(np.trapezoid(here, lens.phases), 1, atol=0.01)
    moved = np.interp((lens.phases + 0.5) % 1.0, lens.phases, there)
    assert_allclose(here, moved, atol=0.05 * there.max())


def turned(belief, by):
    """A belief in phases that are farther round the circle."""
    if hasattr(belief, "timing"):
        cells = round(by * len(belief.timing.costs))
        costs, tempos = np.roll(belief.timing.costs, cells), np.roll(belief.timing.tempos, cells)
        return replace(belief, timing=replace(belief.timing, costs=costs, tempos=tempos))
    if hasattr(belief, "motion"):
        return replace(belief, motion=replace(belief.motion, phase=(belief.motion.phase + by) % 1.0))
    if hasattr(belief, "carried"):
        carried = np.array(belief.carried)
        carried[:, 0] += by
        return replace(belief, carried=carried)
    mean = np.array(belief.mean)
    mean[0] += by
    return replace(belief, mean=mean)


@pytest.mark.parametrize("kind", ["bip", "ebip", "particle, gaussian", "promp, candidates", "rbpf"])
def test_points_that_are_drawn_have_the_moments_of_the_cloud(kind, model, episode, monkeypatch):
    lens, belief = Lens.of(model), midway(model, kind, episode, 0.2)
    few = lens.look(belief)
    assert few.points.shape == (looking.POINTS, 2)
    assert_array_equal(few.points, lens.look(belief).points)  # it does not flicker
    count = 20_000
    monkeypatch.setattr(looking, "POINTS", count)
    points = lens.look(belief).points
    mean, cov = (part[:2] for part in cloud(belief, lens.directions).coordinate_moments)
    white = np.linalg.solve(np.linalg.cholesky(cov[:, :2]), (points - mean).T)
    assert_allclose(white.mean(1), 0, atol=5 / np.sqrt(count))
    assert_allclose(white @ white.T / count, np.eye(2), atol=5 * np.sqrt(4 / count))  # heavier tails than a Gaussian's


def test_correlations_are_those_of_weights_that_were_drawn(model, rng):
    lens, features = Lens.of(model), np.arange(4)
    root = rng.standard_normal((2, len(lens.directions), len(lens.directions)))
    covs, phases = root @ root.swapaxes(1, 2), np.array([0.3, 0.8])
    told = lens.correlations(covs, phases, features)
    for phase, part, own in zip(phases, root, told, strict=True):
        drawn = model.prior.mean + rng.standard_normal((20_000, len(part))) @ part.T @ lens.directions
        read = model.layout.predict_each(np.full((len(drawn), 1), phase), drawn, features)[:, 0]
        assert_allclose(own, np.corrcoef(read, rowvar=False), atol=5 / np.sqrt(len(drawn)))


def test_correlations_of_an_ensemble_are_those_of_its_members(model, episode):
    lens, belief, features = Lens.of(model), midway(model, "ebip", episode), np.arange(4)
    off = (belief.members[:, 2:] - model.prior.mean) @ lens.directions.T
    read = model.layout.predict_each(np.full((len(off), 1), 0.6), model.prior.mean + off @ lens.directions, features)
    told = lens.correlations(lens.look(belief).cov[None], np.array([0.6]), features)[0]
    assert_allclose(told, np.corrcoef(read[:, 0], rowvar=False), atol=1e-8)


def test_a_reading_that_is_certain_correlates_with_nothing(model):
    lens = Lens.of(model)
    none = np.zeros((1, len(lens.directions), len(lens.directions)))
    assert_array_equal(lens.correlations(none, np.array([0.5]), np.arange(4)), np.zeros((1, 4, 4)))


# --------------------------------------------------------------------------------------------------------- the accounts


@pytest.fixture(scope="module")
def live(model, tmp_path_factory):
    """A run of a live loop, as it was recorded."""
    made = bench(model, file=tmp_path_factory.mktemp("runs") / "live.mcap")
    made.run(0.8)
    return made.recorded()


def test_a_recorded_run_is_told_as_it_was(live, model):
    account = account_of_recording(live, model)
    assert account.remarks == ()
    assert len(live.estimates) > 20
    assert all(identical(one, other) for one, other in zip(account.estimates, live.estimates, strict=True))
    assert [frame.step for frame in account.frames] == list(range(len(live.estimates)))
    answered = [i for i, response in enumerate(live.responses) if response is not None]
    assert len(answered) > 10
    for i in answered:  # what was answered then, not what would be answered now
        assert account.now_times[i] == live.responses[i].times[0]
        assert_array_equal(account.now[i], live.responses[i].mean[0])
        assert_array_equal(account.now_std[i], live.responses[i].std[0])
    for frame, (session, _) in zip(account.frames, steps(live, session_of(live, model)), strict=True):
        again = session.respond(samples=SAMPLES)
        assert_array_equal(frame.response.mean, again.mean)
        assert_array_equal(frame.response.std, again.std)
        assert frame.glimpse is not None


def test_what_was_answered_counts_and_not_what_would_be_answered_now(live, model):
    """As with a lookahead, which the session that plays it again does not have."""
    ahead = tuple(r and replace(r, times=r.times + 0.2, mean=r.mean + 1.0) for r in live.responses)
    account, told = account_of_recording(replace(live, responses=ahead), model), account_of_recording(live, model)
    for i, response in enumerate(live.responses):
        later, moved = (0.2, 1.0) if response is not None else (0.0, 0.0)
        assert account.now_times[i] == pytest.approx(told.now_times[i] + later)
        assert_allclose(account.now[i], told.now[i] + moved)


def test_without_a_model_it_is_told_as_recorded_and_says_so(live):
    account = account_of_recording(live)
    assert account.estimates == live.estimates
    assert account.model is account.lens is None
    assert all(frame.glimpse is None for frame in account.frames)
    assert account.remarks == ("the recording holds no model: its beliefs cannot be shown",)


def test_with_another_model_it_is_told_as_recorded_and_says_so(live):
    account = account_of_recording(live, taught(dataset(np.random.default_rng(1))))
    assert account.estimates == live.estimates
    assert account.model is None
    assert "expected the model it was recorded with" in account.remarks[0]


def test_estimates_that_do_not_come_out_again_are_counted(live, model):
    changed = list(live.estimates)
    for i, field in ((3, "phase_std"), (20, "log_likelihood")):
        changed[i] = replace(changed[i], **{field: float(np.nextafter(getattr(changed[i], field), 9.0))})
    account = account_of_recording(replace(live, estimates=tuple(changed)), model)
    (remark,) = account.remarks
    assert remark.startswith(f"2 of {len(changed)} estimates do not come out again")
    fewer = replace(live, estimates=live.estimates[:-3], responses=live.responses[:-3])
    assert (
        account_of_recording(fewer, model)
        .remarks[0]
        .startswith(f"3 of {len(changed) - 3} estimates do not come out again")
    )


def test_a_run_of_nothing_has_an_account(live, model):
    nothing = replace(live, times=live.times[:0], values=live.values[:0], estimates=(), responses=())
    account = account_of_recording(nothing, model)
    assert account.estimates == ()
    assert account.remarks == ("nothing was observed in it",)
    assert summarise(account)


def test_a_demonstration_is_played_by_its_observed_channels_alone(model, episode):
    account = account_of_demonstration(model, episode, "bip", 4)
    session = model.session("bip", 4)
    for i, (time, values) in enumerate(zip(episode.times, episode.values, strict=True)):
        assert identical(account.estimates[i], session.observe(float(time), values[:2]))
        response = session.respond(samples=SAMPLES)
        assert_array_equal(account.frames[i].response.mean, response.mean)
        assert_array_equal(account.now[i], response.mean[0])
    assert_allclose(account.truth, episode.values[:, 2:], rtol=1e-13)
    assert_array_equal(account.progress, episode.phases)
    other = np.array(episode.values)
    other[:, 2:] += 5.0
    told = account_of_demonstration(model, inphase.Demonstration(episode.times, other, "other"), "bip", 4)
    assert all(identical(one, two) for one, two in zip(told.estimates, account.estimates, strict=True))


def test_of_long_runs_evenly_many_steps_are_told_in_full():
    for count in (0, 1, 2, FRAMES - 1, FRAMES, FRAMES + 1, 36_000):
        found = frame_steps(count)
        assert len(found) == min(count, FRAMES)
        assert {0, count - 1} <= {*found.tolist()} or not count
        assert {*np.diff(found).tolist()} <= {(gap := (count - 1) // max(len(found) - 1, 1)), gap + 1}


def test_the_tables_hold_the_errors_of_the_response_now(model, episode):
    account = account_of_demonstration(model, episode, "bip")
    error = account.now - episode.values[:, 2:]
    table = next(table for table in summarise(account) if table["title"] == "Response now")
    spread = model.spread[2:]
    inside = np.abs(error) <= 1.6449 * account.now_std
    assert table["rows"][0] == ["all", "", "", f"{np.mean((error / spread) ** 2):.3g}", f"{100 * inside.mean():.0f} %"]
    for k, row in enumerate(table["rows"][1:]):
        rms, nmse = np.sqrt(np.mean(error[:, k] ** 2)), np.mean((error[:, k] / spread[k]) ** 2)
        unit = model.channels[2 + k].unit
        expected = [model.controlled[k], f"{rms:.3g}", unit, f"{nmse:.3g}", f"{100 * inside[:, k].mean():.0f} %"]
        assert row == expected


def test_what_the_controlled_channels_did_is_read_from_the_recording(model):
    times = np.linspace(0.0, 1.0, 21)
    values = np.full((21, 4), np.nan)
    values[:, :2] = model.predict(0.9 * times)[:, :2]
    values[4:17:3, 2] = 3.0 * times[4:17:3] - 1.0  # read now and then, along a line
    recording = inphase.recording.Recording("r", model.channels, times, values, (), (), provenance_of(model, "bip"))
    truth = account_of_recording(recording, model).truth
    within = (times >= times[4]) & (times <= times[16])
    assert_allclose(truth[within, 0], 3.0 * times[within] - 1.0, atol=1e-12)
    assert np.isnan(truth[~within, 0]).all()
    assert np.isnan(truth[:, 1]).all()


# --------------------------------------------------------------------------------------------------------- the branches


def test_angles_are_drawn_without_jumps_and_beside_the_answers(rng):
    channels = make_channels(["a", "b"], ["c"], kinds={"a": "angle"})
    assert channels[0].kind is Kind.ANGLE
    smooth = np.cumsum(rng.uniform(-0.5, 0.9, 80))
    wrapped = np.stack([(smooth + np.pi) % (2 * np.pi) - np.pi, smooth, smooth], axis=1)
    wrapped[30:34] = np.nan
    drawn = steady(channels, wrapped)
    seen = np.isfinite(wrapped[:, 0])
    assert_array_equal(np.isfinite(drawn), np.isfinite(wrapped))
    assert np.ptp((drawn[seen, 0] - smooth[seen]) / (2 * np.pi)) < 1e-9  # off by the same number of turns everywhere
    assert_array_equal(drawn[:, 1:], wrapped[:, 1:])
    answers = np.stack([smooth + 20 * np.pi + 0.3, smooth, smooth], axis=1)
    near = beside(channels, wrapped, answers)
    assert_allclose(near[seen, 0], smooth[seen] + 20 * np.pi, atol=1e-9)
    assert_allclose(near[seen, 1:], wrapped[seen, 1:])


def test_a_quaternion_does_not_change_its_sign_on_the_way(rng):
    channels = make_channels(["a_qx", "a_qy", "a_qz", "a_qw"], ["c"], kinds={"a_q?": "quaternion"})
    turn = np.linspace(0, 3, 40)[:, None] * [0.6, 0.0, 0.8]
    smooth = np.concatenate([np.sin(turn / 2) * 0.5, np.cos(turn[:, :1] / 2), turn[:, :1]], axis=1)
    flipped = smooth.copy()
    flipped[:, :4] *= np.where(rng.random(40) < 0.5, -1.0, 1.0)[:, None]
    flipped[0, :4] = smooth[0, :4]
    assert_array_equal(steady(channels, flipped), smooth)
    assert_array_equal(beside(channels, flipped, -smooth)[:, :4], -smooth[:, :4])
