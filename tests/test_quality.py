"""The quality of demonstrations: bad ones are found and named, good ones are not, whatever the units and the order."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest
from interactions import CONTROLLED, NOISE_STD, OBSERVED, curves, dataset, shapes_unchecked, wobble
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

import inphase
from inphase.preprocess.sampling import sampling
from inphase.report.overlay_picture import make_figure
from inphase.training import Quality
from inphase.training.likelihood import left_out
from inphase.training.unlike import ERROR_RATE, lateness, scores, threshold

NAMES = (*OBSERVED, *CONTROLLED)


# ------------------------------------------------------------------------------------------- leaving out, one and two


def naive(curves: np.ndarray, out: list[int], floor: np.ndarray, shrinkage: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the curves that are not out, as the module's equation has it."""
    others = np.delete(curves, out, axis=0)
    return others.mean(axis=0), (1 - shrinkage) * np.cov(others.T) + np.diag(floor)


@pytest.mark.parametrize("shrinkage", [0.02, 0.5, 1.0])
@pytest.mark.parametrize(("count", "readings"), [(4, 3), (6, 15), (20, 8)])
def test_leaving_out_equals_a_loop_that_learns_every_gaussian_anew(count, readings, shrinkage, rng):
    drawn = rng.standard_normal((count, 3)) @ rng.standard_normal((3, readings)) + 0.3 * rng.standard_normal(
        (count, readings)
    )
    floor = rng.uniform(0.05, 0.2, readings)
    found = left_out(drawn, floor, shrinkage)
    for j in range(count):
        mean, cov = naive(drawn, [j], floor, shrinkage)
        off = drawn[j] - mean
        own = multivariate_normal(mean, cov).logpdf(drawn[j]) / readings
        assert_allclose(found.log_likelihood[j], own, rtol=0, atol=1e-8)
        assert_allclose(found.distance[j] ** 2, off @ np.linalg.solve(cov, off) / readings, rtol=1e-8)
        assert_allclose(found.deviations[j], off / np.sqrt(np.diag(cov)), rtol=1e-8)
    for i in range(count):
        others = [j for j in range(count) if j != i]
        with_it = [multivariate_normal(*naive(drawn, [j], floor, shrinkage)).logpdf(drawn[j]) for j in others]
        without = [multivariate_normal(*naive(drawn, [i, j], floor, shrinkage)).logpdf(drawn[j]) for j in others]
        assert_allclose(found.contribution[i], np.mean(np.subtract(with_it, without)) / readings, rtol=0, atol=1e-8)
    value = np.linalg.eigvalsh(np.cov((drawn / np.sqrt(floor)).T))[::-1][: min(count - 1, readings)]
    assert_allclose(found.variances[: len(value)], value, rtol=1e-8, atol=1e-10)


def test_what_leaves_the_library_is_read_only(rng):
    found = left_out(rng.standard_normal((5, 6)), np.ones(6), 0.5)
    with pytest.raises(ValueError, match="read-only"):
        found.distance[0] = 0.0
    quality = inphase.assess(dataset(rng))
    with pytest.raises(FrozenInstanceError):
        quality.episodes[0].score = 0.0  # type: ignore[misc]


def test_three_curves_are_too_few_to_leave_two_out():
    with pytest.raises(inphase.DataError, match="at least 4 demonstrations to leave any out, got 3"):
        left_out(np.eye(3), np.ones(3), 0.5)


# ------------------------------------------------------------------------------------------------ found, and not found


def planted(seed: int, fault: str = "none", count: int = 8) -> tuple[inphase.Dataset, int]:
    """Recordings of which one has a fault, and which: its timing, one channel shifted, or another movement."""
    rng = np.random.default_rng(seed)
    odd, times, values = int(rng.integers(count)), [], []
    for i in range(count):
        at = np.arange(round(100 * np.exp(0.1 * rng.standard_normal()))) / 50
        phases, style = at / at[-1], rng.standard_normal(2)
        late = fault == "late" and i == odd
        clean = curves(np.clip((phases - 0.2) / 0.8, 0, 1) if late else phases, style)
        if fault == "shifted" and i == odd:
            clean[:, 1] += 0.6
        if fault == "other" and i == odd:
            clean[:, 2] = 0.8 - 0.5 * np.sin(np.pi * phases)
        times.append(at)
        values.append(clean + wobble(at, 4, NOISE_STD, 0.0, rng))
    return inphase.Dataset.from_arrays(times, values, OBSERVED, CONTROLLED), odd


@pytest.mark.parametrize(("fault", "named"), [("late", None), ("shifted", "lift"), ("other", "grip")])
def test_a_bad_demonstration_is_found_and_named_in_20_of_20_seeds(fault, named):
    late: list[float | None] = []
    for seed in range(20):
        demos, odd = planted(seed, fault)
        found = inphase.assess(demos)
        assert found.outliers[0].name == demos[odd].name
        worst = found.outliers[0]
        assert str(worst.unlike[0].feature) in worst.verdict
        if named is None:
            late.append(worst.late)
        else:
            assert worst.unlike[0].feature == named
            assert worst.late is None
            assert worst.verdict.startswith(f"unlike the others: {named}")
    told = [by for by in late if by is not None]
    assert named is not None or len(told) >= 17  # one who also goes in another style than others is unlike in both
    assert all(0.02 < by < 0.25 for by in told)


def test_the_stretch_of_phase_is_that_of_the_fault(rng):
    demos, _ = planted(0)
    phases = demos[3].phases
    values = np.array(demos[3].values)
    values[:, 3] += 1.5 * np.exp(-((phases - 0.6) ** 2) / (2 * 0.05**2))
    episodes = list(demos)
    episodes[3] = inphase.Demonstration(demos[3].times, values, demos[3].name)
    (worst,) = inphase.assess(inphase.Dataset(demos.channels, tuple(episodes))).outliers
    assert worst.name == demos[3].name
    part = worst.unlike[0]
    assert part.feature == "turn"
    assert 0.45 < part.start < 0.56 < part.at < 0.64 < part.end < 0.75
    assert part.deviation > 5
    assert worst.verdict == f"unlike the others: turn around phase {part.at:.2g}"


def test_of_clean_data_sets_no_more_than_stated_have_one_marked():
    marked = [bool(inphase.assess(planted(seed, count=count)[0]).outliers) for count in (7, 12) for seed in range(20)]
    assert np.mean(marked) <= ERROR_RATE


@pytest.mark.parametrize(("count", "directions"), [(6, 2), (10, 5), (20, 3)])
def test_gaussian_curves_are_marked_no_more_often_than_stated(count, directions, rng):
    """Without anything of movements: the threshold holds for what it was made for, and it is not beyond all reach."""
    drawn = 60
    over = 0
    for _ in range(drawn):
        spread = rng.standard_normal((count, directions)) @ rng.standard_normal((directions, 60))
        found = left_out(spread + 0.2 * rng.standard_normal((count, 60)), np.full(60, 0.05), 0.1)
        over += bool(scores(found.distance, 60).max() > threshold(found.variances, 0.1, 60))
    assert over <= ERROR_RATE * drawn + 2 * np.sqrt(ERROR_RATE * drawn)  # which is what chance makes of the count


def test_who_comes_late_is_told_from_who_does_otherwise():
    phases = (np.arange(50) + 0.5) / 50
    mean, std = np.sin(np.pi * phases)[:, None], np.full((50, 1), 0.1)
    assert lateness(np.sin(np.pi * np.clip(phases - 0.1, 0.01, 1))[:, None], mean, std) == pytest.approx(0.1)
    assert lateness(np.sin(np.pi * np.clip(phases + 0.1, 0, 0.99))[:, None], mean, std) == pytest.approx(-0.1)
    assert lateness(mean, mean, std) is None
    assert lateness(-mean, mean, std) is None


def test_a_demonstration_that_adds_something_new_helps_more_than_a_copy():
    demos, _ = planted(1, count=12)
    copied = inphase.Dataset(demos.channels, (*demos, inphase.Demonstration(demos[0].times, demos[0].values, "copy")))
    by_name = {e.name: e.contribution for e in inphase.assess(copied).episodes}
    alone = {e.name: e.contribution for e in inphase.assess(demos).episodes}
    assert by_name[demos[1].name] is not None
    # Its copy leaves it nothing to add but to the copy itself.
    assert by_name["copy"] == pytest.approx(by_name[demos[0].name])
    assert alone.keys() < by_name.keys()


# -------------------------------------------------------------------------------------------------------- invariances


def figures(found: Quality) -> dict[str, np.ndarray]:
    return {e.name: np.array([e.log_likelihood, e.score, e.contribution]) for e in found.episodes}


@pytest.fixture(scope="module")
def shifted() -> inphase.Dataset:
    return planted(3, "shifted")[0]


def assert_same(one: Quality, other: Quality) -> None:
    assert figures(one).keys() == figures(other).keys()
    for name, values in figures(one).items():
        assert_allclose(figures(other)[name], values, rtol=1e-5, atol=1e-6)
    assert [e.name for e in one.outliers] == [e.name for e in other.outliers]
    assert [e.verdict for e in one.outliers] == [e.verdict for e in other.outliers]
    assert other.threshold == pytest.approx(one.threshold, rel=1e-5)


def test_the_order_of_episodes_does_not_matter(shifted):
    order = np.random.default_rng(0).permutation(len(shifted))
    assert_same(inphase.assess(shifted), inphase.assess(shifted.subset(order.tolist())))


def test_the_order_of_channels_does_not_matter(shifted):
    swapped = inphase.Dataset.from_arrays(
        [d.times for d in shifted],
        [d.values[:, [1, 0, 3, 2]] for d in shifted],
        OBSERVED[::-1],
        CONTROLLED[::-1],
        names=[d.name for d in shifted],
    )
    assert_same(inphase.assess(shifted), inphase.assess(swapped))


def test_units_do_not_matter(shifted):
    scale, offset = np.array([1000.0, 0.01, 3.0, -2.0]), np.array([5.0, -3.0, 0.0, 100.0])
    other = inphase.Dataset.from_arrays(
        [60 * d.times + 7 for d in shifted],
        [d.values * scale + offset for d in shifted],
        OBSERVED,
        CONTROLLED,
        names=[d.name for d in shifted],
    )
    assert_same(inphase.assess(shifted), inphase.assess(other))


# ---------------------------------------------------------------------------------------------------------- bad input


def with_columns(demos: inphase.Dataset, **columns: object) -> inphase.Dataset:
    """The data set with more observed channels, each made from the values of an episode."""
    values = [np.column_stack([*(make(d.values) for make in columns.values()), d.values]) for d in demos]  # type: ignore[operator]
    return inphase.Dataset.from_arrays([d.times for d in demos], values, [*columns, *OBSERVED], CONTROLLED)


def test_channels_that_say_nothing_are_findings_and_no_errors(rng):
    demos = with_columns(
        dataset(rng),
        dead=lambda v: np.full(len(v), 7.0),
        lost=lambda v: np.full(len(v), np.nan),
        twin=lambda v: v[:, 0],
        turned=lambda v: 3 - 2 * v[:, 3],
        both=lambda v: v[:, 1] + v[:, 2],
    )
    found = inphase.assess(demos)
    assert {(f.kind, f.features) for f in found.findings} == {
        ("missing", ("lost",)),
        ("constant", ("dead",)),
        ("duplicate", ("twin", "reach")),
        ("collinear", ("turned", "turn")),
        ("collinear", ("both", "lift", "grip")),
    }
    for finding in found.findings:
        assert all(name in finding.message for name in finding.features)
    assert all(np.isfinite(e.log_likelihood) for e in found.episodes)
    assert inphase.assess(dataset(rng)).findings == ()


def test_two_channels_with_noise_of_their_own_are_no_copies(rng):
    noisy = with_columns(dataset(rng), near=lambda v: v[:, 0] + 0.05 * rng.standard_normal(len(v)))
    assert inphase.assess(noisy).findings == ()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_of_few_demonstrations_none_is_left_out_and_that_is_said(count, rng):
    found = inphase.assess(dataset(rng).subset(list(range(count))))
    assert found.why_not == f"expected at least 4 demonstrations to hold each against the others, got {count}"
    assert [(e.score, e.log_likelihood, e.contribution, e.verdict) for e in found.episodes] == [
        (None,) * 3 + ("",)
    ] * count
    assert found.threshold is None


def test_nothing_that_moves_is_said():
    still = inphase.Dataset.from_arrays([np.arange(5.0)] * 6, [np.ones((5, 2))] * 6, ["a"], ["b"])
    found = inphase.assess(still)
    assert found.why_not == "no channel moves"
    assert [(f.kind, f.features) for f in found.findings] == [("constant", ("a", "b"))]


def test_demonstrations_that_are_all_the_same_are_not_marked():
    times = np.linspace(0, 2, 50)
    same = inphase.Dataset.from_arrays([times] * 6, [curves(times / 2, np.zeros(2))] * 6, OBSERVED, CONTROLLED)
    found = inphase.assess(same)
    assert found.outliers == ()
    assert all(np.isfinite(e.log_likelihood) for e in found.episodes)


def test_more_basis_functions_than_samples(rng):
    times = np.linspace(0, 1, 4)
    few = [curves(times, rng.standard_normal(2)) for _ in range(8)]
    found = inphase.assess(inphase.Dataset.from_arrays([times] * 8, few, OBSERVED, CONTROLLED))
    assert all(np.isfinite([e.log_likelihood, e.score, e.contribution]).all() for e in found.episodes)


def test_a_channel_that_one_episode_lacks_makes_it_no_outlier(rng):
    demos = dataset(rng, count=10)
    values = [np.array(d.values) for d in demos]
    values[4][:, 2:] = np.nan
    lacking = inphase.Dataset.from_arrays([d.times for d in demos], values, OBSERVED, CONTROLLED)
    found = inphase.assess(lacking)
    assert not found.episodes[4].outlier
    assert found.episodes[4].sampling.missing.tolist() == [0, 0, 1, 1]


def test_a_dataset_is_what_is_assessed():
    with shapes_unchecked(), pytest.raises(inphase.DataError, match=r"expected a Dataset, .* got list"):
        inphase.assess([])  # type: ignore[arg-type]


# ----------------------------------------------------------------------------------------------------- how it was taken


def test_rate_jitter_and_gaps_are_those_of_the_clock():
    times = np.concatenate([np.arange(50) / 50, 2 + np.arange(50) / 50])
    values = np.ones((100, 3))
    values[10:30, 1] = np.nan
    values[1::2, 2] = np.nan
    found = sampling(inphase.Demonstration(times, values))
    assert (found.samples, found.start, found.end) == (100, 0.0, times[-1])
    assert found.rate == pytest.approx(50)
    assert found.jitter == pytest.approx(0, abs=1e-9)
    assert found.longest_gap == pytest.approx(2 - 48 / 50)  # of the third channel, of which every second is there
    assert_allclose(found.missing, [0, 0.2, 0.5])
    rng = np.random.default_rng(0)
    uneven = np.cumsum(rng.uniform(0.9, 1.1, 3000))
    found = sampling(inphase.Demonstration(uneven, np.ones((3000, 1))))
    assert found.jitter == pytest.approx(0.2 / np.sqrt(12), rel=0.05)
    assert found.longest_gap == 0


def test_an_end_without_a_channel_is_a_gap():
    times, values = np.arange(20.0), np.ones((20, 2))
    values[12:, 0] = np.nan
    assert sampling(inphase.Demonstration(times, values)).longest_gap == 8


def test_idle_ends_are_those_that_trim_cuts(rng):
    _, (times, values) = None, (np.arange(200) / 50, None)
    phases = np.clip((times - 1) / 2, 0, 1)
    values = [curves(phases, rng.standard_normal(2)) for _ in range(5)]
    demos = inphase.Dataset.from_arrays([times] * 5, values, OBSERVED, CONTROLLED)
    cut = inphase.trim(demos)
    assert [e.moves for e in inphase.assess(demos).episodes] == [(d.times[0], d.times[-1]) for d in cut]
    assert cut[0].times[0] > 0.5


# --------------------------------------------------------------------------------------------- pictures and recordings


def test_the_picture_names_what_it_highlights(shifted):
    found = inphase.assess(shifted)
    figure = make_figure(shifted, found)
    assert [axes.get_title() for axes in figure.axes] == list(NAMES)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [*(e.name for e in found.outliers), f"{len(shifted) - len(found.outliers)} others"]
    assert all(len(axes.get_lines()) == len(shifted) for axes in figure.axes)
    widths = [max(line.get_linewidth() for line in axes.get_lines()) for axes in figure.axes]
    assert int(np.argmax(widths)) == NAMES.index("lift")


def test_of_many_channels_the_named_ones_are_drawn(rng):
    many = with_columns(planted(3, "shifted")[0], **{f"more{i}": lambda v, i=i: v[:, 0] * (1 + i) for i in range(14)})
    drawn = [axes.get_title() for axes in make_figure(many, inphase.assess(many)).axes]
    assert len(drawn) == 12
    assert "lift" in drawn


def test_another_action_among_recordings_of_one_is_found(shared_data: Path):
    waving = inphase.load(shared_data / "yumi" / "waving")
    assert inphase.assess(waving).outliers == ()
    other = inphase.load(shared_data / "yumi" / "rocket")[0]
    mixed = inphase.Dataset(waving.channels, (*waving, inphase.Demonstration(other.times, other.values, "rocket")))
    assert [e.name for e in inphase.assess(mixed).outliers] == ["rocket"]
