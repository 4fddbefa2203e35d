"""The picture of a replay: what is drawn is what was answered, nothing lies over anything, and no half file is left."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from interactions import dataset, taught
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

import inphase
from inphase.cli.picture import panel
from inphase.evaluation import replay
from inphase.report.look import NINETY, check_picture
from inphase.report.replay_picture import ReplayPanel, busiest, draw_replays, make_figure

LABELS = {
    "as recorded",
    "response now, with 90 % band",
    *(f"rest, foreseen at {share} %" for share in (25, 50, 75)),
}


def played(demos: inphase.Dataset, title: str = "the last") -> ReplayPanel:
    """A panel of the last demonstration, followed by a model of the others."""
    model = taught(demos.without(-1))
    return panel(title, model, demos[-1], replay(model, demos[-1], filter="bip"))


def with_channels(count: int, unit: str = "m") -> inphase.Dataset:
    """Interactions of two observed and `count` controlled channels."""
    rng = np.random.default_rng(count)
    demos = dataset(rng, count=4, rate=15.0)
    mixed = [d.values[:, :2] @ rng.standard_normal((2, count)) for d in demos]
    values = [np.column_stack([d.values[:, :2], more]) for d, more in zip(demos, mixed, strict=True)]
    names = [f"robot_joint_{i}" for i in range(1, count + 1)]
    return inphase.Dataset.from_arrays([d.times for d in demos], values, ["reach", "lift"], names, units={"*": unit})


@pytest.fixture(scope="module")
def one() -> ReplayPanel:
    return played(with_channels(1))


@pytest.fixture(scope="module")
def three() -> ReplayPanel:
    return played(with_channels(3))


@pytest.fixture(scope="module")
def seven() -> ReplayPanel:
    return played(with_channels(7))


def unscored(shown: ReplayPanel) -> ReplayPanel:
    """The same replay, what the controlled partner did not being known."""
    nothing = np.full_like(shown.truth, np.nan)
    return ReplayPanel(**{**vars(shown), "truth": nothing})


# ----------------------------------------------------------------------------------------------------------- the file

MAGIC = {".png": b"\x89PNG\r\n\x1a\n", ".svg": b"<?xml", ".pdf": b"%PDF", ".PNG": b"\x89PNG"}


@pytest.mark.parametrize("suffix", MAGIC)
def test_the_file_is_what_its_name_says(suffix, three, tmp_path):
    path = tmp_path / f"picture{suffix}"
    draw_replays(path, [three, three])
    assert path.read_bytes().startswith(MAGIC[suffix])
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("name", ["picture.docx", "picture", "picture.", "png", ".png", "picture.jpg.txt"])
def test_an_unknown_kind_of_file_is_refused(name, three, tmp_path):
    for refuse in (check_picture, lambda path: draw_replays(path, [three])):
        with pytest.raises(inphase.OptionError, match=r"unknown kind of picture .* must end in \.png, \.svg, \.pdf"):
            refuse(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_where_there_is_no_folder_or_nothing_to_draw(three, tmp_path):
    with pytest.raises(inphase.OptionError, match=r"expected the folder .*nowhere to exist"):
        draw_replays(tmp_path / "nowhere" / "a.png", [three])
    with pytest.raises(inphase.OptionError, match="at least one replay to draw, got none"):
        draw_replays(tmp_path / "a.png", [])
    assert list(tmp_path.iterdir()) == []


def test_without_matplotlib_it_is_said_how_to_get_it(three, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(inphase.OptionError, match=r"pip install 'inphase\[plot\]'"):
        draw_replays(tmp_path / "a.png", [three])
    assert list(tmp_path.iterdir()) == []


def test_nothing_half_written(three, tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    path.write_bytes(b"the old picture")

    def half(self: Figure, path: Path, **_: object) -> None:
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, "savefig", half)
    with pytest.raises(KeyboardInterrupt):
        draw_replays(path, [three])
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]
    assert path.read_bytes() == b"the old picture"


# ----------------------------------------------------------------------------------------------------------- the looks


def layouts(one: ReplayPanel, three: ReplayPanel, seven: ReplayPanel) -> dict[str, list[ReplayPanel]]:
    return {
        "one channel": [one],
        "three channels": [three],
        "many channels": [seven],
        "two replays": [three, one],
        "three replays": [three, one, seven],
        "four replays": [one, three, seven, three],
        "five replays": [one] * 5,
        "six replays": [three, one, seven] * 2,
        "no truth": [unscored(three)],
        "no truth in one of two": [unscored(one), one],
    }


NAMES = [
    *("one channel", "three channels", "many channels", "two replays", "three replays", "four replays"),
    *("five replays", "six replays", "no truth", "no truth in one of two"),
]


@pytest.mark.parametrize("name", NAMES)
def test_nothing_lies_over_anything(name, one, three, seven):
    figure = make_figure(layouts(one, three, seven)[name])
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    (legend,) = figure.legends
    boxes.append(legend.get_window_extent())
    if figure.get_suptitle():
        boxes.append(figure._suptitle.get_window_extent())
    for i, box in enumerate(boxes):
        assert box.x0 >= figure.bbox.x0 - 1
        assert box.y0 >= figure.bbox.y0 - 1
        assert box.x1 <= figure.bbox.x1 + 1
        assert box.y1 <= figure.bbox.y1 + 1
        for other in boxes[:i]:
            apart = max(box.x0 - other.x1, other.x0 - box.x1, box.y0 - other.y1, other.y0 - box.y1)
            assert apart > -1  # points: edges may touch
    assert legend.get_window_extent().y1 <= min(box.y0 for box in boxes[: len(figure.axes)]) + 1


@pytest.mark.parametrize("name", NAMES)
def test_a_thousand_pixels_are_enough_to_read_it(name, one, three, seven):
    """Letters are at least ten pixels high where the picture is shown a thousand wide."""
    figure = make_figure(layouts(one, three, seven)[name])
    texts = [text for axes in figure.axes for text in [axes.xaxis.label, axes.yaxis.label, *axes.get_xticklabels()]]
    smallest = min(text.get_fontsize() for text in [*texts, *figure.legends[0].get_texts()])
    assert smallest / 72 * 1000 / figure.get_figwidth() >= 10


# --------------------------------------------------------------------------------------------------- what it tells of


def lines(figure: Figure, axes: int) -> dict[str, np.ndarray]:
    """The labelled lines of one of the axes, (N, 2) each."""
    found = figure.axes[axes].get_lines()
    return {str(line.get_label()): line.get_xydata() for line in found if not str(line.get_label()).startswith("_")}


def test_what_is_drawn_is_what_was_answered(one):
    figure = make_figure([one])
    drawn = lines(figure, 0)
    assert set(drawn) == LABELS
    assert {text.get_text() for text in figure.legends[0].get_texts()} == LABELS
    mean = np.array([r.mean[0, 0] for r in one.responses])
    std = np.array([r.std[0, 0] for r in one.responses])
    assert_array_equal(drawn["response now, with 90 % band"], np.column_stack([one.times, mean]))
    assert_array_equal(drawn["as recorded"], np.column_stack([one.times, one.truth[:, 0]]))
    band = figure.axes[0].collections[0].get_paths()[0].vertices
    for sign in (-1, 1):
        for point in np.column_stack([one.times, mean + sign * NINETY * std]):
            assert np.abs(band - point).sum(axis=1).min() < 1e-9
    for share, response in one.previews.items():
        begun = one.estimates[0].time
        rest = drawn[f"rest, foreseen at {100 * share:.0f} %"]
        assert_allclose(rest, np.column_stack([response.times - begun, response.mean[:, 0]]))
        assert rest[0, 0] == one.times[int(share * len(one.times))]
    below = [line.get_xydata() for line in figure.axes[1].get_lines()]
    assert_array_equal(below[0], np.column_stack([one.times, one.phases]))
    assert_array_equal(below[1], np.column_stack([one.times, [e.phase for e in one.estimates]]))


def test_axes_say_what_and_in_which_unit(one):
    figure = make_figure([one])
    assert figure.axes[0].get_ylabel() == "robot_joint_1 [m]"
    assert figure.axes[1].get_ylabel() == "phase"
    assert figure.axes[1].get_xlabel() == "time [s]"
    assert figure.get_suptitle() == "the last"
    assert make_figure([played(with_channels(1, unit=""))]).axes[0].get_ylabel() == "robot_joint_1"
    assert [axes.get_title() for axes in make_figure([one, one]).axes[::2]] == ["the last"] * 2


def test_what_is_not_known_is_not_drawn(three):
    figure = make_figure([unscored(three)])
    assert set(lines(figure, 0)) == LABELS - {"as recorded"}
    assert {text.get_text() for text in figure.legends[0].get_texts()} == LABELS - {"as recorded"}


def test_the_busiest_channels_are_those_whose_mean_moves_most(seven):
    model = seven.model
    mean = np.array([model.predict([p])[0, 2:] for p in np.linspace(0, 1, 100)])
    way = [(mean[:, i].max() - mean[:, i].min()) / model.spread[2 + i] for i in range(7)]
    for most in (1, 3, 4, 7, 9):
        assert busiest(model, most) == sorted(sorted(range(7), key=lambda i: -way[i])[:most])
    shown = [axes.get_ylabel() for axes in make_figure([seven]).axes if axes.get_ylabel() != "phase"]
    assert shown == [f"robot_joint_{i + 1} [m]" for i in busiest(model, 4)]


def test_an_angle_is_drawn_on_the_branch_of_the_response(rng):
    """Recorded between -π and π, it jumps; drawn, it stays beside what was answered."""
    times = np.linspace(0, 2, 40)
    values = []
    for _ in range(4):
        angle = 2.5 + (0.8 + 0.05 * rng.standard_normal()) * times
        values.append(np.column_stack([np.sin(angle), np.cos(angle), np.angle(np.exp(1j * angle))]))
    demos = inphase.Dataset.from_arrays([times] * 4, values, ["x", "y"], ["wrist"], kinds={"wrist": "angle"})
    assert np.abs(np.diff(values[-1][:, 2])).max() > 6
    shown = played(demos)
    assert np.abs(np.diff(shown.truth[:, 0])).max() < 1
    mean = np.array([r.mean[0, 0] for r in shown.responses])
    assert np.abs(shown.truth[:, 0] - mean).max() < 1
    assert_allclose(np.exp(1j * shown.truth[:, 0]), np.exp(1j * values[-1][:, 2]), atol=1e-9)
