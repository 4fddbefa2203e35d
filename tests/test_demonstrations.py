"""Recorded demonstrations are what the sensors truly read, each whole in a file of its own or not there at all."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import inphase
from inphase import DataError, OptionError
from inphase.channels import Kind, make_channels
from inphase.io import Note, read_notes, whole_file
from inphase.io.atomic import check_target
from inphase.io.csv import read_csv
from inphase.io.notes import write_notes
from inphase.runtime import Command, FakeClock, Fate, Sample, Sensor, SensorRecording, Signal, combine
from inphase.runtime.demonstrations import Demonstrations, State
from inphase.runtime.devices import (
    Dead,
    Drifting,
    Duplicated,
    Late,
    NanBursting,
    ReplaySensor,
    RobotState,
    SimulatedRobot,
)

CHANNELS = make_channels(["hand", "tool"], ["grip"], units={"hand": "m"})
SLOPES = {"hand": 1.0, "tool": -2.0, "grip": 5.0}  # of what a channel reads over time: interpolation gives it back
STEP = 0.013


def sensor(name: str, rate: float, signals: Sequence[str], length: float = 60.0) -> ReplaySensor:
    """Reads straight lines, the first of them the time since it was started; in an order of its own."""
    times = np.arange(round(length * rate)) / rate
    values = np.stack([SLOPES.get(signal, 0.0) * times for signal in signals], axis=1)
    channels = make_channels(signals, [], units={"hand": "m"} if "hand" in signals else {})
    return ReplaySensor(inphase.Demonstration(times, values), channels, name=name)


def usual() -> list[Sensor]:
    return [sensor("arm", 37.0, ["grip"]), sensor("camera", 100.0, ["tool", "other", "hand"])]


@contextmanager
def session(folder: Path, sensors: Sequence[Sensor] | None = None, **options) -> Iterator[Demonstrations]:
    clock = FakeClock(500.0)
    options = {"rate": 50.0} | options
    with Demonstrations(sensors or usual(), CHANNELS, folder / "demos", clock, **options) as opened:
        opened.clock = clock  # type: ignore[attr-defined]
        yield opened


def passes(opened: Demonstrations, seconds: float) -> list[str]:
    """Time passes, step by step; what was told meanwhile."""
    clock, told = opened.clock, []  # type: ignore[attr-defined]
    end = clock.now() + seconds
    while clock.now() < end:
        clock.wait_until(min(clock.now() + STEP, end))
        told += opened.step()
    return told


def recorded(opened: Demonstrations, seconds: float = 2.0):
    opened.start()
    passes(opened, seconds)
    return opened.stop()


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "demos").iterdir())


# ---------------------------------------------------------------------------------------------------------- the truth


def test_an_episode_is_what_the_sensors_read_at_one_rate_in_the_order_of_the_channels(tmp_path):
    with session(tmp_path) as opened:
        passes(opened, 1.234)
        episode = recorded(opened, 3.0)
        assert (opened.state, opened.kept) == (State.IDLE, (episode,))
    assert episode.path == tmp_path / "demos" / "001.csv"
    read = read_csv(episode.path)
    assert read.columns == ("hand", "tool", "grip")
    assert_array_equal(read.times, np.arange(len(read.times)) / 50)
    assert 3.0 - 1 / 37 - 2 / 50 < read.times[-1] <= 3.0
    begin = read.values[0, 0]  # the hand reads the time
    assert 1.234 - 1e-9 <= begin < 1.234 + 1 / 37 + 1 / 50
    for column, name in enumerate(read.columns):
        assert_allclose(read.values[:, column], SLOPES[name] * (begin + read.times), atol=1e-9)
    assert_array_equal(episode.values, read.values)
    assert (episode.gaps, episode.duration) == ({}, read.times[-1])
    counts = {name: (count.samples, round(count.rate), count.dropped) for name, count in episode.sensors.items()}
    assert counts == {"arm": (111, 37, {}), "camera": (300, 100, {})}


def test_what_is_recorded_is_learned_from(tmp_path):
    with session(tmp_path) as opened:
        for _ in range(3):
            passes(opened, 0.5)
            recorded(opened)
    demos = inphase.load(tmp_path / "demos", ["hand", "tool"], ["grip"], units={"hand": "m"})
    assert demos.channels == CHANNELS
    assert [demo.name for demo in demos] == ["001", "002", "003"]
    assert [round(demo.duration, 1) for demo in demos] == [2.0, 2.0, 2.0]
    assert [demo.values[0, 0] for demo in demos] == pytest.approx([0.5, 3.0, 5.5], abs=0.05)


def test_clocks_of_devices_and_late_samples_change_nothing(tmp_path):
    arm, camera = usual()
    sensors = [Drifting(arm, 0.0, offset=-1e5), Late(camera, by=0.0, jitter=0.003)]
    with session(tmp_path, sensors) as opened:
        passes(opened, 1.0)
        episode = recorded(opened, 10.0)
    assert_allclose(episode.values[:, 2], 5 * episode.values[:, 0], atol=5 * 0.003)
    assert_allclose(np.diff(episode.values[:, 0]), 1 / 50, atol=1e-6)


def test_a_robot_that_is_guided_is_read_and_never_commanded(tmp_path, monkeypatch):
    robot = SimulatedRobot([Signal("grip")], [0.3], name="arm")
    state = RobotState(robot)
    assert isinstance(state, Sensor)
    robot_moves = robot.command
    monkeypatch.setattr(robot, "command", pytest.fail)
    with session(tmp_path, [state, usual()[1]]) as opened:
        robot_moves(Command(np.array([500.5]), np.array([[0.8]])))  # the teacher
        episode = recorded(opened, 2.0)
        clock = opened.clock
        assert len(state.read()) <= 1
        assert state.read() == []  # the same state is no news
        robot.answers = False
        clock.advance(0.1)
        assert state.read() == []
    assert robot.state() is None  # stopped with the session
    assert episode.values[0, 2] == pytest.approx(0.3, abs=0.02)
    assert episode.values[-1, 2] == pytest.approx(0.8, abs=0.02)


def test_the_first_row_is_never_lost_to_rounding():
    rng = np.random.default_rng(0)
    for _ in range(40):
        begin, offset = rng.uniform(0, 1e3), rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-3, 9)
        recordings = {}
        for name, rate in (("one", 37.0), ("other", 100.0)):
            times = np.arange(round(rate)) / rate
            recordings[name] = SensorRecording((Signal(name),), times + offset, times[:, None], begin + times)
        values = combine(recordings, 30.0).values
        assert not np.isnan(values[0]).any()
        assert_allclose(values[:, 0], values[:, 1], atol=1e-6)


# ------------------------------------------------------------------------------------- discarded, done again, numbered


def test_discard_drops_what_is_recorded_or_else_the_last_that_was_kept_and_only_one(tmp_path):
    with session(tmp_path) as opened:
        recorded(opened)
        recorded(opened)
        opened.start()
        passes(opened, 0.7)
        assert opened.discard() == "the 0.7 s recorded"
        assert files(tmp_path) == ["001.csv", "002.csv"]
        with pytest.raises(OptionError, match="nothing to discard"):  # a key that is pressed twice
            opened.discard()
        assert recorded(opened).path.name == "003.csv"
        assert opened.discard() == "003.csv"
        assert files(tmp_path) == ["001.csv", "002.csv"]
        with pytest.raises(OptionError, match="nothing to discard"):
            opened.discard()
        assert [episode.path.name for episode in opened.kept] == ["001.csv", "002.csv"]
        assert (opened.number, opened.state) == (3, State.IDLE)


def test_redo_begins_again_in_the_place_of_the_last(tmp_path):
    with session(tmp_path) as opened:
        first = recorded(opened)
        assert opened.redo() == "001.csv"
        assert (files(tmp_path), opened.state) == ([], State.RECORDING)
        passes(opened, 0.5)
        assert opened.redo() == "the 0.5 s recorded"
        passes(opened, 1.0)
        again = opened.stop()
        assert again.path == first.path
        assert again.values[0, 0] == pytest.approx(2.5, abs=0.05)  # none of what was discarded
        assert again.duration < 1.0
        opened.start()
        opened.discard()
        assert opened.redo() == ""  # nothing is left to discard: it begins
        passes(opened, 1.0)
        opened.stop()
    assert files(tmp_path) == ["001.csv", "002.csv"]


def test_numbers_go_on_and_nothing_is_written_over(tmp_path, monkeypatch):
    folder = tmp_path / "demos"
    folder.mkdir()
    for name in ("007.csv", "x.csv", "12.txt", "٣.csv", "003.npz"):
        (folder / name).write_text("mine")
    with session(tmp_path) as opened:
        assert opened.number == 8
        assert recorded(opened).path.name == "008.csv"
        opened.start()
        passes(opened, 0.5)
        monkeypatch.setattr("inphase.runtime.episode.next_number", lambda _: 7)  # as if they had come meanwhile
        assert opened.stop().path.name == "009.csv"
    assert (folder / "007.csv").read_text() == "mine"
    assert "mine" not in (folder / "008.csv").read_text()


@pytest.mark.parametrize("links", [True, False])
def test_a_new_file_takes_the_place_of_no_other(links, tmp_path, monkeypatch):
    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    if not links:  # as on a memory stick
        monkeypatch.setattr(os, "link", refused)
    path = tmp_path / "a.txt"
    for content in ("one", "two"):
        try:
            with whole_file(path, new=True) as temporary:
                temporary.write_text(content)
        except FileExistsError:
            assert content == "two"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert path.read_text() == "one"


def test_what_was_noted_of_a_discarded_episode_does_not_hold_for_the_next_of_its_name(tmp_path):
    with session(tmp_path) as opened:
        recorded(opened)
        recorded(opened)
        write_notes(opened.folder, {"001": Note(start=0.5), "002": Note(use=False, reason="dropped it")})
        opened.redo()
        passes(opened, 1.0)
        opened.stop()
        assert read_notes(opened.folder) == {"001": Note(start=0.5)}


def test_what_does_not_fit_the_state_is_refused(tmp_path):
    with session(tmp_path) as opened:
        with pytest.raises(OptionError, match="none is being recorded"):
            opened.stop()
        with pytest.raises(OptionError, match="nothing to discard"):
            opened.discard()
        opened.start()
        with pytest.raises(OptionError, match="expected to begin an episode, but it records"):
            opened.start()


def test_an_end_in_mid_episode_leaves_what_was_finished(tmp_path):
    with suppress(KeyboardInterrupt), session(tmp_path) as opened:
        recorded(opened)
        opened.start()
        passes(opened, 1.0)
        raise KeyboardInterrupt
    assert files(tmp_path) == ["001.csv"]


# ------------------------------------------------------------------------------------------------------------ sensors


def test_a_sensor_that_dies_is_told_at_once_and_its_channels_are_missing(tmp_path):
    arm, camera = usual()
    with session(tmp_path, [Dead(arm, after=2.0, length=3.0), camera], silence=0.5) as opened:
        opened.start()
        assert passes(opened, 2.4) == []
        assert passes(opened, 0.2) == ["arm: nothing was read for 0.5 s"]
        assert dict(opened.silent) == {"arm": "nothing was read for 0.5 s"}
        assert passes(opened, 1.0) == []  # told once
        episode = opened.stop()
        assert passes(opened, 2.0) == ["arm is back"]
        assert dict(opened.silent) == {}
    missing = np.isnan(episode.values[:, 2])
    assert missing[episode.times > 2.1].all()
    assert not missing[episode.times < 1.9].any()
    assert not np.isnan(episode.values[:, :2]).any()
    assert list(episode.gaps) == ["grip"]
    assert episode.gaps["grip"] == pytest.approx(3.6 - 2.0 - 3 / 37, abs=0.05)
    assert ("grip", "not-a-number") in [(f.channel, f.kind.value) for f in episode.findings]


def test_a_burst_of_nothing_is_a_gap_as_long_as_it_was(tmp_path):
    arm, camera = usual()
    with session(tmp_path, [arm, NanBursting(camera, [(1.0, 0.4)], only="tool")]) as opened:
        episode = recorded(opened, 2.0)
    assert list(episode.gaps) == ["tool"]
    assert episode.gaps["tool"] == pytest.approx(0.4 - 3 / 100, abs=0.05)


class Broken(ReplaySensor):
    """Cannot be read while `fault` is set."""

    fault: Exception | None = None

    def read(self) -> list[Sample]:
        if self.fault is not None:
            raise self.fault
        return super().read()


def test_a_sensor_that_fails_is_told_and_the_others_go_on(tmp_path):
    arm = sensor("arm", 37.0, ["grip"])
    arm.__class__ = Broken
    with session(tmp_path, [arm, usual()[1]]) as opened:
        opened.start()
        passes(opened, 1.0)
        arm.fault = OSError(19, "No such device")
        assert passes(opened, 1.0) == ["arm: cannot be read: [Errno 19] No such device"]
        arm.fault = None
        assert passes(opened, 0.1) == ["arm is back"]
        assert opened.stop().sensors["camera"].samples == 210
    with session(tmp_path, [arm, usual()[1]]) as opened:
        opened.step()
        arm.read = lambda: [Sample(np.zeros(2), 0.0, 0.0)]
        assert opened.step() == ["arm: cannot be read: expected 1 values, got 2"]


def test_what_was_dropped_is_counted_with_its_reason(tmp_path):
    arm, camera = usual()
    with session(tmp_path, [arm, Duplicated(camera, share=0.3, seed=1)]) as opened:
        episode = recorded(opened)
    (dropped,) = episode.sensors["camera"].dropped.items()
    assert dropped[0] is Fate.DUPLICATED
    assert 30 < dropped[1] == episode.sensors["camera"].samples - 200
    assert episode.sensors["arm"].dropped == {}


def test_what_is_worth_a_look_is_found_also_beside_the_others(tmp_path):
    with session(tmp_path) as opened:
        first = recorded(opened, 2.0)
        recorded(opened, 2.0)
        long = recorded(opened, 8.0)
    assert "length" not in [finding.kind.value for finding in first.findings]
    assert "length" in [finding.kind.value for finding in long.findings]


def test_an_episode_of_nothing_is_not_kept(tmp_path):
    arm, camera = usual()
    with session(tmp_path, [Dead(arm, after=1.0), camera]) as opened:
        opened.start()
        with pytest.raises(DataError, match="not kept"):
            opened.stop()
        assert recorded(opened, 0.5).path.name == "001.csv"
        passes(opened, 1.0)
        opened.start()
        passes(opened, 1.0)
        with pytest.raises(DataError, match=r"nothing came of arm in 1\.0 s; it is not kept"):
            opened.stop()
        assert opened.state is State.IDLE
        with pytest.raises(OptionError, match="nothing to discard"):  # and not the one before
            opened.discard()
    assert files(tmp_path) == ["001.csv"]
    arm, camera = usual()
    with session(tmp_path, [arm, NanBursting(camera, [(0.0, 60.0)], only="tool")]) as opened:
        opened.start()
        passes(opened, 1.0)
        with pytest.raises(DataError, match="nothing was read of tool; it is not kept"):
            opened.stop()


def test_a_pedal_is_read_and_is_no_channel(tmp_path):
    times = np.arange(400) / 20
    down = np.where((times > 1.0) & (times < 2.0), 1.0, np.where(times < 0.5, np.nan, 0.0))[:, None]
    pedal = ReplaySensor(inphase.Demonstration(times, down), make_channels(["pedal"], []), name="pedal")
    with session(tmp_path, [*usual(), pedal], trigger="pedal") as opened:
        assert opened.pressed is None
        seen = []
        for _ in range(30):
            passes(opened, 0.1)
            seen.append(opened.pressed)
        assert [seen.index(pressed) for pressed in (None, False, True)] == [0, 4, 10]
        assert seen == [None] * 4 + [False] * 6 + [True] * 9 + [False] * 11
        assert list(recorded(opened).sensors) == ["arm", "camera"]
    with pytest.raises(OptionError, match="one sensor with the trigger 'foot', got 0: grip, tool"):
        Demonstrations(usual(), CHANNELS, tmp_path, FakeClock(), trigger="foot")


# ----------------------------------------------------------------------------------------------------------- mistakes


@pytest.mark.parametrize(
    ("sensors", "options", "told"),
    [
        (usual()[1:], {}, "no device offers grip"),
        ([*usual(), sensor("second", 10.0, ["tool"])], {}, "'tool' is offered twice"),
        ([usual()[0], usual()[0], usual()[1]], {}, "sensors of different names"),
        (usual(), {"rate": 0.0}, "finite rate"),
        (usual(), {"silence": -1.0}, "finite silence"),
        (usual(), {"staleness": {"foot": 1.0}}, "no channel fits 'foot'"),
        (usual(), {"staleness": -1.0}, "expected a positive, finite time"),
        (usual(), {"shared_clock": ["eye"]}, "no sensor is called eye; the sensors are arm, camera"),
    ],
)
def test_bad_options_are_named_before_anything_is_recorded(sensors, options, told, tmp_path):
    with pytest.raises(inphase.InphaseError, match=told), session(tmp_path, sensors, **options):
        pass


def test_half_a_quaternion_is_refused_at_once(tmp_path):
    channels = make_channels([f"q{axis}" for axis in "xyzw"], [], kinds={"q?": Kind.QUATERNION})
    sensors = [sensor("one", 10.0, ["qx", "qy"]), sensor("two", 10.0, ["qz", "qw"])]
    with pytest.raises(OptionError, match="all four channels of quaternion"):
        Demonstrations(sensors, channels, tmp_path, FakeClock())


def test_sensors_that_were_started_are_stopped_when_another_cannot_be(tmp_path, monkeypatch):
    arm, camera = usual()

    def refused(_: object) -> None:
        raise OSError(16, "Device or resource busy")

    monkeypatch.setattr(camera, "start", refused)
    with pytest.raises(OSError, match="busy"), session(tmp_path, [arm, camera]):
        pass
    assert arm._clock is None


@contextmanager
def nobody() -> Iterator[None]:
    """As a user who may not do everything."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_a_folder_that_cannot_be_written_to_is_told_before_anything_is_recorded(tmp_path):
    folder = tmp_path / "demos"
    folder.mkdir()
    folder.chmod(0o555)
    with nobody(), pytest.raises(OptionError, match=r"cannot record into .*: Permission denied"), session(tmp_path):
        pass
    with pytest.raises(OptionError, match=r"cannot record into .*: No such file"), session(tmp_path / "none"):
        pass
    (tmp_path / "file").mkdir()
    (tmp_path / "file" / "demos").write_text("")
    with pytest.raises(OptionError, match=r"cannot record into .*: File exists"), session(tmp_path / "file"):
        pass


def test_a_folder_that_may_not_be_entered_is_told_as_one(tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir()
    closed.chmod(0o000)
    with nobody(), pytest.raises(OptionError, match=r"cannot write .*a\.csv: Permission denied"):
        check_target(closed / "below" / "a.csv")
    closed.chmod(0o755)
    with pytest.raises(OptionError, match="cannot write"):
        check_target(tmp_path / ("x" * 300) / "a.csv")


def test_on_a_full_disk_the_episode_is_held_until_it_can_be_written(tmp_path):
    with session(tmp_path) as opened:
        recorded(opened, 0.2)
        opened.start()
        passes(opened, 5.0)
        with largest_file(4096), pytest.raises(OptionError, match=r"could not be written into .*: File too large"):
            opened.stop()
        assert (files(tmp_path), opened.state) == (["001.csv"], State.UNWRITTEN)  # no half of one
        with pytest.raises(OptionError, match="holds an episode that could not be written"):
            opened.start()
        with largest_file(4096), pytest.raises(OptionError, match="could not be written"):
            opened.stop()
        passes(opened, 3.0)  # what comes now is not of it
        episode = opened.stop()
        assert episode.path.name == "002.csv"
        assert episode.duration == pytest.approx(5.0, abs=0.1)
        assert opened.state is State.IDLE
        opened.start()
        passes(opened, 5.0)
        with largest_file(4096), pytest.raises(OptionError, match="could not be written"):
            opened.stop()
        assert opened.discard() == "the episode that could not be written"
        with pytest.raises(OptionError, match="nothing to discard"):
            opened.discard()
    assert files(tmp_path) == ["001.csv", "002.csv"]


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """No file may grow beyond so many bytes: as a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
