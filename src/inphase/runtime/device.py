"""What a device is to the loop: a sensor that is read, a robot that is commanded, and the channels both offer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.channels import Channel
from inphase.errors import OptionError, listing
from inphase.runtime.clock import Clock


@dataclass(frozen=True)
class Signal:
    """One channel of a device, and its unit; '' where it has none."""

    name: str
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Sample:
    """What a device read at one time.

    values: (D,) by its signals, NaN where not read. stamp: [s] when it was read, by the device's own clock.
    received: [s] when it came, by the loop's clock.
    """

    values: Float[np.ndarray, " D"]
    stamp: float
    received: float

    def __post_init__(self) -> None:
        freeze(self, values=self.values)


@dataclass(frozen=True, eq=False)
class Command:
    """Where a robot is to be and when: one point, or a trajectory.

    times: (S,) [s] by the loop's clock, increasing. positions: (S, D) by the robot's signals.
    Raises OptionError for parts that do not fit, or a number that is not finite.
    """

    times: Float[np.ndarray, " S"]
    positions: Float[np.ndarray, "S D"]

    def __post_init__(self) -> None:
        freeze(self, times=self.times, positions=self.positions)
        if self.times.ndim != 1 or self.positions.ndim != 2 or not len(self.times) == len(self.positions) > 0:
            raise OptionError(
                f"command: expected times (S,) and positions (S, D), got {self.times.shape} and {self.positions.shape}"
            )
        if not (np.isfinite(self.times).all() and (np.diff(self.times) > 0).all()):
            raise OptionError("command: expected finite times that increase")
        if not np.isfinite(self.positions).all():
            point, column = np.argwhere(~np.isfinite(self.positions))[0]
            got = self.positions[point, column]
            raise OptionError(f"command: expected finite positions, got {got} in column {column} at point {point}")


@runtime_checkable
class Device(Protocol):
    """What sensors and robots share: a name, the signals they offer, a start and a stop."""

    @property
    def name(self) -> str:
        """What messages call it."""
        ...

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What it reads or moves, known before it is started."""
        ...

    def start(self, clock: Clock) -> None:
        """Begin, by the loop's clock."""
        ...

    def stop(self) -> None:
        """End, and let go of what is held; harmless where it has not begun."""
        ...


@runtime_checkable
class Sensor(Device, Protocol):
    """A source of samples."""

    def read(self) -> list[Sample]:
        """All that came since the last call, in the order it came; never waits."""
        ...


@runtime_checkable
class Robot(Device, Protocol):
    """What carries out commands."""

    def state(self) -> Sample | None:
        """Its latest position; None where it does not answer. Never waits."""
        ...

    def command(self, command: Command) -> None:
        """Take over from the last command. Never waits; raises OptionError for another number of positions."""
        ...


def check_signals(channels: Sequence[Channel], devices: Iterable[Device]) -> dict[str, tuple[str, int]]:
    """Which device offers every channel of a model, and in which column.

    A model without units fits all; a device is free to offer more than is asked for. Raises OptionError that names
    every channel that nobody offers or two do, and every unit that differs.
    """
    offers: dict[str, list[tuple[str, int, str]]] = {}
    for device in devices:
        for column, signal in enumerate(device.signals):
            offers.setdefault(signal.name, []).append((device.name, column, signal.unit))
    faults, missing = [], []
    found: dict[str, tuple[str, int]] = {}
    for channel in channels:
        offered = offers.get(channel.name, [])
        if not offered:
            missing.append(channel.name)
        elif len(offered) > 1:
            faults.append(f"{channel.name!r} is offered twice, by {listing(name for name, _, _ in offered)}")
        else:
            name, column, unit = offered[0]
            found[channel.name] = name, column
            if channel.unit and channel.unit != unit:
                faults.append(f"{channel.name!r} is in {channel.unit!r} in the model and in {unit!r} from {name}")
    if missing:
        faults.insert(0, f"no device offers {listing(missing)}; offered are {listing(offers)}")
    if faults:
        raise OptionError("the devices do not fit the model: " + "; ".join(faults))
    return found
