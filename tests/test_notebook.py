"""What a notebook shows: well-formed, small, true, and no name in it is anything but text."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from interactions import dataset, taught, wide_model
from numpy.testing import assert_allclose

import inphase
from inphase.report.look import NINETY
from inphase.report.notebook import sparkline

ODD = ["<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "a & b &amp; c", "</td></tr></table>'"]
ALLOWED = {"div", "b", "span", "table", "tr", "td", "code", "svg", "polygon", "polyline"}


@pytest.fixture(scope="module")
def shown() -> dict[str, object]:
    """A data set whose names and units are all but text, and all that comes of it."""
    plain = dataset(np.random.default_rng(3), count=5, rate=20.0)
    times, values = [one.times for one in plain], [one.values for one in plain]
    demos = inphase.Dataset.from_arrays(times, values, ODD[:2], ODD[2:], units={"*": "<m>"})
    model = taught(demos, basis=inphase.basis.Gaussian(8))
    session = model.session("bip")
    estimates = [session.observe(t, v[:2]) for t, v in zip(times[0][:10], values[0], strict=False)]
    return {"dataset": demos, "model": model, "response": session.respond(samples=20), "estimate": estimates[-1]}


def tree(value: object) -> ElementTree.Element:
    """What a notebook would show; as XML it is read more strictly than any browser reads it."""
    return ElementTree.fromstring(value._repr_html_())


def curve(svg: ElementTree.Element) -> np.ndarray:
    """(S, 2) the points of the line, y upward."""
    points = svg.find("polyline").get("points").split()
    return np.array([[float(number) for number in point.split(",")] for point in points]) * [1, -1]


def assert_drawn(svg: ElementTree.Element, at: np.ndarray, mean: np.ndarray, std: np.ndarray) -> None:
    """The line is the mean and its band 90 %, each brought to pixels by one scale, to a tenth of one."""
    low, high = (mean - NINETY * std).min(), (mean + NINETY * std).max()
    drawn, tall = curve(svg), float(svg.get("height")) - 4
    across = (at - at[0]) / (at[-1] - at[0]) * (float(svg.get("width")) - 2)
    assert_allclose(drawn[:, 0] - drawn[0, 0], across, atol=0.11)
    assert_allclose(drawn[:, 1] + tall + 2, (mean - low) / (high - low) * tall, atol=0.06)
    band = np.array([point.split(",") for point in svg.find("polygon").get("points").split()], dtype=float)[:, 1]
    upper, lower = band[: len(at)], band[len(at) :][::-1]
    assert_allclose((lower - upper) / tall * (high - low), 2 * NINETY * std, atol=0.11 / tall * (high - low))


@pytest.mark.parametrize("name", ["dataset", "model", "response", "estimate"])
def test_names_are_text_and_the_colours_are_those_of_the_page(name, shown):
    root = tree(shown[name])
    assert {element.tag for element in root.iter()} <= ALLOWED
    for element in root.iter():
        assert not [attribute for attribute in element.attrib if attribute.startswith("on") or "href" in attribute]
        for attribute in ("fill", "stroke"):
            assert element.get(attribute) in (None, "none", "currentColor")
        assert not re.search(r"color|background|url", element.get("style", ""))
    names = [code.text for code in root.iter("code")]
    assert names == {"estimate": [], "response": ODD[2:]}.get(name, ODD)
    if name in ("dataset", "model"):
        assert [row[-1].text for row in root.iter("tr")] == ["<m>"] * 4


def test_the_line_of_a_model_is_its_distribution(shown):
    model = shown["model"]
    at = np.linspace(0, 1, 40)
    mean, std = model.distribution(at)
    for i, svg in enumerate(tree(model).iter("svg")):
        assert_drawn(svg, at, mean[:, i], std[:, i])
    assert "5 demonstrations" in model._repr_html_()


def test_the_line_of_a_shrunk_prior_too():
    """Though it is drawn without the prior's factor."""
    model = wide_model(4, shrinkage=0.3, trust=0.4)
    at = np.linspace(0, 1, 40)
    mean, std = model.distribution(at)
    for i, svg in enumerate(tree(model).iter("svg")):
        assert_drawn(svg, at, mean[:, i], std[:, i])


def test_the_line_of_a_response_is_the_response(shown):
    response = shown["response"]
    for i, svg in enumerate(tree(response).iter("svg")):
        assert_drawn(svg, response.times, response.mean[:, i], response.std[:, i])


def test_the_line_of_a_data_set_is_that_of_its_demonstrations(shown):
    demos = shown["dataset"]
    at = np.linspace(0, 1, 40)
    for i, svg in enumerate(tree(demos).iter("svg")):
        curves = np.array([np.interp(at, one.phases, one.values[:, i]) for one in demos])
        assert_drawn(svg, at, curves.mean(0), curves.std(0, ddof=1))


def test_an_estimate_in_words(shown):
    estimate = shown["estimate"]
    text = " ".join(tree(estimate).itertext())
    assert f"{estimate.phase:.3f} ± {estimate.phase_std:.3f}" in text
    assert estimate.status.value in text


def test_of_many_channels_a_few_are_shown():
    model = wide_model(2000, functions=15, shrinkage=0.2)  # whose factor would take minutes
    html = model._repr_html_()
    assert len(html) < 12_000
    root = ElementTree.fromstring(html)
    assert [code.text for code in root.iter("code")] == ["a0", "a1", "a2", "b0", "b1", "b2"]
    assert "… and 1,994 more" in html
    assert "1,000 observed, 1,000 controlled channels" in html


def test_what_was_never_seen_is_a_dash_and_one_demonstration_has_no_band():
    values = np.column_stack([np.full(5, np.nan), np.linspace(0, 1, 5)])
    alone = inphase.Dataset.from_arrays([np.arange(5.0)], [values], ["lost"], ["arm"])
    root = tree(alone)
    assert [row[2].text for row in root.iter("tr")] == ["–", None]
    (svg,) = root.iter("svg")
    at = np.linspace(0, 1, 40)
    assert_drawn(svg, at, at, np.zeros(40))
    assert "1 demonstration of 4.00 s" in " ".join(root.itertext())


@pytest.mark.parametrize("count", [1, 4])  # with four of them not all of a quaternion is shown
def test_angles_and_orientations_are_drawn_without_jumps(count):
    times = np.linspace(0, 2, 60)
    half = (2.6 + 0.8 * times) / 2
    turning = np.column_stack([np.zeros((60, 2)), np.sin(half), np.cos(half)])
    turning[30:] *= -1  # the same orientations
    values = np.column_stack([turning, *[np.angle(np.exp(2j * half))] * count])
    names, wrists = ["head_qx", "head_qy", "head_qz", "head_qw"], [f"wrist {i}" for i in range(count)]
    demos = inphase.Dataset.from_arrays([times] * 2, [values] * 2, names, wrists, kinds={"wrist*": "angle"})
    lines = [curve(svg)[:, 1] for svg in tree(demos).iter("svg")]
    assert len(lines) == min(6, 4 + count)
    assert max(np.abs(np.diff(line)).max() for line in lines) < 3  # of 22 pixels


def test_a_line_of_nothing_one_point_or_no_height():
    nothing, one = np.full(3, np.nan), np.ones(1)
    assert sparkline(np.arange(3.0), nothing, nothing) == "–"
    for at, mean in ((one, one), (np.arange(3.0), np.full(3, 1e-300)), (np.arange(3.0), np.array([1, np.nan, 2]))):
        assert "nan" not in sparkline(at, mean, np.zeros(len(at)))
