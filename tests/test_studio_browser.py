"""The studio in a real browser: its tabs, what is decided and tried there, bad recordings, names that are markup."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from interactions import CONTROLLED, OBSERVED, curves
from playwright.sync_api import Browser, Page, expect, sync_playwright
from system_packages import need

import inphase

SWITCHES = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
MARKUP = "<img src=x onerror=window.hacked=1>"
WAIT = 60_000  # [ms] for a command to end, on a machine that is busy


# ------------------------------------------------------------------------------------------------------------- studio


def write(folder: Path, names: list[str], episodes: int = 6, called: str = "episode") -> None:
    """Recordings of a partner and a robot, the last of which is unlike the others."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    for i in range(episodes):
        times = np.arange(0, 2, 0.03)
        values = curves(times / times[-1], rng.standard_normal(2)) + 1e-3 * rng.standard_normal((len(times), 4))
        rows = np.column_stack([times, values])
        np.savetxt(folder / f"{called}_{i}.csv", rows, delimiter=",", comments="", header=",".join(["time", *names]))


@contextmanager
def studio(folder: Path) -> Iterator[str]:
    """The address of a studio that runs, and that ends well."""
    command = [sys.executable, "-m", "inphase.cli", "studio", str(folder)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        assert process.stdout is not None
        process.stdout.readline()
        yield process.stdout.readline().strip()
        process.send_signal(signal.SIGINT)
        output, said = process.communicate(timeout=30)
        assert (process.returncode, said) == (0, "")
        assert output.strip() == "studio ended"
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    program = shutil.which("chromium")
    need(program, "chromium (apt-get install chromium)")
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=program, args=SWITCHES)
        yield started
        started.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("studio")
    write(folder, [*OBSERVED, *CONTROLLED])
    dataset = inphase.load(folder, observed=OBSERVED, controlled=CONTROLLED)
    inphase.fit(dataset, calibrate=False).save(folder / "model.inphase")
    return folder


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    with studio(folder) as address:
        yield address


@contextmanager
def opened(browser: Browser, address: str, width: int = 1280, scheme: Any = "light") -> Iterator[Page]:
    """The page; nothing in it may go wrong, and nothing may ask for anything but the studio."""
    wrong: list[str] = []
    host = urlsplit(address).netloc
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page = context.new_page()
    page.set_default_timeout(WAIT)
    expect.set_options(timeout=WAIT)
    page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda asked: wrong.append(asked.url) if urlsplit(asked.url).netloc != host else None)
    page.goto(address)
    yield page
    context.close()
    assert wrong == []


def picture(page: Page, name: str) -> None:
    """Keep a picture of it where pictures are asked for."""
    if wanted := os.environ.get("INPHASE_SCREENSHOTS"):
        Path(wanted).mkdir(parents=True, exist_ok=True)
        page.screenshot(path=Path(wanted) / f"{name}.png", full_page=True)


def tab(page: Page, name: str) -> Any:
    """Go to a tab; what is in it."""
    page.get_by_role("tab", name=name).click()
    return page.locator(f"#panel-{name.lower()}")


# -------------------------------------------------------------------------------------------------------------- tests


def test_tabs_are_gone_through_with_the_keys(browser, address):
    with opened(browser, address) as page:
        page.get_by_role("tab", name="Data").focus()
        for name in ("train", "try", "live", "export", "data"):
            page.keyboard.press("ArrowRight")
            expect(page.locator(f"#tab-{name}")).to_have_attribute("aria-selected", "true")
            assert page.locator("[role=tabpanel]:not([hidden])").get_attribute("id") == f"panel-{name}"


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (400, "dark")])
def test_recordings_are_looked_at_by_themselves(browser, address, width, scheme):
    with opened(browser, address, width, scheme) as page:
        data = tab(page, "Data")
        expect(
            data.get_by_text("inphase inspect . --observed reach lift --controlled grip turn --json")
        ).to_be_visible()
        expect(data.get_by_text("none is unlike the others")).to_be_visible()
        expect(data.get_by_text("demonstrations over phase")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        picture(page, f"studio-data-{width}-{scheme}")


def test_an_episode_is_left_out_and_taken_back(browser, tmp_path):
    write(tmp_path / "below", [*OBSERVED, *CONTROLLED], episodes=4)
    notes = tmp_path / "below/inphase-notes.json"
    with studio(tmp_path) as address, opened(browser, address) as page:
        data = tab(page, "Data")
        data.get_by_label("Episode", exact=True).select_option("episode_2")
        data.get_by_label("Why").fill("dropped the baton")
        shown = "inphase inspect below --drop 'episode_2=dropped the baton' --json"
        expect(data.get_by_text(shown)).to_be_visible()
        data.get_by_role("button", name="Note it").click()
        expect(data.get_by_text("left out: dropped the baton").first).to_be_visible()
        expect(data.get_by_text("3 demonstrations over phase; the chosen episode is left out")).to_be_visible()
        assert json.loads(notes.read_text())["episodes"] == {"episode_2": {"use": False, "reason": "dropped the baton"}}

        data.get_by_role("button", name="As recorded").click()
        expect(data.get_by_text("inphase inspect below --keep episode_2 --json")).to_be_visible()
        data.get_by_role("button", name="Note it").click()
        expect(data.get_by_text("4 demonstrations over phase")).to_be_visible()
        assert not notes.exists()


def test_an_episode_is_cut_and_roles_are_said(browser, tmp_path):
    write(tmp_path, ["hand_x", "hand_y", "robot_x", "robot_y"], episodes=3)
    with studio(tmp_path) as address, opened(browser, address) as page:
        data = tab(page, "Data")
        data.get_by_label("Controlled: names or patterns").fill("robot_? hand_x")
        data.get_by_label("Observed: names or patterns").fill("hand_?")
        data.get_by_label("Observed: names or patterns").press("Enter")
        expect(
            data.get_by_text("expected every channel to be observed or controlled, got as both: hand_x")
        ).to_be_visible()
        data.get_by_label("Controlled: names or patterns").fill("robot_?")
        data.get_by_label("Controlled: names or patterns").press("Enter")
        expect(data.get_by_text("inphase inspect . --observed 'hand_?' --controlled 'robot_?' --json")).to_be_visible()

        data.get_by_role("button", name="Cut", exact=True).click()
        handle = data.get_by_role("slider").first
        handle.focus()
        for _ in range(3):
            page.keyboard.press("ArrowRight")
        expect(data.get_by_text(re.compile("--cut episode_0=0.*: --json"))).to_be_visible()
        data.get_by_role("button", name="Note it").click()
        expect(data.get_by_text(re.compile("^used from 0")).first).to_be_visible()
        assert 0 < json.loads((tmp_path / "inphase-notes.json").read_text())["episodes"]["episode_0"]["from"] < 1
        picture(page, "studio-cut")


def test_names_that_are_markup_are_text(browser, tmp_path):
    folder = tmp_path / f"a{MARKUP}"
    names = [f"see{MARKUP}", "see $$y$$", f"do{MARKUP}", "do_b"]
    write(folder, names, episodes=3, called=f"$$e$$ {MARKUP}")
    dataset = inphase.load(folder, observed=names[:2], controlled=names[2:])
    inphase.fit(dataset, calibrate=False).save(folder / f"model{MARKUP}.inphase")
    with studio(tmp_path) as address, opened(browser, address) as page:
        data = tab(page, "Data")
        expect(data.get_by_text("demonstrations over phase")).to_be_visible()
        expect(data.get_by_text(names[0]).first).to_be_visible()
        data.get_by_label("Why").fill(MARKUP)
        data.get_by_role("button", name="Note it").click()
        expect(data.get_by_text(f"left out: {MARKUP}").first).to_be_visible()
        for name in ("Train", "Try", "Live"):
            tab(page, name)
        export = tab(page, "Export")
        export.get_by_role("button", name="Show its card").click()
        expect(export.get_by_text("2 observed and 2 controlled channels")).to_be_visible()
        export.get_by_role("textbox").first.fill(f"b{MARKUP}")
        export.get_by_role("button", name="Save").click()
        expect(export.get_by_text("expected a name that ends in .inphase, got")).to_be_visible()
        assert page.evaluate("window.hacked") is None
        assert page.locator("img").count() == 0
        picture(page, "studio-markup")


def test_recordings_that_cannot_be_used_are_a_line_each(browser, tmp_path):
    def csv(folder: str, text: str) -> None:
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "episode.csv").write_text(text)

    csv("a broken one", "time,a,b\n0,1,2\n1,x,3\n")
    csv("b one sample", "time,a,b\n0,1,2\n")
    csv("c nothing seen", "time,a,b\n" + "".join(f"{i},,\n" for i in range(20)))
    csv(
        "d wide",
        ",".join(["time", *(f"c{i}" for i in range(500))])
        + "\n"
        + "".join(",".join(str(i * j) for j in range(1, 502)) + "\n" for i in range(20)),
    )
    (tmp_path / "e no notes").mkdir()
    shutil.copy(tmp_path / "c nothing seen/episode.csv", tmp_path / "e no notes")
    (tmp_path / "e no notes/inphase-notes.json").write_text("{")
    with studio(tmp_path) as address, opened(browser, address) as page:
        data = tab(page, "Data")
        for place, line in {
            "a broken one": "line 3, channel 'a': expected a number, got 'x'",
            "b one sample": "expected at least 3 samples, got 1",
            "c nothing seen": "none is held against the others: no channel moves",
            "d wide": "expected at least",
            "e no notes": "expected JSON, got something else",
        }.items():
            data.get_by_label("Recordings", exact=True).select_option(label=f"{place} (1)")
            expect(data.get_by_text(line).first).to_be_visible()
            expect(data.get_by_role("button", name="Look once more")).to_be_enabled()
        picture(page, "studio-bad")


def test_a_folder_without_recordings_says_what_is_missing(browser, tmp_path):
    with studio(tmp_path) as address, opened(browser, address) as page:
        expect(tab(page, "Data").get_by_text("There is no recording in")).to_be_visible()
        expect(tab(page, "Try").get_by_text("there is no model yet: the Train tab makes one")).to_be_visible()
        expect(tab(page, "Export").get_by_text("there is no model yet: the Train tab makes one")).to_be_visible()


def test_a_model_is_saved_once(browser, address, folder):
    with opened(browser, address) as page:
        export = tab(page, "Export")
        export.get_by_label("Save as").fill("copy.inphase")
        expect(export.get_by_text("cp -n -- model.inphase copy.inphase")).to_be_visible()
        export.get_by_role("button", name="Save").click()
        expect(export.get_by_text("wrote")).to_be_visible()
        assert (folder / "copy.inphase").read_bytes() == (folder / "model.inphase").read_bytes()
        export.get_by_role("button", name="Save").click()
        expect(export.get_by_text("is there already")).to_be_visible()
        export.get_by_label("in the place of a file that is there").check()
        expect(export.get_by_text("cp -- model.inphase copy.inphase")).to_be_visible()
        picture(page, "studio-export-1280-light")
    (folder / "copy.inphase").unlink()


def test_an_episode_is_played_to_two_filters(browser, address):
    help_of_report = subprocess.run([sys.executable, "-m", "inphase.cli", "report", "--help"], capture_output=True)
    if help_of_report.returncode:
        pytest.skip("`inphase report` is not there yet")
    with opened(browser, address) as page:
        tried = tab(page, "Try")
        tried.get_by_label("Episode").select_option("episode_1")
        tried.get_by_role("button", name="ebip").click()
        expect(tried.get_by_text("inphase report model.inphase episode_1.csv --filter")).to_be_visible()
        tried.get_by_role("button", name="Play").click()
        frame = tried.frame_locator("iframe")
        expect(frame.locator("canvas").first).to_be_visible()
        picture(page, "studio-try-1280-light")
