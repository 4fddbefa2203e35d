"""docs/live.md and docs/devices.md: their code, commands and files run as they stand, and their tables are true."""

from __future__ import annotations

import contextlib
import inspect
import io
import re
import shlex
import socket
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interactions import shapes_unchecked
from pages import blocks, commands, leading_code, rows

from inphase.cli import main
from inphase.filters import RECOMMENDED
from inphase.runtime import FakeClock, Robot, Sensor
from inphase.runtime.conduct import Conduct
from inphase.runtime.configuration import devices, read_configuration
from inphase.runtime.configuration.toml_lines import tomllib
from inphase.runtime.loop import Rates
from inphase.runtime.perception import Sight
from inphase.runtime.playing import Play
from inphase.runtime.safety import Policy, State
from inphase.runtime.smoothing import AlphaBeta

DOCS = Path(__file__).parents[1] / "docs"
LIVE, DEVICES = DOCS / "live.md", DOCS / "devices.md"
LONGEST = 30  # lines of code of a device on the page


@pytest.fixture(autouse=True)
def unchecked() -> Iterator[None]:
    """As readers run it."""
    with shapes_unchecked():
        yield


@pytest.fixture(scope="module")
def demonstrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where the demo was."""
    folder = tmp_path_factory.mktemp("pages")
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()), shapes_unchecked():
        patch.chdir(folder)
        patch.setattr("inphase.runtime.live.SystemClock", FakeClock)
        assert main(["demo", "--live", "--duration", "0.5"]) == 0
    return folder


@pytest.fixture
def here(demonstrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "inphase-demo").mkdir()
    for name in ("Sine.inphase", "live.toml"):
        (tmp_path / "inphase-demo" / name).write_bytes((demonstrated / "inphase-demo" / name).read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_python(page: Path, names: dict[str, Any], text: str) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        for language, line, code in blocks(text):
            if language == "python":
                # Blank lines before it, so that a traceback names the line of the page.
                exec(compile("\n" * (line - 1) + code, page, "exec"), names)
    return printed.getvalue()


def test_the_commands_and_files_of_the_page_on_live_runs(here, monkeypatch, capsys):
    monkeypatch.setattr("inphase.runtime.live.SystemClock", FakeClock)
    text = LIVE.read_text(encoding="utf-8")
    ran = 0
    for language, line, block in blocks(text):
        for command in commands(block) if language == "sh" else ():
            words = shlex.split(command)
            assert words[0] == "inphase"
            assert main(words[1:]) == 0, f"{LIVE}:{line}: {command}\n{capsys.readouterr().err}"
            ran += 1
        if language == "toml":
            Path("inphase-demo/page.toml").write_text(block)
            assert main(["live", "inphase-demo/page.toml"]) == 0, capsys.readouterr().err
            ran += 1
    assert ran == 5


def test_the_code_of_the_page_on_live_runs(here, monkeypatch):
    monkeypatch.setattr("inphase.runtime.SystemClock", FakeClock)
    monkeypatch.setattr("inphase.runtime.live.SystemClock", FakeClock)
    printed = run_python(LIVE, {"__name__": "page"}, LIVE.read_text(encoding="utf-8"))
    assert "2 s have passed after 2." in printed
    assert "inphase-demo/runs/live-" in printed.splitlines()[-1]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_the_page_on_devices_runs(here, monkeypatch):
    text = DEVICES.read_text(encoding="utf-8")
    ports = {"9870": str(free_port()), "9871": str(free_port())}
    text = re.sub("|".join(ports), lambda port: ports[port[0]], text)
    configuration = next(block for language, _, block in blocks(text) if language == "toml")
    Path("udp.toml").write_text(configuration.replace("[robot]", "[robot]\nport = " + ports["9871"]))
    names: dict[str, Any] = {"__name__": "page"}
    printed = run_python(DEVICES, names, text)
    (counts,) = re.findall(r"^tracker: (\d+) came in order", printed, re.MULTILINE)
    assert int(counts) > 20
    assert "2 s have passed" in printed

    sensor, robot = names["UdpSensor"](["x"], "a", port=free_port()), names["UdpRobot"](["y"], "b", port=free_port())
    assert (isinstance(sensor, Sensor), isinstance(robot, Robot)) == (True, True)
    clock = FakeClock(5.0)
    assert (sensor.read(), robot.state()) == ([], None)
    for _ in range(2):  # each can be started again
        sensor.start(clock)
        to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        for said in (b"1.5 2.5", b"nonsense", b"", b"1 2 3", b"1.75 nan"):
            to.sendto(said, ("127.0.0.1", sensor.port))
        to.close()
        got = []
        while len(got) < 2:
            got += sensor.read()
        assert [(sample.stamp, sample.received) for sample in got] == [(1.5, 5.0), (1.75, 5.0)]
        np.testing.assert_array_equal([sample.values[0] for sample in got], [2.5, np.nan])
        sensor.stop()
    assert sensor.read() == []


def test_devices_on_the_page_are_short():
    for _, _, block in blocks(DEVICES.read_text(encoding="utf-8")):
        for _, code in re.findall(r"^class (\w+):\n((?:    .*\n|\n)+)", block + "\n", re.MULTILINE):
            lines = [line for line in code.splitlines() if line.strip()]
            assert len(lines) <= LONGEST, len(lines)


def test_the_entry_points_on_the_page_are_of_the_group_that_is_looked_at():
    (package,) = [block for language, _, block in blocks(DEVICES.read_text()) if "entry-points" in block]
    offered = tomllib.loads(package)["project"]["entry-points"]
    assert list(offered) == [devices.GROUP]


# -------------------------------------------------------------------------------------------------------- the tables


def documented() -> dict[str, str]:
    """Entry → default as the page says it, both as written."""
    table = [cells for _, cells in rows(LIVE.read_text(encoding="utf-8")) if len(cells) == 3]
    return {leading_code(cells[0])[0]: cells[1].strip("`") for cells in table if leading_code(cells[0])}


def defaults() -> dict[str, object]:
    found: dict[str, object] = {"filter.name": RECOMMENDED, "filter.seed": 0}
    kinds = {"rates": (Rates,), "sensing": (Sight,), "response": (Play,), "smoothing": (AlphaBeta,)}
    for table, made in {**kinds, "safety": (Policy, Conduct)}.items():
        for kind in made:
            for field in fields(kind):
                if not (kind is Conduct and field.name in ("limits", "smoothing", "policy")):
                    found[f"{table}.{field.name}"] = field.default
    return found


def test_every_entry_is_on_the_page_with_its_default():
    said = documented()
    for entry, default in defaults().items():
        wanted = getattr(default, "value", default)
        wanted = list(wanted) if isinstance(wanted, tuple) else wanted
        got = tomllib.loads(f"a = {said[entry]}")["a"] if said[entry] else None
        assert (type(got), got) == (type(wanted), wanted), entry
    tables = {entry.split(".")[0] for entry in said if "." in entry}
    assert tables == {
        *("filter", "rates", "sensing", "sensors", "robot", "response", "smoothing", "safety", "recording"),
        *("outputs", "demonstrations"),
    }
    checked = {entry for entry in said if re.match(r"(rates|sensing|response|smoothing|safety)\.", entry)}
    assert checked <= set(defaults())


def test_every_device_is_on_the_page_with_its_entries():
    table = {leading_code(cells[0])[0]: cells for _, cells in rows(LIVE.read_text()) if leading_code(cells[0])}
    for kind, makers in (("sensor", devices.SENSORS), ("robot", devices.ROBOTS), ("output", devices.OUTPUTS)):
        for name, make in makers.items():
            assert kind in table[name][1].split(", "), name
            entries = re.findall(r"`([a-z_]+)`", table[name][2])
            if "](" not in table[name][2]:  # else another page tells of them
                known = set(inspect.signature(make).parameters) - {"name", "model", "controlled"}
                assert set(entries) == known, name


def test_a_table_or_a_key_that_the_page_does_not_know_is_none(here):
    """The message lists what there is; it and the page name the same tables."""
    Path("a.toml").write_text("nothing = 1\n")
    with pytest.raises(ValueError, match="one of ") as caught:
        read_configuration("a.toml")
    listed = str(caught.value).split("one of ")[1].split(", ")
    assert set(listed) == {entry.split(".")[0] for entry in documented() if entry not in all_devices()}


def all_devices() -> set[str]:
    return {*devices.SENSORS, *devices.ROBOTS, *devices.OUTPUTS}


def test_the_states_of_the_picture_are_those_there_are():
    (picture,) = [block for _, _, block in blocks(LIVE.read_text(encoding="utf-8")) if "HOLDING" in block]
    assert set(re.findall(r"[A-Z]{5,}", picture)) == {state.name for state in State}
