"""Which devices a configuration may name, and how each is made from its table."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, make_channels, spread
from inphase.errors import OptionError, listing
from inphase.io import read_episode, read_recording
from inphase.model import Model
from inphase.runtime.adapters.bags import bag_sensor
from inphase.runtime.adapters.lsl import LslMarkers, LslSensor
from inphase.runtime.adapters.ros1_robot import Ros1Robot
from inphase.runtime.adapters.ros1_sensor import Ros1Sensor
from inphase.runtime.adapters.ros1_services import Ros1Services
from inphase.runtime.configuration.section import Section
from inphase.runtime.device import Robot, Sensor, Signal
from inphase.runtime.devices import ReplaySensor, SimulatedPartner, SimulatedRobot
from inphase.trajectory import Demonstration

Maker = Callable[..., Any]
GROUP = "inphase.devices"  # of entry points: a package that is installed offers devices of its own


def replay(
    file: Path,
    name: str,
    only: tuple[str, ...] | None = None,
    units: Mapping[str, str] | None = None,
    speed: float = 1.0,
    time: str = "time",
) -> Sensor:
    """The columns of a CSV or npz recording, or the observed channels of a live run (.mcap), in their time."""
    if file.suffix == ".mcap":
        return ReplaySensor(read_recording(file), only=only, speed=speed, name=name)
    table = read_episode(file, time=time)
    channels = make_channels(table.columns, [], units)
    demonstration = Demonstration(table.times, table.pick(table.columns), file.stem)
    return ReplaySensor(demonstration, channels, only=only, speed=speed, name=name)


def simulated_partner(
    model: Model,
    name: str,
    seed: int = 0,
    rate: float = 60.0,
    tempo: float | None = None,
    pauses: tuple[tuple[float, float], ...] = (),
    noise: float = 0.01,
) -> Sensor:
    """A partner who moves as the model says partners do."""
    if seed < 0:
        raise OptionError(f"expected a seed >= 0, got {seed}")
    return SimulatedPartner(model, seed, rate=rate, tempo=tempo, pauses=pauses, noise=noise, name=name)


def simulated_robot(
    controlled: tuple[Channel, ...],
    home: Mapping[str, float],
    name: str,
    time_constant: float = 0.05,
    low: Mapping[str, float] | None = None,
    high: Mapping[str, float] | None = None,
    velocity: Mapping[str, float] | None = None,
) -> Robot:
    """A robot of the controlled channels that follows by a first-order lag; numbers are by signal or pattern."""
    names = [channel.name for channel in controlled]
    stands = spread(home, names)
    if missing := [name for name in names if name not in stands]:
        raise OptionError(f"expected a home of every channel, got none of {listing(missing)}")
    return SimulatedRobot(
        [Signal(channel.name, channel.unit) for channel in controlled],
        [stands[name] for name in names],
        time_constant=time_constant,
        low=by_name(low or {}, names, -np.inf),
        high=by_name(high or {}, names, np.inf),
        velocity=by_name(velocity or {}, names, np.inf),
        name=name,
    )


def by_name(numbers: Mapping[str, float], names: Sequence[str], otherwise: float) -> Float[np.ndarray, " D"]:
    """(D,) the number of each name, from names and patterns."""
    given = spread(numbers, names)
    return np.array([given.get(name, otherwise) for name in names], dtype=np.float64)


SENSORS: Mapping[str, Maker] = MappingProxyType(
    {
        "replay": replay,
        "simulated_partner": simulated_partner,
        "bag": bag_sensor,
        "lsl": LslSensor,
        "ros1": Ros1Sensor,
    }
)
ROBOTS: Mapping[str, Maker] = MappingProxyType({"simulated_robot": simulated_robot, "ros1": Ros1Robot})
OUTPUTS: Mapping[str, Maker] = MappingProxyType({"lsl": LslMarkers, "ros1": Ros1Services})


def make_device(section: Section, makers: Mapping[str, Maker], **known: Any) -> Any:
    """The device of a table `device = "name"` with its other entries as keywords.

    makers: by name; devices of installed packages (entry points `inphase.devices`) are known besides. known: what the
    file does not say, as the model: those get it that ask for it by a parameter of that name. Raises OptionError with
    the line for an unknown device, one that wants what is not there, or entries that do not fit.
    """
    device = section.get("device", str)
    make = _maker(section, device, makers)
    wanted = [name for name in known if name in inspect.signature(make).parameters]
    if any(known[name] is None for name in wanted):
        raise section.fail(f"{device} needs a model: expected model = a file, at the top, got none", "device")
    try:
        return section.call(make, ("device",), **{name: known[name] for name in wanted})
    except (ImportError, OSError) as error:  # a port that is not there, a driver that is not installed
        raise section.fail(f"{device} cannot be made: {error}", "device") from error


def _maker(section: Section, device: str, makers: Mapping[str, Maker]) -> Maker:
    if device in makers:
        return makers[device]
    others = {point.name: point for point in entry_points(group=GROUP)}
    if device not in others:
        names = listing(dict.fromkeys([*makers, *others]))
        raise section.fail(f"there is no device {device!r}; one of {names}", "device")
    source = others[device].value
    try:
        make = others[device].load()
    except (ImportError, AttributeError) as error:
        raise section.fail(f"{device}, of {source}, cannot be loaded: {error}", "device") from error
    if not callable(make):
        raise section.fail(f"{device}: expected a class or function in {source}, got {make!r}", "device")
    return cast(Maker, make)
