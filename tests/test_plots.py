"""Pictures for papers and notebooks: what is drawn is what was said, nothing leaves the page, and no figure is kept."""

from __future__ import annotations

import gc
import re
import sys
import weakref
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from interactions import chance_model, dataset, phase_model, taught, wide_model
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

import inphase
from inphase import report
from inphase.errors import ChannelError, OptionError
from inphase.filters import FILTERS, Belief
from inphase.filters.cloud import Cloud
from inphase.recording import Recording
from inphase.report.density import cloud_of, phase_density, tempo_density
from inphase.report.look import NINETY
from inphase.report.plots.correlation import NEGATIVE, POSITIVE

OPTIONS = {"bip": {}, "ebip": {"members": 60}, "particle": {"particles": 300}, "promp": {}, "rbpf": {"particles": 60}}


@dataclass
class Told:
    """An interaction that was followed a while."""

    demos: inphase.Dataset
    model: inphase.Model
    session: inphase.Session
    estimates: list[inphase.Estimate]
    beliefs: list[Belief]
    response: inphase.Response


@pytest.fixture(scope="module")
def told() -> Told:
    demos = dataset(np.random.default_rng(3), count=5, rate=20.0)
    model = taught(demos, basis=inphase.basis.Gaussian(8))
    session, estimates, beliefs = model.session(seed=1, particles=50), [], []
    for time, values in zip(demos[0].times[:25], demos[0].values, strict=False):
        estimates.append(session.observe(time, values[:2]))
        beliefs.append(session.belief)
    return Told(demos, model, session, estimates, beliefs, session.respond(samples=20))


def lines(axes: object) -> list[np.ndarray]:
    return [line.get_xydata() for line in axes.get_lines()]


def assert_band(axes: object, at: np.ndarray, mean: np.ndarray, std: np.ndarray) -> None:
    """The edges of the one band are 90 % away from the mean."""
    (band,) = axes.collections
    vertices = band.get_paths()[0].vertices
    for sign in (-1, 1):
        for point in np.column_stack([at, mean + sign * NINETY * std]):
            assert np.abs(vertices - point).sum(axis=1).min() < 1e-9


# --------------------------------------------------------------------------------------------------- what is drawn


def test_a_model_is_its_distribution_and_its_demonstrations(told):
    figure = told.model.plot()
    assert [axes.get_title() for axes in figure.axes] == ["reach", "lift", "grip", "turn"]
    for i, axes in enumerate(figure.axes):
        *curves, drawn = lines(axes)
        mean, std = told.model.distribution(drawn[:, 0])
        assert_array_equal(drawn[:, 1], mean[:, i])
        assert_band(axes, drawn[:, 0], mean[:, i], std[:, i])
        for curve, weights in zip(curves, told.model.prior.samples, strict=True):
            assert_array_equal(curve[:, 1], told.model.predict(curve[:, 0], weights)[:, i])
    assert lines(figure.axes[0])[-1][[0, -1], 0].tolist() == [0, 1]


def test_a_response_is_its_mean_and_band_over_time_or_phase(told):
    r = told.response
    for figure, at in ((r.plot(), r.times), (r.plot(phase=True), r.phases)):
        assert [axes.get_title() for axes in figure.axes] == ["grip", "turn"]
        for i, axes in enumerate(figure.axes):
            (drawn,) = lines(axes)
            assert_array_equal(drawn, np.column_stack([at, r.mean[:, i]]))
            assert_band(axes, at, r.mean[:, i], r.std[:, i])


def test_a_response_of_one_sample_is_a_point_with_a_bar(told):
    one = told.session.respond(samples=1)
    (axes,) = one.plot(channels="turn").axes
    assert_array_equal(axes.get_lines()[0].get_xydata(), [[one.times[0], one.mean[0, 1]]])
    (bar,) = axes.collections[0].get_segments()
    assert_allclose(bar[:, 1], one.mean[0, 1] + NINETY * one.std[0, 1] * np.array([-1, 1]))


def test_a_phase_that_rolls_over_is_not_drawn_back_across_the_picture():
    phases = (0.7 + np.arange(10) / 10) % 1.0
    cycle = inphase.Response(np.arange(10) / 10, phases, phases[:, None], np.ones((10, 1)), ("arm",))
    (axes,) = cycle.plot(phase=True).axes
    assert [len(line) for line in lines(axes)] == [3, 7]
    assert all((np.diff(line[:, 0]) > 0).all() for line in lines(axes))


def test_demonstrations_are_what_was_recorded(told):
    figure = report.plot_demonstrations(told.demos)
    over_time = report.plot_demonstrations(told.demos, phase=False, channels=["l*", "turn"])
    for i, axes in enumerate(figure.axes):
        for line, one in zip(lines(axes), told.demos, strict=True):
            assert_array_equal(line, np.column_stack([one.phases, one.values[:, i]]))
    for i, axes in zip([1, 3], over_time.axes, strict=True):
        for line, one in zip(lines(axes), told.demos, strict=True):
            assert_array_equal(line, np.column_stack([one.times - one.times[0], one.values[:, i]]))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [one.name for one in told.demos]


def test_what_was_not_seen_is_passed_over(told):
    values = [one.values.copy() for one in told.demos]
    for one in values:
        one[::2, 0], one[:, 1] = np.nan, np.nan
    demos = inphase.Dataset.from_arrays([d.times for d in told.demos], values, ["reach", "lift"], ["grip", "turn"])
    reach, lift, *_ = report.plot_demonstrations(demos).axes
    assert_array_equal(lines(reach)[0][:, 1], told.demos[0].values[1::2, 0])
    assert [len(line) for line in lines(lift)] == [0] * 5
    assert [text.get_text() for text in lift.texts] == ["never seen"]


def test_an_angle_is_drawn_without_jumps(rng):
    times = np.linspace(0, 2, 40)
    angles = [2.5 + (0.8 + 0.05 * rng.standard_normal()) * times for _ in range(3)]
    values = [np.column_stack([np.sin(angle), np.angle(np.exp(1j * angle))]) for angle in angles]
    demos = inphase.Dataset.from_arrays([times] * 3, values, ["x"], ["wrist"], kinds={"wrist": "angle"})
    for line, angle in zip(lines(report.plot_demonstrations(demos).axes[1]), angles, strict=True):
        assert_allclose(np.diff(line[:, 1]), np.diff(angle), atol=1e-9)
        assert_allclose(np.exp(1j * line[:, 1]), np.exp(1j * angle), atol=1e-9)


def test_a_basis_is_its_functions_and_their_sum(told):
    basis = inphase.basis.Sigmoid(5)
    (axes,) = report.plot_basis(basis).axes
    *curves, total = lines(axes)
    for i, curve in enumerate(curves):
        assert_allclose(curve[:, 1], basis(curve[:, 0])[:, i])
    assert_allclose(total[:, 1], basis(total[:, 0]).sum(1))
    assert len(lines(report.plot_basis(basis, total=False).axes[0])) == 5
    mixed = chance_model(np.random.default_rng(0), phase_model())
    titles = [axes.get_title() for axes in report.plot_basis(mixed).axes]
    assert titles == ["reach, grip: Gaussian", "lift: Sigmoid", "turn: Polynomial"]
    assert [axes.get_title() for axes in report.plot_basis(mixed, channels="turn").axes] == ["turn: Polynomial"]
    with pytest.raises(OptionError, match="a basis knows none"):
        report.plot_basis(basis, channels="turn")


# ------------------------------------------------------------------------------------------------------ correlation


def test_the_matrix_is_the_correlation(told):
    for source, belief in ((told.model, None), (told.session, told.beliefs[-1]), (told.beliefs[3], told.beliefs[3])):
        axes = report.plot_correlation(source, phase=0.4).axes[0]
        assert_array_equal(axes.images[0].get_array(), report.channel_correlation(told.model, belief, 0.4))
        assert [text.get_text() for text in axes.get_yticklabels()] == ["reach", "lift", "grip", "turn"]
        some = report.plot_correlation(source, channels=["lift", "turn"]).axes[0]
        whole = report.channel_correlation(told.model, belief)
        assert_array_equal(some.images[0].get_array(), whole[np.ix_([1, 3], [1, 3])])
        weights = report.plot_correlation(source, channels=["lift", "turn"], weights=True).axes[0]
        names, expected = report.weight_correlation(told.model, belief, ["lift", "turn"])
        assert len(names) == 16
        assert_array_equal(weights.images[0].get_array(), expected)
        assert_allclose(weights.get_yticks(), [3.5, 11.5])
        assert weights.get_lines()[0].get_ydata()[0] == 7.5  # between the partners, or two features


def test_squares_are_as_large_as_the_correlation_is_strong(told):
    axes = report.plot_correlation(told.model, hinton=True).axes[0]
    expected = report.channel_correlation(told.model)
    (squares,) = axes.collections
    axes.figure.draw_without_rendering()
    corners = np.array([path.vertices[:4] for path in squares.get_paths()])
    areas = np.prod(corners.max(1) - corners.min(1), axis=1).reshape(4, 4)
    assert_allclose(areas / areas[0, 0], np.abs(expected), atol=1e-12)
    places = corners.mean(1).reshape(4, 4, 2)
    assert_allclose(places[2, 1], [1, 2], atol=1e-12)  # x is the column
    colours = squares.get_facecolors().reshape(4, 4, 4)
    for i, j in np.ndindex(4, 4):
        assert_allclose(colours[i, j], to_rgba(POSITIVE if expected[i, j] > 0 else NEGATIVE), atol=0.01)


def test_what_cannot_be_read_is_refused(told):
    with pytest.raises(OptionError, match="the same at every phase"):
        report.plot_correlation(told.model, weights=True, phase=0.5)
    many = wide_model(70)
    for draw in (
        lambda: many.plot(channels="*"),
        lambda: report.plot_correlation(many, weights=True, hinton=True),
    ):
        with pytest.raises(OptionError, match="at most"):
            draw()
    assert len(many.plot().axes) == 12
    assert many.plot().get_suptitle().startswith("12 of 70 channels")
    report.plot_correlation(many).draw_without_rendering()
    with pytest.raises(OptionError, match="at most 2000 weights in a figure, got 2080"):
        report.plot_correlation(wide_model(260), weights=True)


# -------------------------------------------------------------------------------------------------------- densities

GRID = np.linspace(0, 1, 2001)


def area(grid: np.ndarray, density: np.ndarray) -> float:
    return float((density[1:] + density[:-1]) @ np.diff(grid) / 2)


@pytest.mark.parametrize("name", FILTERS)
def test_every_belief_tells_all_of_its_phase(told, name):
    """Its cloud has its moments, and the density drawn has them too, but for smoothing."""
    session = told.model.session(name, seed=1, **OPTIONS[name])
    for time, values in zip(told.demos[0].times[:20], told.demos[0].values, strict=False):
        session.observe(time, values[:2])
    belief, seen = session.belief, cloud_of(session.belief)
    mean = seen.weights @ seen.moving
    off = seen.moving - mean
    cov = (off.T * seen.weights) @ off + np.diag(seen.weights @ seen.moving_var)
    assert seen.weights.sum() == pytest.approx(1)
    assert_allclose(mean[:2], belief.phase_mean[:2], atol=1e-9)
    # An ensemble's is unbiased.
    assert_allclose(np.diag(cov), np.diag(belief.phase_cov)[:2], rtol=1 / 59 + 1e-6, atol=1e-9)
    left, right = report.plot_phase_densities(belief).axes
    for axes, column in ((left, 0), (right, 1)):
        grid, density = lines(axes)[0].T
        assert area(grid, density) == pytest.approx(1, abs=0.01)
        at = float(area(grid, grid * density))
        assert at == pytest.approx(mean[column], abs=0.25 * np.sqrt(cov[column, column]))


def test_a_gaussian_is_drawn_as_one(told):
    estimate = told.estimates[12]
    left, right = report.plot_phase_densities(estimate).axes
    for axes, mean, std in (
        (left, estimate.phase, estimate.phase_std),
        (right, estimate.phase_velocity, estimate.phase_velocity_std),
    ):
        grid, density = lines(axes)[0].T
        assert_allclose(density, np.exp(-0.5 * ((grid - mean) / std) ** 2) / (std * np.sqrt(2 * np.pi)), atol=1e-12)


def points_at(shares: list[float], moving: list[list[float]]) -> Cloud:
    count = len(shares)
    moved = np.array(moving)
    return Cloud(np.array(shares), moved, np.zeros_like(moved), np.empty((count, 0)), np.empty((1, 0, 0)))


def test_points_stay_inside_and_a_circle_is_closed():
    early = points_at([0.5, 0.3, 0.2], [[0.0, 0.5], [0.02, 0.6], [0.05, 0.4]])
    assert area(GRID, phase_density(early, GRID)) == pytest.approx(1, abs=1e-3)
    straddling = points_at([0.5, 0.5], [[-0.03, 1.0], [7.04, 1.0]])
    round_it = phase_density(straddling, GRID, periodic=True)
    assert area(GRID, round_it) == pytest.approx(1, abs=1e-3)
    assert round_it[0] == pytest.approx(round_it[-1])
    one = points_at([1.0], [[0.3, 0.7]])  # all of it at one place is still seen
    assert area(GRID, phase_density(one, GRID)) == pytest.approx(1, abs=1e-3)
    assert area(GRID, tempo_density(one, GRID)) == pytest.approx(1, abs=1e-3)


def test_moments_of_a_recording_are_picked_by_time(told):
    recording = Recording(
        "run", told.model.channels, np.empty(0), np.empty((0, 4)), tuple(told.estimates), (None,) * 25
    )

    def named(figure: Figure) -> list[str]:
        return [text.get_text() for text in figure.legends[0].get_texts()]

    times = [e.time for e in told.estimates]
    assert named(report.plot_phase_densities(recording, at=[0.31, 99.0])) == ["0.30 s", f"{times[-1]:.2f} s"]
    assert named(report.plot_phase_densities(recording)) == [f"{times[i]:.2f} s" for i in (5, 10, 14, 19)]
    assert named(report.plot_phase_densities({"early": told.beliefs[2], "now": told.session})) == ["early", "now"]
    assert named(report.plot_phase_densities(told.beliefs[:2])) == ["moment 1", "moment 2"]
    for wrong, at, message in (
        (recording, [-1.0], "expected times from 0 s on, got -1 s"),
        (told.beliefs[:2], [0.1], "expected estimates, which have a time"),
        (told.beliefs[:13], None, "1 to 12 moments in a figure, got 13"),
        ([], None, "1 to 12 moments"),
        (replace(recording, estimates=(), responses=()), None, "something was observed, got none"),
    ):
        with pytest.raises(OptionError, match=message):
            report.plot_phase_densities(wrong, at=at)


def test_a_belief_without_a_tempo_has_that_of_the_demonstrations():
    still = chance_model(np.random.default_rng(0), phase_model(order=0))
    _, right = report.plot_phase_densities(still.session("bip")).axes
    grid, density = lines(right)[0].T
    assert area(grid, density) == pytest.approx(1, abs=0.01)
    assert grid[density.argmax()] == pytest.approx(still.phase.nominal_velocity, rel=0.01)


# ---------------------------------------------------------------------------------------------------------- the page


def pictures(told: Told) -> dict[str, Callable[..., Figure]]:
    return {
        "model": told.model.plot,
        "one channel": lambda **axes: told.model.plot(channels="grip", demonstrations=False, **axes),
        "response": told.response.plot,
        "demonstrations": lambda **axes: report.plot_demonstrations(told.demos, **axes),
        "densities": lambda **axes: report.plot_phase_densities(told.beliefs[::6], **axes),
        "correlation": lambda **axes: report.plot_correlation(told.model, **axes),
        "hinton": lambda **axes: report.plot_correlation(told.session, hinton=True, weights=True, **axes),
        "basis": lambda **axes: report.plot_basis(told.model, **axes),
    }


NAMES = ("model", "one channel", "response", "demonstrations", "densities", "correlation", "hinton", "basis")


@pytest.mark.parametrize("name", NAMES)
def test_nothing_leaves_the_page_or_lies_over_anything(name, told):
    figure = pictures(told)[name]()
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes] + [legend.get_window_extent() for legend in figure.legends]
    for i, box in enumerate(boxes):
        assert box.x0 >= -1
        assert box.y0 >= -1
        assert box.x1 <= figure.bbox.x1 + 1
        assert box.y1 <= figure.bbox.y1 + 1
        for other in boxes[:i]:
            assert max(box.x0 - other.x1, other.x0 - box.x1, box.y0 - other.y1, other.y0 - box.y1) > -1


@pytest.mark.parametrize("name", NAMES)
def test_it_is_drawn_in_the_axes_of_a_paper(name, told):
    draw = pictures(told)[name]
    count = {"correlation": 1}.get(name, len(draw().axes))  # a bar of colours comes with it
    paper = Figure()
    axes = paper.subplots(1, count, squeeze=False)[0]
    assert draw(axes=axes if count > 1 else axes[0]) is paper
    assert all(one.lines or one.images or one.collections for one in axes)
    assert paper.legends == []
    assert paper.get_suptitle() == ""
    with pytest.raises(OptionError, match=f"expected {count} axes, one a panel, got {count + 1}"):
        draw(axes=[*axes, axes[0]])


def test_no_figure_goes_through_pyplot():
    files = (Path(report.__file__).parents[1]).rglob("*.py")
    assert [str(path) for path in files if re.search(r"import.*(pyplot|pylab)", path.read_text("utf-8"))] == []


@pytest.mark.parametrize("name", NAMES)
def test_no_figure_is_kept(name, told):
    figure = pictures(told)[name]()
    assert isinstance(figure, Figure)
    gone = weakref.ref(figure)
    del figure
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize("name", NAMES)
def test_without_matplotlib_it_is_said_how_to_get_it(name, told, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(OptionError, match=r"pip install 'inphase\[plot\]'"):
        pictures(told)[name]()


def test_a_notebook_shows_a_figure_that_is_the_value_of_a_cell(told):
    assert told.response.plot()._repr_png_().startswith(b"\x89PNG\r\n\x1a\n")


def test_unknown_channels_are_told(told):
    for draw in (told.model.plot, told.response.plot, lambda **o: report.plot_demonstrations(told.demos, **o)):
        with pytest.raises(ChannelError, match="no channel fits 'nobody'"):
            draw(channels="nobody")


def test_names_are_text_whatever_they_hold(told):
    """A dollar sign begins no mathematics, and an underscore hides nothing from the legend."""
    odd = ["$\\frac{$", "<b>x</b>", "_y", "a$b$"]
    values, times = [one.values for one in told.demos], [one.times for one in told.demos]
    demos = inphase.Dataset.from_arrays(times, values, odd[:2], odd[2:], names=["_a", "$\\b$", "c", "d", "$"])
    model = taught(demos, basis=inphase.basis.Gaussian(5))
    for figure in (
        report.plot_demonstrations(demos),
        model.plot(),
        report.plot_correlation(model),
        report.plot_basis(model),
        model.session("bip").respond().plot(),
        report.plot_phase_densities({"$\\bad$": told.session}),
    ):
        figure.draw_without_rendering()
    legend = report.plot_demonstrations(demos).legends[0]
    assert [text.get_text() for text in legend.get_texts()] == [" _a", r"\$\b\$", "c", "d", r"\$"]
