"""The file of an interaction: what it says is what is run, and every mistake in it is named with its line."""

from __future__ import annotations

import contextlib
import enum
import importlib
import re
import string
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

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
from inphase.runtime.configuration import Configuration, no_limits, read_configuration
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
    assert loop.rates == Rates(60.0, 20.0, 50.0)
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
    "no rate": ("sense = 60", "sense = 0", "rates.sense", "rates: expected|expected sense > 0"),
    "a rate without end": ("sense = 60", "sense = inf", "rates.sense", "expected sense > 0"),
    "a rate that is no number": ("sense = 60", "sense = nan", "rates.sense", "expected sense > 0"),
    "few samples": ("samples = 20", "samples = 1", "response.samples", "expected samples >= 2, got 1"),
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
    "a limit that is no number": ("acceleration = 30", "acceleration = nan", "robot.limits.turn", "an acceleration|acceleration > 0 of turn"),
    "no velocity": ("velocity = 1.5", "velocity = 0", "robot.limits.*", "expected a velocity > 0 of grip, got 0"),
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
