"""The recorder: what was put is what is read, by anybody, after any accident; and the loop never waits for it."""

from __future__ import annotations

import errno
import io
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from interactions import CONTROLLED, OBSERVED, chance_model, phase_model, shapes_unchecked
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

import inphase
from inphase import DataError, Estimate, OptionError, Recording, Response, Status
from inphase.channels import make_channels
from inphase.io import mcap_messages, read_recorded_model, read_recording
from inphase.io.model_file import checksum_named, model_bytes, model_hash
from inphase.recording import RecordedCommand, RecordedEvent
from inphase.replay import provenance_of, replay
from inphase.runtime.recorder import FLUSH_EVERY, Recorder

CHANNELS = make_channels(OBSERVED, CONTROLLED, units={"reach": "m"})
MODEL = chance_model(np.random.default_rng(3), phase_model())
COMMAND = RecordedCommand(0.5, np.array([0.5, 0.75]), np.array([[0.1, -0.0], [np.nan, 0.3]]), ("j1", 'j"2'))
EVENT = RecordedEvent(0.6, "safety", "größe: sensor 'imu' is stale", "running", "holding")


def estimate(at: float, **parts: Any) -> Estimate:
    usual = {"phase": 0.1, "phase_std": 0.2, "phase_velocity": 1.0, "phase_velocity_std": 0.3, "log_likelihood": -1.0}
    return Estimate(time=at, **(usual | {"status": Status.FOLLOWING} | parts))


def answer(at: float) -> Response:
    rng = np.random.default_rng(0)
    return Response(at + np.arange(5.0), np.linspace(0, 1, 5), rng.normal(size=(5, 2)), np.ones((5, 2)), CONTROLLED)


def steps(count: int) -> Iterator[tuple[float, np.ndarray]]:
    rng = np.random.default_rng(1)
    return ((0.01 * i, rng.normal(size=4)) for i in range(count))


def filled(target: Any, count: int = 20, **options: Any) -> Recorder:
    """A closed recorder of some of everything."""
    with Recorder(target, CHANNELS, {"bag": "a"}, name="walk", **options) as recorder:
        for i, (at, values) in enumerate(steps(count)):
            recorder.put_step(values, estimate(at, phase=i / count))
            if i % 5 == 0:
                recorder.put_response(at, answer(at))
        recorder.put_command(COMMAND)
        recorder.put_event(EVENT)
    return recorder


def same(one: Response | None, other: Response | None) -> bool:
    if one is None or other is None:
        return one is other
    parts = ("times", "phases", "mean", "std")
    equal = all(np.array_equal(getattr(one, part), getattr(other, part), equal_nan=True) for part in parts)
    return equal and one.channels == other.channels


def read_or_refused(path: Path) -> Recording | None:
    """None for one clear error that names the file; whatever else is raised is a mistake."""
    return or_refused(read_recording, path)


def or_refused(read: Callable[[Path], Any], path: Path) -> Any:
    try:
        return read(path)
    except DataError as refused:
        message = str(refused)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return None


def wait_for(truth: Callable[[], bool], at_most: float = 5.0) -> bool:
    end = time.monotonic() + at_most
    while time.monotonic() < end:
        if truth():
            return True
        time.sleep(0.005)
    return False


# ------------------------------------------------------------------------------------------------ put, and read again


def test_what_was_put_is_what_is_read(tmp_path: Path) -> None:
    recorder = filled(tmp_path / "a.mcap")
    read = read_recording(tmp_path / "a.mcap")
    assert (recorder.lost, recorder.failure) == (0, None)
    assert (read.name, read.channels, read.provenance) == ("walk", CHANNELS, {"bag": "a"})
    np.testing.assert_array_equal(read.times, [at for at, _ in steps(20)])
    np.testing.assert_array_equal(read.values, [values for _, values in steps(20)])
    assert read.estimates == tuple(estimate(at, phase=i / 20) for i, (at, _) in enumerate(steps(20)))
    expected = [answer(at) if i % 5 == 0 else None for i, (at, _) in enumerate(steps(20))]
    assert all(itertools.starmap(same, zip(read.responses, expected, strict=True)))
    (command,) = read.commands
    assert (command.time, command.signals) == (COMMAND.time, COMMAND.signals)
    np.testing.assert_array_equal(command.times, COMMAND.times)
    np.testing.assert_array_equal(command.positions, COMMAND.positions)
    assert np.signbit(command.positions[0, 1])  # -0.0: to the last bit
    assert read.events == (EVENT,)


@settings(max_examples=40)
@given(st.lists(st.floats(), min_size=10, max_size=10), st.sampled_from(Status))
@example([5e-324, -0.0, np.inf, -np.inf, np.nan, 1.7976931348623157e308, 0.1, 1 / 3, np.inf, np.nan], Status.COLLAPSED)
def test_every_number_comes_back_to_the_last_bit(numbers: list[float], status: Status) -> None:
    made = Estimate(0.25, *numbers[:5], status)
    values = np.array(numbers[5:9])
    message = json.loads(mcap_messages.estimate(made), parse_constant=pytest.fail)  # no NaN: that is not JSON
    np.testing.assert_array_equal(astuple(mcap_messages.read_estimate(message))[:6], astuple(made)[:6])
    assert mcap_messages.read_estimate(message).status is status
    message = json.loads(mcap_messages.observation(0.25, "abcd", values), parse_constant=pytest.fail)
    _, read = mcap_messages.read_observation(message, {"a": 0, "b": 1, "c": 2, "d": 3})
    seen = np.where(np.isfinite(values), values, np.nan)  # infinite is not seen, as for a session
    np.testing.assert_array_equal(read.view(np.int64)[np.isfinite(seen)], values.view(np.int64)[np.isfinite(seen)])
    np.testing.assert_array_equal(read, seen)
    matrix = np.array(numbers[:6]).reshape(3, 2)
    made_response = Response(np.array(numbers[:3]), np.array(numbers[3:6]), matrix, matrix[::-1], ("a", "é"))
    text = mcap_messages.response(made_response)
    assert same(mcap_messages.read_response(json.loads(text, parse_constant=pytest.fail)), made_response)


@pytest.mark.parametrize(
    ("filter", "options"), [("rbpf", {"particles": 30}), ("ebip", {"members": 20}), ("particle", {}), ("bip", {})]
)
def test_a_new_session_gives_every_estimate_again(tmp_path: Path, filter: str, options: dict[str, Any]) -> None:
    rng = np.random.default_rng(5)
    session = MODEL.session(filter, 7, **options)
    told = provenance_of(MODEL, filter, 7, options, configuration="rate = 60")
    live, answers = [], []
    path = tmp_path / "a.mcap"
    with Recorder(path, MODEL.channels, told) as recorder:
        for i in range(40):
            at = 0.03 * (i - i % 7 // 6)  # some come twice at a time
            values: Any = MODEL.predict(np.array([0.05 + at * 0.8]))[0, :2] + rng.normal(scale=0.02, size=2)
            if i % 4 == 1:
                values = {"turn": 0.1 * rng.normal(), "reach": float(values[0])}
            elif i % 4 == 2:
                values = np.array([np.nan, values[1]])
            elif i % 9 == 3:
                values = [np.inf, np.nan]
            live.append(session.observe(at, values))
            recorder.put_step(values, live[-1])
            if i % 10 == 0:
                answers.append(session.respond(samples=4))
                recorder.put_response(at, answers[-1])
    MODEL.save(tmp_path / "model.inphase")
    read = read_recording(path)
    assert read.provenance["configuration"] == "rate = 60"
    assert read.estimates == tuple(live)
    assert tuple(replay(read, inphase.Model.load(tmp_path / "model.inphase"))) == read.estimates
    assert all(itertools.starmap(same, zip([r for r in read.responses if r], answers, strict=True)))
    other = chance_model(np.random.default_rng(4), phase_model())
    with pytest.raises(DataError, match="expected the model it was recorded with"):
        next(replay(read, other))


def test_a_reset_on_the_way_is_one_in_the_replay(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    session, live = MODEL.session("rbpf", 3, particles=30), []
    path = tmp_path / "a.mcap"
    told = provenance_of(MODEL, "rbpf", 3, {"particles": 30})
    with Recorder(path, MODEL.channels, told, model=MODEL) as recorder:
        for i in range(60):
            at = 0.03 * (i - i % 2)  # two at a time
            if i in (0, 20, 40):  # before the first, between two, and twice in one place
                for late in range(1 + (i == 40)):
                    session.reset()
                    recorder.put_event(RecordedEvent(at - 0.01 * late - 0.001, "reset", "asked for"))
            if i == 50:  # what is told of others is not a reset, nor is one at no time
                recorder.put_event(RecordedEvent(at - 0.001, "safety", "reset"))
                recorder.put_event(RecordedEvent(np.nan, "reset", ""))
            phase = 0.05 + 0.03 * (i % 20) * 0.8
            values = MODEL.predict(np.array([phase]))[0, :2] + rng.normal(scale=0.02, size=2)
            live.append(session.observe(at, values))
            recorder.put_step(values, live[-1])
        recorder.put_event(RecordedEvent(99.0, "reset", "after the last"))
    read = read_recording(path)
    assert live[20].phase < 0.3 < live[19].phase  # it did begin anew
    assert tuple(replay(read, MODEL)) == read.estimates == tuple(live)
    # A sample at the very time of a reset came before it, as the loop promises.
    at = live[20].time
    moved = [replace(e, time=at) if e.time == at - 0.001 else e for e in read.events]
    other = tuple(replay(replace(read, events=tuple(moved)), MODEL))
    assert other[:20] == read.estimates[:20]
    assert other[22:40] != read.estimates[22:40]
    assert other[40:] == read.estimates[40:]
    (begun,) = [i for i in range(20, 40) if other[i].phase < 0.3 < other[i - 1].phase]
    assert begun == 22


# ---------------------------------------------------------------------------------------------- the model in the file


def with_model(target: Any, count: int = 4, model: inphase.Model = MODEL) -> bytes:
    """A recording that holds its model, and where it lies; it is written as a file of its own would be."""
    with Recorder(target, model.channels, provenance_of(model, "bip"), model=model) as recorder:
        for at, values in steps(count):
            recorder.put_step(values, estimate(at))
    return model_bytes(model)


def test_a_recording_gives_its_model_back(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    held = with_model(path)
    MODEL.save(tmp_path / "model.inphase")
    assert held == (tmp_path / "model.inphase").read_bytes()
    assert checksum_named(held) == model_hash(MODEL)
    model = read_recorded_model(path)
    assert model is not None
    assert model_bytes(model) == held
    content = path.read_bytes()
    assert content.count(held) == 1
    assert content.index(held) < content.index(b'{"time": 0.0')  # before all data: a killed process leaves it
    with path.open("rb") as file:  # others find it too
        (attached,) = make_reader(file, validate_crcs=True).iter_attachments()
    assert (attached.name, attached.data) == ("model.inphase", held)
    filled(tmp_path / "none.mcap")
    assert read_recorded_model(tmp_path / "none.mcap") is None
    with pytest.raises(DataError, match=r"missing\.mcap: cannot be read: No such file"):
        read_recorded_model(tmp_path / "missing.mcap")


def test_a_model_is_recorded_only_with_its_own_hash(tmp_path: Path) -> None:
    other = chance_model(np.random.default_rng(4), phase_model())
    for told in ({}, provenance_of(other)):
        with pytest.raises(OptionError, match="expected a provenance that names the model"):
            Recorder(tmp_path / "a.mcap", MODEL.channels, told, model=MODEL)
    assert not (tmp_path / "a.mcap").exists()
    path = tmp_path / "b.mcap"
    held, foreign = with_model(path), model_bytes(other)
    assert len(held) == len(foreign)
    path.write_bytes(path.read_bytes().replace(held, foreign))
    with pytest.raises(DataError, match=r"b\.mcap: model\.inphase: expected the model that the recording names"):
        read_recorded_model(path)
    assert len(read_recording(path).estimates) == 4  # what was recorded is none the worse for it


def model_or_refused(path: Path) -> inphase.Model | None:
    """As `read_or_refused`; None also where there is none."""
    return or_refused(read_recorded_model, path)


def test_a_damaged_model_is_never_taken_for_one(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    held = with_model(path)
    whole, content = read_recording(path), path.read_bytes()
    begin = content.index(held)
    framed = range(begin - 60, begin + 70)  # lengths, name, kind; then the prefix of the model
    given = 0
    for place in [*framed, *range(begin + 70, begin + len(held) + 8, 97)]:
        mutated = bytearray(content)
        mutated[place] ^= 1 << place % 8
        path.write_bytes(mutated)
        model = model_or_refused(path)
        if model is not None:
            given += 1
            assert model_bytes(model) == held
        read = read_or_refused(path)
        if begin <= place < begin + len(held):
            assert model is None  # its own checksum
            assert read is not None
            assert (read.estimates, "damage" in read.provenance) == (whole.estimates, False)
        elif read is not None:
            assert read.estimates == whole.estimates[: len(read.estimates)]
    assert given > 0  # a flipped bit of the media type hurts nobody
    for size in range(begin - 40, begin + len(held) + 40, 61):
        path.write_bytes(content[:size])
        model = model_or_refused(path)
        read = read_or_refused(path)
        assert (model is not None) == (size >= begin + len(held) + 4)
        assert read is None or "damage" in read.provenance


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.one_of(st.binary(max_size=100), st.binary(max_size=60).map(lambda tail: model_bytes(MODEL)[:20] + tail)),
    st.booleans(),
)
@example(model_bytes(MODEL)[:16] + (2**31).to_bytes(8, "little") + bytes(32), True)
def test_a_model_of_another_hand_gives_an_error_of_ours(tmp_path: Path, content: bytes, named: bool) -> None:
    """Also one that is named by the recording as it stands there."""
    stream = io.BytesIO()
    writer = Writer(stream, compression=CompressionType.NONE)
    writer.start()
    told = {"model": checksum_named(content)} if named else {}
    writer.add_metadata("inphase", mcap_messages.describe_run("a", CHANNELS, told))
    writer.add_attachment(0, 0, "model.inphase", "", content)
    writer.finish()
    (tmp_path / "a.mcap").write_bytes(stream.getvalue())
    with shapes_unchecked():
        assert model_or_refused(tmp_path / "a.mcap") is None


def test_a_disk_that_is_full_of_the_model_is_told_before_anything_moves() -> None:
    with pytest.raises(OptionError, match="cannot write the stream: No space left on device"):
        with_model(FullDisk(room=len(model_bytes(MODEL)) // 2))


def test_a_recording_that_names_no_session_is_not_replayed(tmp_path: Path) -> None:
    filled(tmp_path / "a.mcap")
    with pytest.raises(DataError, match=r"walk: expected it to name its model, filter, seed, options"):
        next(replay(read_recording(tmp_path / "a.mcap"), MODEL))
    with pytest.raises(OptionError, match="written as JSON"):
        provenance_of(MODEL, "ebip", options={"members": {1}})


def test_the_public_reader_reads_it(tmp_path: Path) -> None:
    filled(tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        found = list(reader.iter_messages())
        (described,) = reader.iter_metadata()
    assert described.name == "inphase"
    assert json.loads(described.metadata["provenance"]) == {"bag": "a"}
    assert summary.statistics.message_count == len(found) == 20 + 20 + 4 + 1 + 1
    assert {channel.topic for channel in summary.channels.values()} == set(mcap_messages.FIELDS)
    for schema, channel, message in found:
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        content = json.loads(message.data, parse_constant=pytest.fail)
        assert set(json.loads(schema.data)["required"]) == set(content)  # it says what is there
        at = content["time"] if "time" in content else content["times"][0]
        assert message.log_time == pytest.approx(at * 1e9, abs=1)


def test_values_are_those_of_the_moment_of_the_put(tmp_path: Path) -> None:
    buffer = np.zeros(4)
    with Recorder(tmp_path / "a.mcap", CHANNELS) as recorder:
        for i in range(50):
            buffer[:] = i
            recorder.put_step(buffer, estimate(float(i)))
    np.testing.assert_array_equal(read_recording(tmp_path / "a.mcap").values[:, 0], np.arange(50))


def test_mistakes_raise_at_once(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", CHANNELS) as recorder:
        with pytest.raises(inphase.ObservationError, match="at most 4 values, got shape"):
            recorder.put_step(np.zeros(5), estimate(0.0))
        with pytest.raises(inphase.ObservationError, match="unknown channel foot; the channels are reach, lift"):
            recorder.put_step({"foot": 1.0}, estimate(0.0))
    with pytest.raises(OptionError, match="already, and a recording is never overwritten"):
        Recorder(tmp_path / "a.mcap", CHANNELS)
    with pytest.raises(OptionError, match="expected the folder"):
        Recorder(tmp_path / "none" / "a.mcap", CHANNELS)
    with pytest.raises(OptionError, match="capacity of at least 1"):
        Recorder(tmp_path / "b.mcap", CHANNELS, capacity=0)
    assert not (tmp_path / "b.mcap").exists()


def test_what_is_not_as_promised_is_told_and_the_rest_is_written(tmp_path: Path) -> None:
    with shapes_unchecked(), Recorder(tmp_path / "a.mcap", CHANNELS) as recorder:
        recorder.put_command(RecordedCommand(0.0, np.zeros(1), np.zeros((1, 1)), (b"j1",)))  # type: ignore[arg-type]
        recorder.put_event(EVENT)
    told, event = read_recording(tmp_path / "a.mcap").events
    assert (told.kind, event, recorder.lost) == ("recorder", EVENT, 1)
    assert "/command lost, it cannot be written" in told.reason


# ------------------------------------------------------------------------------------------------------------ accidents

KILLED = """
import sys, time
import numpy as np
from inphase import Estimate, Model, Status
from inphase.runtime.recorder import Recorder
from inphase.replay import provenance_of

model = Model.load(sys.argv[2])
recorder = Recorder(sys.argv[1], model.channels, {**provenance_of(model), "bag": "killed"}, model=model)
start = time.perf_counter()
while True:
    now = time.perf_counter() - start
    recorder.put_step([now], Estimate(now, 0.5, 0.1, 1.0, 0.1, 0.0, Status.FOLLOWING))
    print(now, flush=True)
    time.sleep(0.002)
"""


@pytest.mark.parametrize("lives", [0.05, 1.5])
def test_a_killed_process_leaves_all_but_the_last_second(tmp_path: Path, lives: float) -> None:
    path, model = tmp_path / "a.mcap", tmp_path / "a.inphase"
    MODEL.save(model)
    command = [sys.executable, "-c", KILLED, str(path), str(model)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        last = 0.0
        while last < lives:
            last = float(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
        told = [float(line) for line in process.stdout.read().split("\n") if "." in line]
    last = told[-1] if told else last
    assert process.returncode == -signal.SIGKILL
    read = read_recording(path)
    assert (read.provenance["bag"], read.provenance["damage"][:9]) == ("killed", "cut short")
    assert [e.time for e in read.estimates] == read.times.tolist() == read.values[:, 0].tolist()
    assert (read.times[-1] if len(read.times) else 0.0) > last - 1.0
    assert (found := read_recorded_model(path)) is not None
    assert model_bytes(found) == model.read_bytes()
    if lives > 1:
        assert len(read.times) > 100


def test_a_file_cut_anywhere_gives_all_up_to_there_or_one_error(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("inphase.runtime.recorder.FLUSH_EVERY", 0.0)  # a chunk for every message
    filled(tmp_path / "whole.mcap", count=8)
    content = (tmp_path / "whole.mcap").read_bytes()
    whole = read_recording(tmp_path / "whole.mcap")
    cut, counts = tmp_path / "cut.mcap", []
    for size in [*range(0, len(content), 67), len(content) - 1]:
        cut.write_bytes(content[:size])
        read = read_or_refused(cut)
        if read is None:
            assert counts == []  # once it says what it is of, all that follows can be read
            continue
        assert read.estimates == whole.estimates[: len(read.estimates)]
        np.testing.assert_array_equal(read.values, whole.values[: len(read.values)])
        is_whole = len(read.events) == 1
        assert is_whole or "damage" in read.provenance
        counts.append(len(read.estimates))
    assert counts == sorted(counts)
    assert set(counts) == set(range(9))


def stored() -> bytes:
    stream = io.BytesIO()
    filled(stream, count=3)
    return stream.getvalue()


WHOLE = stored()


def test_a_flipped_bit_is_never_taken_for_a_reading(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    (tmp_path / "whole.mcap").write_bytes(WHOLE)
    whole = read_recording(tmp_path / "whole.mcap")
    refused = 0
    for place in range(0, len(WHOLE), 61):
        mutated = bytearray(WHOLE)
        mutated[place] ^= 1 << place % 8
        path.write_bytes(mutated)
        read = read_or_refused(path)
        if read is None:
            refused += 1
            continue
        assert read.estimates == whole.estimates[: len(read.estimates)]
        np.testing.assert_array_equal(read.values, whole.values[: len(read.values)])
        assert (read.channels, read.name, read.provenance["bag"]) == (CHANNELS, "walk", "a")
    assert 0 < refused < len(WHOLE) / 61
    path.write_bytes(WHOLE.replace(b'{"bag": "a"}', b'{"bag": "b"}'))
    with pytest.raises(DataError, match="the checksum of the description differs"):
        read_recording(path)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.one_of(
        st.binary(max_size=200),
        st.binary(max_size=200).map(lambda tail: WHOLE[:8] + tail),
        st.tuples(st.integers(0, len(WHOLE)), st.binary(max_size=40)).map(
            lambda at: WHOLE[: at[0]] + at[1] + WHOLE[at[0] + len(at[1]) :]
        ),
    )
)
@example(b"")
@example(WHOLE[:8] + b"\x06" + b"\xff" * 200)
@example(WHOLE[:8] + b"\x06" + (60).to_bytes(8, "little") + b"\xff" * 100)
def test_garbage_gives_an_error_of_ours_or_what_was_there(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with shapes_unchecked():
        read_or_refused(path)


TEXTS = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["reach", "lift", "x"]), inner),
    max_leaves=6,
)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(list(mcap_messages.FIELDS)), st.data())
def test_messages_of_another_hand_give_an_error_of_ours(tmp_path: Path, topic: str, data: st.DataObject) -> None:
    path = tmp_path / "a.mcap"
    message = {field: data.draw(TEXTS) for field in mcap_messages.FIELDS[topic]}
    path.write_bytes(by_another_hand(topic, json.dumps(message)))
    with shapes_unchecked():
        read_or_refused(path)


def by_another_hand(topic: str, text: str, compression: CompressionType = CompressionType.NONE) -> bytes:
    stream = io.BytesIO()
    writer = Writer(stream, compression=compression)
    writer.start()
    writer.add_metadata("inphase", mcap_messages.describe_run("a", CHANNELS, {}))
    channel = writer.register_channel(topic, "json", writer.register_schema(topic, "jsonschema", b"{}"))
    writer.add_message(channel, 0, text.encode(), 0)
    writer.finish()
    return stream.getvalue()


def test_files_of_another_hand_are_refused_with_the_reason(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(by_another_hand("/observation", "[" * 10**5))
    with pytest.raises(DataError, match="its content is not that of a recording: RecursionError"):
        read_recording(path)
    path.write_bytes(by_another_hand("/command", '{"time": 0, "times": [], "positions": [1]}'))
    with shapes_unchecked(), pytest.raises(DataError, match="its content is not that of a recording: IndexError"):
        read_recording(path)
    path.write_bytes(by_another_hand("/observation", '{"time": 0, "values": {}}', CompressionType.ZSTD))
    with pytest.raises(DataError, match="got zstd: `mcap decompress` unpacks them"):
        read_recording(path)
    path.write_bytes(by_another_hand("/tf", "whatever else stands in it"))
    assert len(read_recording(path).times) == 0
    writer = Writer(stream := io.BytesIO())
    writer.start()
    writer.finish()
    path.write_bytes(stream.getvalue())
    with pytest.raises(DataError, match=r"expected a recording of inphase, got an MCAP file that tells of none$"):
        read_recording(path)
    path.write_bytes(b"time,a,b\n0,1,2")
    with pytest.raises(DataError, match="expected an MCAP file, which begins with"):
        read_recording(path)
    with pytest.raises(DataError, match="cannot be read: No such file"):
        read_recording(tmp_path / "none.mcap")


# ------------------------------------------------------------------------------------------------ slow and full disks


class SlowDisk(io.BytesIO):
    """Takes nothing while it is `stuck`."""

    def __init__(self) -> None:
        super().__init__()
        self.free = threading.Event()
        self.free.set()
        self.waiting = threading.Event()

    def write(self, data: Any) -> int:
        self.waiting.set()
        self.free.wait()
        return super().write(data)


class FullDisk(io.BytesIO):
    """Has room for so many bytes, and is full ever after."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self.room = room

    def write(self, data: Any) -> int:
        if self.tell() + len(data) > self.room:
            super().write(data[: max(self.room - self.tell(), 0)])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def read_from(stream: io.BytesIO, path: Path) -> Recording:
    path.write_bytes(stream.getvalue())
    return read_recording(path)


def test_a_slow_disk_never_holds_up_the_loop_and_the_loss_is_told(tmp_path: Path) -> None:
    disk = SlowDisk()
    recorder = Recorder(disk, CHANNELS, capacity=50)
    disk.waiting.clear()
    disk.free.clear()
    recorder.put_step(np.zeros(4), estimate(0.0))
    assert disk.waiting.wait(5.0)  # its thread stands still in a write
    began, taken = time.perf_counter(), []
    for i in range(1, 201):
        taken.append(recorder.put_step(np.zeros(4), estimate(float(i))))
    assert time.perf_counter() - began < 0.5  # no lock, no wait: 200 puts to a disk that takes none
    assert taken == [True] * 50 + [False] * 150
    assert recorder.lost == 150
    disk.free.set()
    assert wait_for(lambda: recorder.put_step(np.zeros(4), estimate(201.0)))
    refused = recorder.lost
    recorder.put_step(np.zeros(4), estimate(202.0))
    recorder.close()
    read = read_from(disk, tmp_path / "a.mcap")
    assert [e.time for e in read.estimates] == [*range(51), 201, 202]
    assert read.events == (RecordedEvent(201.0, "recorder", f"{refused} lost here: the queue was full"),)
    assert (recorder.lost, recorder.failure) == (refused, None)


def test_a_loss_at_the_end_is_told_too(tmp_path: Path) -> None:
    disk = SlowDisk()
    recorder = Recorder(disk, CHANNELS, capacity=1)
    disk.waiting.clear()
    disk.free.clear()
    recorder.put_step(np.zeros(4), estimate(0.0))
    assert disk.waiting.wait(5.0)
    assert [recorder.put_event(EVENT) for _ in range(3)] == [True, False, False]
    disk.free.set()
    recorder.close()
    _, told = read_from(disk, tmp_path / "a.mcap").events
    assert told == RecordedEvent(EVENT.time, "recorder", "2 lost here: the queue was full")


def test_a_disk_that_never_answers_does_not_hold_up_the_end() -> None:
    disk = SlowDisk()
    recorder = Recorder(disk, CHANNELS)
    disk.free.clear()
    for i in range(10):
        recorder.put_step(np.zeros(4), estimate(float(i)))
    began = time.perf_counter()
    recorder.close(timeout=0.5)
    assert time.perf_counter() - began < 1.0
    assert recorder.failure == "cannot write the stream: it did not take what was left within 0.5 s"
    assert recorder.lost == 10
    assert not recorder.put_step(np.zeros(4), estimate(10.0))
    disk.free.set()  # lets the thread end


def test_a_full_disk_is_told_and_the_loop_goes_on(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("inphase.runtime.recorder.FLUSH_EVERY", 0.0)
    disk = FullDisk(room=12000)
    with Recorder(disk, CHANNELS) as recorder:
        for i in range(500):
            recorder.put_step(np.full(4, 0.1 * i), estimate(float(i)))
        assert wait_for(lambda: recorder.failure is not None)
        began = time.perf_counter()
        assert not any(recorder.put_step(np.zeros(4), estimate(500.0 + i)) for i in range(100))
        assert time.perf_counter() - began < 0.5
    assert recorder.failure == "cannot write the stream: No space left on device"
    read = read_from(disk, tmp_path / "a.mcap")
    assert [e.time for e in read.estimates] == list(range(len(read.estimates)))
    assert 5 < len(read.estimates) == len(read.times) < 100
    assert recorder.lost == 600 - len(read.estimates)  # not one that is neither in the file nor counted


def test_a_disk_that_is_full_at_the_start_is_told_before_anything_moves() -> None:
    with pytest.raises(OptionError, match="cannot write the stream: No space left on device"):
        Recorder(FullDisk(room=100), CHANNELS)


def test_a_file_that_fails_is_closed_and_what_was_flushed_stays(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("inphase.runtime.recorder.FLUSH_EVERY", 0.0)
    path = tmp_path / "a.mcap"
    with Recorder(path, CHANNELS) as recorder:
        recorder.put_step(np.zeros(4), estimate(0.0))
        assert wait_for(lambda: len(read_recording(path).estimates) == 1)  # while it is written
        assert recorder._own is not None
        recorder._own.close()  # as when the system takes the disk away
        recorder.put_step(np.zeros(4), estimate(1.0))
        assert wait_for(lambda: recorder.failure is not None)
    assert recorder.lost == 1
    assert "cannot write" in (recorder.failure or "")
    assert len(read_recording(path).estimates) == 1


def test_a_folder_that_is_read_only_is_told_before_anything_moves(tmp_path: Path) -> None:
    folder = tmp_path / "fixed"
    folder.mkdir(mode=0o500)
    user = os.geteuid()
    try:
        if user == 0:  # whom no permission stops
            os.seteuid(65534)
        with pytest.raises(OptionError, match=r"cannot write .*a\.mcap: Permission denied"):
            Recorder(folder / "a.mcap", CHANNELS)
    finally:
        if user == 0:
            os.seteuid(user)


def test_what_is_left_of_a_run_that_was_never_closed_is_flushed_all_the_same(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", CHANNELS)
    recorder.put_step(np.zeros(4), estimate(0.0))
    began = time.perf_counter()
    assert wait_for(lambda: len(read_recording(tmp_path / "a.mcap").estimates) == 1)
    assert time.perf_counter() - began < 4 * FLUSH_EVERY
    recorder.close()
    recorder.close()  # a second time is nothing
    assert "damage" not in read_recording(tmp_path / "a.mcap").provenance
