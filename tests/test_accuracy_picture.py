"""The picture of an evaluation: every figure stands where it belongs, nothing over anything, no half file is left."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import inphase
from inphase.cli.accuracy import accuracy_series
from inphase.evaluation import CONDITIONS, Evaluation, Row
from inphase.report.accuracy_picture import AccuracySeries, draw_accuracy, make_figure

ALL = tuple(CONDITIONS)
FILTERS = ("rbpf", "ebip", "particle", "promp", "bip")


def series(name: str, conditions: int = 5, baseline: bool = False, level: float = 0.1, seed: int = 0) -> AccuracySeries:
    rng = np.random.default_rng(seed)
    now, cover = level * np.exp(rng.normal(size=conditions)), rng.uniform(0.5, 1, conditions)
    return AccuracySeries(name, now, 0.1 * now, cover, np.full(conditions, 0.02), baseline)


def many(conditions: int = 5) -> list[AccuracySeries]:
    filters = [series(name, conditions, seed=i) for i, name in enumerate(FILTERS)]
    baselines = [series(name, conditions, True, 0.8, seed=9) for name in ("mean trajectory", "ridge")]
    return [*filters, *baselines]


def points(figure: Figure, axes: int) -> dict[str, ErrorbarContainer]:
    return {str(found.get_label()): found for found in figure.axes[axes].containers}


def test_every_figure_stands_at_its_condition_with_its_standard_error():
    drawn = many()
    figure = make_figure("handover", ALL, drawn)
    assert [label.get_text() for label in figure.axes[1].get_xticklabels()] == list(ALL)
    assert figure.axes[0].get_title() == "handover"
    for axes, metric in ((0, "now"), (1, "cover")):
        found = points(figure, axes)
        assert list(found) == [one.name for one in drawn]
        for one in drawn:
            marks, _, (bars,) = found[one.name].lines
            places, values = marks.get_data()
            assert_allclose(values, getattr(one, metric))
            assert_allclose(np.round(places), np.arange(5))
            ends = np.array(bars.get_segments())[:, :, 1]
            error = getattr(one, f"{metric}_error")
            assert_allclose(ends, np.column_stack([values - error, values + error]))


def test_predictors_stand_side_by_side_and_no_two_look_alike():
    found = points(make_figure("handover", ALL, many()), 0)
    places = np.array([container.lines[0].get_xdata() for container in found.values()])
    assert (np.diff(places, axis=0) > 0).all()
    assert (places[0, 1:] > places[-1, :-1]).all()
    looks = {
        (c.lines[0].get_color(), c.lines[0].get_marker(), c.lines[0].get_markerfacecolor()) for c in found.values()
    }
    assert len({colour for colour, _, _ in looks}) == len({(marker, face) for _, marker, face in looks}) == 7
    hollow = {name for name, c in found.items() if c.lines[0].get_markerfacecolor() == "white"}
    assert hollow == {"mean trajectory", "ridge"}


def test_the_mean_and_the_wanted_share_are_lines():
    above, below = make_figure("handover", ALL, many()).axes
    assert [1.0, 1.0] in [list(line.get_ydata()) for line in above.get_lines()]
    assert [0.9, 0.9] in [list(line.get_ydata()) for line in below.get_lines()]


def test_what_is_not_known_is_not_drawn():
    """A condition in which nothing was scored, a single episode without standard error, a predictor without error."""
    nan, values = np.full(2, np.nan), np.array([0.5, np.nan])
    figure = make_figure("a", ALL[:2], [AccuracySeries("bip", values, nan, values, nan), series("oracle", 2, level=0)])
    figure.draw_without_rendering()
    marks = points(figure, 0)["bip"].lines[0]
    assert_allclose(marks.get_ydata(), values)


LAYOUTS = {
    "all": (ALL, many()),
    "one of each": (ALL[:1], [series("rbpf", 1)]),
    "two conditions": (ALL[:2], many(2)),
    "three predictors": (ALL[:3], many(3)[4:]),
    "far apart": (ALL, [series("bip", level=50.0), series("ridge", level=1e-3, baseline=True)]),
    "two decades": (ALL, [series("bip", level=0.05), series("ridge", level=4, baseline=True)]),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_nothing_lies_over_anything(name):
    figure = make_figure("mean of 4 tasks", *LAYOUTS[name])
    figure.draw_without_rendering()
    (legend,) = figure.legends
    boxes = [*(axes.get_tightbbox() for axes in figure.axes), legend.get_window_extent()]
    for i, box in enumerate(boxes):
        assert box.x0 >= figure.bbox.x0 - 1
        assert box.y0 >= figure.bbox.y0 - 1
        assert box.x1 <= figure.bbox.x1 + 1
        assert box.y1 <= figure.bbox.y1 + 1
        for other in boxes[:i]:
            assert max(box.x0 - other.x1, other.x0 - box.x1, box.y0 - other.y1, other.y0 - box.y1) > -1
    for axis in (figure.axes[0].yaxis, figure.axes[1].yaxis, figure.axes[1].xaxis):
        labels = [label.get_window_extent() for label in axis.get_ticklabels() if label.get_text()]
        inside = [b for b in labels if figure.bbox.y0 <= b.y0 and b.y1 <= figure.bbox.y1]
        assert not any(one.overlaps(other) for i, one in enumerate(inside) for other in inside[:i])
    for axes in figure.axes:
        low, high = axes.get_ylim()
        for container in axes.containers:
            values = container.lines[0].get_ydata()
            assert (low <= values).all()
            assert (values <= high).all()


def test_it_draws_what_was_evaluated(rng):
    rows = [
        Row(task, name, condition, 0, f"episode {i}", *rng.uniform(0.1, 1, 6))
        for task in ("wave", "reach")
        for name in ("bip", "ridge")
        for condition in ALL[:2]
        for i in range(3)
    ]
    found = Evaluation(tuple(rows))
    bip, ridge = accuracy_series(found)
    assert (bip.name, bip.baseline, ridge.name, ridge.baseline) == ("bip", False, "ridge", True)
    for one in (bip, ridge):
        for i, condition in enumerate(ALL[:2]):
            now, cover = (found.figure(metric, one.name, condition) for metric in ("now", "cover"))
            assert (one.now[i], one.now_error[i]) == (now.mean, now.error)
            assert (one.cover[i], one.cover_error[i]) == (cover.mean, cover.error)


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_the_file_is_what_its_name_says(suffix, magic, tmp_path):
    path = tmp_path / f"a{suffix}"
    draw_accuracy(path, "handover", ALL, many())
    assert path.read_bytes().startswith(magic)
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_drawn_is_refused(tmp_path, monkeypatch):
    for name, conditions, drawn, words in (
        ("a.docx", ALL, many(), "unknown kind of picture"),
        ("no/a.png", ALL, many(), "expected the folder"),
        ("a.png", ALL, [], "expected conditions and series to draw, got 5 and 0"),
        ("a.png", ALL, [series("bip", 4)], "bip: expected 5 figures, one a condition, got 4"),
    ):
        with pytest.raises(inphase.OptionError, match=words):
            draw_accuracy(tmp_path / name, "handover", conditions, drawn)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(inphase.OptionError, match=r"pip install 'inphase\[plot\]'"):
        draw_accuracy(tmp_path / "a.png", "handover", ALL, many())
    assert list(tmp_path.iterdir()) == []


def test_nothing_half_written(tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    path.write_bytes(b"the old picture")

    def half(self: Figure, path: Path, **_: object) -> None:
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, "savefig", half)
    with pytest.raises(KeyboardInterrupt):
        draw_accuracy(path, "handover", ALL, many())
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"a.png": b"the old picture"}
