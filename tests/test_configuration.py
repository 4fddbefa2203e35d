"""The file of an interaction: what it says is what is run, and every mistake in it is named with its line."""

# ruff: noqa: E501 - of a table of mistakes, a row is a line

from __future__ import annotations

import contextlib
import enum
import functools
import importlib
import re
import string
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from interactions import chance_model, phase_model, shapes_unchecked
from jaxtyping import Float

import inphase
from inphase.errors import DataError, OptionError
from inphase.io.csv import write_csv
from inphase.runtime import Clock, Command, FakeClock, Sample, Signal
from inphase.runtime.configuration import Configuration, no_limits, read_configuration, toml_lines
from inphase.runtime.configuration.section import Section
from inphase.runtime.configuration.toml_lines import line_of
from inphase.runtime.devices import ReplaySensor, SimulatedPartner, SimulatedRobot
from inphase.runtime.loop import Rates
from inphase.runtime.safety import Answer

if TYPE_CHECKING:
    from nowhere import Thing

MODEL = chance_model(np.random.default_rng(3), phase_model())
UNITS = {"reach": "m", "lift": "m", "grip": "rad", "turn": "rad"}
MODEL = replace(MODEL, channels=tuple(replace(channel, unit=UNITS[channel.name]) for channel in MODEL.channels))

GOOD = """\
model = "walk.inphase"

[filter]
name = "rbpf"
seed = 3
particles = 20

[rates]  # per second
sense = 60
respond = 20.0
command = 50

[sensing]
staleness = 0.3
delay = 0.01
needed = ["reach"]

[sensors.hand]
device = "simulated_partner"
clock = "shared"
tempo = 1.2
pauses = [[0.5, 0.25]]

[robot]
device = "simulated_robot"
home = { "*" = 0.5, "turn" = 0.1 }
time_constant = 0.02

[robot.limits."*"]
low = -2
high = 2
velocity = 1.5

[robot.limits.turn]
acceleration = 30

[response]
samples = 20
control_lag = 0.05

[smoothing]
alpha = 0.7

[safety]
stale_sensors = "retreat"
retreat = { grip = 0.5, turn = 0.25 }
silence = 0.3
watchdog = 0.4

[recording]
folder = "runs"

[outputs]

[demonstrations]
anything = "goes"
"""


@pytest.fixture(autouse=True)
def unchecked() -> Iterator[None]:
    """As users run it: wrong types get as far as the library's own checks."""
    with shapes_unchecked():
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("interaction")
    MODEL.save(folder / "walk.inphase")
    times = np.arange(20) / 10
    write_csv(folder / "hand.csv", ("reach", "lift", "mood"), times, np.ones((20, 3)))
    (folder / "other.txt").write_text("no model at all")
    return folder


Read = Callable[..., Configuration]


@pytest.fixture
def read(folder: Path) -> Read:
    def read(text: str, makers: Mapping[str, Callable[..., Any]] | None = None) -> Configuration:
        path = folder / "live.toml"
        path.write_text(text, encoding="utf-8")
        return read_configuration(path, makers)

    return read


def build(read: Read, text: str, makers: Mapping[str, Callable[..., Any]] | None = None) -> Any:
    """All that a file is checked for before a device is started."""
    return read(text, makers).loop(FakeClock())


# --------------------------------------------------------------------------------------------------- what a file says


def test_what_it_says_is_what_is_run(read):
    configuration = read(GOOD)
    loop = configuration.loop(FakeClock())
    assert loop.rates == Rates(sense=60.0, respond=20.0, command=50.0)
    assert (loop.player.play.samples, loop.player.play.control_lag) == (20, 0.05)
    conduct = loop.actuation.conduct
    assert conduct.limits.low.tolist() == [-2, -2]
    assert conduct.limits.velocity.tolist() == [1.5, 1.5]
    assert conduct.limits.acceleration.tolist() == [np.inf, 30]
    assert conduct.smoothing.alpha == 0.7
    assert (conduct.silence, conduct.watchdog) == (0.3, 0.4)
    assert conduct.policy.stale_sensors is Answer.RETREAT
    assert conduct.policy.interrupt is Answer.STOP
    assert conduct.retreat is not None
    assert conduct.retreat.tolist() == [0.5, 0.25]
    (hand,) = loop.perception.sensors
    assert isinstance(hand, SimulatedPartner)
    assert (hand.name, hand.tempo) == ("hand", 1.2)
    assert isinstance(loop.actuation.robot, SimulatedRobot)
    assert configuration.shared_clocks() == ["hand"]
    told = configuration.provenance()
    assert (told["filter"], told["seed"], told["options"]) == ("rbpf", "3", '{"particles": 20}')
    assert told["configuration"] == GOOD
    assert no_limits(conduct.limits, ("grip", "turn")) == ()


def test_the_loop_it_describes_runs(read):
    loop = build(read, GOOD)
    with shapes_unchecked():
        report = loop.run(1.0, watch=False)
    assert report.commands == pytest.approx(50, abs=15)  # it comes to rest after that second
    assert not report.stopped


def test_little_is_enough(read):
    short = 'model = "walk.inphase"\n[sensors.hand]\ndevice = "simulated_partner"\n'
    short += '[robot]\ndevice = "simulated_robot"\nhome = {grip = 0, turn = 0}\n'
    loop = build(read, short)
    assert loop.rates == Rates()
    assert no_limits(loop.actuation.conduct.limits, ("grip", "turn")) == ("grip", "turn")


def test_paths_are_relative_to_the_file(read, folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    configuration = read(GOOD.replace(SIMULATED, REPLAYED))
    (hand,) = configuration.sensors()
    assert isinstance(hand, ReplaySensor)
    assert [(signal.name, signal.unit) for signal in hand.signals] == [("reach", "m"), ("lift", "m")]
    absolute = GOOD.replace('"walk.inphase"', repr(str(folder / "walk.inphase")))
    assert read(absolute).model is not None
    monkeypatch.setenv("HOME", str(folder))
    assert read(GOOD.replace('"walk', '"~/walk')).model is not None


def test_a_byte_order_mark_and_lines_of_windows_change_nothing(folder):
    path = folder / "windows.toml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("seed = 3", "seed = 'x'").replace("\n", "\r\n").encode())
    with pytest.raises(OptionError, match=r"^windows\.toml, line 5: filter\.seed: expected a whole number, got 'x'$"):
        read_configuration(path)


# ----------------------------------------------------------------------------------------------------------- mistakes

SIMULATED = """\
device = "simulated_partner"
clock = "shared"
tempo = 1.2
pauses = [[0.5, 0.25]]
"""
REPLAYED = """\
device = "replay"
clock = "shared"
file = "hand.csv"
only = ["reach", "lift"]
units = { "*" = "m" }
"""

# What is written instead of what, in which line of the file, at which entry, and what is said.
MISTAKES = {
    # tables and keys
    "a table that is none": ("[smoothing]", "[smothing]", "smothing", "is not known here; one of model, filter, rates"),
    "a key at the top": ("[filter]", "speed = 3\n[filter]", "speed", "is not known here; one of model, filter"),
    "a key in a table": ("alpha = 0.7", "gamma = 1", "smoothing.gamma", "is not known here; one of alpha, beta"),
    "a key of limits": ("velocity = 1.5", "jerk = 3", "robot.limits.*.jerk", "one of low, high, velocity, accel"),
    "a key of the safety": ("silence", "silent", "safety.silent", "is not known here; one of .*good_cycles"),
    "a key of the sensing": ("delay", "dealy", "sensing.dealy", "is not known here; one of staleness, delay, needed"),
    "no table": ("[outputs]", "", "smoothing", None),
    "a number for a table": ("[filter]\n", "[[filter]]\n", "filter", r"expected a table, got \["),
    "a number for limits": ("acceleration = 30", "[robot.limits]\ngrip = 3", "robot.limits.grip", "expected a table, got 3"),
    # types
    "a text for a number": ("sense = 60", 'sense = "60"', "rates.sense", "expected a number, got '60'"),
    "a truth for a number": ("sense = 60", "sense = true", "rates.sense", "expected a number, got True"),
    "half a sample": ("samples = 20", "samples = 20.5", "response.samples", "expected a whole number, got 20.5"),
    "a number for a text": ('name = "rbpf"', "name = 1", "filter.name", "expected a text, got 1"),
    "a number of 400 digits": ("sense = 60", "sense = 1" + "0" * 400, "rates.sense", r"expected a number that .*…$"),
    "a text for a list": ('["reach"]', '"reach"', "sensing.needed", "expected a list: a text each, got 'reach'"),
    "a list of three for two": ("0.25]]", "0.25, 1]]", "sensors.hand.pauses", "expected a list of 2: a number, a number, got"),
    "a list for a number or a table": ("staleness = 0.3", "staleness = [1]", "sensing.staleness", "a number or a table of"),
    "a number in a table": ("0.1 }", "'far' }", "robot.home.turn", "expected a number, got 'far'"),
    "a text for a limit": ("low = -2", 'low = "-2"', "robot.limits.*.low", "expected a number, got '-2'"),
    "a retreat that is a number": ("{ grip = 0.5, turn = 0.25 }", "1", "safety.retreat", "a table of a number by name, got 1"),
    # values
    "no rate": ("sense = 60", "sense = 0", "rates.sense", "expected sense > 0"),
    "a rate without end": ("sense = 60", "sense = inf", "rates.sense", "expected sense > 0"),
    "a rate that is no number": ("sense = 60", "sense = nan", "rates.sense", "expected sense > 0"),
    "few samples": ("samples = 20", "samples = 1", "response.samples", "expected 2 to 10000 samples, got 1"),
    "both lookaheads": ("samples = 20", "lookahead = 0.1", "response.lookahead", "give either lookahead .* or control_lag"),
    "a share above one": ("alpha = 0.7", "alpha = 1.7", "smoothing.alpha", "expected 0 < alpha <= 1, got 1.7"),
    "no such answer": ('"retreat"', '"run"', "safety.stale_sensors", "expected one of hold, retreat, stop, got 'run'"),
    "a lost robot that retreats": ("silence = 0.3", 'lost_robot = "retreat"', "safety.lost_robot", "one of hold, stop"),
    "no silence": ("silence = 0.3", "silence = 0", "safety.silence", "expected silence > 0, got 0"),
    "no patience": ("watchdog = 0.4", "watchdog = -1", "safety.watchdog", "expected watchdog > 0, got -1"),
    "endless patience": ("watchdog = 0.4", "watchdog = 1e300", "safety.watchdog", "expected a finite patience"),
    "a delay back in time": ("delay = 0.01", "delay = -0.01", "sensing.delay", "expected a delay >= 0"),
    "no tempo": ("tempo = 1.2", "tempo = 0", "sensors.hand.tempo", "expected a finite tempo > 0, got 0"),
    "a clock of its own kind": ('"shared"', '"atomic"', "sensors.hand.clock", "expected one of own, shared, got 'atomic'"),
    "a negative seed": ("seed = 3", "seed = -3", "filter.seed", "expected a seed >= 0, got -3"),
    # names
    "no such filter": ('"rbpf"', '"kalman"', "filter.name", "there is no filter 'kalman'; one of bip, ebip, particle"),
    "no such option": ("particles", "members", "filter.members", "filter 'rbpf' has no option members; it has .*particles"),
    "no such sensor": ('"simulated_partner"', '"camera"', "sensors.hand.device", "no device 'camera'; one of replay, "),
    "a robot for a sensor": ('"simulated_partner"', '"simulated_robot"', "sensors.hand.device", "one of replay, simulated_p"),
    "no such robot": ('"simulated_robot"', '"ur5"', "robot.device", "there is no device 'ur5'; one of simulated_robot"),
    "an entry of no sensor": ("tempo = 1.2", "pace = 1.2", "sensors.hand.pace", "is not known here; one of seed, rate, tempo"),
    "a name of one's own": ("tempo = 1.2", 'name = "x"', "sensors.hand.name", "is not known here"),
    "a robot with a clock": ("time_constant = 0.02", 'clock = "own"', "robot.clock", "is not known here; one of home"),
    # patterns
    "a home of nothing": ('"turn" = 0.1', '"tern" = 0.1', "robot.home.tern", "no channel fits 'tern'; .* grip, turn"),
    "a limit of nothing": ("limits.turn]", 'limits."t[o]*"]', "robot.limits.t[o]*", r"no channel fits 't\[o\]\*'; .*grip, turn"),
    "an empty limit of nothing": ("acceleration = 30", "[robot.limits.x]", "robot.limits.x", "no channel fits 'x'"),
    "a staleness of nothing": ("= 0.3\nd", "= { gone = 1 }\nd", "sensing.staleness", "no channel fits 'gone'; .* reach, lift"),
    "a staleness of none": ("staleness = 0.3", "staleness = -1", "sensing.staleness", "staleness"),
    "nothing needed": ('["reach"]', '["rich"]', "sensing.needed", "no channel fits 'rich'; the channels are reach, lift"),
    "a retreat of nothing": ("{ grip", "{ nose = 1, grip", "safety.retreat", "no channel fits 'nose'; .* grip, turn"),
    # limits and retreat
    "low above high": ("low = -2", "low = 3", "robot.limits.*", "expected low <= high of grip, got 3 and 2"),
    "low above high by the last": ("acceleration = 30", "high = -5", "robot.limits.turn", "low <= high of turn, got -2 and -5"),
    "a limit that is no number": ("acceleration = 30", "acceleration = nan", "robot.limits.turn", "acceleration > 0 of turn, got nan"),
    "no velocity": ("velocity = 1.5", "velocity = 0", "robot.limits.*", "expected velocity > 0 of grip, got 0"),
    "a retreat without a pose": ("retreat = {", "# retreat = {", "safety.stale_sensors", "expected a pose to retreat to"),
    "a retreat without a velocity": ("velocity = 1.5", "", "safety.stale_sensors", "a finite velocity limit of every"),
    "a retreat of half a robot": (", turn = 0.25", "", "safety.retreat", "a position of every signal, got none of turn"),
    "a retreat out of reach": ("turn = 0.25", "turn = 9", "safety.retreat", "a retreat within the limits of position"),
    # what is missing
    "no model": ('model = "walk.inphase"', "", "", "expected model = a model file|needs a model"),
    "no such model": ("walk.in", "talk.in", "model", "talk.inphase: .*No such file|cannot be read"),
    "a file that is no model": ("walk.inphase", "other.txt", "model", "other.txt"),
    "a folder for a model": ('"walk.inphase"', '"."', "model", "directory"),
    "a path of nothing": ('"walk.inphase"', '""', "model", "expected a path, got ''"),
    "a path that no system has": ('"walk.inphase"', '"a\\u0000b"', "model", "expected a path, got"),
    "a home of nobody": ('"walk', '"~nobody-at-all/walk', "model", "expected a path in a home that is there"),
    "no device of a sensor": ('device = "simulated_partner"\n', "", "sensors.hand", "expected device = a text, got none"),
    "no device of the robot": ('device = "simulated_robot"\n', "", "robot", r"expected a table \[robot\] with a device"),
    "no home": ('home = { "*" = 0.5, "turn" = 0.1 }', "", "robot", "expected home = a table of a number by name, got none"),
    "half a home": ('"*" = 0.5, ', "", "robot.home", "expected a home of every channel, got none of grip"),
    "a home out of reach": ("time_constant", "high = { grip = 0.1 }\ntime_constant", "robot.home", "low <= home <= high"),
    "no sensors": ("[sensors.hand]\n" + SIMULATED, "", "sensors", r"a table \[sensors.NAME\] for each sensor, got none"),
    # devices that do not fit the model
    "a file that is not there": (SIMULATED, REPLAYED.replace("hand.csv", "foot.csv"), "sensors.hand.file", "foot.csv: cannot be read: No such file"),
    "no file": (SIMULATED, REPLAYED.replace('file = "hand.csv"', ""), "sensors.hand", "expected file = a path, got none"),
    "too few channels": (SIMULATED, REPLAYED.replace(', "lift"', ""), "sensors", "no device offers lift; offered are reach"),
    "no channels at all": (SIMULATED, REPLAYED.replace('"reach", "lift"', '"mood"'), "sensors", "no device offers reach, lift; "),
    "other units": (SIMULATED, REPLAYED.replace('"m"', '"mm"'), "sensors.hand", "'reach' is in 'm' in the model and in 'mm' from hand; 'lift' is"),
    "no units": (SIMULATED, REPLAYED.replace('units = { "*" = "m" }', ""), "sensors.hand", "'reach' is in 'm' in the model and in '' from hand"),
    "units of nothing": (SIMULATED, REPLAYED.replace('"*" =', "foot ="), "sensors.hand.units.foot", "no channel fits 'foot'"),
    "channels that are not there": (SIMULATED, REPLAYED.replace('"lift"]', '"foot"]'), "sensors.hand.only", "no channel fits 'foot'"),
    "two of one channel": ("[robot]", f"[sensors.other]\n{SIMULATED}[robot]", "sensors.hand", "'reach' is offered twice, by hand, other"),
}  # fmt: skip


def place(text: str, path: str) -> int:
    """The line of an entry by a plain reading of these files: the header of its table, and from there its key."""
    lines, parts = text.splitlines(), path.split(".")
    for cut in range(len(parts), -1, -1):
        header = ".".join(part if part.isalnum() else f'"{part}"' for part in parts[:cut])
        begins = [i for i, line in enumerate(lines) if line.lstrip("[").startswith(f"{header}]") and line[0] == "["]
        begins += [i for i, line in enumerate(lines) if line.startswith(f"[{header}.")]
        for begin in begins[:1] if cut else [-1]:
            for i, line in enumerate(lines[begin + 1 :], start=begin + 1):
                if line.startswith("[") or cut == len(parts):
                    break
                if line.split("=")[0].strip() == parts[cut]:
                    return i + 1
            if cut:
                return begin + 1
    return 1


@pytest.mark.parametrize("what", MISTAKES)
def test_a_mistake_is_told_with_its_line_and_what_is_allowed(what, read):
    old, new, path, said = MISTAKES[what]
    text = GOOD.replace(old, new, 1)
    assert text != GOOD
    if said is None:
        build(read, text)
        return
    with pytest.raises(OptionError) as caught:
        build(read, text)
    message = str(caught.value)
    assert "\n" not in message
    where = f"live.toml, line {place(text, path)}: " + (f"{path}: " if path else "")
    assert message.startswith(where), (message, where)
    assert re.search(said, message.removeprefix(where)), message


def test_what_is_no_toml_is_named_with_its_line(folder):
    path = folder / "live.toml"
    for text, said in (("a = 1\nb = \n", "line 2: expected TOML"), ("\n\n[robot\n", "line 3: expected TOML")):
        path.write_text(text)
        with pytest.raises(DataError, match=rf"^{re.escape(str(path))}, {said}"):
            read_configuration(path)
    with pytest.raises(DataError, match=r"none\.toml: cannot be read"):
        read_configuration(folder / "none.toml")


def test_a_long_value_is_not_said_whole(read):
    with pytest.raises(OptionError) as caught:
        read(GOOD.replace("alpha = 0.7", f"alpha = {list(range(1000))}"))
    assert len(str(caught.value)) < 200


# ------------------------------------------------------------------------------------------------ random corruptions


PIECES = st.sampled_from(
    [*"=[]{}\"'\n.,#\0\r\x85é0", *["-1", "nan", "-inf", "1e308", "1e400", "true", "[]", "{}", "[[1]]", "'*'", "1979-05-27", "hold", "own", "grip"], "9" * 25, "a = 3\n"]
)  # fmt: skip


@given(
    changes=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 12), st.one_of(PIECES, st.text(max_size=3))), min_size=1, max_size=3
    )
)
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_written_is_read_or_refused(changes, folder):
    text = GOOD
    for where, length, piece in changes:
        at = round(where * len(text))
        text = text[:at] + piece + text[at + length :]
    path = folder / "corrupt.toml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with contextlib.suppress(OptionError, DataError):
        read_configuration(path).loop(FakeClock())


VALUES = ["-1", "nan", "9" * 25, "true", '"x"', "[]", "[[1, -2]]", "{ x = 1 }", '{ "*" = {} }']
ENTRIES = [i for i, line in enumerate(GOOD.splitlines()) if "=" in line]


def refusal(read: Read, text: str) -> str | None:
    try:
        build(read, text)
    except OptionError as error:
        return str(error)
    return None


@pytest.mark.parametrize("value", VALUES)
def test_whatever_an_entry_is_it_is_taken_or_refused_where_it_stands(value, read):
    lines = GOOD.splitlines()
    for i in ENTRIES:
        key = lines[i].split("=")[0].strip()
        text = "\n".join([*lines[:i], f"{key} = {value}", *lines[i + 1 :]])
        said = refusal(read, text)
        if said is not None:
            table = next(j for j in range(i, -1, -1) if lines[j].startswith("[") or j == 0)
            line = int(re.match(r"live\.toml, line (\d+): ", said)[1])
            # What does not go together with another entry may be told at that one.
            assert line in (i + 1, table + 1) or key in ("low", "high", "velocity"), (lines[i], value, said)


# ------------------------------------------------------------------------------------------------------ which line


KEYS = st.one_of(
    st.text(string.ascii_letters + string.digits + "-_", min_size=1, max_size=3),
    st.text(st.sampled_from("ab.='[]# \"\\\té"), max_size=4),
)


def written(draw: st.DrawFn, key: str) -> str:
    """A key as TOML may have it."""
    forms = ['"' + key.replace("\\", "\\\\").replace('"', '\\"').replace("\t", "\\t") + '"']
    forms += [f"'{key}'"] if "'" not in key else []
    forms += [key] if re.fullmatch(r"[A-Za-z0-9_-]+", key) else []
    forms += ['"' + "".join(f"\\u{ord(letter):04x}" for letter in key) + '"']
    return draw(st.sampled_from(forms))


CONFUSING = [
    *("[\n[1],\n[ 'a' ],\n]", "[\n{ a = 1 },\n[\n[1]\n]]"),
    *("1", '"[a]"', "'b = 1'", '"#"', '"""\n[a]\nb = 1\n"""', "'''\n[a]\n#'''", "{ a = 1, b = { 'c' = \"}\" } }"),
    *(
        "[ # ]\n1, [2], # b = 2\n]",
        '"""a\\"""" # "',
        '"""x"""""',
        "''''''",
        '""',
        "''",
        '"\\\\"',
        "[\n'''\n]''', ]",
        "0x1F",
    ),
]


@st.composite
def documents(draw: st.DrawFn) -> tuple[str, list[tuple[int, tuple[str, ...]]]]:
    """A TOML text, and every header and entry in it as (line, path)."""
    text, told, taken = "", list[tuple[int, tuple[str, ...]]](), set[tuple[str, ...]]()

    def fresh(path: tuple[str, ...]) -> bool:
        """Whether that path may be defined: nothing of it or within it is."""
        free = all(path[: len(other)] != other and other[: len(path)] != path for other in taken)
        taken.add(path) if free else None
        return free

    def dotted(keys: Sequence[str]) -> str:
        return draw(st.sampled_from([".", " . ", "\t."])).join(written(draw, key) for key in keys)

    for table in [(), *draw(st.lists(st.lists(KEYS, min_size=1, max_size=3).map(tuple), max_size=4))]:
        entries = draw(st.lists(st.lists(KEYS, min_size=1, max_size=2).map(tuple), max_size=3))
        if table:
            if not fresh((*table, "\0")):  # no other header may be of it
                continue
            taken.discard((*table, "\0"))
            taken.add(table)
            array = draw(st.booleans())
            line = ("[[{}]]" if array else "[{}]").format(draw(st.sampled_from(["", " "])) + dotted(table))
            told.append((text.count("\n") + 1, table))
            text += draw(st.sampled_from(["", "  "])) + line + draw(st.sampled_from(["", " # [x]"])) + "\n"
        inside = set[tuple[str, ...]]()
        for entry in entries:
            if any(entry[: len(o)] == o or o[: len(entry)] == entry for o in inside):
                continue
            if not table and any((*table, *entry)[:1] == o[:1] for o in taken):
                continue
            inside.add(entry)
            text += draw(st.sampled_from(["", "\n", "# a = 1\n", "\t"]))
            told.append((text.count("\n") + 1, (*table, *entry)))
            text += f"{dotted(entry)} = {draw(st.sampled_from(CONFUSING))}"
            text += draw(st.sampled_from(["\n", " # b = 2\n", " \t\n"]))
        if not table:
            taken |= {entry[:1] for entry in inside}
    return text, told


def plainly(told: Sequence[tuple[int, tuple[str, ...]]], path: Sequence[str]) -> int:
    """The line of that path: its own, else the first of what is in it, else that of what it is in."""
    for length in range(len(path), 0, -1):
        beginning = tuple(path[:length])
        own = [line for line, found in told if found == beginning]
        deeper = [line for line, found in told if found[:length] == beginning]
        if own or deeper:
            return (own or deeper)[0]
    return 1


@given(documents(), st.data())
@settings(max_examples=100)
def test_the_line_is_that_on_which_a_key_was_written(document, data):
    text, told = document
    try:
        toml_lines.tomllib.loads(text)
    except ValueError:  # a table that is defined twice in some way
        hypothesis.reject()
    paths = [path for _, path in told] + [("a",), ("nowhere",), ()]
    paths += [path[:-1] for path in paths] + [(*path, "a") for path in paths]
    for ending in ("\n", "\r\n"):
        for path in data.draw(st.permutations(paths)):
            assert line_of(text.replace("\n", ending), path) == plainly(told, path), path


def test_the_own_line_of_a_table_goes_before_that_of_what_is_in_it():
    text = "[a.b]\nx = 1\n[a]\ny = 1\n[c]\nd.e = 1\n"
    for path, line in {
        ("a",): 3,
        ("a", "z"): 3,
        ("a", "b"): 1,
        ("a", "b", "x"): 2,
        ("c", "d"): 6,
        ("c", "d", "f"): 6,
    }.items():
        assert line_of(text, path) == line, path


def test_a_line_is_found_in_whatever_is_no_toml():
    for text in ("", "\n", "[", "= 1", "a = '''", 'a = """', "a = [", "[a\nb = 1", "\0", "a =", "a.=1\nb = 1"):
        assert 1 <= line_of(text, ("b",)) <= text.count("\n") + 1
    assert line_of("a = 1 \u2028\x0c\n# \x85\nb = 1", ("b",)) == 3  # only a new line begins one


# ------------------------------------------------------------------------------------------------ devices of others


class Glove:
    """A sensor of one's own, that notes what it was made with."""

    signals = (Signal("reach", "m"), Signal("lift", "m"))

    def __init__(self, name: str, port: str = "/dev/null", **options: Any) -> None:
        self.name, self.port, self.options = name, port, options

    def start(self, clock: Clock) -> None: ...

    def read(self) -> list[Sample]:
        return []

    def stop(self) -> None: ...


class Arm(SimulatedRobot):
    def __init__(self, name: str, model: inphase.Model, weights: Float[np.ndarray, " D"]) -> None:
        super().__init__([Signal(n, UNITS[n]) for n in model.controlled], weights, name=name)


class Colour(enum.Enum):
    RED = "red"
    BLUE = "blue"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A package that offers devices, as pip would leave it."""
    information = tmp_path / "gloves-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: gloves\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(
        "[inphase.devices]\nglove = gloves:make\nbroken = gloves:nothing\nabsent = no_gloves:make\nnumber = gloves:NUMBER\n"
        "wall = gloves:wall\nunplugged = gloves:unplugged\nsimulated_partner = gloves:unplugged\n"
    )
    (tmp_path / "gloves.py").write_text(
        "from test_configuration import Glove\n\nNUMBER = 3\n\n\n"
        "def make(name: str, port: str, rate: float = 60.0):\n    return Glove(name, port, rate=rate)\n\n\n"
        "def wall():\n    return object()\n\n\n"
        "def unplugged():\n    raise FileNotFoundError(2, 'No such file or directory', '/dev/ttyUSB7')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield
    sys.modules.pop("gloves", None)


def glove(rest: str, device: str = "glove") -> str:
    return GOOD.replace(SIMULATED, f'device = "{device}"\n{rest}\n')


def test_a_device_of_a_script_is_made_by_its_name(read):
    (made,) = read(glove('port = "usb"\ngain = { a = [1, "b"] }'), {"glove": Glove}).sensors()
    assert (made.name, made.port, made.options) == ("hand", "usb", {"gain": {"a": [1, "b"]}})
    text = GOOD.replace('device = "simulated_robot"', 'device = "arm"\nweights = [1, 2.5]')
    text = re.sub(r"home = .*\ntime_constant = .*\n", "", text)
    robot = read(text, {"arm": Arm}).robot()
    robot.start(FakeClock())
    assert robot.state().values.tolist() == [1.0, 2.5]
    with pytest.raises(OptionError, match=r"line \d+: robot\.weights: expected a list of numbers, got 'many'"):
        read(text.replace("[1, 2.5]", "'many'"), {"arm": Arm}).robot()
    with pytest.raises(OptionError, match=r"robot\.device: arm needs a model: expected model = a file"):
        read(text.replace('model = "walk.inphase"', ""), {"arm": Arm}).robot()


def test_a_device_of_a_package_is_made_by_its_name(read, installed):
    (made,) = read(glove('port = "usb"\nrate = 30')).sensors()
    assert (made.port, made.options) == ("usb", {"rate": 30.0})
    build(read, glove('port = "usb"'))


@pytest.mark.parametrize(
    ("rest", "device", "said"),
    [
        ("port = 3", "glove", r"line 20: sensors\.hand\.port: expected a text, got 3$"),
        ("", "glove", r"line 18: sensors\.hand: expected port = a text, got none$"),
        ("", "mitten", r"line 19: sensors\.hand\.device: .*'mitten'; one of replay, .*glove, .*unplugged$"),
        ("", "broken", r"line 19: sensors\.hand\.device: broken, of gloves:nothing, cannot be loaded: .*'nothing'"),
        ("", "absent", r"line 19: sensors\.hand\.device: absent, of no_gloves:make, cannot be loaded: No module named"),
        ("", "number", r"line 19: sensors\.hand\.device: .* a class or function in gloves:NUMBER, got 3$"),
        (
            "",
            "wall",
            r"line 19: sensors\.hand\.device: expected a sensor, got <object .*, which has no name, signals, s",
        ),
        ("", "unplugged", r"line 19: .*device: unplugged cannot be made: .*No such file or directory: '/dev/ttyUSB7'"),
    ],
)
def test_a_mistake_about_a_device_of_a_package_is_told(rest, device, said, read, installed):
    with pytest.raises(OptionError, match=said):
        read(glove(rest, device)).sensors()


def test_what_a_package_calls_as_ours_is_ours(read, installed):
    assert isinstance(read(GOOD).sensors()[0], SimulatedPartner)


def test_a_robot_in_the_place_of_a_sensor_is_told(read):
    with pytest.raises(OptionError, match=r"expected a sensor, got <.*>, which has no read$"):
        read(glove("", "arm"), {"arm": lambda: SimulatedRobot([], [])}).sensors()
    with pytest.raises(OptionError, match=r"robot\.device: expected a robot, got <.*>, which has no state, command$"):
        read(re.sub("simulated_robot", "glove", GOOD).replace("home =", "house ="), {"glove": Glove}).robot()


# ------------------------------------------------------------------------------------------------------------- types

A, PLACE = "a = ", Path("/place")


def plain(a): ...
def any_(a: Any): ...
def number(a: float): ...
def whole(a: int | None = None): ...
def path(a: Path): ...
def path_or_text(a: str | Path | None): ...
def like(a: str | PathLike[str]): ...
def texts(a: list[str]): ...
def some(a: Sequence[int]): ...
def set_(a: frozenset[str]): ...
def bare(a: tuple): ...
def pair(a: tuple[float, str]): ...
def pairs(a: tuple[tuple[float, float], ...]): ...
def table(a: dict[str, list[float]]): ...
def loose(a: dict): ...
def paths(a: Mapping[str, Path]): ...
def colour(a: Colour): ...
def mode(a: Literal["fast", "slow", 3]): ...
def noted(a: Annotated[float, "in metres"]): ...
def array(a: np.ndarray): ...
def matrix(a: Float[np.ndarray, "R C"] | None): ...
def unknown(a: Thing): ...
def command(a: Command): ...
def beside(a: float, b: Thing | None = None): ...
def either(a: float | Mapping[str, float]): ...


ACCEPTED = [
    (plain, "'x'", "x"), (plain, "{ b = [1] }", {"b": [1]}), (any_, "[1]", [1]), (number, "3", 3.0), (whole, "3", 3),
    (path, "'b/c'", PLACE / "b/c"), (path, "'/b'", Path("/b")), (path_or_text, "'b'", PLACE / "b"), (like, "'b'", PLACE / "b"),
    (texts, "['x', 'y']", ["x", "y"]), (some, "[1, 2]", (1, 2)), (set_, "['x', 'x']", frozenset("x")), (bare, "[1, 'b']", (1, "b")),
    (pair, "[1, 'b']", (1.0, "b")), (pairs, "[[1, 2], [3, 4]]", ((1.0, 2.0), (3.0, 4.0))), (table, "{ b = [1] }", {"b": [1.0]}),
    (loose, "{ b = 'c' }", {"b": "c"}), (paths, "{ b = 'c' }", {"b": PLACE / "c"}), (colour, "'red'", Colour.RED),
    (mode, "'fast'", "fast"), (mode, "3", 3), (noted, "3", 3.0), (array, "[1, 2]", [1.0, 2.0]), (matrix, "[[1], [2]]", [[1.0], [2.0]]),
    (unknown, "'x'", "x"), (command, "3", 3), (beside, "3", 3.0), (either, "3", 3.0), (either, "{ b = 3 }", {"b": 3.0}),
]  # fmt: skip
REFUSED = [
    (number, "'3'", "a number"), (number, "true", "a number"), (whole, "3.0", "a whole number"), (path, "3", "a path"),
    (path_or_text, "3", "a path or a text"), (texts, "'x'", "a list: a text each"), (texts, "[1]", "a text"), (some, "[1.5]", "a whole"),
    (bare, "3", "a list"), (pair, "[1]", "a list of 2: a number, a text"), (table, "3", "a table of a list: a number each by name"),
    (loose, "[]", "a table"), (colour, "'green'", "one of red, blue"), (colour, "['red']", "one of red, blue"),
    (mode, "'medium'", "one of fast, slow, 3"), (mode, "true", "one of fast, slow, 3"), (noted, "'x'", "a number"),
    (array, "'1'", "a list of numbers"), (array, "[[1], 2]", "a list of numbers"), (array, "['1']", "a list of numbers"),
    (beside, "'x'", "a number"), (either, "[]", "a number or a table of a number by name"),
]  # fmt: skip


def section(text: str) -> Section:
    return Section("a.toml", text, PLACE, toml_lines.tomllib.loads(text))


@pytest.mark.parametrize(("make", "text", "expected"), ACCEPTED)
def test_an_entry_comes_as_what_its_parameter_is(make, text, expected):
    def keep(a: Any, **others: Any) -> Any:
        return a

    keep.__annotations__ = make.__annotations__
    got = section(A + text).call(keep)
    assert type(got) is (np.ndarray if make in (array, matrix) else type(expected))
    assert (got.tolist() if isinstance(got, np.ndarray) else got) == expected


@pytest.mark.parametrize(("make", "text", "expected"), REFUSED)
def test_an_entry_of_another_type_is_refused_in_words(make, text, expected):
    with pytest.raises(OptionError, match=rf"^a\.toml, line 1: a: expected {expected}.*, got "):
        section(A + text).call(make)


def test_a_method_a_class_and_a_part_of_a_function_can_be_called():
    class Called:
        def __call__(self, a: float) -> float:
            return a

        def method(self, a: float) -> float:
            return a

    for make in (
        Called(),
        Called().method,
        functools.partial(lambda b, a: a, 1),
        functools.partial(Called.method, None),
    ):
        assert section("a = 3").call(make) == 3.0
    assert section("x = 1.5\ny = 3").call(complexes) == complex(1.5, 3)


def complexes(*ignored: str, x: float, y: float) -> complex:
    return complex(x, y)


def test_an_error_is_told_at_the_entry_that_it_names_first():
    def refuse(said: str) -> Callable[..., None]:
        def make(**entries: Any) -> None:
            raise OptionError(said)

        return make

    text = "low = 1\nhigh = 2\n[of]\nlow = 3\nfast = [4]\nby = { grip = 1 }\nlist = ['a']"
    for said, line in (
        ("expected high > low", 2), ("expected low < high", 1), ("expected lowest < 1", 1), ("expected nothing, got high", 1),
    ):  # fmt: skip
        with pytest.raises(OptionError, match=f"^a\\.toml, line {line}: "):
            section(text).without("of").call(refuse(said))
    for said, where in (
        ("of: expected fast", "5: of.fast: expected fast"), ("no channel fits 'grip'", "6: of.by.grip: "), ("no 'a'", "7: of.list: "),
        ("rain", "3: of: rain"),
    ):  # fmt: skip
        with pytest.raises(OptionError, match=f"^a\\.toml, line {where}"):
            section(text).section("of").call(refuse(said))
