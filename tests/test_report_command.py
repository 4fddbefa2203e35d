"""`inphase report`: a page of runs, or of recordings played to a model; bad input is one line, and leaves no file."""

from __future__ import annotations

import contextlib
import io
import json
import re

import numpy as np
import pytest
from browser import browser, watched
from interactions import CONTROLLED, OBSERVED, dataset, taught

import inphase
from inphase.cli import main
from inphase.cli.report import UNASKED
from inphase.recording import RecordedEvent
from inphase.replay import provenance_of
from inphase.report.page.figures import RUNS
from inphase.report.page.payload import MOST_CONTROLLED
from inphase.result import Estimate, Status
from inphase.runtime.recorder import Recorder


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return taught(dataset(np.random.default_rng(0), count=4, rate=20.0))


@pytest.fixture(scope="module")
def folder(model, tmp_path_factory):
    """A model, two episodes as CSV and a recorded run, to be read alone."""
    made = tmp_path_factory.mktemp("given")
    model.save(made / "m.inphase")
    for i, episode in enumerate(dataset(np.random.default_rng(3), count=2, rate=20.0)):
        write(made / f"episode{i}.csv", [*OBSERVED, *CONTROLLED], episode.times, episode.values)
    record(made / "run.mcap", model)
    record(made / "bare.mcap", model, inside=False)
    return made


@pytest.fixture(scope="module")
def page(folder):
    """The page of the recorded run."""
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["report", str(folder / "run.mcap"), "-o", str(folder / "page.html")]) == 0
    return folder / "page.html"


def write(path, names, times, values):
    rows = np.column_stack([times, values])
    np.savetxt(path, rows, delimiter=",", header=",".join(["time", *names]), comments="", fmt="%.9g")


def record(path, model, *, count=30, inside=True, values=None, events=()):
    """A run of a session at 20 Hz, with or without the model in it."""
    session = model.session("bip", 2)
    told = provenance_of(model, "bip", 2)
    with Recorder(path, model.channels, told, model=model if inside else None) as recorder:
        for event in events:
            recorder.put_event(event)
        for i in range(count):
            seen = model.predict(np.array([min(0.03 * i, 1.0)]))[0, :2] if values is None else values
            estimate = session.observe(5.0 + 0.05 * i, seen)
            recorder.put_step(seen, estimate)
            recorder.put_response(estimate.time, session.respond(samples=3))


def described(path):
    """What a page knows of its runs; and that the file is whole."""
    text = path.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert text.rstrip().endswith("</html>")
    (told,) = re.findall(r'<script type="application/json" id="runs">(.*?)</script>', text, re.S)
    return json.loads(told)


def remarks(path):
    return " ".join(remark for run in described(path)["runs"] for remark in run["remarks"])


@pytest.fixture
def refused(run, tmp_path):
    """A report that is refused: one line, exit code 2, and nothing is left of it."""

    def refuse(*arguments, output="out.html"):
        target = tmp_path / output
        before = sorted(tmp_path.rglob("*"))
        code, out, err = run("report", *arguments, "-o", target)
        assert (code, out) == (2, ""), (code, out, err)
        assert err.count("\n") == 1
        assert "Traceback" not in err
        assert sorted(tmp_path.rglob("*")) == before
        return err

    return refuse


# ---------------------------------------------------------------------------------------------------------------- pages


def test_a_recorded_run_becomes_a_page_and_always_the_same(folder, page, run, tmp_path):
    code, out, err = run("report", folder / "run.mcap", "-o", tmp_path / "r.html")
    assert (code, err) == (0, "")
    assert f"wrote {tmp_path / 'r.html'}" in out.replace("\n", "")
    (told,) = described(tmp_path / "r.html")["runs"]
    assert (told["title"], told["filter"], told["steps"], told["remarks"]) == ("run", "bip", 30, [])
    assert told["length"] == pytest.approx(29 * 0.05)
    assert "cloud" in told["arrays"]
    assert [path.name for path in tmp_path.iterdir()] == ["r.html"]
    assert described(tmp_path / "r.html") == described(page)


def test_a_run_is_told_as_recorded_where_that_is_asked_or_all_there_is(folder, run, tmp_path):
    path = tmp_path / "r.html"
    assert run("report", folder / "run.mcap", "--quick", "-o", path)[0] == 0
    assert remarks(path) == UNASKED
    assert "cloud" not in described(path)["runs"][0]["arrays"]
    code, out, _ = run("report", folder / "bare.mcap", "-o", path)
    assert code == 0
    assert remarks(path) == "the recording holds no model: its beliefs cannot be shown"
    assert "the recording holds no model" in out
    assert run("report", folder / "bare.mcap", "--model", folder / "m.inphase", "-o", path)[0] == 0
    assert remarks(path) == ""
    assert "cloud" in described(path)["runs"][0]["arrays"]


def test_recordings_are_played_to_a_model_with_every_filter(folder, run, tmp_path):
    path = tmp_path / "p.HTML"
    code, _, err = run("report", folder / "m.inphase", folder / "episode?.csv", "--filter", "bip", "promp", "-o", path)
    assert (code, err) == (0, "")
    told = described(path)["runs"]
    assert [(one["title"], one["filter"]) for one in told] == [
        ("episode0", "bip"),
        ("episode0", "promp"),
        ("episode1", "bip"),
        ("episode1", "promp"),
    ]
    assert run("report", folder / "m.inphase", folder / "episode0.csv", "--title", "Of <b>one</b>", "-o", path)[0] == 0
    one = described(path)
    assert (one["title"], one["runs"][0]["filter"]) == ("Of <b>one</b>", inphase.filters.RECOMMENDED)
    assert "<title>Of &lt;b&gt;one&lt;/b&gt;</title>" in path.read_text(encoding="utf-8")


def test_runs_of_one_name_are_told_apart_by_their_folders(folder, model, run, tmp_path):
    for place in ("a", "b"):
        (tmp_path / place).mkdir()
        record(tmp_path / place / "run.mcap", model, count=4)
    path = tmp_path / "r.html"
    assert run("report", tmp_path / "a" / "run.mcap", tmp_path / "b" / "run.mcap", "-o", path)[0] == 0
    titles = [one["title"] for one in described(path)["runs"]]
    assert titles == [str(tmp_path / place / "run.mcap") for place in ("a", "b")]


# ------------------------------------------------------------------------------------------------ what is hardly a run


def test_of_a_truncated_recording_there_is_a_page_that_tells_of_the_damage(folder, run, tmp_path):
    whole = (folder / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: -len(whole) // 8])
    assert run("report", tmp_path / "cut.mcap", "-o", tmp_path / "r.html")[0] == 0
    (told,) = described(tmp_path / "r.html")["runs"]
    source = dict(next(table for table in told["summary"] if table["title"] == "Source")["rows"])
    assert source["damage"]
    assert told["steps"] <= 30


def test_five_hundred_channels_are_a_page_of_those_that_can_be_shown(run, tmp_path):
    """As recorded: what is in it decides, not how long a model of them takes."""
    names = [f"c{i:03d}" for i in range(500)]
    channels = inphase.channels.make_channels(names[:250], names[250:])
    rng = np.random.default_rng(0)
    with Recorder(tmp_path / "many.mcap", channels, {"filter": "bip"}) as recorder:
        for i in range(10):
            recorder.put_step(
                rng.standard_normal(500), Estimate(0.1 * i, 0.1 * i, 0.1, 1.0, 0.1, 0.0, Status.FOLLOWING)
            )
    assert run("report", tmp_path / "many.mcap", "-o", tmp_path / "r.html")[0] == 0
    (told,) = described(tmp_path / "r.html")["runs"]
    assert len(told["observed"]) + told["left_out"]["observed"] == 250
    assert len(told["controlled"]) == MOST_CONTROLLED
    assert told["left_out"]["controlled"] == 250 - MOST_CONTROLLED


def test_pages_of_hardly_a_run_open_without_a_complaint(model, run, tmp_path):
    """In the browser, which fails on errors in the console and on whatever is asked of others."""
    makes = {
        "none": {"count": 0},
        "one": {"count": 1},
        "blind": {"values": np.full(2, np.nan)},
        "events": {"events": [RecordedEvent(5.1, "safety", "too fast", "RUNNING", "STOPPED")]},
    }
    for name, how in makes.items():
        record(tmp_path / f"{name}.mcap", model, **how)
    record(tmp_path / "quick.mcap", model)
    together = [tmp_path / f"{name}.mcap" for name in makes]
    pages = {"quick": [tmp_path / "quick.mcap", "--quick"], "together": together}
    steps = {"none": 0, "one": 1}
    said = {"none": "Nothing was inferred", "blind": "No observed channel was read for 1.45 s", "events": "too fast"}
    with browser() as started:
        for name, arguments in pages.items():
            assert run("report", *arguments, "-o", tmp_path / f"{name}.html")[0] == 0
            told = described(tmp_path / f"{name}.html")["runs"]
            assert [one["steps"] for one in told] == [steps.get(one["title"], 30) for one in told]
            for one in told:
                assert said.get(one["title"], "") in " ".join(finding["says"] for finding in one["findings"])
            with watched(started) as seen:
                seen.page.goto((tmp_path / f"{name}.html").as_uri())
                seen.page.wait_for_selector("html[data-ready=true]")
                for key in ("End", "ArrowLeft", "Home"):
                    seen.page.keyboard.press(key)
                seen.page.locator("#axis").select_option("phase")
                for i in reversed(range(len(makes) if name == "together" else 0)):  # that of nothing stays
                    seen.page.locator("#run").select_option(str(i))
                seen.page.evaluate("scrollTo(0, document.body.scrollHeight)")
                for summary in seen.page.locator("details.beside summary:visible").all():
                    summary.click()
                seen.page.wait_for_timeout(80)


# ------------------------------------------------------------------------------------------------------------ bad input


def test_what_cannot_be_reported_is_one_clear_line(folder, refused, tmp_path):
    run_, model_, episode = folder / "run.mcap", folder / "m.inphase", folder / "episode0.csv"
    assert "a page, .html, got" in refused(run_, output="out.pdf")
    assert "a page, .html, got" in refused(run_, output="out")
    assert "nowhere" in refused(run_, output="nowhere/out.html")
    assert "unknown filter 'kalman'" in refused(model_, episode, "--filter", "kalman")
    assert "rbpf" in refused(model_, episode, "--filter", "kalman")  # the valid names
    assert f"1 to {RUNS} runs" in refused(*[run_] * (RUNS + 1))
    assert f"1 to {RUNS} episodes and filters" in refused(
        model_, folder / "episode?.csv", "--filter", "bip", "ebip", "promp", "rbpf"
    )
    assert "need a model before them" in refused(episode)
    assert "one model and recordings" in refused(model_)
    assert "one model and recordings" in refused(model_, run_, episode)
    assert "one model and recordings" in refused(model_, model_, episode)
    assert "a recorded run has its own" in refused(run_, "--filter", "bip")
    assert "missing.mcap" in refused(folder / "missing.mcap")
    assert "missing.inphase" in refused(folder / "missing.inphase", episode)
    assert "missing" in refused(model_, folder / "missing" / "*.csv")
    assert "missing.inphase" in refused(run_, "--model", folder / "missing.inphase")


def test_what_is_wrong_from_the_first_is_said_before_anything_is_played(folder, refused, monkeypatch):
    def played(*given, **options):
        raise AssertionError("played")

    for name in ("account_of_recording", "account_of_demonstration"):
        monkeypatch.setattr(f"inphase.cli.report.{name}", played)
    assert "nowhere" in refused(folder / "run.mcap", output="nowhere/out.html")
    assert "kalman" in refused(folder / "m.inphase", folder / "episode0.csv", "--filter", "bip", "kalman")


def test_a_file_that_is_no_recording_is_one_clear_line(folder, refused, tmp_path):
    for content in (b"", b"time,a\n0,1\n", bytes(range(256)) * 4):
        bad = folder / "bad.mcap"
        bad.write_bytes(content)
        assert "bad.mcap" in refused(bad)
    bad = folder / "bad.inphase"
    bad.write_bytes(b"no model")
    assert "bad.inphase" in refused(bad, folder / "episode0.csv")


def test_recordings_of_other_channels_than_the_models_are_one_clear_line(folder, refused):
    times = np.arange(20) / 20
    write(folder / "other.csv", ["reach", "knee", *CONTROLLED], times, np.random.default_rng(0).random((20, 4)))
    err = refused(folder / "m.inphase", folder / "other.csv")
    assert "lift" in err
    write(folder / "one.csv", [*OBSERVED, *CONTROLLED], times[:1], np.zeros((1, 4)))
    assert "one" in refused(folder / "m.inphase", folder / "one.csv")
    (folder / "empty.csv").write_text("time,reach,lift,grip,turn\n")
    assert "empty" in refused(folder / "m.inphase", folder / "empty.csv")


def test_a_run_of_another_model_is_told_as_recorded_and_says_why(folder, run, tmp_path):
    other = taught(dataset(np.random.default_rng(9), count=3, rate=20.0))
    other.save(tmp_path / "other.inphase")
    code, out, _ = run("report", folder / "run.mcap", "--model", tmp_path / "other.inphase", "-o", tmp_path / "r.html")
    assert code == 0
    assert "expected the model it was recorded with" in remarks(tmp_path / "r.html")
    assert "expected the model it was recorded with" in out.replace("\n", " ")


def test_an_older_page_stays_where_a_new_one_cannot_be_made(folder, run, tmp_path):
    page = tmp_path / "r.html"
    page.write_text("older")
    assert run("report", folder / "missing.mcap", "-o", page)[0] == 2
    assert page.read_text() == "older"


def test_without_bokeh_it_is_said_what_to_install(folder, refused, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "bokeh", None)
    assert "pip install 'inphase[studio]'" in refused(folder / "run.mcap")


# ------------------------------------------------------------------------------------------------------------ addresses


def test_nothing_in_the_page_is_fetched_by_how_it_is_written(page):
    """The real proof is the browser's, which fails on every request; this finds what would be asked for only later."""
    text = page.read_text(encoding="utf-8")
    markup = re.sub(r"<script\b[^>]*>.*?</script>", "<script></script>", text, flags=re.S)
    assert re.findall(r"https?://[^\s\"'<]+", markup) == []
    assert re.findall(r"<(?:img|iframe|object|embed|audio|video|source|base)\b", markup) == []
    assert re.findall(r"<link\b[^>]*>", markup) == ['<link rel="icon" href="data:,">']
    assert re.findall(r"<script\b[^>]*\bsrc=", text) == []
    assert re.findall(r"@import|url\((?!data:)", markup) == []
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', markup)
    assert "default-src 'none'" in policy
    assert "http" not in policy
    assert "*" not in policy
