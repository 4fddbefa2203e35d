"""Calibration: held-out demonstrations decide, and chance does not."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from interactions import dataset, shapes_unchecked, taught
from numpy.testing import assert_allclose, assert_array_equal

import inphase
from inphase.errors import OptionError
from inphase.evidence import Evidence, Trial
from inphase.metrics import Errors
from inphase.training import rehearsal
from inphase.training.calibrate import CHOICES, Calibration, Candidate
from inphase.training.fit import _proposed as proposed
from inphase.training.rehearsal import CONDITIONS, Rehearsal, play, rehearsals, relative
from inphase.workers import workers

SAMPLES, CHANNELS = 40, 2


@pytest.fixture(scope="module")
def demos() -> inphase.Dataset:
    return dataset(np.random.default_rng(2), count=4, rate=20.0)


@pytest.fixture(scope="module")
def model(demos: inphase.Dataset) -> inphase.Model:
    return taught(demos)


class Stage:
    """Plays that cost nothing: the errors depend on the model's usual tempo and the weight of its reflex alone."""

    def __init__(
        self, model: inphase.Model, size: dict[float, float], reflex: float = 0.0, doubt: float = 0.01
    ) -> None:
        rng = np.random.default_rng(5)
        still = inphase.Demonstration(np.arange(3.0), np.zeros((3, 4)))  # nobody looks at it
        self.held_out = [Rehearsal(model, (still,) * 3) for _ in range(6)]
        self.noise = rng.normal(size=(18, SAMPLES, CHANNELS))
        self.luck = doubt * rng.normal(size=(18, 1, 1))
        self.size, self.reflex = size, reflex

    def run(self, function: object, tasks: Iterable[tuple]) -> list[Errors]:
        played = []
        for i, (model, _) in enumerate(tasks):
            size = self.size[model.tempo.usual] * (1 + (self.luck[i] if model.tempo.usual != 0.8 else 0))
            error = size * self.noise[i] * (1 + self.reflex * model.reflex.weight)
            flat = np.full_like(error, 1.0)
            played.append(Errors(error, flat, np.full_like(error, np.nan), np.ones(CHANNELS)))
        return played


def usual(share: float) -> Candidate:
    return Candidate(f"{share}", lambda model: replace(model, tempo=replace(model.tempo, usual=share)))


def staged(model: inphase.Model, stage: Stage) -> Calibration:
    return Calibration(stage.held_out, stage.run, lambda: None)


def test_what_is_clearly_better_is_chosen(model: inphase.Model) -> None:
    calibration = staged(model, Stage(model, {0.8: 1.0, 0.5: 0.9, 0.9: 0.8}))
    calibration.choose("usual tempo", [usual(0.5), usual(0.9)])
    assert calibration.applied(model).tempo.usual == 0.9
    assert [t.value for t in calibration.trials if t.chosen] == ["as learned", "0.9"]


def test_what_is_better_by_chance_alone_is_not(model: inphase.Model) -> None:
    chosen = []
    for size in (1.0, 0.995):
        calibration = staged(model, Stage(model, {0.8: 1.0, 0.5: size}, doubt=0.2))
        calibration.choose("usual tempo", [usual(0.5)])
        chosen.append(calibration.applied(model).tempo.usual)
    assert chosen == [0.8, 0.8]


@pytest.mark.parametrize(("worse", "kept"), [(0.5, 0.0), (-0.2, 1.0)])
def test_a_reflex_that_misleads_is_dropped(worse: float, kept: float, model: inphase.Model) -> None:
    assert model.reflex is not None
    model = replace(model, reflex=replace(model.reflex, weight=1.0))
    calibration = staged(model, Stage(model, {0.8: 1.0}, reflex=worse))
    calibration.choose("reflex", CHOICES["reflex"])
    assert calibration.applied(model).reflex.weight == kept  # type: ignore[union-attr]


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_the_band_holds_nine_of_ten(size: float, model: inphase.Model) -> None:
    calibration = staged(model, Stage(model, {0.8: size}))
    calibration.choose_band()
    assert_allclose(calibration.applied(model).band, size, rtol=0.1)  # the errors are normal, with that deviation
    assert_allclose(calibration.trials[-1].coverage, 0.9, atol=2 / (18 * SAMPLES * CHANNELS))


def test_a_band_multiplies_the_deviation_of_a_response(model: inphase.Model) -> None:
    one, three = model.session(), replace(model, band=3.0).session()
    for session in (one, three):
        session.observe(0.0, [0.1, 0.2])
    assert_allclose(three.respond().std, 3 * one.respond().std)
    assert_array_equal(three.respond().mean, one.respond().mean)


# -------------------------------------------------------------------------------------------------- held-out episodes


def test_nothing_is_played_to_a_model_that_knows_it(demos: inphase.Dataset) -> None:
    shown: list[set[bytes]] = []

    def learn(part: inphase.Dataset) -> inphase.Model:
        shown.append({d.values.tobytes() for d in part})
        return replace(taught(part), provenance={"fold": str(len(shown) - 1)})

    for held_out in rehearsals(demos, learn):
        names = {v.name for v in held_out.variations}
        played = next(d for d in demos if {d.name} == names)
        assert played.values.tobytes() not in shown[int(held_out.model.provenance["fold"])]


@pytest.mark.parametrize("name", CONDITIONS)
def test_a_variation_is_the_same_movement(name: str, demos: inphase.Dataset) -> None:
    original = demos[0]
    varied = CONDITIONS[name](original, 2, 0.25)
    rows = {row.tobytes() for row in original.values[:, 2:]}
    assert all(row.tobytes() in rows for row in varied.values[:, 2:])
    factor = {"half speed": 2.0, "double speed": 0.5, "a pause": 1.3}.get(name, 1.0)
    assert_allclose(varied.duration, factor * original.duration, rtol=1e-9)
    unseen = np.isnan(varied.values[:, :2]).all(1).mean()
    assert abs(unseen - (0.3 if name == "out of sight" else 0.0)) < 0.05
    assert not np.isnan(varied.values[:, 2:]).any()


# --------------------------------------------------------------------------------------------------------- the whole


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short plays: here it matters what is made of them, and not how good they are."""
    monkeypatch.setattr(rehearsal, "SAMPLES", 6)
    monkeypatch.setattr(rehearsal, "PARTICLES", 10)


@pytest.fixture(scope="module")
def calibrated(demos: inphase.Dataset) -> inphase.Model:
    """The whole way, as users go it; its shapes are checked below, where a channel is known of one demonstration."""
    shares: list[float] = []
    with pytest.MonkeyPatch.context() as patch, shapes_unchecked():
        patch.setattr(rehearsal, "SAMPLES", 6)
        patch.setattr(rehearsal, "PARTICLES", 10)
        patch.setattr(rehearsal, "PLAYED", 3)
        model = inphase.fit(demos, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[0] > 0
    assert abs(shares[-1] - 1) < 1e-9
    return model


def test_a_fit_stores_what_it_chose_and_why(calibrated: inphase.Model) -> None:
    evidence = calibrated.evidence
    assert evidence is not None
    assert evidence.held_out == 3
    assert evidence.conditions == tuple(CONDITIONS)
    assert evidence.before is evidence.trials[0]
    assert evidence.after is evidence.trials[-1]
    assert evidence.after.error <= evidence.before.error
    assert abs(evidence.after.coverage - 0.9) < 0.02
    assert evidence.after.error < evidence.by_the_clock
    for choice in dict.fromkeys(t.choice for t in evidence.trials):
        assert sum(t.chosen for t in evidence.trials if t.choice == choice) == 1


def test_what_is_given_is_not_chosen(demos: inphase.Dataset, calibrated: inphase.Model, short: None) -> None:
    given = {"noise": calibrated.noise, "prior": calibrated.prior, "tempo": inphase.tempo.Tempo(usual=0.6)}
    with shapes_unchecked():
        model = inphase.fit(demos, **given, shrinkage=0.0)
    assert model.evidence is not None
    assert {t.choice for t in model.evidence.trials} == {"before", "reflex", "band"}
    assert model.tempo.usual == 0.6
    assert_array_equal(model.noise.correlation_time, calibrated.noise.correlation_time)


@pytest.mark.parametrize(("ripples", "more"), [(0, False), (9, True)])
def test_as_many_functions_are_proposed_as_the_movement_needs(
    ripples: int, more: bool, rng: np.random.Generator
) -> None:
    """Twenty functions cannot follow nine waves; a glide needs fewer."""
    times, values = [], []
    for _ in range(8):
        t, height = np.linspace(0, 3, 150), rng.normal(1, 0.3)
        wave = height * (np.sin(2 * np.pi * ripples * t / 3) if ripples else 1.0)
        values.append(np.stack([t + wave, wave - t], axis=1) + 0.01 * rng.normal(size=(150, 2)))
        times.append(t)
    demos = inphase.Dataset.from_arrays(times, values, ["a"], ["b"])
    basis = proposed(demos, inphase.fit(demos, calibrate=False))
    assert basis is not None
    assert (basis.size > 20) == more


@pytest.mark.parametrize(("size", "taken"), [(0.5, True), (0.999, False), (1.5, False)])
def test_another_basis_is_taken_where_it_follows_better_by_more_than_chance(
    size: float, taken: bool, model: inphase.Model
) -> None:
    stage = Stage(model, {0.8: 1.0, 0.6: size})
    calibration = staged(model, stage)
    otherwise = replace(model, tempo=replace(model.tempo, usual=0.6))
    still = stage.held_out[0].variations
    assert calibration.consider("basis", "9 functions", [Rehearsal(otherwise, still) for _ in range(6)]) == taken
    assert [t.chosen for t in calibration.trials if t.choice == "basis"] == [not taken, taken]
    # What is tried next is tried with what was taken.
    calibration.choose("reflex", [Candidate("as it is, once more", lambda model: model)])
    assert calibration.trials[-1].error == pytest.approx(size**2 if taken else 1.0, rel=0.2)
    assert calibration.trials[-1].error == pytest.approx(calibration.trials[-2].error)


@pytest.mark.parametrize("given", [{}, {"basis": inphase.basis.Gaussian(7)}, {"prior": None}])
def test_only_a_basis_that_nobody_named_is_chosen(
    given: dict, demos: inphase.Dataset, model: inphase.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, offered = sys.modules["inphase.training.fit"], []
    monkeypatch.setattr(module, "calibrated", lambda *a, **k: offered.append(k["alternative"]) or a[1])
    fitted = inphase.fit(demos, **{name: value or model.prior for name, value in given.items()})
    assert fitted.layout.bases[0].size == (7 if "basis" in given else 20)
    (alternative,) = offered
    assert (alternative is None) == bool(given)
    if alternative is not None:
        assert alternative.learn(demos).layout == alternative.model.layout
        assert alternative.value == f"{alternative.model.layout.bases[0].size} functions"


def test_two_processes_find_what_one_finds(model: inphase.Model, demos: inphase.Dataset) -> None:
    tasks = [(model, CONDITIONS["as recorded"](demo, 2, 0.3)) for demo in demos.subset([0, 1])]
    with workers(1) as one, workers(2) as two:
        for here, there in zip(one.run(play, tasks), two.run(play, tasks), strict=True):
            assert_array_equal(here.now, there.now)
            assert_array_equal(here.std, there.std)


def test_three_demonstrations_are_not_held_out(demos: inphase.Dataset) -> None:
    model = inphase.fit(demos.subset([0, 1, 2]))
    assert model.evidence is None
    assert model.band == 1.0


def test_a_channel_of_one_demonstration_alone_is_survived(demos: inphase.Dataset, short: None) -> None:
    values = [d.values.copy() for d in demos]
    for v in values[1:]:
        v[:, 1] = np.nan
    only = inphase.Dataset.from_arrays([d.times for d in demos], values, demos.observed, demos.controlled)
    given = taught(only)
    model = inphase.fit(only, noise=given.noise, prior=given.prior, tempo=given.tempo)
    assert model.evidence is not None
    assert model.evidence.held_out == 3


def test_no_process_is_no_number_of_them() -> None:
    with pytest.raises(OptionError, match="at least 1"), workers(0):
        pass


def test_evidence_without_trials_is_none() -> None:
    with pytest.raises(OptionError, match="trials"):
        Evidence(3, (), (), 1.0)
    assert Trial("band", "1", 0.1, 0.0, 0.9, 0.5, True).chosen


def test_errors_in_their_own_deviations_leave_out_what_was_not_recorded() -> None:
    error = Errors(np.array([[2.0, np.nan]]), np.array([[4.0, 1.0]]), np.array([[np.nan, np.nan]]), np.ones(2))
    assert_array_equal(relative([error]), [0.5])
