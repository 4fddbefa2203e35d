"""A recording followed while it grows: all is told that the whole file says, and the run knows nothing of it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from interactions import CONTROLLED, OBSERVED, chance_model, phase_model, shapes_unchecked
from rigs import bench, learned

from inphase import DataError, Estimate, Response, Status
from inphase.channels import make_channels
from inphase.io import Follower, News, follow_recording, read_recording
from inphase.recording import RecordedCommand, RecordedEvent
from inphase.runtime import provenance_of
from inphase.runtime.recorder import Recorder

CHANNELS = make_channels(OBSERVED, CONTROLLED, units={"reach": "m"})
MODEL = chance_model(np.random.default_rng(3), phase_model())
STEPS = 40


def put_step(recorder: Recorder, i: int) -> None:
    """One step of a run, with some of everything."""
    at = 0.25 * i
    values = np.where(np.arange(4) == i % 5, np.nan, i + np.arange(4.0))
    recorder.put_step(values, Estimate(at, i / STEPS, 0.1, 1.0, 0.2, -float(i), Status.FOLLOWING))
    for _ in range(i % 3):  # of several, the last counts
        mean = np.full((3, 2), float(i))
        recorder.put_response(at, Response(at + np.arange(3.0), np.linspace(0, 1, 3), mean, mean + 1, CONTROLLED))
    recorder.put_command(RecordedCommand(at, np.array([at]), np.array([[0.5, float(i)]]), ("j1", 'j"2')))
    if i % 10 == 9:
        recorder.put_event(RecordedEvent(at, "safety", f"größe {i}", "running", "holding"))


def record(path: Path, monkeypatch: pytest.MonkeyPatch, steps: int = STEPS, first: int = 0) -> bytes:
    """A recording with a chunk for every message."""
    monkeypatch.setattr("inphase.runtime.recorder.FLUSH_EVERY", 0.0)
    with Recorder(path, CHANNELS, provenance_of(MODEL, "bip"), model=MODEL, name="walk") as recorder:
        for i in range(first, first + steps):
            put_step(recorder, i)
    return path.read_bytes()


@dataclass
class Told:
    """All that a follower has told, put together as a user of it does."""

    times: list[float] = field(default_factory=list)
    values: list[np.ndarray] = field(default_factory=list)
    estimates: list[Estimate] = field(default_factory=list)
    responses: dict[int, Response] = field(default_factory=dict)
    commands: list[RecordedCommand] = field(default_factory=list)
    events: list[RecordedEvent] = field(default_factory=list)
    anew: int = 0

    def hear(self, news: News) -> None:
        if news.anew:
            self.__init__(anew=self.anew + 1)  # type: ignore[misc]
        self.times.extend(news.times)
        self.values.extend(news.values)
        self.estimates.extend(news.estimates)
        self.responses.update(news.responses)
        self.commands.extend(news.commands)
        self.events.extend(news.events)

    @property
    def nothing(self) -> bool:
        return not (self.times or self.estimates or self.responses or self.commands or self.events)


def assert_equal(told: Told, follower: Follower, path: Path) -> None:
    """What was told is what `read_recording` says of the file as it is now."""
    try:
        whole = read_recording(path)
    except DataError:
        assert told.nothing
        return
    assert (follower.name, follower.channels) == (whole.name, whole.channels)
    assert follower.provenance == {k: v for k, v in whole.provenance.items() if k != "damage"}
    np.testing.assert_array_equal(told.times, whole.times)
    np.testing.assert_array_equal(np.array(told.values).reshape(whole.values.shape), whole.values)
    assert tuple(told.estimates) == whole.estimates
    assert sorted(told.responses) == [i for i, response in enumerate(whole.responses) if response is not None]
    for i, response in told.responses.items():
        expected = whole.responses[i]
        assert expected is not None
        for part in ("times", "phases", "mean", "std"):
            np.testing.assert_array_equal(getattr(response, part), getattr(expected, part))
        assert response.channels == expected.channels
    assert [(c.time, c.positions.tolist(), c.signals) for c in told.commands] == [
        (c.time, c.positions.tolist(), c.signals) for c in whole.commands
    ]
    assert tuple(told.events) == whole.events
    if follower.ended:
        assert "damage" not in whole.provenance
        assert follower.waiting == 0
    else:
        assert "damage" in whole.provenance


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    with pytest.MonkeyPatch.context() as patch:
        return record(tmp_path_factory.mktemp("follow") / "whole.mcap", patch)


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("grows")


# --------------------------------------------------------------------------------------------------- a file that grows


@given(data=st.data())
@settings(max_examples=12)
def test_however_a_file_grows_all_is_told_once(data: Any, content: bytes, scratch: Path) -> None:
    cuts = data.draw(st.lists(st.integers(0, len(content)), max_size=6))
    at_most = data.draw(st.sampled_from([1, 1000, 10**6]))
    path, told = scratch / "grows.mcap", Told()
    path.unlink(missing_ok=True)
    follower = follow_recording(path)
    told.hear(follower.news(at_most))
    assert (told.nothing, follower.there, follower.trouble) == (True, False, "")
    done = 0
    with path.open("wb", buffering=0) as file:
        for cut in [*sorted(cuts), len(content)]:
            file.write(content[done:cut])
            done = cut
            taken = -1
            while taken != follower.waiting:  # until a look finds nothing more
                taken = follower.waiting
                told.hear(follower.news(at_most))
            assert (follower.there, follower.trouble, follower.size) == (True, "", cut)
            assert_equal(told, follower, path)
    assert (follower.ended, told.anew) == (True, 0)
    assert len(told.estimates) == STEPS


def test_what_was_taken_is_not_read_again(tmp_path: Path, content: bytes) -> None:
    path, follower, told = tmp_path / "a.mcap", follow_recording(tmp_path / "a.mcap"), Told()
    path.write_bytes(content[: len(content) // 2])
    told.hear(news := follower.news())
    assert len(told.estimates) > STEPS // 4
    assert not news.times.flags.writeable
    assert not news.values.flags.writeable
    with path.open("r+b") as file:  # had it to be read again, it could not be
        file.write(bytes(follower.size - follower.waiting - 64))
        file.seek(0, os.SEEK_END)
        file.write(content[len(content) // 2 :])
    told.hear(follower.news())
    assert (follower.ended, follower.trouble, told.anew) == (True, "", 0)
    path.write_bytes(content)
    assert_equal(told, follower, path)


def test_of_a_long_run_only_the_last_seconds_are_taken_and_all_events(tmp_path: Path, content: bytes) -> None:
    path, told = tmp_path / "a.mcap", Told()
    path.write_bytes(content[:-2000])
    whole = read_recording(path)
    follower = follow_recording(path, last=2.0)
    told.hear(follower.news())
    assert told.times == [t for t in whole.times if t >= whole.times[-1] - 2.0]
    assert [e.time for e in told.estimates] == [c.time for c in told.commands] == told.times
    assert told.events == [event for event in whole.events if event.time <= told.times[-1]]
    expected = {i for i, r in enumerate(whole.responses) if r is not None and r.times[0] >= told.times[0]}
    assert set(told.responses) == expected  # beside the estimates of the file, by their numbers there
    path.write_bytes(content)  # and what comes then is taken whole
    told.hear(follower.news())
    assert told.times[-1] == read_recording(path).times[-1]
    assert follower.ended


# ------------------------------------------------------------------------------------------------- accidents of a file


@given(at=st.integers(0, 10**9), byte=st.integers(0, 255), cut=st.integers(0, 10**9))
@example(at=9, byte=255, cut=10**9)  # a length that is not true
@example(at=16, byte=127, cut=10**9)  # one that no memory holds
@settings(max_examples=40)
def test_of_a_damaged_file_as_much_is_told_as_can_be_read(
    at: int, byte: int, cut: int, content: bytes, scratch: Path
) -> None:
    path, told = scratch / "damaged.mcap", Told()
    at, cut = at % len(content), cut % (len(content) + 1)
    damaged = content[:at] + bytes([byte]) + content[at + 1 :]
    path.write_bytes(damaged[:cut])
    follower = follow_recording(path)
    with shapes_unchecked():
        told.hear(follower.news(10**9))
        path.write_bytes(damaged)
        told.hear(follower.news(10**9))
        assert follower.trouble == "" or follower.trouble.startswith(f"{path}: ")
        if not follower.trouble:
            assert_equal(told, follower, path)
        elif (read := whole_or_none(path)) is not None:
            assert tuple(told.estimates) == read.estimates
        again = follower.news()
    assert not again.estimates
    assert follower.ended or follower.trouble or follower.waiting


def whole_or_none(path: Path) -> Any:
    try:
        return read_recording(path)
    except DataError:
        return None


@pytest.mark.parametrize("over", [False, True])
@pytest.mark.parametrize(
    ("before", "reason"),
    [(b"time,x\n0,1\n", "expected an MCAP file"), (b"\x89MCAP0\r\n" + bytes(100), "damaged after byte 8")],
)
def test_what_is_no_recording_is_told_and_a_recording_in_its_place_is_followed(
    before: bytes, reason: str, over: bool, tmp_path: Path, content: bytes
) -> None:
    path, told = tmp_path / "a.mcap", Told()
    path.write_bytes(before)
    follower = follow_recording(path)
    for _ in range(2):
        told.hear(follower.news())
        assert reason in follower.trouble
    with path.open("ab") as file:
        file.write(bytes(1000))  # what cannot be read may grow, and is the same still
    told.hear(follower.news())
    assert (reason in follower.trouble, told.anew) == (True, 0)
    if over:
        path.write_bytes(content)
    else:
        (tmp_path / "b.mcap").write_bytes(content)
        (tmp_path / "b.mcap").replace(path)
    told.hear(follower.news())
    assert (follower.trouble, told.anew) == ("", 1)
    assert_equal(told, follower, path)


@pytest.mark.parametrize("how", ["replaced", "written over", "cut and written", "deleted"])
def test_another_file_in_its_place_is_told_from_its_beginning(
    how: str, tmp_path: Path, content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, told = tmp_path / "a.mcap", Told()
    path.write_bytes(content[: len(content) // 2])
    follower = follow_recording(path)
    told.hear(follower.news())
    other = record(tmp_path / "other.mcap", monkeypatch, first=100)
    if how == "replaced":
        (tmp_path / "other.mcap").replace(path)
    elif how == "written over":
        path.write_bytes(other)
    elif how == "cut and written":
        path.write_bytes(other[:100])
        told.hear(follower.news())
        assert (told.nothing, told.anew) == (True, 1)
        path.write_bytes(other)
    else:
        path.unlink()
        told.hear(follower.news())
        assert (told.nothing, told.anew, follower.there, follower.channels) == (True, 1, False, ())
        path.write_bytes(other)
    told.hear(follower.news())
    assert (told.anew, told.times[0]) == (1, 25.0)
    assert_equal(told, follower, path)


def test_what_cannot_be_read_is_told_and_looked_at_again(tmp_path: Path, content: bytes) -> None:
    path, told = tmp_path / "a.mcap", Told()
    follower = follow_recording(path)
    for make, remove in ((path.mkdir, path.rmdir), (lambda: os.mkfifo(path), path.unlink)):
        make()
        told.hear(follower.news())
        assert follower.trouble == f"{path}: cannot be read: it is no file"
        remove()
        told.hear(follower.news())
        assert follower.trouble == ""
    path.write_bytes(content)
    told.hear(follower.news())
    assert follower.trouble == ""
    assert_equal(told, follower, path)


# ---------------------------------------------------------------------------------------- and the run that is followed

HANGS = """
import sys, time
from inphase.io import follow_recording
follower = follow_recording(sys.argv[1])
file = open(sys.argv[1], "rb")
print(len(follower.news().estimates), flush=True)
time.sleep(1000)
"""


def test_a_run_writes_the_same_bytes_whoever_follows(tmp_path: Path, content: bytes, monkeypatch: Any) -> None:
    """One that looks all the time, one that hangs with the file open, and one that is killed."""
    monkeypatch.setattr("inphase.runtime.recorder.FLUSH_EVERY", 0.0)
    path, told, over = tmp_path / "followed.mcap", Told(), threading.Event()
    follower, hanging = follow_recording(path), list[subprocess.Popen[str]]()

    def follow() -> None:
        while not over.is_set() or not follower.ended:
            told.hear(follower.news())

    thread = threading.Thread(target=follow)
    thread.start()
    try:
        with Recorder(path, CHANNELS, provenance_of(MODEL, "bip"), model=MODEL, name="walk") as recorder:
            for i in range(STEPS):
                if i == STEPS // 2:
                    hanging.append(
                        subprocess.Popen([sys.executable, "-c", HANGS, str(path)], stdout=subprocess.PIPE, text=True)
                    )
                    assert hanging[0].stdout is not None
                    assert hanging[0].stdout.readline()
                elif i == STEPS * 3 // 4:
                    hanging[0].kill()
                put_step(recorder, i)
    finally:
        over.set()
        thread.join(20.0)
        for process in hanging:
            process.kill()
            process.communicate()
    assert recorder.failure is None
    assert path.read_bytes() == content
    assert_equal(told, follower, path)


def test_a_loop_does_the_same_whoever_follows(tmp_path: Path) -> None:
    """By a clock that is told: cycles, commands and recording do not differ in a bit."""
    model = learned()
    alone, followed = (bench(model, file=tmp_path / name) for name in ("alone.mcap", "followed.mcap"))
    told, follower = Told(), follow_recording(tmp_path / "followed.mcap")
    followed.loop.journal.listeners.append(lambda _: told.hear(follower.news()))
    sensed = followed.partner.read

    def looked() -> Any:  # in every cycle
        told.hear(follower.news())
        return sensed()

    followed.partner.read = looked
    alone.run(1.0)
    followed.run(1.0)
    told.hear(follower.news())
    assert_equal(told, follower, tmp_path / "followed.mcap")
    one, other = (
        [(now, command.times.tolist(), command.positions.tolist(), state) for now, command, state in b.robot.sent]
        for b in (alone, followed)
    )
    assert one == other
    assert len(one) > 30
    assert told.events[-1].kind == "report"
