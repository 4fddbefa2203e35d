"""Keys, pipes, signals and a pedal: each does what it says, and a terminal is left as it was found."""

from __future__ import annotations

import contextlib
import io
import os
import pty
import re
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import inphase
from inphase.channels import make_channels
from inphase.cli.keys import SIGNALS, Key, Keys
from inphase.cli.record_demonstrations import PACE, fit_command, record_demonstrations
from inphase.io.csv import read_csv
from inphase.runtime import FakeClock
from inphase.runtime.demonstrations import Demonstrations
from inphase.runtime.devices import Dead, Duplicated, NanBursting, ReplaySensor

CHANNELS = make_channels(["hand", "turn"], ["grip"], kinds={"turn": "angle"})


def sensor(name: str, rate: float, signals: list[str]) -> ReplaySensor:
    times = np.arange(round(120 * rate)) / rate
    values = np.stack([np.sin(times + i) for i in range(len(signals))], axis=1)
    return ReplaySensor(inphase.Demonstration(times, values), make_channels(signals, []), name=name)


def sensors() -> list:
    return [sensor("camera", 100.0, ["hand", "turn"]), sensor("arm", 40.0, ["grip"])]


class Script:
    """Keys at times of a clock [s]."""

    def __init__(self, clock: FakeClock, *presses: tuple[float, Key]) -> None:
        self._pressed: list[Key] = []
        for at, key in presses:
            clock.at(at, lambda key=key: self._pressed.append(key))

    def read(self) -> list[Key]:
        pressed, self._pressed = self._pressed, []
        return pressed


def played(folder: Path, *presses: tuple[float, Key], devices: list | None = None, **options) -> tuple[str, list[Path]]:
    """What is printed, and the files, after these keys."""
    clock, text = FakeClock(), io.StringIO()
    console = Console(file=text, width=200, highlight=False, markup=False)
    keys = Script(clock, *presses)
    with Demonstrations(devices or sensors(), CHANNELS, folder / "demos", clock, **options) as session:
        try:
            kept = record_demonstrations(session, clock, keys, console)
            assert kept == session.kept
        except KeyboardInterrupt:
            text.write("KeyboardInterrupt")
    return text.getvalue(), sorted((folder / "demos").iterdir())


# ----------------------------------------------------------------------------------------------------- what keys do


def test_start_stop_discard_redo_quit(tmp_path):
    text, files = played(
        tmp_path,
        (1.0, Key.TOGGLE),
        (3.0, Key.TOGGLE),  # 001
        (4.0, Key.START),
        (4.5, Key.START),  # does nothing more
        (6.0, Key.STOP),  # 002
        (6.5, Key.STOP),
        (7.0, Key.DISCARD),  # no 002
        (7.1, Key.DISCARD),
        (8.0, Key.TOGGLE),
        (9.0, Key.REDO),
        (12.0, Key.TOGGLE),  # 002
        (13.0, Key.HELP),
        (14.0, Key.QUIT),
    )
    assert [path.name for path in files] == ["001.csv", "002.csv"]
    assert [read_csv(path).times[-1] for path in files] == pytest.approx([2.0, 3.0], abs=0.06)
    said = [line for line in text.splitlines() if line[:1] != " "]
    first, *rest = said
    assert first.startswith("space or enter: start and stop")
    assert rest[0] == f"into {tmp_path}/demos, the next is 001.csv"
    assert rest[1] == "recording 001"
    assert rest[2].startswith("kept 001.csv: 1.9")
    assert "camera 200 (100.0/s)   arm 80 (40.0/s)" in rest[2]
    assert rest[3] == "recording 002"
    assert rest[4].startswith("kept 002.csv: 1.9")
    assert rest[5:9] == [
        "discarded 002.csv",
        "nothing to discard since the last start or discard",
        "recording 002",
        "discarded the 1.0 s recorded; recording 002",
    ]
    assert rest[9].startswith("kept 002.csv: 2.9")
    assert rest[10] == first  # help
    assert rest[11] == f"2 episodes kept in {tmp_path}/demos: 001, 002"
    assert rest[12] == f"learn from all that is there: inphase fit {tmp_path}/demos " + (
        "--observed hand turn --controlled grip --angle turn"
    )
    assert len(rest) == 13


@pytest.mark.parametrize("key", [Key.QUIT, Key.END])
def test_to_quit_in_mid_episode_keeps_it(key, tmp_path):
    text, files = played(tmp_path, (1.0, Key.TOGGLE), (3.0, key))
    assert [path.name for path in files] == ["001.csv"]
    assert "1 episode kept" in text
    text, files = played(tmp_path, (1.0, key))
    assert f"0 episodes kept in {tmp_path}/demos\n" in text


def test_an_interrupt_in_mid_episode_keeps_what_was_finished_and_says_so(tmp_path):
    presses = (1.0, Key.TOGGLE), (3.0, Key.TOGGLE), (4.0, Key.TOGGLE), (5.5, Key.INTERRUPT)
    text, files = played(tmp_path, *presses)
    assert [path.name for path in files] == ["001.csv"]
    assert "interrupted: discarded the 1.5 s recorded\n" in text
    assert f"1 episode kept in {tmp_path}/demos: 001\n" in text
    assert text.endswith("KeyboardInterrupt")


def test_mistakes_and_troubles_are_told_and_it_goes_on(tmp_path):
    camera, arm = sensors()
    devices = [Duplicated(NanBursting(camera, [(2.0, 0.5)], only="hand"), 0.2), Dead(arm, after=4.0)]
    text, files = played(
        tmp_path,
        (1.0, Key.TOGGLE),
        (3.5, Key.TOGGLE),  # 001
        (3.6, Key.TOGGLE),
        (3.6, Key.TOGGLE),  # of nothing
        (6.0, Key.TOGGLE),
        (8.0, Key.TOGGLE),  # without the arm
        (9.0, Key.QUIT),
        devices=devices,
    )
    assert [path.name for path in files] == ["001.csv"]
    assert text.count("it is not kept\n") == 2
    assert "nothing came of arm in 2.0 s; it is not kept\n" in text
    assert "\narm: nothing was read for 1 s\n" in text
    assert "samples dropped: came before, or adds nothing to one of the same stamp\n" in text
    assert "  hand: not seen for up to 0.4" in text


def test_of_a_pedal_the_ways_down_and_up_begin_and_end(tmp_path):
    times = np.arange(600) / 50
    down = np.where((times < 0.5) | ((times > 2) & (times < 4)) | ((times > 5) & (times < 6.5)), 1.0, 0.0)
    pedal = ReplaySensor(inphase.Demonstration(times, down[:, None]), make_channels(["down"], []), name="pedal")
    presses = ((5.5, Key.TOGGLE), (8.0, Key.QUIT))  # a key ends it as well
    text, files = played(tmp_path, *presses, devices=[*sensors(), pedal], trigger="down")
    assert [read_csv(path).times[-1] for path in files] == pytest.approx([2.0, 0.5], abs=0.08)
    assert text.count("recording 00") == 2


def test_where_nothing_can_be_written_it_is_held_and_tried_again(tmp_path, monkeypatch):
    from inphase.runtime import demonstrations

    def full(*_: object) -> Path:
        raise OSError(28, "No space left on device")

    real, clock_times = demonstrations.write_next, []
    monkeypatch.setattr(demonstrations, "write_next", lambda *a: (clock_times or [full])[0](*a))
    held = (
        "could not be written into {}/demos: No space left on device\nit is still held: space tries again, d discards"
    )
    presses = ((1.0, Key.TOGGLE), (3.0, Key.TOGGLE), (4.0, Key.START), (5.0, Key.QUIT), (6.0, Key.END))
    text, files = played(tmp_path, *presses)
    assert files == []
    assert text.count(held.format(tmp_path)) == 2  # and quits only when nobody is left
    assert "expected to begin an episode, but it holds an episode that could not be written" in text
    assert "discarded the episode that could not be written\n0 episodes kept" in text
    monkeypatch.setattr(FakeClock, "wait_until", freed_after(5.0, lambda: clock_times.append(real)))
    text, files = played(tmp_path, (1.0, Key.TOGGLE), (3.0, Key.TOGGLE), (6.0, Key.TOGGLE), (7.0, Key.QUIT))
    assert [path.name for path in files] == ["001.csv"]


def freed_after(at: float, free: Callable[[], None]) -> Callable[[FakeClock, float], None]:
    wait, freed = FakeClock.wait_until, []

    def waiting(clock: FakeClock, until: float) -> None:
        wait(clock, until)
        if until >= at and not freed:
            freed.append(True)
            free()

    return waiting


def test_sensors_are_read_at_a_pace_and_a_late_round_is_not_made_up_for(tmp_path, monkeypatch):
    rounds: list[float] = []
    step = Demonstrations.step

    def slow(session: Demonstrations) -> list[str]:
        rounds.append(session._clock.now())
        if len(rounds) == 10:
            session._clock.wait_until(session._clock.now() + 0.5)
        return step(session)

    monkeypatch.setattr(Demonstrations, "step", slow)
    played(tmp_path, (2.0, Key.QUIT))
    np.testing.assert_allclose(np.delete(np.diff(rounds), 9), 1 / PACE)
    assert np.diff(rounds)[9] == pytest.approx(0.5)


def test_the_live_line_tells_time_samples_and_who_is_silent(tmp_path):
    clock, text = FakeClock(), io.StringIO()
    console = Console(file=text, width=100, force_terminal=True)
    keys = Script(clock, (1.0, Key.TOGGLE), (3.0, Key.QUIT))
    lines = []
    camera, arm = sensors()
    with Demonstrations([camera, Dead(arm, after=1.5)], CHANNELS, tmp_path / "demos", clock) as session:
        from rich.status import Status

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Status, "update", lambda _, said: lines.append(said))
            record_demonstrations(session, clock, keys, console)
    assert lines[0] == "001 waits for a start"
    assert re.fullmatch(r"recording 001   0\.5 s   camera (49|50)   arm (19|20)", lines[75])
    assert lines[140].endswith("silent: arm")


def test_what_to_type_to_learn_is_quoted():
    channels = make_channels(["my hand", "a"], [])
    assert fit_command("my demos", channels) == "inphase fit 'my demos' --observed 'my hand' a"


# ------------------------------------------------------------------------------------------------- a real terminal


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    master, slave = pty.openpty()
    yield master, slave
    for end in (master, slave):
        with contextlib.suppress(OSError):
            os.close(end)


def settled(read: Callable[[], list[Key]], count: int) -> list[Key]:
    """So many keys, once they are there."""
    keys: list[Key] = []
    end = time.monotonic() + 5
    while len(keys) < count and time.monotonic() < end:
        keys += read()
    time.sleep(0.02)
    return keys + read()


def test_keys_of_a_terminal_come_one_by_one_and_unseen(terminal):
    master, slave = terminal
    with Keys(slave) as keys:
        assert keys.is_terminal
        assert keys.read() == []  # never waits
        os.write(master, b" dRq\n\rx\x04")
        toggle, other = Key.TOGGLE, Key.HELP
        expected = [toggle, Key.DISCARD, Key.REDO, Key.QUIT, toggle, toggle, other, other]
        assert settled(keys.read, 8) == expected
    os.set_blocking(master, False)
    with pytest.raises(BlockingIOError):  # nothing was echoed
        os.read(master, 100)


def test_an_arrow_or_a_function_key_is_not_the_letters_it_sends(terminal):
    master, slave = terminal
    with Keys(slave) as keys:
        os.write(master, b"\x1b[D\x1b[1;5D\x1bOR\x1b[24~\x1bd ")
        assert settled(keys.read, 1) == [Key.TOGGLE]
        os.write(master, b"\x1b[")  # in two parts
        assert settled(keys.read, 0) == []
        os.write(master, b"Dd")
        assert settled(keys.read, 1) == [Key.DISCARD]


@pytest.mark.parametrize("error", [None, KeyboardInterrupt, RuntimeError, SystemExit])
def test_a_terminal_is_put_back_as_it_was_however_it_ends(error, terminal):
    _, slave = terminal
    before = termios.tcgetattr(slave)
    handlers = [signal.getsignal(getattr(signal, name)) for name in SIGNALS]
    with contextlib.suppress(*[error or ValueError]), Keys(slave):
        assert not termios.tcgetattr(slave)[3] & (termios.ICANON | termios.ECHO)
        assert termios.tcgetattr(slave)[3] & termios.ISIG
        if error:
            raise error
    assert termios.tcgetattr(slave) == before
    assert [signal.getsignal(getattr(signal, name)) for name in SIGNALS] == handlers


def test_a_terminal_that_goes_away_ends_nothing_by_itself(terminal):
    master, slave = terminal
    with Keys(slave) as keys:
        os.close(master)
        assert settled(keys.read, 0) == []
        assert keys.read() == []


# ---------------------------------------------------------------------------------------------- a pipe, and signals


def test_lines_of_a_pipe_are_words(tmp_path):
    reading, writing = os.pipe()
    with Keys(reading) as keys:
        assert not keys.is_terminal
        assert keys.read() == []
        os.write(writing, b"start\nsto")
        assert keys.read() == [Key.START]
        os.write(writing, b"p\n\n Discard \nredo\r\nd\nr\nwhat\n" + "größe\n".encode() + b"quit\nq")
        expected = [Key.STOP, Key.TOGGLE, Key.DISCARD, Key.REDO, Key.DISCARD, Key.REDO, Key.HELP, Key.HELP, Key.QUIT]
        assert keys.read() == expected
        os.close(writing)
        assert keys.read() == [Key.QUIT, Key.END]  # the last line may lack its end
        assert keys.read() == []
    os.close(reading)


def test_where_there_never_was_a_word_signals_alone_are_heard():
    with open(os.devnull) as nothing, Keys(nothing.fileno()) as keys:
        assert [keys.read() for _ in range(3)] == [[], [], []]
        os.kill(os.getpid(), signal.SIGUSR1)
        os.kill(os.getpid(), signal.SIGUSR2)
        assert settled(keys.read, 2) == [Key.TOGGLE, Key.DISCARD]


def test_the_first_interrupt_is_a_key_and_the_second_is_itself():
    with open(os.devnull) as nothing:
        with pytest.raises(KeyboardInterrupt), Keys(nothing.fileno()) as keys:  # noqa: PT012
            os.kill(os.getpid(), signal.SIGINT)
            assert settled(keys.read, 1) == [Key.INTERRUPT]
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1.0)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_on_another_thread_keys_are_read_without_signals():
    reading, writing = os.pipe()
    os.write(writing, b"start\n")
    found: list[Key] = []

    def listen() -> None:
        with Keys(reading) as keys:
            found.extend(keys.read())

    thread = threading.Thread(target=listen)
    thread.start()
    thread.join()
    assert found == [Key.START]
    for end in (reading, writing):
        os.close(end)


PROGRAM = """
import sys
import numpy as np
import inphase
from inphase.channels import make_channels
from inphase.cli.console import Output
from inphase.cli.keys import Keys
from inphase.cli.record_demonstrations import record_demonstrations
from inphase.runtime import SystemClock
from inphase.runtime.demonstrations import Demonstrations
from inphase.runtime.devices import ReplaySensor

times = np.arange(6000) / 100
channels = make_channels(["hand"], ["grip"])
sensor = ReplaySensor(inphase.Demonstration(times, np.stack([times, np.sin(times)], 1)), channels, only="*")
clock = SystemClock()
try:
    with Demonstrations([sensor], channels, sys.argv[1], clock) as session, Keys() as keys:
        record_demonstrations(session, clock, keys, Output())
except KeyboardInterrupt:
    print("interrupted at last", flush=True)
    sys.exit(130)
"""


class Child:
    """The program with its standard input, and what it has printed."""

    def __init__(self, folder: Path, stdin: int) -> None:
        environment = {
            **os.environ,
            "PYTHONPATH": str(Path(inphase.__file__).parents[1]),
            "PYTHONUNBUFFERED": "1",
            "TERM": "xterm",
        }
        self.process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(folder)],
            stdin=stdin,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
            text=True,
            # A group of its own beside its parent's: one that no shell of the session looks after cannot be suspended.
            preexec_fn=os.setpgrp,
        )
        self.text = ""
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.text += line

    def wait_for(self, words: str, count: int = 1) -> None:
        end = time.monotonic() + 20
        while self.text.count(words) < count:
            assert time.monotonic() < end, self.text
            assert self.process.poll() is None or self.text.count(words) >= count, self.text
            time.sleep(0.01)

    def ended(self) -> int:
        code = self.process.wait(20)
        self._thread.join(5)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return code


@contextlib.contextmanager
def child(folder: Path, stdin: int) -> Iterator[Child]:
    running = Child(folder, stdin)
    try:
        yield running
    finally:
        if running.process.poll() is None:
            running.process.kill()
            running.ended()


@pytest.mark.parametrize("last", [signal.SIGINT, signal.SIGTERM])
def test_a_process_is_told_by_signals(last, tmp_path):
    with child(tmp_path / "demos", subprocess.DEVNULL) as running:
        running.wait_for("the next is 001.csv")
        for episode in (1, 2):
            running.process.send_signal(signal.SIGUSR1)
            running.wait_for(f"recording 00{episode}")
            time.sleep(0.4)
            running.process.send_signal(signal.SIGUSR1)
            running.wait_for(f"kept 00{episode}.csv")
        running.process.send_signal(signal.SIGUSR2)
        running.wait_for("discarded 002.csv")
        running.process.send_signal(signal.SIGUSR1)
        running.wait_for("recording 002", 2)
        time.sleep(0.2)
        running.process.send_signal(last)
        assert running.ended() == 130
    assert "interrupted: discarded the 0." in running.text
    assert "1 episode kept" in running.text
    assert "Traceback" not in running.text
    assert [path.name for path in (tmp_path / "demos").iterdir()] == ["001.csv"]
    table = read_csv(tmp_path / "demos" / "001.csv")
    np.testing.assert_allclose(table.values[:, 1], np.sin(table.values[:, 0]), atol=1e-3)


def test_a_process_at_a_terminal_is_suspended_and_goes_on(tmp_path, terminal):
    master, slave = terminal
    before = termios.tcgetattr(slave)
    with child(tmp_path / "demos", slave) as running:
        running.wait_for("the next is 001.csv")
        assert not termios.tcgetattr(slave)[3] & termios.ICANON
        running.process.send_signal(signal.SIGTSTP)
        end, status = time.monotonic() + 20, 0
        while not os.WIFSTOPPED(status):
            assert time.monotonic() < end
            _, status = os.waitpid(running.process.pid, os.WUNTRACED | os.WNOHANG)
            time.sleep(0.01)
        assert termios.tcgetattr(slave) == before  # a shell finds it as it was
        running.process.send_signal(signal.SIGCONT)
        end = time.monotonic() + 20
        while termios.tcgetattr(slave)[3] & termios.ICANON:  # what is typed before is not for the program
            assert time.monotonic() < end
            time.sleep(0.01)
        os.write(master, b" ")
        running.wait_for("recording 001")
        time.sleep(0.3)
        os.write(master, b" ")
        running.wait_for("kept 001.csv")
        os.write(master, b"q")
        assert running.ended() == 0
    assert termios.tcgetattr(slave) == before


def test_a_process_at_the_end_of_a_pipe(tmp_path):
    reading, writing = os.pipe()
    with child(tmp_path / "demos", reading) as running:
        os.close(reading)
        running.wait_for("the next is 001.csv")
        os.write(writing, b"start\n")
        running.wait_for("recording 001")
        time.sleep(0.3)
        os.close(writing)
        assert running.ended() == 0
    assert "1 episode kept" in running.text
