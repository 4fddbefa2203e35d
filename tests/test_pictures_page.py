"""docs/pictures.md: its code runs as it stands, its table names every picture and option there is."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from interactions import shapes_unchecked
from pages import blocks, rows

import inphase
from inphase import report
from inphase.io.handwriting import export_handwriting

PAGE = Path(__file__).parents[1] / "docs" / "pictures.md"


@pytest.fixture(autouse=True)
def unchecked() -> Iterator[None]:
    """As readers run it."""
    with shapes_unchecked():
        yield


def test_the_code_of_the_page_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    export_handwriting("Sine", tmp_path / "inphase-demo" / "Sine")
    names: dict[str, object] = {}
    for language, line, code in blocks(PAGE.read_text(encoding="utf-8")):
        assert language == "python"
        # Blank lines before it, so that a traceback names the line of the page.
        exec(compile("\n" * (line - 1) + code, PAGE, "exec"), names)
    drawn = {path.name for path in tmp_path.glob("*.png")}
    assert drawn == {"model.png", "densities.png"}
    assert drawn == {Path(link).name for link in re.findall(r"\]\((pictures/.+?)\)", PAGE.read_text(encoding="utf-8"))}
    figure = names["paper"]
    figure.draw_without_rendering()
    assert [axes.get_title() for axes in figure.axes[:2]] == ["y [mm]", ""]


def test_the_table_names_every_picture_and_its_options():
    table = {cells[0]: cells[2] for _, cells in rows(PAGE.read_text(encoding="utf-8"))}
    for name in report.__all__:
        if not name.startswith("plot_"):  # a number on this page, or a part of the report on its own
            pages = (PAGE, PAGE.with_name("report.md"))
            assert any(f"report.{name}(" in page.read_text(encoding="utf-8") for page in pages)
            continue
        (written,) = [options for picture, options in table.items() if f"`report.{name}(" in picture]
        parameters = [*inspect.signature(getattr(report, name)).parameters][1:]
        assert set(re.findall(r"`(\w+)[`=]", written)) == set(parameters) - {"axes"}


def test_doors_take_the_options_of_what_they_open():
    for door, picture in ((inphase.Model.plot, report.plot_model), (inphase.Response.plot, report.plot_response)):
        named = inspect.signature(door).parameters
        there = inspect.signature(picture).parameters
        for option, parameter in named.items():
            if option not in ("self", "options"):
                assert parameter.default == there[option].default
