"""`inphase live`: what it says, how it ends, and that neither a signal nor a disk gets in the way of the robot."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from interactions import chance_model, phase_model, shapes_unchecked

from inphase.cli import live as command_line
from inphase.cli import main
from inphase.cli.live import status
from inphase.io import read_recording
from inphase.result import Estimate, Status
from inphase.runtime import FakeClock, Sample
from inphase.runtime.configuration import devices, read_configuration
from inphase.runtime.devices import SimulatedPartner, SimulatedRobot

MODEL = chance_model(np.random.default_rng(3), phase_model())
GOOD = """\
model = "walk.inphase"

[filter]
particles = 20

[sensors.hand]
device = "simulated_partner"
clock = "shared"

[robot]
device = "simulated_robot"
home = { "*" = 0 }

[robot.limits]
"*" = { velocity = 3, acceleration = 20 }

[recording]
"""
PAUSED = GOOD.replace('clock = "shared"', 'clock = "shared"\npauses = [[0.2, 1e6]]')  # it never ends by itself
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def unchecked() -> Iterator[None]:
    """As users run it."""
    with shapes_unchecked():
        yield


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    MODEL.save(tmp_path / "walk.inphase")
    (tmp_path / "live.toml").write_text(GOOD)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def command(*arguments: object) -> tuple[int, str, str]:
        code = main(["live", *map(str, arguments)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return command


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> list[FakeClock]:
    """The loop runs by a clock that waits for nobody."""
    clocks: list[FakeClock] = []

    def make() -> FakeClock:
        clocks.append(FakeClock(100.0))
        return clocks[-1]

    monkeypatch.setattr("inphase.runtime.live.SystemClock", make)
    return clocks


def recorded(folder: Path) -> list[Path]:
    return sorted((folder / "runs").glob("*.mcap"))


# ------------------------------------------------------------------------------------------------------- what it says


def test_a_check_starts_nothing_and_writes_nothing(folder, run, monkeypatch):
    for kind in (SimulatedPartner, SimulatedRobot):
        monkeypatch.setattr(kind, "start", lambda *_: pytest.fail("a device was started"))
    before = sorted(folder.rglob("*"))
    code, out, err = run("live.toml", "--check")
    assert (code, err) == (0, "")
    assert out.startswith("live.toml is right: Loop(")
    assert "with hand, robot" in out
    assert sorted(folder.rglob("*")) == before


def test_what_has_no_limit_is_said(folder, run):
    Path("live.toml").write_text(GOOD.replace('"*" = { velocity = 3, acceleration = 20 }', "grip = { velocity = 1 }"))
    out = run("live.toml", "--check")[1]
    assert out.startswith("no limit of velocity is set for turn: see [robot.limits]\n")


def test_an_interaction_to_its_end(folder, run, at_once):
    code, out, err = run("live.toml")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "    0.00 s  start: robot, hand"
    assert lines[1].endswith(" s  holding → running: all was well for 10 cycles")
    assert lines[2].endswith(" s  end: the interaction is over")
    assert lines[3].startswith("the interaction is over after ")
    (path,) = recorded(folder)
    assert lines[-2:] == [f"wrote runs/{path.name}", f"next, try: inphase replay runs/{path.name}"]
    recording = read_recording(path)
    assert recording.provenance["configuration"] == GOOD
    assert (len(recording.estimates) > 20, len(recording.commands) > 20) == (True, True)
    assert main(["replay", str(path)]) == 0


def test_for_a_machine_it_says_nothing_but_json(folder, run, at_once):
    code, out, err = run("live.toml", "--json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert (found["ended"], found["stopped"]) == ("the interaction is over", False)
    (path,) = recorded(folder)
    (told,) = [json.loads(event.reason) for event in read_recording(path).events if event.kind == "report"]
    assert {key: value for key, value in told.items() if key != "timings"} == {
        key: value for key, value in found.items() if key != "timings"
    }
    assert found["samples"]["hand"].keys() == {"came in order"}


def test_it_ends_after_the_time_it_was_given(folder, run, at_once):
    Path("live.toml").write_text(PAUSED)
    code, out, _ = run("live.toml", "--duration", 1)
    assert code == 0
    assert "end: 1 s have passed" in out
    assert 101 <= at_once[0].now() < 103


def test_runs_of_one_second_do_not_overwrite_each_other(folder, run, at_once, monkeypatch):
    monkeypatch.setattr("time.strftime", lambda format: "now")
    for _ in range(3):
        assert run("live.toml")[0] == 0
    assert [path.name for path in recorded(folder)] == ["live-now-2.mcap", "live-now-3.mcap", "live-now.mcap"]


def test_nothing_is_recorded_where_nothing_is_asked_for(folder, run, at_once):
    Path("live.toml").write_text(GOOD.replace("[recording]\n", ""))
    code, out, _ = run("live.toml")
    assert (code, "wrote" in out) == (0, False)
    assert sorted(path.name for path in folder.iterdir()) == ["live.toml", "walk.inphase"]


def test_the_line_says_where_the_interaction_is(folder):
    loop = read_configuration("live.toml").loop(FakeClock())
    assert status(loop) == "holding: nothing was observed yet"
    loop.perception.last = Estimate(0.0, 0.25, 0.125, 0.4, 0.1, 0.0, Status.FOLLOWING)
    assert status(loop) == "holding  phase 0.25 ± 0.12  pace 0.50  following"


def test_on_a_terminal_there_is_such_a_line(folder, run, at_once, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # what rich takes for a terminal
    lines: list[str] = []
    monkeypatch.setattr(command_line, "REFRESHED", 0.001)
    monkeypatch.setattr(command_line, "status", lambda loop: (lines.append("asked"), "where it is")[1])
    assert run("live.toml")[0] == 0
    assert lines


# ------------------------------------------------------------------------------------------------- how it may end


class Blind(SimulatedPartner):
    """Falls silent."""

    def read(self) -> list[Sample]:
        return super().read() if self._clock.now() < 101 else []


def test_one_that_stopped_for_a_trouble_ends_with_one(folder, run, at_once, monkeypatch):
    monkeypatch.setitem(devices.__dict__, "SimulatedPartner", Blind)
    Path("live.toml").write_text(PAUSED + '[safety]\nstale_sensors = "stop"\n')
    code, out, _ = run("live.toml")
    assert code == command_line.STOPPED_BY_TROUBLE == 1
    assert "running → stopping: nothing is read of the partner: reach, lift" in out
    assert "stopping → stopped" in out
    found = json.loads(run("live.toml", "--json")[1])
    assert (found["stopped"], found["ended"]) == (True, "nothing is read of the partner: reach, lift")


BAD = [
    ("model", "is not known here", 'modle = "a"\n'),
    ("mistake", "line 20: smoothing.alpha: expected 0 < alpha <= 1, got 2", "[smoothing]\nalpha = 2\n"),
    ("toml", "line 19: expected TOML: ", "= 3\n"),
]


@pytest.mark.parametrize(("what", "said", "more"), BAD, ids=[bad[0] for bad in BAD])
@pytest.mark.parametrize("check", [[], ["--check"], ["--json"]], ids=["run", "check", "json"])
def test_bad_input_is_refused_in_one_line(what, said, more, check, folder, run, at_once):
    Path("live.toml").write_text(f"{more}{GOOD}" if what == "model" else f"{GOOD}\n{more}")
    code, out, err = run("live.toml", *check)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("inphase: live.toml, line ")
    assert said in err
    assert recorded(folder) == []


def test_no_file_is_refused_in_one_line(folder, run):
    assert run("none.toml") == (2, "", "inphase: none.toml: cannot be read: No such file or directory\n")


def test_where_nothing_can_be_recorded_nothing_is_started(folder, run, monkeypatch):
    monkeypatch.setattr(SimulatedRobot, "start", lambda *_: pytest.fail("a device was started"))
    Path("runs").write_text("a file")
    code, out, err = run("live.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "line 17: recording.folder: cannot make the folder runs: File exists" in err
    Path("live.toml").write_text(GOOD + 'folder = "walk.inphase/runs"\n')
    assert "line 18: recording.folder: cannot make the folder walk.inphase/runs: Not a directory" in run("live.toml")[2]
    Path("live.toml").write_text(GOOD + 'folder = "/proc"\n')  # a folder in which nobody can make a file
    code, out, err = run("live.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "cannot write /proc/live-" in err


def test_outputs_are_checked_before_anything_is_started(folder, run, monkeypatch):
    monkeypatch.setattr(SimulatedRobot, "start", lambda *_: pytest.fail("a device was started"))
    Path("live.toml").write_text(GOOD + '[outputs.smoke]\ndevice = "signals"\n')
    code, out, err = run("live.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("inphase: live.toml, line 19: outputs.smoke.device: there is no device 'signals'; one of ")


# ------------------------------------------------------------------------------------------------ a process of its own


def child(folder: Path, *arguments: str, before: str = "") -> subprocess.Popen[str]:
    """`inphase live`, whose output comes line by line; `before` is run in the child, before the command."""
    program = textwrap.dedent(before) + "\nimport sys\nfrom inphase.cli import main\nsys.exit(main())\n"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONUNBUFFERED": "1"}
    command = [sys.executable, "-W", "error", "-c", program, "live", *arguments]
    return subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def until(process: subprocess.Popen[str], said: str) -> str:
    assert process.stdout is not None
    for line in process.stdout:
        if said in line:
            return line
    assert process.stderr is not None
    raise AssertionError(f"it never said {said!r}: {process.stderr.read()}")


INTERRUPTED = [
    ("stop", [signal.SIGINT], 1, "someone interrupted"),
    ("stop", [signal.SIGTERM], 1, "someone interrupted"),
    ("hold", [signal.SIGINT, signal.SIGINT], 0, "it was interrupted"),
    ("hold", [signal.SIGTERM], 0, "it was asked to terminate"),
    ("retreat", [signal.SIGINT], 1, "someone interrupted"),
]


@pytest.mark.parametrize(("answer", "signals", "expected", "ended"), INTERRUPTED)
def test_a_signal_does_what_the_policy_says_and_all_is_recorded(answer, signals, expected, ended, folder):
    more = f'[safety]\ninterrupt = "{answer}"\nretreat = {{ grip = 0.1, turn = 0.1 }}\n'
    Path("live.toml").write_text(PAUSED + more)
    process = child(folder, "live.toml")
    until(process, "holding → running")
    begun = {"stop": "running → stopping", "hold": "running → holding", "retreat": "running → retreating"}[answer]
    for i, number in enumerate(signals):
        process.send_signal(number)
        if i == 0 and number == signal.SIGINT:
            assert "someone interrupted" in until(process, begun)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (expected, "")
    assert f"{ended} after " in out
    (path,) = recorded(folder)
    recording = read_recording(path)
    assert "damage" not in recording.provenance
    assert recording.events[-1].kind == "report"
    sent = np.array([command.positions[-1] for command in recording.commands])
    times = np.array([command.time for command in recording.commands])
    assert (np.abs(np.diff(sent, axis=0)) <= 3 * np.diff(times)[:, None] + 1e-9).all()
    assert np.abs(sent[-1] - sent[-2]).max() < 1e-3  # it came to rest
    if answer == "retreat":
        np.testing.assert_allclose(sent[-1], 0.1, atol=1e-5)


def test_three_times_ctrl_c_ends_at_once(folder):
    """Whatever hangs: here a robot that takes for ever to stop."""
    Path("live.toml").write_text(PAUSED)
    stuck = """
    import time
    from inphase.runtime.devices import SimulatedRobot
    def stop(self):
        print("stuck", flush=True)
        time.sleep(600)
    SimulatedRobot.stop = stop
    """
    process = child(folder, "live.toml", before=stuck)
    until(process, "holding → running")
    process.send_signal(signal.SIGINT)
    until(process, "stuck")
    for _ in range(100):  # two that come at once are one
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.2)
            break
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "inphase: stopped\n")


FULL = 150_000  # bytes: half a second


def test_a_disk_that_is_full_does_not_stop_the_robot(folder):
    full = f"""
    import resource, signal
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, ({FULL}, {FULL}))
    """
    process = child(folder, "live.toml", "--json", before=full)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    found = json.loads(out)
    (path,) = recorded(folder)
    assert found["recorder_failure"] == f"cannot write runs/{path.name}: File too large"
    assert found["unrecorded"] > 50
    assert (found["ended"], found["missed"] < found["commands"]) == ("the interaction is over", True)
    assert path.stat().st_size <= FULL
    recording = read_recording(path)
    assert recording.provenance["damage"]
    assert recording.estimates
    assert recording.provenance["configuration"] == GOOD

    process = child(folder, "live.toml", before=full)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    assert "recorder: cannot write runs/" in out  # when it happened
    assert "not recorded: cannot write runs/" in out  # and at the end


def test_a_model_that_is_too_large_for_the_disk_is_refused(folder):
    Path("live.toml").write_text(PAUSED)
    full = """
    import resource, signal
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
    """
    process = child(folder, "live.toml", before=full)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err.count("\n")) == (2, "", 1)
    assert "cannot write runs/live-" in err
    assert recorded(folder) == []
