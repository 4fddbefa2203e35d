"""The studio in a real browser: its tabs, what is decided and tried there, bad recordings, names that are markup."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import NARROW, WIDE
from browser import browser as started_browser
from interactions import CONTROLLED, OBSERVED
from playwright.sync_api import expect
from studios import WAIT, opened, picture, studio, tab, write

import inphase
from inphase.replay import provenance_of
from inphase.runtime.recorder import Recorder

MARKUP = "<img src=x onerror=window.hacked=1>"

expect.set_options(timeout=WAIT)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with started_browser() as started:
        yield started


def csv(folder: Path, *lines: str) -> None:
    folder.mkdir(parents=True)
    (folder / "episode.csv").write_text("\n".join([*lines, ""]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a test changes is its own; all of it is served by one studio."""
    folder = tmp_path_factory.mktemp("studio")
    write(folder / "plain")
    dataset = inphase.load(folder / "plain", observed=OBSERVED, controlled=CONTROLLED)
    model = inphase.fit(dataset, calibrate=False)
    model.save(folder / "model.inphase")
    session = model.session("bip")
    with Recorder(folder / "run.mcap", model.channels, provenance_of(model, "bip"), model=model) as recorder:
        for time, values in zip(dataset[0].times, dataset[0].values, strict=True):
            seen = values[: len(OBSERVED)]
            recorder.put_step(seen, session.observe(time, seen))
    write(folder / "dropped", episodes=4)
    write(folder / "roles", ["hand_x", "hand_y", "robot_x", "robot_y"], episodes=3)
    csv(folder / "bad broken", "time,a,b", "0,1,2", "1,x,3")
    csv(folder / "bad short", "time,a,b", "0,1,2")
    csv(folder / "bad empty", "time,a,b", *(f"{i},," for i in range(20)))
    wide = [",".join(str(i * j) for j in range(1, 502)) for i in range(20)]
    csv(folder / "bad wide", ",".join(["time", *(f"c{i}" for i in range(500))]), *wide)
    return folder


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    with studio(folder) as address:
        yield address


def recordings(page: Any, place: str, count: int) -> Any:
    """The data tab, of these recordings."""
    data = tab(page, "Data")
    data.get_by_label("Recordings", exact=True).select_option(label=f"{place} ({count})")
    return data


# -------------------------------------------------------------------------------------------------------------- tests


def test_tabs_are_gone_through_with_the_keys(browser, address):
    with opened(browser, address) as page:
        page.get_by_role("tab", name="Data").focus()
        for name in ("train", "try", "live", "export", "data"):
            page.keyboard.press("ArrowRight")
            expect(page.locator(f"#tab-{name}")).to_have_attribute("aria-selected", "true")
            assert page.locator("[role=tabpanel]:not([hidden])").get_attribute("id") == f"panel-{name}"


@pytest.mark.parametrize(("size", "scheme"), [(WIDE, "light"), (NARROW, "dark")])
def test_recordings_are_looked_at_by_themselves(browser, address, size, scheme):
    with opened(browser, address, viewport=size, color_scheme=scheme) as page:
        data = recordings(page, "plain", 6)
        # The roles are those of the model in the folder.
        expect(
            data.get_by_text("inphase inspect plain --observed reach lift --controlled grip turn --json")
        ).to_be_visible()
        expect(data.get_by_text("none is unlike the others")).to_be_visible()
        expect(data.get_by_text("6 demonstrations over phase")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        picture(page, f"studio-data-{size['width']}-{scheme}")


def test_an_episode_is_left_out_and_taken_back(browser, address, folder):
    notes = folder / "dropped/inphase-notes.json"
    with opened(browser, address) as page:
        data = recordings(page, "dropped", 4)
        data.get_by_label("Episode", exact=True).select_option("episode_2")
        data.get_by_label("Why").fill("dropped the baton")
        expect(data.get_by_text("--drop 'episode_2=dropped the baton' --json")).to_be_visible()
        data.get_by_role("button", name="Note it").click()
        expect(data.get_by_text("left out: dropped the baton").first).to_be_visible()
        expect(data.get_by_text("3 demonstrations over phase; the chosen episode is left out")).to_be_visible()
        assert json.loads(notes.read_text())["episodes"] == {"episode_2": {"use": False, "reason": "dropped the baton"}}

        data.get_by_role("button", name="As recorded").click()
        expect(data.get_by_text("--keep episode_2 --json")).to_be_visible()
        data.get_by_role("button", name="Note it").click()
        expect(data.get_by_text("4 demonstrations over phase")).to_be_visible()
        assert not notes.exists()


def test_an_episode_is_cut_and_roles_are_said(browser, address, folder):
    with opened(browser, address) as page:
        data = recordings(page, "roles", 3)
        expect(data.get_by_label("Drawn").locator("option")).to_have_text(["hand", "robot"])
        observed, controlled = (data.get_by_label(f"{role}: names or patterns") for role in ("Observed", "Controlled"))
        observed.fill("hand_?")
        observed.press("Enter")
        expect(data.get_by_text("inphase inspect roles --observed 'hand_?' --json")).to_be_visible()
        controlled.fill("robot_? hand_x")
        controlled.press("Enter")
        expect(
            data.get_by_text("expected every channel to be observed or controlled, got as both: hand_x")
        ).to_be_visible()
        controlled.fill("robot_?")
        controlled.press("Enter")
        expect(data.get_by_text("inspect roles --observed 'hand_?' --controlled 'robot_?' --json")).to_be_visible()

        data.get_by_role("button", name="Cut", exact=True).click()
        data.get_by_role("slider").first.focus()
        for _ in range(3):
            page.keyboard.press("ArrowRight")
        expect(data.get_by_text(re.compile("--cut episode_0=0.*: --json"))).to_be_visible()
        data.get_by_role("button", name="Note it").click()
        expect(data.get_by_text(re.compile("^used from 0")).first).to_be_visible()
        noted = json.loads((folder / "roles/inphase-notes.json").read_text())["episodes"]
        assert 0 < noted["episode_0"]["from"] < 1
        picture(page, "studio-cut")


def test_recordings_that_cannot_be_used_are_a_line_each(browser, address):
    with opened(browser, address) as page:
        for place, line in {
            "bad broken": "line 3, channel 'a': expected a number, got 'x'",
            "bad short": "expected at least 3 samples, got 1",
            "bad empty": "none is held against the others: no channel moves",
            "bad wide": "none is held against the others: expected at least",
        }.items():
            data = recordings(page, place, 1)
            expect(data.get_by_text(line).first).to_be_visible()
            expect(data.get_by_role("button", name="Look once more")).to_be_enabled()
        picture(page, "studio-wide")


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
        export.get_by_label("Save as").fill(f"b{MARKUP}")
        export.get_by_role("button", name="Save").click()
        expect(export.get_by_text("expected a name that ends in .inphase, got")).to_be_visible()
        assert page.evaluate("window.hacked") is None
        assert page.locator("img").count() == 0
        picture(page, "studio-markup")


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
    with opened(browser, address) as page:
        recordings(page, "plain", 6)
        tried = tab(page, "Try")
        tried.get_by_label("Episode").select_option("episode_1")
        tried.get_by_role("button", name="ebip").click()
        expect(tried.get_by_text("inphase report model.inphase plain/episode_1.csv --filter")).to_be_visible()
        tried.get_by_role("button", name="Play").click()
        frame = tried.frame_locator("iframe")
        expect(frame.locator("canvas").first).to_be_visible()
        picture(page, "studio-try-1280-light")
        tried.get_by_role("button", name="Open the report").click()  # of a run, in the place of the page before
        expect(frame.locator("h1")).to_have_text("run")
        expect(frame.locator("#moment")).to_contain_text("step 1 of")
