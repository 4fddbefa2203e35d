"""The demonstrations table of a configuration: from which sensors they are recorded, and into which folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from inphase.channels import Channel, make_channels, match
from inphase.errors import listing
from inphase.runtime.clock import Clock
from inphase.runtime.demonstrations import Demonstrations
from inphase.runtime.device import Sensor
from inphase.runtime.devices import RobotState

if TYPE_CHECKING:
    from inphase.runtime.configuration.interaction import Configuration

TABLE = "demonstrations"


def demonstrations(configuration: Configuration, clock: Clock) -> Demonstrations:
    """What records demonstrations as a configuration says; raises OptionError, with the line, for what is wrong.

    The observed and the controlled channels are named by the table, or are those of the model. Where no sensor offers
    the controlled ones, the robot is read as it is guided by hand.
    """
    section = configuration.section(TABLE)
    section.only("folder", "rate", "observed", "controlled", "kinds", "trigger")
    sensors = configuration.sensors()
    if "device" in configuration.section("robot"):
        offered = {signal.name for sensor in sensors for signal in sensor.signals}
        robot = configuration.robot()
        if not offered >= {signal.name for signal in robot.signals}:
            sensors.append(RobotState(robot))
    with section.naming():
        return Demonstrations(
            sensors,
            _channels(configuration, sensors),
            section.get("folder", Path, configuration.path.parent / "demonstrations"),
            clock,
            rate=section.get("rate", float, 60.0),
            shared_clock=configuration.shared_clocks(),
            trigger=section.get("trigger", str, ""),
        )


def _channels(configuration: Configuration, sensors: list[Sensor]) -> tuple[Channel, ...]:
    section = configuration.section(TABLE)
    if "observed" not in section and "controlled" not in section and configuration.model is not None:
        return configuration.model.channels
    offered = {signal.name: signal.unit for sensor in sensors for signal in sensor.signals}
    names: dict[str, list[str]] = {}
    for role in ("observed", "controlled"):
        with section.naming([role]):
            names[role] = [list(offered)[i] for i in match(section.get(role, tuple[str, ...]), list(offered))]
    if twice := sorted(set(names["observed"]) & set(names["controlled"])):
        raise section.fail(
            f"expected channels to be observed or controlled, got {listing(twice)} as both", "controlled"
        )
    kinds = section.get("kinds", Mapping[str, str], {})
    with section.naming(["kinds"]):
        return make_channels(names["observed"], names["controlled"], offered, kinds)
