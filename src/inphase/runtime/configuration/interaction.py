"""A configuration file: all that an interaction is made of, in one TOML file, and the loop that it describes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from inphase.errors import listing
from inphase.filters import FILTERS, RECOMMENDED
from inphase.io.toml import read_toml
from inphase.model import Model
from inphase.runtime.clock import Clock
from inphase.runtime.conduct import Conduct
from inphase.runtime.configuration.devices import ROBOTS, SENSORS, Maker, by_name, make_device
from inphase.runtime.configuration.section import Section
from inphase.runtime.device import Robot, Sensor
from inphase.runtime.journal import Journal
from inphase.runtime.limits import Limits
from inphase.runtime.loop import Loop, Rates
from inphase.runtime.perception import Sight
from inphase.runtime.playing import Play
from inphase.runtime.replay import provenance_of
from inphase.runtime.safety import Policy
from inphase.runtime.smoothing import AlphaBeta
from inphase.session import Session

TABLES = ("filter", "rates", "sensing", "sensors", "robot", "response", "smoothing", "safety", "recording", "outputs")
OF_DEMONSTRATIONS = "demonstrations"
LIMITS = ("low", "high", "velocity", "acceleration")
GUARDING = ("retreat", "silence", "late_commands", "watchdog")  # what the safety table says besides the policy


@dataclass(frozen=True, eq=False)
class Configuration:
    """What a configuration file says, checked as far as that goes without starting a device.

    path: of the file. text: its content. root: its entries. model: as named by the file; None where it names none.
    """

    path: Path
    text: str
    root: Section
    model: Model | None
    makers: Mapping[str, Maker] = field(default_factory=dict)

    def section(self, name: str) -> Section:
        """The table of that name, empty where there is none."""
        return self.root.section(name)

    def sensors(self) -> list[Sensor]:
        """New sensors, in the order of the file; raises OptionError where there is none or one cannot be made."""
        tables = self.section("sensors").sections()
        if not tables:
            raise self.root.fail("expected a table [sensors.NAME] for each sensor, got none", "sensors")
        makers = {**SENSORS, **self.makers}
        return [make_device(table, makers, name=name, model=self.model) for name, table in tables.items()]

    def shared_clocks(self) -> list[str]:
        """The sensors that stamp with the clock of the loop."""
        tables = self.section("sensors").sections()
        return [name for name, table in tables.items() if _clock(table) == "shared"]

    def robot(self) -> Robot:
        """A new robot; raises OptionError where there is none or it cannot be made."""
        section, model = self.section("robot"), self.model
        if "device" not in section:
            raise self.root.fail("expected a table [robot] with a device, got none", "robot")
        controlled = None if model is None else model.channels[len(model.observed) :]
        inner = Section(
            section.file,
            section.text,
            section.folder,
            {key: section.get(key, Any) for key in section if key != "limits"},
            section.path,
        )
        robot: Robot = make_device(inner, {**ROBOTS, **self.makers}, name="robot", model=model, controlled=controlled)
        return robot

    def session(self) -> Session:
        """A new session of the model; raises OptionError where the file names none."""
        model, section = self.needed_model(), self.section("filter")
        name, seed, options = self._filter()
        with section.naming():
            return model.session(name, seed, **options)

    def needed_model(self) -> Model:
        """The model; raises OptionError where the file names none."""
        if self.model is None:
            raise self.root.fail("expected model = a model file, as `inphase fit` writes it, got none")
        return self.model

    def loop(self, clock: Clock, journal: Journal | None = None) -> Loop:
        """The loop that the file describes, with new devices, which are not started yet."""
        robot = self.robot()
        rates, play, sight = self.rates(), self.section("response").call(Play), self.section("sensing").call(Sight)
        conduct = self.conduct(robot)
        with self.root.naming():
            return Loop(
                self.session(),
                self.sensors(),
                robot,
                clock,
                conduct,
                rates=rates,
                play=play,
                sight=sight,
                shared_clock=self.shared_clocks(),
                journal=journal,
            )

    def rates(self) -> Rates:
        """How often what is done."""
        return self.section("rates").call(Rates)

    def conduct(self, robot: Robot) -> Conduct:
        """Limits, smoothing and safety of that robot."""
        names, section = [signal.name for signal in robot.signals], self.section("safety")
        policy = section.call(Policy, GUARDING)
        known = {
            "limits": self._limits(names),
            "smoothing": self.section("smoothing").call(AlphaBeta),
            "policy": policy,
        }
        pose = None
        if "retreat" in section:
            with section.naming(["retreat"]):
                pose = by_name(section.get("retreat", Mapping[str, float]), names, np.nan)
            if missing := [name for name, value in zip(names, pose, strict=True) if np.isnan(value)]:
                raise section.fail(f"expected a position of every signal, got none of {listing(missing)}", "retreat")
        return section.call(
            Conduct, [*(key for key in section if key not in GUARDING), "retreat"], retreat=pose, **known
        )

    def provenance(self) -> dict[str, str]:
        """What a recording says of where it comes from."""
        return provenance_of(self.needed_model(), *self._filter(), configuration=self.text)

    def _filter(self) -> tuple[str, int, dict[str, Any]]:
        section = self.section("filter")
        name, seed = section.get("name", str, RECOMMENDED), section.get("seed", int, 0)
        if name not in FILTERS:
            raise section.fail(f"there is no filter {name!r}; one of {listing(FILTERS)}", "name")
        return name, seed, {key: section.get(key, Any) for key in section if key not in ("name", "seed")}

    def _limits(self, names: Sequence[str]) -> Limits:
        section = self.section("robot").section("limits")
        numbers: dict[str, dict[str, float]] = {key: {} for key in LIMITS}
        for pattern, table in section.sections().items():
            table.only(*LIMITS)
            with section.naming([pattern]):
                for key in table:
                    by_name({pattern: 0.0}, names, 0.0)  # a pattern that fits nothing is a mistake
                    numbers[key][pattern] = table.get(key, float)
        unlimited = {"low": -np.inf, "high": np.inf, "velocity": np.inf, "acceleration": np.inf}
        with section.naming():
            return Limits(**{key: by_name(numbers[key], names, unlimited[key]) for key in LIMITS})


def read_configuration(path: str | PathLike[str], makers: Mapping[str, Maker] | None = None) -> Configuration:
    """What a TOML file says of an interaction: docs/live.md tells of every entry.

    makers: devices of one's own, by the name that the file calls them. Raises DataError for a file that cannot be read
    or is no TOML, ModelFileError for a model that is none, OptionError, with the line, for an entry that is not known.
    """
    path = Path(path)
    table = read_toml(path)
    text = path.read_text(encoding="utf-8-sig")
    root = Section(path.name, text, path.parent, table)
    root.only("model", *TABLES, OF_DEMONSTRATIONS)
    for name in TABLES:
        root.section(name)
    for sensor in root.section("sensors").sections().values():
        _clock(sensor)
    file = root.get("model", Path, None)
    if file is None:
        model = None
    else:
        with root.naming(["model"]):
            model = Model.load(file)
    configuration = Configuration(path, text, root, model, dict(makers or {}))
    configuration.rates()
    for name, kind in (("response", Play), ("sensing", Sight), ("smoothing", AlphaBeta)):
        root.section(name).call(kind)
    root.section("safety").call(Policy, GUARDING)
    configuration._filter()
    return configuration


def _clock(sensor: Section) -> str:
    clock: str = sensor.get("clock", str, "own")
    if clock not in ("own", "shared"):
        raise sensor.fail(f"expected one of own, shared, got {clock!r}", "clock")
    return clock


def no_limits(limits: Limits, names: Sequence[str]) -> tuple[str, ...]:
    """The signals that may move as fast as they like."""
    return tuple(name for name, velocity in zip(names, limits.velocity, strict=True) if velocity == np.inf)
