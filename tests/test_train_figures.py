"""The train tab's figures: what is drawn is what the model says, and names are never markup or mathematics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bokeh.models import HoverTool, PlainText
from interactions import CONTROLLED, OBSERVED, chance_model, dataset, phase_model, taught
from numpy.testing import assert_allclose

import inphase
from inphase.basis import Gaussian
from inphase.cli.groups import groups_of_model
from inphase.cli.select import describe_selection
from inphase.evidence import Evidence, Trial
from inphase.studio.correlations import strongest, weights_of_pair
from inphase.studio.details import MOST, details
from inphase.studio.figures.basis import draw_basis
from inphase.studio.figures.criterion import draw_criterion, least, size_of
from inphase.studio.figures.hinton import SIDE, draw_hinton, squares_of
from inphase.studio.figures.prior import draw_prior, movements_of
from inphase.studio.figures.ranges import draw_ranges, groups_of
from inphase.studio.figures.trials import WHAT, draw_trials, row_names, trial_names
from inphase.studio.shown import busiest, picked

MARKUP = "<img src=x onerror=alert(1)> $$x^2$$"


@pytest.fixture
def model(rng: np.random.Generator) -> inphase.Model:
    return chance_model(rng, phase_model())


def drawn(figure: Any, glyph: str) -> list[dict[str, Any]]:
    """The data of every glyph of that kind, by the properties that are read from it."""
    found = []
    for renderer in figure.renderers:
        if type(renderer.glyph).__name__ == glyph:
            fields = renderer.glyph.properties_with_values()
            named = {name: value.field for name, value in fields.items() if hasattr(value, "field")}
            found.append({name: renderer.data_source.data[field] for name, field in named.items()})
    return found


def texts(figure: Any) -> list[object]:
    """Everything on the canvas that a reader reads, but numbers."""
    overrides = [text for axis in figure.axis for text in axis.major_label_overrides.values()]
    return [figure.title.text, *(axis.axis_label for axis in figure.axis), *overrides]


# ---------------------------------------------------------------------------------------------------------- movements


@pytest.mark.parametrize("shrinkage", [0.0, 0.4])
def test_what_is_drawn_is_the_distribution_of_the_model(model, shrinkage):
    blocks = tuple(basis.size for basis in model.layout.bases)
    model = replace(model, prior=replace(model.prior, shrinkage=shrinkage, trust=0.5, partner=9, blocks=blocks))
    for channel in range(4):
        figure = draw_prior(model, movements_of(model), channel)
        (line,), (band,), (behind,) = (drawn(figure, kind) for kind in ("Line", "VArea", "MultiLine"))
        mean, std = (values[:, channel] for values in model.distribution(line["x"]))
        assert_allclose(line["y"], mean)
        assert_allclose(band["y1"], mean - std)
        assert_allclose(band["y2"], mean + std)
        assert_allclose(behind["ys"], [model.predict(behind["xs"][0], w)[:, channel] for w in model.prior.samples])


def test_of_many_demonstrations_some_are_drawn_the_first_and_the_last_among_them(rng):
    model = chance_model(rng, phase_model(), demonstrations=90)
    behind = movements_of(model).behind
    assert len(behind) == 30
    for row, weights in ((0, model.prior.samples[0]), (-1, model.prior.samples[-1])):
        assert_allclose(behind[row], model.predict(np.linspace(0, 1, 101), weights))


def test_basis_functions_are_drawn_as_they_are():
    (lines,) = drawn(draw_basis("seven", Gaussian(7)), "MultiLine")
    assert_allclose(np.transpose(lines["ys"]), Gaussian(7)(np.array(lines["xs"][0])))


# ------------------------------------------------------------------------------------------------------- correlations


def test_areas_are_correlations_and_what_is_negative_is_hollow(rng):
    r = np.corrcoef(rng.normal(size=(5, 12)))
    r[0, 3] = r[3, 0] = np.nan
    data = squares_of(draw_hinton("", list("abcde"), list("abcde"), r)).data
    assert len(data["r"]) == 23
    for row, column, side, filled in zip(data["row"], data["column"], data["side"], data["filled"], strict=True):
        assert side**2 == pytest.approx(SIDE**2 * abs(r[row, column]))
        assert (filled < 0.5) == (r[row, column] < 0)
        if row == column:
            assert side == pytest.approx(SIDE)


def test_the_rows_of_the_matrix_stand_as_in_the_table_the_first_on_top():
    figure = draw_hinton("", ["up", "down"], ["left", "middle", "right"], np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -0.5]]))
    assert figure.y_range.start > figure.y_range.end
    assert figure.x_range.start < figure.x_range.end
    data = squares_of(figure).data
    assert (data["name"][-1], data["other"][-1], data["r"][-1]) == ("down", "right", -0.5)
    assert [figure.yaxis[0].major_label_overrides[i].text for i in range(2)] == ["up", "down"]


def test_weights_of_a_pair_are_those_of_the_demonstrations(model):
    rows, columns, r = weights_of_pair(model, "turn", "lift")
    assert rows == ["turn 1", "turn 2", "turn 3", "turn 4"]
    assert columns == ["lift 1", "lift 2", "lift 3", "lift 4"]
    assert_allclose(r, np.corrcoef(model.prior.samples.T)[14:18, 5:9])
    rows, columns, r = weights_of_pair(model, "reach", "reach")
    assert rows == columns
    assert_allclose(r.diagonal(), 1)


def test_the_pair_that_is_opened_first_is_one_of_either_partner(model):
    r = np.eye(4)
    r[0, 1] = r[1, 0] = 0.99  # both observed
    r[1, 2] = r[2, 1] = -0.6
    r[0, 3] = r[3, 0] = 0.5
    assert strongest(model, [0, 1, 2, 3], r) == (1, 2)
    assert strongest(model, [0, 1], np.eye(2)) == (0, 1)


# ----------------------------------------------------------------------------------------------------------- scaling


def test_groups_are_those_of_the_card(rng):
    names = ["hand_x", "hand_y", "head_qx", "head_qy", "head_qz", "head_qw", "grip"]
    times = np.linspace(0, 2, 40)
    values = []
    for _ in range(4):
        turn = 0.3 * np.sin(times) + 0.05 * rng.normal()
        moving = [(1 + rng.normal() / 9) * np.sin(times), np.cos(times), np.sin(turn / 2), 0 * turn]
        values.append(np.stack([*moving, 0 * turn, np.cos(turn / 2), times + rng.normal() / 9], axis=1))
    demos = inphase.Dataset.from_arrays(
        [times] * 4, values, names[:6], names[6:], units={"hand_?": "m"}, kinds={"head_q?": "quaternion"}
    )
    model = taught(demos, basis=Gaussian(8))
    assert [
        {"group": g.name, "unit": g.unit, "channels": list(g.channels), "low": g.low, "high": g.high, "span": g.span}
        for g in groups_of(model)
    ] == groups_of_model(model)
    # The longest of a group is one long, as near as the bases come to it.
    (bars,) = drawn(draw_ranges(model, range(model.layout.count)), "HBar")
    for group in groups_of(model):
        ways = [
            h - low
            for h, low, of in zip(bars["right"], bars["left"], groups_in_order(model), strict=True)
            if of == group.name
        ]
        assert max(ways) == pytest.approx(1, abs=0.05)


def groups_in_order(model: inphase.Model) -> list[str]:
    """The group of every bar: features of a group beside each other."""
    groups = list(model.coordinates.groups)
    return sorted(groups, key=groups.index)


# --------------------------------------------------------------------------------------------------------- selection


def test_a_criterion_is_drawn_by_size_and_family(rng):
    selection = inphase.select_basis(dataset(rng, count=4), sizes=(5, 8, 11))
    described = describe_selection(selection)
    for criterion in ("held-out", "aic", "bic"):
        chosen = selection.candidates[selection.chosen(criterion)[0]]
        best = selection.values(criterion)[0, selection.chosen(criterion)[0]]
        family = type(chosen).__name__.lower()
        figure = draw_criterion(described["candidates"], criterion, (family, chosen.size))
        *dots, ring = drawn(figure, "Scatter")
        assert_allclose([ring["x"][0], ring["y"][0]], [chosen.size, best])
        for at, name in zip(dots, ("gaussian", "sigmoid", "polynomial"), strict=True):
            kinds = [i for i, basis in enumerate(selection.candidates) if type(basis).__name__.lower() == name]
            for size, value in zip(at["x"], at["y"], strict=True):
                of = [i for i in kinds if selection.candidates[i].size == size]
                assert value == pytest.approx(selection.values(criterion)[0, of].min())


def test_candidates_that_are_not_known_are_left_out():
    known = {"family": "gaussian", "size": 5, "aic": [1.0]}
    candidates = [
        known,
        {"family": "gaussian", "size": 9, "aic": [None]},
        {"family": "polynomial", "degree": 3, "aic": [None]},
    ]
    assert least(candidates, "aic") == {"gaussian": {5: 1.0}, "polynomial": {}}
    assert size_of(candidates[2]) == 4
    draw_criterion(candidates[1:], "aic", ("gaussian", 9))  # nothing to draw is a picture too


# ------------------------------------------------------------------------------------------------------- calibration


def evidence() -> Evidence:
    return Evidence(
        5,
        ("as recorded",),
        (
            Trial("before", "as learned", 0.5, 0.1, 0.8, 1.0, True),
            Trial("trust", "as it is", 0.5, 0.1, 0.8, 1.0, False),
            Trial("trust", "0.5", 0.4, 0.1, 0.7, np.inf, True),
            Trial("band", "1.20 times as wide", 0.4, 0.1, 0.9, 0.9, True),
        ),
        0.7,
    )


@pytest.mark.parametrize("what", WHAT)
def test_trials_are_drawn_in_their_order_and_filled_where_the_model_has_them(what):
    (dots,) = drawn(draw_trials(evidence(), what), "Scatter")
    trials = [t for t in evidence().trials if np.isfinite(getattr(t, what))]
    assert_allclose(dots["x"], [getattr(t, what) for t in trials])
    assert [bool(filled) for filled in dots["fill_alpha"]] == [t.chosen for t in trials]
    assert [evidence().trials[row] for row in dots["y"]] == trials


def test_a_choice_is_named_once_above_its_candidates():
    assert trial_names(evidence())[1:3] == ["trust: as it is", "trust: 0.5"]
    assert row_names(evidence()) == [
        "before: as learned",
        "trust: as it is",
        "· 0.5",
        "after, band: 1.20 times as wide",
    ]


# ------------------------------------------------------------------------------------------------------------- names


def test_no_name_is_markup_or_mathematics(rng):
    names = {old: f"{MARKUP}{i}" for i, old in enumerate((*OBSERVED, *CONTROLLED))}
    demos = dataset(rng, count=4)
    demos = inphase.Dataset.from_arrays(
        [d.times for d in demos],
        [d.values for d in demos],
        [names[n] for n in OBSERVED],
        [names[n] for n in CONTROLLED],
    )
    model = taught(demos, basis=Gaussian(5))
    r = np.eye(4)
    figures = [
        draw_prior(model, movements_of(model), 0),
        draw_hinton(MARKUP, model.names, model.names, r),
        draw_ranges(model, range(4)),
        draw_trials(evidence(), "error"),
        draw_basis(MARKUP, Gaussian(5)),
    ]
    for figure in figures:
        assert all(isinstance(text, PlainText) for text in texts(figure))
        for tool in figure.select(HoverTool):
            assert not any("{safe}" in value for _, value in tool.tooltips)
    assert "&lt;img" in details(MARKUP, [MARKUP], [[MARKUP]]).text
    assert "<img" not in details(MARKUP, [MARKUP], [[MARKUP]]).text
    assert details("", [""], []).disable_math


def test_a_table_is_folded_and_says_where_it_was_cut():
    table = details("all of them", ["name", "r"], [[f"n{i}", 0.123456] for i in range(MOST + 3)])
    assert table.text.startswith("<details><summary>all of them</summary>")
    assert "… and 3 more rows" in table.text
    assert '<td class="number">0.1235</td>' in table.text


# ---------------------------------------------------------------------------------------------------- which are shown


def wide(model: inphase.Model, count: int) -> inphase.Model:
    """Moving channels of either partner: those of higher numbers move more."""
    times = np.linspace(0, 1, 30)
    rows = [
        np.stack([np.full(30, 1.0 * i) + 1e-3 * np.sin(9 * times + i + j) for i in range(count)], axis=1)
        for j in range(3)
    ]
    for values in rows:
        values += np.linspace(0, 1, count) * times[:, None]
    names = [f"c{i}" for i in range(count)]
    demos = inphase.Dataset.from_arrays([times] * 3, rows, names[: count - 3], names[count - 3 :])
    return taught(demos, basis=Gaussian(4))


def test_of_many_channels_the_busiest_of_either_partner_are_shown(model):
    many = wide(model, 40)
    shown, said = picked(many, "", 8)
    assert len(shown) == 8
    assert {37, 38, 39} <= set(shown)  # all there are of the controlled partner
    assert said.startswith("the 8 busiest of 40 channels")
    assert 0 not in busiest(many, 39)
    assert picked(many, "c1 'c2' c3?", 24) == ([1, 2, *range(30, 40)], "")
    assert picked(many, "c*", 24)[1].startswith("the 24 first of 40")
    for wrong in ("nobody", "'c1"):
        with pytest.raises(inphase.InphaseError):
            picked(many, wrong, 8)
    assert picked(model, "", 12) == ([0, 1, 2, 3], "")
