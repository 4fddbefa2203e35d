"""docs/report.md and docs/studio.md: their commands run, and their pictures are made as a visitor would see them."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from browser import NARROW, browser, watched
from interactions import shapes_unchecked
from pages import blocks, commands
from studios import opened, studio, tab

from inphase.cli import main

DOCS = Path(__file__).parents[1] / "docs"
STEP = 120  # of the recording that is shown


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that `inphase demo` leaves, and the page that docs/report.md makes there."""
    folder = tmp_path_factory.mktemp("visitor")
    with pytest.MonkeyPatch.context() as patched, shapes_unchecked():
        patched.chdir(folder)
        assert main(["demo", "--shapes", "Sine"]) == 0
        page = (DOCS / "report.md").read_text(encoding="utf-8")
        for kind, _, text in blocks(page):
            if kind == "python":
                exec(text, {})
            for command in commands(text) if kind == "sh" else ():
                program, *arguments = shlex.split(command)
                assert program == "inphase"
                assert main(arguments) == 0
    return folder


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where pictures are left: `make pictures` wants them in docs/pictures."""
    folder = Path(os.environ.get("INPHASE_SCREENSHOTS") or tmp_path_factory.mktemp("pictures"))
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def test_the_report_looks_as_it_is_shown(demo, pictures):
    looks = {
        "report": ("report.html", {"viewport": {"width": 1280, "height": 1130}}),
        "report-dark": ("report.html", {"viewport": {"width": 1280, "height": 1130}, "color_scheme": "dark"}),
        "report-narrow": ("report.html", {"viewport": NARROW}),
        "report-compared": ("compared.html", {"viewport": {"width": 1280, "height": 1130}}),
    }
    with browser() as started:
        for name, (file, context) in looks.items():
            with watched(started, **context) as seen:
                seen.page.goto((demo / file).as_uri())
                seen.page.wait_for_selector("html[data-ready=true]")
                slider = seen.page.locator("#step")
                slider.fill(str(STEP))
                if name == "report-compared":
                    seen.page.locator("#course").scroll_into_view_if_needed()
                    seen.page.evaluate("() => document.getElementById('course').scrollIntoView()")
                    seen.page.evaluate("() => window.scrollBy(0, -110)")
                seen.page.wait_for_timeout(300)
                assert seen.page.locator("#moment").inner_text().endswith(f"step {STEP + 1} of 250")
                seen.page.screenshot(path=pictures / f"{name}.png")


def test_the_studio_looks_as_it_is_shown(demo, pictures):
    tall = {"viewport": {"width": 1280, "height": 1130}}
    with browser() as started, studio(demo / "inphase-demo") as address, opened(started, address, **tall) as page:
        page.get_by_text("done").first.wait_for()
        page.get_by_text("7 demonstrations over phase").wait_for()
        page.wait_for_timeout(500)
        page.screenshot(path=pictures / "studio-data.png")
        train = tab(page, "Train")
        train.get_by_role("heading", name="Calibration").wait_for()
        page.wait_for_timeout(500)
        page.screenshot(path=pictures / "studio-train.png", full_page=True)


def test_what_a_report_costs_is_measured_in_a_browser():
    command = [sys.executable, str(DOCS.parent / "benchmarks" / "report.py"), "--quick", "--json"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout.splitlines()[-1])
    assert 0 < found["page [MB]"] < 15
    assert found["trivial page [MB]"] < found["page [MB]"]
    assert all(value > 0 for value in found.values())
