"""A configuration file: all that an interaction is made of, in one TOML file, and the loop that it describes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from inphase.channels import match
from inphase.errors import InphaseError, listing
from inphase.filters import FILTERS, RECOMMENDED
from inphase.io.toml import read_toml
from inphase.model import Model
from inphase.replay import provenance_of
from inphase.runtime.clock import Clock
from inphase.runtime.conduct import Conduct
from inphase.runtime.configuration.devices import ROBOTS, SENSORS, Maker, make_device
from inphase.runtime.configuration.robot_conduct import GUARDING, read_conduct, read_policy
from inphase.runtime.configuration.section import Section
from inphase.runtime.device import Robot, Sensor, check_signals
from inphase.runtime.journal import Journal
from inphase.runtime.loop import Loop
from inphase.runtime.perception import Perception, Sight, check_names
from inphase.runtime.playing import Play
from inphase.runtime.rates import Rates
from inphase.runtime.smoothing import AlphaBeta
from inphase.runtime.synchronise import by_channel
from inphase.session import Session

TABLES = ("filter", "rates", "sensing", "sensors", "robot", "response", "smoothing", "safety", "recording", "outputs")
OF_DEMONSTRATIONS = "demonstrations"


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
        made = list[Sensor]()
        for name, table in tables.items():
            sensor = make_device(table.without("clock"), makers, name=name, model=self.model)
            _check_kind(table, sensor, Sensor)
            made.append(sensor)
        return made

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
        table = section.without("limits")
        robot: Robot = make_device(table, {**ROBOTS, **self.makers}, name="robot", model=model, controlled=controlled)
        _check_kind(section, robot, Robot)
        return robot

    def session(self) -> Session:
        """A new session of the model; raises OptionError where the file names none."""
        model, section = self.needed_model(), self.section("filter")
        name, seed, options = self._filter()
        with section.naming([*options]):
            try:
                return model.session(name, seed, **options)
            except InphaseError:
                raise
            except (TypeError, ValueError, OverflowError, MemoryError) as error:  # as of a text for a number
                raise section.fail(f"{name} cannot be made with {options}: {error}") from error

    def needed_model(self) -> Model:
        """The model; raises OptionError where the file names none."""
        if self.model is None:
            raise self.root.fail("expected model = a model file, as `inphase fit` writes it, got none")
        return self.model

    def loop(self, clock: Clock, journal: Journal | None = None) -> Loop:
        """The loop that the file describes, with new devices, which are not started yet."""
        session, robot, sensors = self.session(), self.robot(), self.sensors()
        rates, play, sight = self.rates(), self.section("response").call(Play), self.section("sensing").call(Sight)
        self._check_fit(session, sensors, robot, sight)
        conduct = self.conduct(robot)
        with self.section("safety").naming(GUARDING):  # how patient a watchdog can be is known where it is made
            return Loop(
                session,
                sensors,
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
        return read_conduct(self.root, [signal.name for signal in robot.signals])

    def _check_fit(self, session: Session, sensors: list[Sensor], robot: Robot, sight: Sight) -> None:
        """What a loop would refuse too, said at the table it is about."""
        channels, observed = session.model.channels, len(session.model.observed)
        with self.section("sensors").naming([sensor.name for sensor in sensors]):
            check_names(sensors)
            check_signals(channels[:observed], sensors)
        with self.section("robot").naming():
            check_signals(channels[observed:], [robot])
        section = self.section("sensing")
        names = [signal.name for sensor in sensors for signal in sensor.signals]
        with section.at(*(["staleness"] if "staleness" in section else [])):
            by_channel(sight.staleness, names)
        with section.at(*(["needed"] if "needed" in section else [])):
            match(sight.needed, session.model.observed)
        with section.naming(["staleness", "delay"]):
            Perception(session, sensors, sight, 1 / self.rates().sense, self.shared_clocks())

    def provenance(self) -> dict[str, str]:
        """What a recording says of where it comes from."""
        return provenance_of(self.needed_model(), *self._filter(), configuration=self.text)

    def _filter(self) -> tuple[str, int, dict[str, Any]]:
        section = self.section("filter")
        name, seed = section.get("name", str, RECOMMENDED), section.get("seed", int, 0)
        if name not in FILTERS:
            raise section.fail(f"there is no filter {name!r}; one of {listing(FILTERS)}", "name")
        if seed < 0:
            raise section.fail(f"expected a seed >= 0, got {seed}", "seed")
        return name, seed, {key: section.get(key, Any) for key in section if key not in ("name", "seed")}


def read_configuration(path: str | PathLike[str], makers: Mapping[str, Maker] | None = None) -> Configuration:
    """What a TOML file says of an interaction: docs/live.md tells of every entry.

    makers: devices of one's own, by the name that the file calls them. Raises DataError for a file that cannot be read
    or is no TOML, and OptionError, with the line, for whatever in it is not known, of another type or out of range, and
    for a model that cannot be read.
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
        with root.at("model"):
            model = Model.load(file)
    configuration = Configuration(path, text, root, model, dict(makers or {}))
    configuration.rates()
    for name, kind in (("response", Play), ("sensing", Sight), ("smoothing", AlphaBeta)):
        root.section(name).call(kind)
    read_policy(root)
    configuration._filter()
    return configuration


def _clock(sensor: Section) -> str:
    clock: str = sensor.get("clock", str, "own")
    if clock not in ("own", "shared"):
        raise sensor.fail(f"expected one of own, shared, got {clock!r}", "clock")
    return clock


def _check_kind(section: Section, device: object, kind: type) -> None:
    """Raise OptionError for a device of another kind: what is made by others may be anything."""
    parts = ("name", "signals", "start", "stop", *(("read",) if kind is Sensor else ("state", "command")))
    if missing := [part for part in parts if not hasattr(device, part)]:
        what = kind.__name__.lower()
        raise section.fail(f"expected a {what}, got {device!r}, which has no {listing(missing)}", "device")
