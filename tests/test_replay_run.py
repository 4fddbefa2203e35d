"""`inphase replay RUN.mcap`: what was recorded is computed once more, and the least difference is told."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from interactions import CONTROLLED, OBSERVED, chance_model, phase_model

import inphase
from inphase import Estimate, Status
from inphase.channels import make_channels
from inphase.recording import RecordedEvent
from inphase.replay import identical, provenance_of
from inphase.runtime import FakeClock
from inphase.runtime.recorder import Recorder

MODEL = chance_model(np.random.default_rng(3), phase_model())
STEP, COUNT = 0.03, 30


def unchanged(index: int, estimate: Estimate) -> Estimate:
    return estimate


def recorded(
    path: Path,
    change: Callable[[int, Estimate], Estimate] = unchanged,
    *,
    model: inphase.Model | None = MODEL,
    lost: Sequence[int] = (),
    begin: float = 100.0,
) -> list[Estimate]:
    """A run with a reset in the middle; returns what is in it."""
    rng = np.random.default_rng(5)
    session, written = MODEL.session("rbpf", 7, particles=30), []
    told = provenance_of(MODEL, "rbpf", 7, {"particles": 30})
    with Recorder(path, MODEL.channels, told, model=model, name="walk") as recorder:
        recorder.put_event(RecordedEvent(begin, "safety", "all was well for 10 cycles", "HOLDING", "RUNNING"))
        for i in range(COUNT):
            at = begin + STEP * i
            if i == COUNT // 2:
                session.reset()
                recorder.put_event(RecordedEvent(at - 0.01, "reset", "asked for"))
            seen = MODEL.predict(np.array([0.05 + 0.03 * (i % 15)]))[0, :2] + rng.normal(scale=0.02, size=2)
            made = change(i, session.observe(at, seen))
            if i in lost:
                recorder.put_event(RecordedEvent(at, "recorder", "1 lost here: the queue was full"))
            else:
                recorder.put_step(seen, made)
                written.append(made)
    return written


def last_bit(at: int, field: str = "phase_std") -> Callable[[int, Estimate], Estimate]:
    def change(index: int, estimate: Estimate) -> Estimate:
        return replace(estimate, **{field: float(np.nextafter(getattr(estimate, field), 9.0))} if index == at else {})

    return change


def test_a_run_is_the_same_once_more(tmp_path, run):
    path = tmp_path / "a.mcap"
    recorded(path)
    code, out, err = run("replay", path)
    assert (code, err) == (0, "")
    assert out.splitlines() == [
        "walk: 30 samples, 0.87 s",
        'rbpf, seed 7, options {"particles": 30}',
        f"model {provenance_of(MODEL)['model'][:12]}…, in the recording",
        "    0.000 s  safety: HOLDING → RUNNING: all was well for 10 cycles",
        "    0.440 s  reset: asked for",
        "30 of 30 estimates equal to the last bit",
    ]
    code, out, err = run("replay", path, "--json")
    found = json.loads(out)
    assert (code, err, found["equal"], found["estimates"], found["samples"]) == (0, "", 30, 30, 30)
    assert (found["first_difference"], found["damage"], found["lost"]) == (None, None, [])
    assert [event["kind"] for event in found["events"]] == ["safety", "reset"]
    assert (found["filter"], found["seed"], found["options"]) == ("rbpf", "7", '{"particles": 30}')


FIELDS = ["phase", "phase_std", "phase_velocity", "phase_velocity_std", "log_likelihood"]


@pytest.mark.parametrize("field", FIELDS)
def test_the_last_bit_of_one_number_is_found(field, tmp_path, run):
    path = tmp_path / "a.mcap"
    written = recorded(path, last_bit(11, field))
    code, out, _ = run("replay", path)
    assert code == 1
    assert "29 of 30 estimates equal to the last bit" in out
    assert "the first that differs is that of sample 12, at 0.330 s:" in out
    (row,) = [line for line in out.splitlines() if line.split()[:1] == [field]]
    assert row.split()[1] == repr(getattr(written[11], field)) != row.split()[2]
    code, out, _ = run("replay", path, "--json")
    different = json.loads(out)["first_difference"]
    assert (code, different["sample"]) == (1, 11)
    assert different["recorded"].pop(field) != different["recomputed"].pop(field)
    assert different["recorded"] == different["recomputed"]


def test_another_status_is_a_difference_too(tmp_path, run):
    path = tmp_path / "a.mcap"
    recorded(path, lambda i, made: replace(made, status=Status.BLIND) if i == 3 else made)
    code, out, _ = run("replay", path)
    assert code == 1
    (row,) = [line for line in out.splitlines() if line.startswith("status")]
    assert row.split()[1:] == ["blind", "following"]


def test_what_is_no_number_is_equal_to_itself_and_zero_has_a_sign():
    one = Estimate(0.0, 0.0, float("nan"), np.inf, -0.0, 1.0, Status.FOLLOWING)
    assert identical(one, replace(one, phase_std=-float("nan")))
    assert not identical(one, replace(one, phase_std=1.0))
    assert not identical(one, replace(one, phase_velocity_std=0.0))
    assert not identical(one, replace(one, phase=-0.0))
    assert not identical(one, replace(one, phase_velocity=-np.inf))


def test_what_was_lost_is_told_and_the_next_interaction_is_whole(tmp_path, run):
    path = tmp_path / "a.mcap"
    recorded(path, lost=[5])
    code, out, _ = run("replay", path)
    assert code == 1
    assert "    0.150 s  1 lost here: the queue was full" in out
    assert "the first that differs is that of sample 6, at 0.180 s:" in out
    assert "samples were lost before it" in out
    code, out, _ = run("replay", path, "--json")
    found = json.loads(out)
    assert [event["reason"] for event in found["lost"]] == ["1 lost here: the queue was full"]
    assert found["equal"] >= 5 + 15  # before the loss, and after the reset


def test_of_a_damaged_run_what_is_left_is_compared(tmp_path, run):
    path = tmp_path / "a.mcap"
    recorded(path)
    content = path.read_bytes()
    path.write_bytes(content[: content.index(b'"time": 100.6,')])  # the chunk is cut: nothing of it is left
    code, out, _ = run("replay", path)
    assert code == 0
    assert "the recording is damaged: " in out
    assert "0 of 0 estimates equal to the last bit" in out
    path.write_bytes(content[: content.rindex(b"/estimate")])  # only the index at the end is
    code, out, _ = run("replay", path)
    assert code == 0
    assert "30 of 30 estimates equal" in out


def test_a_model_of_ones_own_is_taken_if_it_is_the_one(tmp_path, run):
    path, model = tmp_path / "a.mcap", tmp_path / "m.inphase"
    recorded(path, model=None)
    assert run("replay", path) == (
        2,
        "",
        f"inphase: {path}: holds no model; name the one it was made with: --model FILE\n",
    )
    MODEL.save(model)
    code, out, _ = run("replay", path, "--model", model)
    assert code == 0
    assert f"…, {model}" in out
    chance_model(np.random.default_rng(4), phase_model()).save(model)
    code, out, err = run("replay", "--model", model, path)
    assert code == 2
    assert "expected the model it was recorded with" in err


class Watched(FakeClock):
    """Remembers until when it was waited for."""

    def __init__(self, start: float) -> None:
        super().__init__(start)
        self.waited: list[float] = []

    def wait_until(self, time: float) -> None:
        self.waited.append(time)
        super().wait_until(time)


def test_a_speed_is_that_of_the_recording(tmp_path, run, monkeypatch):
    path = tmp_path / "a.mcap"
    recorded(path, last_bit(20))
    usual = run("replay", path, "--json")[1]
    for speed in (0.5, 1, 10):
        clock = Watched(3.0)
        monkeypatch.setattr("inphase.cli.replay_run.SystemClock", lambda clock=clock: clock)
        assert run("replay", path, "--speed", speed, "--json") == (1, usual, "")
        np.testing.assert_allclose(clock.waited, 3.0 + STEP * np.arange(COUNT) / speed)
    code, _, err = run("replay", path, "--speed", 0)
    assert (code, err) == (2, "inphase: expected a finite speed > 0, got 0.0\n")


def test_on_a_terminal_a_line_says_how_far_it_is(tmp_path, run, monkeypatch):
    path = tmp_path / "a.mcap"
    recorded(path)
    monkeypatch.setenv("FORCE_COLOR", "1")  # what rich takes for a terminal
    err = run("replay", path, "--speed", 2)[2]
    assert "of 0.9 s   phase 0." in err


@pytest.mark.parametrize(
    "option", ["--filter", "--seed=3", "--members", "--particles", "--picture", "--time", "--ignore-notes"]
)
def test_options_of_other_recordings_are_refused_in_one_line(option, tmp_path, run):
    code, out, err = run("replay", tmp_path / "a.mcap", option, "bip")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"a recorded run is replayed as it was, expected no {option}" in err


def test_bad_runs_are_refused_in_one_line(tmp_path, run):
    path = tmp_path / "a.mcap"
    assert "a.mcap: cannot be read: No such file" in run("replay", path)[2]
    path.write_text("time,a\n0,1\n")
    assert "expected an MCAP file" in run("replay", path)[2]
    assert "inphase replay a.mcap --model m.inphase" in run("replay", "m.inphase", "a.mcap")[2]
    path.unlink()
    with Recorder(path, make_channels(OBSERVED, CONTROLLED)) as recorder:
        recorder.put_step(np.zeros(4), Estimate(0.0, 0.1, 0.1, 1.0, 0.1, 0.0, Status.FOLLOWING))
    MODEL.save(tmp_path / "m.inphase")
    code, _, err = run("replay", path, "--model", tmp_path / "m.inphase")
    assert (code, err.count("\n")) == (2, 1)
    assert "expected it to name its model, filter, seed, options" in err


def test_the_help_tells_of_both(run):
    assert "inphase replay RUN.mcap" in run("replay", "--help")[1]
    assert "--speed" in run("replay", "a.mcap", "--help")[1]
