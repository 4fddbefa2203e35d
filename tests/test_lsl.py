"""Streams of other processes, over loopback: all that is sent is read, and what fails is told or goes stale."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from interactions import shapes_unchecked

from inphase.errors import ChannelError, OptionError
from inphase.recording import RecordedEvent
from inphase.runtime import Sensor, Signal, Synchroniser, SystemClock
from inphase.runtime.adapters import lsl_library
from inphase.runtime.adapters.lsl import LslMarkers, LslSensor
from inphase.runtime.adapters.lsl_library import load_lsl
from inphase.runtime.configuration.section import Section

PATIENCE = 20.0  # [s] on a busy machine
LABELS = "x,y,gap"


@pytest.fixture(scope="module", autouse=True)
def loopback() -> None:
    """Before any outlet is started: they are to have the same settings."""
    load_lsl()
    assert "LSLAPICFG" in os.environ


@pytest.fixture
def outlets() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts programs that send, and ends them."""
    running: list[subprocess.Popen[str]] = []

    def start(name: str, *, kind="MoCap", source="s", form="double64", count=300, labels=LABELS) -> Any:
        script = Path(__file__).with_name("lsl_outlet.py")
        command = [sys.executable, str(script), name, kind, source, form, str(count), labels]
        program = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        running.append(program)
        assert program.stdout is not None
        assert program.stdout.readline() == "ready\n"
        return program

    yield start
    for program in running:
        program.kill()
        program.wait()
        for pipe in (program.stdin, program.stdout):
            assert pipe is not None
            pipe.close()


def send(program: Any) -> None:
    program.stdin.write("\n")
    program.stdin.flush()


def unique(what: str = "stream") -> str:
    """A name that no other test of this machine uses."""
    return f"{what} {uuid.uuid4().hex}"


def gather(sensor: LslSensor, enough: Callable[[list], bool], patience: float = PATIENCE) -> list:
    samples: list = []
    end = time.monotonic() + patience
    while not enough(samples) and time.monotonic() < end:
        began = time.perf_counter()
        samples += sensor.read()
        assert time.perf_counter() - began < 1.0  # never waits, though it may be kept waiting by the machine
        time.sleep(0.005)
    return samples


def test_300_samples_at_100_hz_and_none_is_lost(outlets):
    name, clock = unique(), SystemClock()
    program = outlets(name)
    sensor = LslSensor("hand", name, {"b": "y", "a": 0, "c": "gap"}, kind="MoCap", units={"?": "m"})
    assert isinstance(sensor, Sensor)
    assert sensor.signals == (Signal("b", "m"), Signal("a", "m"), Signal("c", "m"))
    assert sensor.read() == []
    sensor.start(clock)
    send(program)
    samples = gather(sensor, lambda got: len(got) >= 300)
    assert len(samples) == 300
    values, counted = np.array([s.values for s in samples]), np.arange(300.0)
    np.testing.assert_array_equal(values[:, :2], np.stack([2 * counted, counted], axis=1))
    np.testing.assert_array_equal(values[:, 2], np.where(counted % 10 == 9, np.nan, 3 * counted))
    np.testing.assert_allclose(np.diff([s.stamp for s in samples]), 0.01, atol=1e-9)  # the sender's own
    received = [s.received for s in samples]
    assert received == sorted(received)
    together = Synchroniser({"hand": sensor.signals}, 0.5)
    together.take("hand", samples)
    assert together.clocks["hand"].stamp_at(received[-1]) >= samples[-1].stamp - 1e-6
    sensor.stop()
    assert sensor.read() == []


@pytest.mark.parametrize(("what", "source"), [("named", "by source"), ("unnamed", ""), ("it's", "by source")])
def test_a_stream_that_vanishes_is_silent_and_one_that_is_back_is_heard(outlets, what, source):
    """Found again by liblsl, by its source; and by us, where that is not told or cannot be asked for."""
    name = unique(what)
    source = source and f"{source} {name}"
    first = outlets(name, source=source, count=100_000)
    sensor = LslSensor("hand", name, {"x": "x"})
    sensor.start(SystemClock())
    send(first)
    assert len(gather(sensor, lambda got: len(got) >= 20)) >= 20
    first.kill()
    first.wait()
    time.sleep(0.3)
    sensor.read()
    assert gather(sensor, bool, patience=1.0) == []
    second = outlets(name, source=source, count=100_000)
    send(second)
    back = gather(sensor, lambda got: len(got) >= 20)
    assert len(back) >= 20
    values = np.concatenate([s.values for s in back])
    np.testing.assert_array_equal(np.diff(values), 1)
    assert values[0] < 2000  # those of the second
    sensor.stop()


def test_wrong_names_labels_units_and_texts_are_refused(outlets):
    name, texts = unique(), unique()
    outlets(name)
    outlets(texts, form="string", source="t", kind="Markers")
    clock = SystemClock()
    missing = LslSensor("hand", "no such stream", {"x": "x"}, timeout=0.5)
    with pytest.raises(OptionError, match="expected one LSL stream with name='no such stream', found ") as caught:
        missing.start(clock)
    assert f"'{name}' of type 'MoCap' from " in str(caught.value)
    assert missing.read() == []
    with pytest.raises(OptionError, match="and type='EEG', found"):
        LslSensor("hand", name, {"x": "x"}, kind="EEG", timeout=0.5).start(clock)
    with pytest.raises(OptionError, match="hand: expected one channel 'z' in the stream, which has x, y, gap"):
        LslSensor("hand", name, {"a": "z"}).start(clock)
    with pytest.raises(OptionError, match="hand: expected one channel '3' in the stream, which has x, y, gap"):
        LslSensor("hand", name, {"a": 3}).start(clock)
    with pytest.raises(OptionError, match="hand: 'a' is in 'm' in the stream, expected 'mm'"):
        LslSensor("hand", name, {"a": "x"}, units={"a": "mm"}).start(clock)
    with pytest.raises(OptionError, match="expected a stream of numbers, got one of texts"):
        LslSensor("hand", texts, {"a": "x"}).start(clock)


def test_two_streams_of_one_name_are_not_guessed_between(outlets):
    name = unique()
    outlets(name, source="one")
    outlets(name, source="two", kind="EEG")
    with pytest.raises(OptionError, match=r"expected one LSL stream with .*, found .*'(MoCap|EEG)' .*'(MoCap|EEG)'"):
        LslSensor("hand", name, {"x": "x"}).start(SystemClock())
    sensor = LslSensor("hand", name, {"x": "x"}, kind="EEG")
    sensor.start(SystemClock())
    sensor.stop()


def test_whole_numbers_are_read_as_numbers(outlets):
    name = unique()
    program = outlets(name, form="int32", labels="n")
    table = {"stream": name, "channels": {"n": 0}, "units": {"n": "m"}, "timeout": 5}  # as a configuration says it
    sensor = Section("live.toml", "", Path(), table).call(LslSensor, name="counter")
    sensor.start(SystemClock())
    send(program)
    samples = gather(sensor, lambda got: len(got) >= 5)
    assert [s.values.tolist() for s in samples[:5]] == [[0.0], [1.0], [2.0], [3.0], [4.0]]
    sensor.stop()


def test_markers_are_received_with_all_they_say():
    pylsl, name = load_lsl(), unique()
    markers = LslMarkers(stream=name)
    events = [
        RecordedEvent(1.5, "safety", "sensor 'größe' is \"stale\"", "running", "holding"),
        RecordedEvent(2.5, "end", ""),
    ]
    markers(events[0])  # not begun
    markers.start()
    (info,) = pylsl.resolve_byprop("name", name, timeout=PATIENCE)
    inlet = pylsl.StreamInlet(info)
    inlet.open_stream(PATIENCE)
    while not markers._outlet.have_consumers():
        time.sleep(0.01)
    for event in events:
        markers(event)
    received = [inlet.pull_sample(PATIENCE) for _ in events]
    told = [json.loads(sample[0]) for sample, _ in received]
    assert [RecordedEvent(**one) for one in told] == events
    assert (info.type(), info.channel_count()) == ("Markers", 1)
    markers.stop()
    markers(events[1])
    assert inlet.pull_sample(0.3) == (None, None)


def test_bad_options_are_named():
    with pytest.raises(OptionError, match="hand: expected at least one channel"):
        LslSensor("hand", "s", {})
    with pytest.raises(OptionError, match="timeout > 0"):
        LslSensor("hand", "s", {"x": 0}, timeout=0.0)
    with pytest.raises(ChannelError, match="no channel fits 'y'"):
        LslSensor("hand", "s", {"x": 0}, units={"y": "m"})
    with pytest.raises(OptionError, match="scope: expected one of machine, network, got 'world'"):
        LslMarkers(scope="world")
    with pytest.raises(OptionError, match="scope: expected 'machine', as another LSL device of this process has"):
        LslMarkers(scope="network")
    with pytest.raises(OptionError, match="one kind of quotation mark"):
        LslSensor("hand", "'\"", {"x": 0})


def run(code: str, **environment: str) -> str:
    """What a fresh process prints."""
    kept = {key: value for key, value in os.environ.items() if key != "LSLAPICFG"} | environment
    result = subprocess.run([sys.executable, "-c", code], env=kept, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


def test_the_settings_are_a_file_of_the_process_unless_there_is_one_of_the_user(tmp_path):
    load = "import os\nfrom inphase.runtime.adapters.lsl_library import load_lsl\nload_lsl({})\n"
    path, content = run(load.format("") + "p = os.environ['LSLAPICFG']; print(p); print(open(p).read())").split("\n", 1)
    assert "ResolveScope = machine" in content
    assert "ListenAddress = 127.0.0.1" in content
    assert not Path(path).exists()
    own = tmp_path / "own.cfg"
    own.write_text("[lab]\nSessionID = own\n")
    assert run(load.format("") + "print(os.environ['LSLAPICFG'])", LSLAPICFG=str(own)) == str(own)
    assert run(load.format("'network'") + "print(os.environ.get('LSLAPICFG'))") == "None"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ModuleNotFoundError("No module named 'pylsl'"), r"pip install 'inphase\[lsl\]'"),
        (RuntimeError("LSL binary library file was not found."), r"found no liblsl: install it \(https"),
    ],
)
def test_a_missing_library_is_named(monkeypatch, error, said):
    def fail(*arguments: Any) -> None:
        raise error

    monkeypatch.delitem(sys.modules, "pylsl", raising=False)
    finder = SimpleNamespace(find_spec=lambda name, *rest: fail() if name == "pylsl" else None)
    monkeypatch.setattr(sys, "meta_path", [finder, *sys.meta_path])
    with pytest.raises(OptionError, match=said), shapes_unchecked():
        lsl_library.load_lsl()
