"""The studio's live tab: a real run, in a process of its own, is watched in a real browser while it goes on."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import NARROW, WIDE, browser, watched
from interactions import dataset, taught
from rigs import simulated
from studios import picture

from inphase import Estimate, Response, Status
from inphase.channels import make_channels
from inphase.io import follow_recording, read_recording
from inphase.recording import RecordedCommand, RecordedEvent, Recording
from inphase.runtime.recorder import Recorder
from inphase.runtime.run_report import RunReport
from inphase.runtime.timing import Spread
from inphase.studio import live_words as words
from inphase.studio.live_window import EVENTS, POINTS, LiveWindow

SCREENSHOTS = os.environ.get("INPHASE_SCREENSHOTS")
OLD = time.mktime((2026, 1, 2, 3, 4, 0, 0, 0, -1))
EVIL = "<img src=x onerror=alert(1)>"


def running(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
    command = [sys.executable, "-m", "inphase.cli", *arguments]
    return subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def end(process: subprocess.Popen[str]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
    process.communicate()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a configuration that is ready to run, and the recording of another whose names hold markup."""
    made = tmp_path_factory.mktemp("live")
    taught(dataset(np.random.default_rng(0))).save(made / "handover.inphase")
    (made / "run.toml").write_text(simulated("handover.inphase", tempo=0.03, samples=20))
    channels = make_channels(["hand"], [EVIL, *(f"joint_{i}" for i in range(500))])
    with Recorder(made / "odd.mcap", channels, name=EVIL) as recorder:
        recorder.put_event(RecordedEvent(0.0, EVIL, EVIL, EVIL, EVIL))
        for i in range(20):
            recorder.put_step([np.nan], Estimate(0.1 * i, np.nan, np.inf, np.nan, 0.1, 0.0, Status.NOTHING_SEEN))
            mean = np.full((2, 1), np.nan)
            recorder.put_response(0.1 * i, Response(0.1 * i + np.arange(2.0), np.arange(2.0), mean, mean, (EVIL,)))
            recorder.put_command(RecordedCommand(0.1 * i, np.zeros(0), np.zeros((0, 1)), (EVIL,)))
    os.utime(made / "odd.mcap", (OLD, OLD))
    return made


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    pytest.importorskip("bokeh")
    studio = running(folder, "studio")
    try:
        assert studio.stdout is not None
        said = [studio.stdout.readline(), studio.stdout.readline()]
        assert said[1].startswith("http"), said
        yield said[1].strip()
    finally:
        end(studio)


@pytest.fixture(scope="module")
def started() -> Iterator[Any]:
    with browser() as found:
        yield found


@pytest.fixture
def opened(started: Any, address: str) -> Iterator[Callable[..., Any]]:
    """Open the live tab; whatever the console says or the page asks of others fails the test."""
    home = (address, address.replace("http", "ws", 1))
    with ExitStack() as pages:

        def page(dark: bool = False, viewport: dict[str, int] = WIDE) -> Any:
            scheme = "dark" if dark else "light"
            new = pages.enter_context(watched(started, home, viewport=viewport, color_scheme=scheme)).page
            new.set_default_timeout(30_000)
            new.goto(f"{address}#live")
            new.get_by_role("button", name="Attach").wait_for()
            return new

        yield page


def shown(page: Any, words: str) -> None:
    page.locator("#panel-live").get_by_text(re.compile(words)).first.wait_for()


PIXELS = """() => {
  const found = []
  const look = root => { for (const e of root.querySelectorAll("*")) {
    if (e.tagName === "CANVAS" && e.offsetParent) found.push(e.toDataURL().length + ":" + e.toDataURL().slice(-4000))
    if (e.shadowRoot) look(e.shadowRoot)
  } }
  look(document.getElementById("panel-live"))
  return found.join("|")
}"""


def test_a_run_is_watched_while_it_goes_on_and_to_its_end(opened, folder) -> None:
    page = opened()
    run = running(folder, "live", "run.toml")
    try:
        assert page.get_by_label("Recording of a run").input_value().startswith("odd.mcap · 2026")
        page.locator("option:checked", has_text="running now").first.wait_for(state="attached")  # the new one is chosen
        page.get_by_role("button", name="Attach").click()
        shown(page, "Running now")
        shown(page, "plays the response")
        shown(page, r"Phase 0\.\d\d ± 0\.\d\d, tempo")
        shown(page, r"picture is up to \d+\.\d s old")
        before = page.evaluate(PIXELS)
        time.sleep(0.8)
        assert page.evaluate(PIXELS) != before
        if SCREENSHOTS:
            time.sleep(5.0)
        picture(page, "studio-live-running")
        if SCREENSHOTS:
            other = opened(dark=True, viewport=NARROW)  # who comes late sees the same
            other.get_by_role("button", name="Attach").click()
            shown(other, "Running now")
            time.sleep(0.5)
            picture(other, "studio-live-running-400-dark")
        run.send_signal(signal.SIGTERM)
        shown(page, "The run has ended")
        shown(page, r"someone interrupted after \d+\.\d s: \d+ cycles")
        shown(page, "inphase report runs/run-")
        run.wait(10)
        picture(page, "studio-live-ended")
    finally:
        end(run)
    (recorded,) = (folder / "runs").glob("*.mcap")
    read = read_recording(recorded)
    assert "damage" not in read.provenance
    last = [event for event in read.events if event.kind == "end"]
    shown(page, last[0].reason)
    page.get_by_role("button", name="Detach").click()
    shown(page, "Detached")


def test_names_are_text_and_what_is_not_known_is_not_drawn(opened) -> None:
    page = opened(dark=True)
    page.get_by_label("Recording of a run").select_option(label="odd.mcap · 2026-01-02 03:04")
    page.get_by_role("button", name="Attach").click()
    shown(page, "The run has ended")
    assert page.get_by_label("Channels").locator("option").count() == 502
    shown(page, re.escape(EVIL))
    picture(page, "studio-live-odd")


def test_a_run_that_is_killed_is_told_apart_and_one_in_its_place_is_shown(opened, folder) -> None:
    content = (folder / "odd.mcap").read_bytes()
    path = folder / "gone.mcap"
    path.write_bytes(content[:-3000])
    os.utime(path, (OLD, OLD))
    page = opened()
    page.get_by_label("Recording of a run").select_option(label="gone.mcap · 2026-01-02 03:04, without an end")
    page.get_by_role("button", name="Attach").click()
    shown(page, r"Nothing was written for \d+ days, and the recording has no end")
    path.write_bytes(b"no recording")
    shown(page, "gone.mcap: expected an MCAP file")
    path.write_bytes(content)
    shown(page, "The run has ended")
    path.unlink()
    shown(page, "no such file; it is waited for")


# -------------------------------------------------------------------------------------------- what the window remembers


def followed(path: Path, seconds: float) -> LiveWindow:
    window, follower = LiveWindow(seconds), follow_recording(path, last=seconds)
    window.hear(follower.news(), follower.channels)
    return window


def long_run(path: Path, steps: int, rate: float) -> Recording:
    """A hand and a joint that move by chance."""
    rng = np.random.default_rng(0)
    with Recorder(path, make_channels(["hand"], ["joint"]), capacity=10 * steps) as recorder:
        recorder.put_event(RecordedEvent(99.0, "start", "robot, hand"))
        for i in range(steps):
            at = 100.0 + i / rate
            made = Estimate(at, *rng.uniform(size=4), -1.0, Status.FOLLOWING)
            recorder.put_step([rng.normal(), np.nan], made)
            mean = rng.normal(size=(5, 1))
            recorder.put_response(at, Response(at + np.arange(5.0), np.linspace(0, 1, 5), mean, mean**2, ("joint",)))
            recorder.put_command(RecordedCommand(at, np.array([at + 0.1]), rng.normal(size=(1, 2)), ("spare", "joint")))
            recorder.put_event(RecordedEvent(at, "safety", f"event {i}", "RUNNING", "HOLDING"))
        recorder.put_event(RecordedEvent(at, "report", report().as_json))
    return read_recording(path)


def report(**parts: Any) -> RunReport:
    timings = {"sense": Spread(3, 0.001, 0.002, 0.003), "late": Spread(0, 0.0, 0.0, 0.0)}
    samples = {"hand": {"taken": 3, "too late": 1}}
    usual = {"lag": 0.1, "recorder_failure": None, "stopped": False, "ended": "over"}
    return RunReport(2.0, 100, 1, 50, 0, timings, samples, 2, 1, 3, **(usual | parts))


@pytest.mark.parametrize("parts", [{}, {"lag": float("nan"), "recorder_failure": "no space left", "stopped": True}])
def test_a_report_is_read_as_it_was_written(parts: dict[str, Any]) -> None:
    read = RunReport.of_json(report(**parts).as_json)
    assert read.as_json == report(**parts).as_json
    assert read.lines == report(**parts).lines


def test_what_is_drawn_is_what_was_recorded(tmp_path: Path) -> None:
    recording = long_run(tmp_path / "a.mcap", 100, 50.0)
    window = followed(tmp_path / "a.mcap", 5.0)
    times = recording.times - 99.0
    responses = [response for response in recording.responses if response is not None]
    assert (window.begin, window.now) == (99.0, times[-1])
    np.testing.assert_allclose(window.read("hand").times, times)
    np.testing.assert_array_equal(window.read("hand").mean, recording.values[:, 0])
    assert np.isnan(window.read("joint").mean).all()
    np.testing.assert_array_equal(window.course("joint").mean, [r.mean[0, 0] for r in responses])
    np.testing.assert_array_equal(window.course("joint").std, [r.std[0, 0] for r in responses])
    np.testing.assert_allclose(window.response("joint").times, responses[-1].times - 99.0)
    np.testing.assert_array_equal(window.response("joint").mean, responses[-1].mean[:, 0])
    np.testing.assert_allclose(window.sent("joint").times, [c.times[0] - 99.0 for c in recording.commands])
    np.testing.assert_array_equal(window.sent("joint").mean, [c.positions[0, 1] for c in recording.commands])
    assert window.estimates[1] == list(recording.estimates)
    assert [event.reason for event in window.events] == [f"event {i}" for i in range(99, -1, -1)] + ["robot, hand"]
    assert window.report is not None
    assert window.report.lines == report().lines
    assert (len(window.course("hand").times), len(window.sent("hand").times)) == (0, 0)


def test_a_long_run_is_remembered_in_a_bounded_memory(tmp_path: Path) -> None:
    recording = long_run(tmp_path / "a.mcap", 800, 500.0)
    window = followed(tmp_path / "a.mcap", 1.0)
    courses = window.read("hand"), window.course("joint"), window.sent("joint")
    for times in (window.estimates[0], *(course.times for course in courses)):
        assert window.now - 1.0 <= times[0] <= window.now - 0.8
        assert times[-1] >= window.now  # the newest is there whatever was left out
        assert len(times) <= POINTS + 2
        assert np.diff(times).max() < 3 * 1.0 / POINTS
    assert len(window.events) == EVENTS
    assert window.told == 801
    assert words.events(window).count("<tr>") == words.SHOWN + 1
    assert recording.times[-1] == window.newest
