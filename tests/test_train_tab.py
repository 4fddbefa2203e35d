"""The train tab in a real browser: a model is trained, stopped, shown; its command is the command line's own."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import NARROW
from browser import browser as started_browser
from interactions import CONTROLLED, OBSERVED
from playwright.sync_api import expect
from studios import WAIT, opened, picture, studio, tab, write

import inphase
from inphase.basis import Gaussian, Polynomial
from inphase.cli import fit as fit_file
from inphase.errors import OptionError
from inphase.evidence import Evidence, Trial
from inphase.studio.desk import Choice
from inphase.studio.train_tab import fit_command

MARKUP = ["<img src=x onerror=window.hacked=1>", "$$x^2$$", r"\(y\)", "<b>turn</b>"]
CHOICE = Choice(("recordings",), OBSERVED, CONTROLLED)
PAINTED = """() => {
  const canvases = root => [...root.querySelectorAll("*")].flatMap(e => [
    ...(e.tagName === "CANVAS" ? [e] : []), ...(e.shadowRoot ? canvases(e.shadowRoot) : [])])
  const there = canvases(document.querySelector("#panel-train")).filter(c => c.width * c.height > 0)
  return there.length > 4 && there.some(c => c.toDataURL().length > 8000)  // an empty one is a few hundred characters
}"""
AT = """([title, row, column]) => {
  const [view] = Bokeh.index.query(v => v.model.type === "Figure" && v.model.title.text.text === title)
  view.el.scrollIntoView({block: "center"})
  const {left, top} = view.el.getBoundingClientRect()
  return [left + view.frame.x_scale.compute(column), top + view.frame.y_scale.compute(row)]
}"""

expect.set_options(timeout=WAIT)


# ------------------------------------------------------------------------------------------------------------ command


@pytest.mark.parametrize("quick", [True, False])
def test_the_command_is_what_the_command_line_takes(tmp_path, monkeypatch, run, quick):
    write(tmp_path / "recordings", episodes=3)
    monkeypatch.chdir(tmp_path)
    asked: dict[str, Any] = {}

    def fit(dataset: inphase.Dataset, **options: Any) -> inphase.Model:
        asked.update(options, dataset=dataset)
        return inphase.fit(dataset, basis=options["basis"], calibrate=False)

    monkeypatch.setattr(fit_file, "fit_model", fit)
    command = fit_command(CHOICE, "-my model.inphase", {"basis": "polynomial:5", "periodic": False}, quick)
    assert run(*command.arguments)[0] == 0
    assert asked["calibrate"] is not quick
    assert asked["basis"] == Polynomial(5)
    assert (asked["dataset"].observed, asked["dataset"].controlled) == (OBSERVED, CONTROLLED)
    assert set(inphase.Model.load(tmp_path / "-my model.inphase").layout.bases) == {Polynomial(5)}


@pytest.mark.parametrize(
    ("choice", "output", "missing"),
    [
        (Choice((), OBSERVED, CONTROLLED), "a.inphase", "recordings"),
        (Choice(("recordings",), (), CONTROLLED), "a.inphase", "observed"),
        (Choice(("recordings",), OBSERVED, ()), "a.inphase", "controlled"),
        (CHOICE, "model.txt", "inphase"),
        (CHOICE, "", "inphase"),
    ],
)
def test_what_is_missing_is_said_and_nothing_is_run(choice, output, missing):
    with pytest.raises(OptionError, match=missing):
        fit_command(choice, output, {}, quick=True)


# ------------------------------------------------------------------------------------------------------------ browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with started_browser() as started:
        yield started


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("train")
    write(folder, episodes=5)
    return folder


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    with studio(folder) as address:
        yield address


def enter(field: Any, value: str) -> None:
    field.fill(value)
    field.press("Tab")


def pictured(page: Any, title: str) -> None:
    """Wait until there are pictures below the heading, which are not empty."""
    page.locator("#panel-train").get_by_role("heading", name=title).wait_for()
    page.wait_for_function(PAINTED)


def test_a_model_is_trained_and_shown(browser, address, folder):
    with opened(browser, address) as page:
        train = tab(page, "Train")
        expect(train.get_by_text("expected observed channels").first).to_be_visible()
        enter(train.get_by_label("Observed channels"), "reach l*")
        enter(train.get_by_label("Controlled channels"), "grip turn")
        train.get_by_label("Basis functions").select_option(label="gaussian")
        enter(train.get_by_label("How many"), "12")
        enter(train.get_by_label("Model file"), "trained.inphase")
        typed = (
            "inphase fit . --observed reach 'l*' --controlled grip turn --basis gaussian:12 --quick --output trained"
        )
        expect(train.get_by_text(typed)).to_be_visible()
        train.get_by_role("button", name="Train", exact=True).click()
        train.get_by_text("wrote trained.inphase").wait_for()
        expect(train.get_by_label("Model", exact=True)).to_have_value("trained.inphase")
        expect(train.get_by_text("48 basis weights").last).to_be_visible()
        for part in ("Movements", "Correlations", "Scaling", "Calibration"):
            pictured(page, part)
        picture(page, "studio-train")
        # A pair of channels opens into its weights: a square is tapped, here turn with lift.
        page.mouse.click(*page.evaluate(AT, ["Channels", 3, 1]))
        train.get_by_text("weights of turn and lift in a table").press("Enter")
        expect(train.get_by_role("cell", name="turn 3", exact=True).first).to_be_visible()
        expect(train.get_by_role("cell", name="lift 9", exact=True).first).to_be_visible()
        enter(train.get_by_label("Channels to show"), "gr* nobody")
        expect(train.get_by_text("no channel fits 'nobody'")).to_be_visible()
        enter(train.get_by_label("Channels to show"), "gr* turn")
        expect(train.get_by_label("Weights of").locator("option")).to_have_text(["grip", "turn"])
    assert set(inphase.Model.load(folder / "trained.inphase").layout.bases) == {Gaussian(12)}


def test_a_fit_is_stopped_and_bases_are_compared_on_a_narrow_dark_page(browser, address, folder):
    with opened(browser, address, viewport=NARROW, color_scheme="dark") as page:
        train = tab(page, "Train")
        train.get_by_label("Fit", exact=True).select_option(label="full: calibrated, up to minutes")
        enter(train.get_by_label("Model file"), "never.inphase")
        expect(train.get_by_text("--output never.inphase")).to_be_visible()
        train.get_by_role("button", name="Train", exact=True).click()
        train.get_by_text("learning from 5 demonstrations").wait_for()
        train.get_by_role("button", name="Stop").locator("visible=true").click()
        train.get_by_text("stopped", exact=True).wait_for()
        expect(train.get_by_role("button", name="Train", exact=True)).to_be_enabled()
        train.get_by_role("button", name="Compare basis functions").click()
        train.get_by_role("button", name=re.compile("^Take ")).click()
        best = (train.get_by_role("button", name=re.compile("^Take ")).text_content() or "").split()[-1]
        expect(train.get_by_text(f"--basis {best} --output never")).to_be_visible()
        pictured(page, "Calibration")
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        picture(page, "studio-train-400-dark")
    assert not list(folder.glob("*never*"))


def test_names_that_are_markup_are_text_and_500_channels_are_a_few(browser, tmp_path):
    write(tmp_path, MARKUP, episodes=3)
    rng, times, many = np.random.default_rng(0), np.linspace(0, 1, 30), [f"c{i}" for i in range(500)]
    values = [np.sin(3 * times[:, None] + np.arange(500)) + 0.1 * rng.normal(size=500) for _ in range(3)]
    wide = inphase.Dataset.from_arrays([times] * 3, values, many[:250], many[250:])
    inphase.fit(wide, calibrate=False).save(tmp_path / "<i>wide.inphase")
    (tmp_path / "<b>broken.inphase").write_bytes(b"nothing")
    marked = inphase.load(tmp_path, observed=MARKUP[:2], controlled=MARKUP[2:])
    trials = [Trial("<i>trust", f"<b>{i}", 0.1 * i, 0.05, 0.9 + 0.01 * i, -0.1 * i, i == 1) for i in range(3)]
    model = inphase.fit(marked, calibrate=False, basis=Gaussian(5))
    replace(model, evidence=Evidence(3, ("<i>as recorded",), tuple(trials), 0.5)).save(tmp_path / "marked.inphase")
    with studio(tmp_path) as address, opened(browser, address) as page:
        train = tab(page, "Train")
        chosen = train.get_by_label("Model", exact=True)
        chosen.select_option("marked.inphase")
        expect(train.get_by_text("20 basis weights")).to_be_visible()
        pictured(page, "Correlations")
        pictured(page, "Calibration")
        train.get_by_text("all that was tried").press("Enter")
        expect(train.get_by_role("cell", name="after, <i>trust: <b>2")).to_be_visible()
        picture(page, "studio-train-markup")
        chosen.select_option("<i>wide.inphase")
        expect(train.get_by_text("the 12 busiest of 500 channels").first).to_be_visible()
        pictured(page, "Correlations")
        picture(page, "studio-train-wide")
        chosen.select_option("<b>broken.inphase")
        expect(train.get_by_text("<b>broken.inphase").last).to_be_visible()
        assert page.evaluate("window.hacked") is None
