"""Sense and observe: what sensors read goes to the session once, in the order in which it was read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from jaxtyping import Bool

from inphase.arrays import FloatArray
from inphase.channels import match
from inphase.errors import OptionError
from inphase.result import Estimate
from inphase.runtime.averaging import Averaging
from inphase.runtime.clock import Clock
from inphase.runtime.device import Sensor, check_signals
from inphase.runtime.synchronise import Synchroniser, by_channel
from inphase.session import Session

STALENESS = 0.25  # [s] of channels for which none is named
CATCH_UP = 20  # observations in a cycle: after a long delay those before are left out, or it would never catch up


@dataclass(frozen=True)
class Sight:
    """When a reading is no longer one of now.

    staleness: [s] for which a reading stands, one number or by channel name or pattern. delay: [s] to wait for sensors
    that are slow: all is observed as of that long ago. needed: names or patterns of channels without any of which the
    partner counts as not seen; without them all channels have to be stale. Raises OptionError for values out of range.
    """

    staleness: float | Mapping[str, float] = STALENESS
    delay: float = 0.0
    needed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "needed", tuple(self.needed))
        if not 0 <= self.delay < inf:
            raise OptionError(f"sensors: expected a delay >= 0 [s], got {self.delay}")


class Perception:
    """Reads all sensors, and gives the session every reading of an observed channel, at the time it was read.

    within: [s] apart, readings of several sensors are one observation; the time between two looks. merge: all that is
    new is one, averaged, so that a session observes no more often than it is asked to. Raises OptionError where the
    sensors do not offer the session's observed channels in its units, or for a staleness that does not fit.
    """

    def __init__(
        self,
        session: Session,
        sensors: Sequence[Sensor],
        sight: Sight,
        within: float,
        shared_clock: Sequence[str] = (),
        *,
        merge: bool = False,
    ) -> None:
        observed = session.model.channels[: len(session.model.observed)]
        check_names(sensors)
        check_signals(observed, sensors)
        self.session, self.sensors = session, tuple(sensors)
        self.last: Estimate | None = None
        self.failed: dict[str, str] = {}
        self.skipped = self.late = 0
        self._delay, self._within, self._merge = sight.delay, within, merge
        self._averaging = Averaging(observed)
        offered = {sensor.name: sensor.signals for sensor in sensors}
        names = [signal.name for signals in offered.values() for signal in signals]
        times = dict.fromkeys(names, STALENESS) | by_channel(sight.staleness, names)
        self.synchroniser = Synchroniser(
            offered, times, session.model.channels, shared_clock=shared_clock, history=sight.delay + 1.0
        )
        self.names = tuple(channel.name for channel in observed)
        self._order = np.array([names.index(name) for name in self.names], dtype=np.int64)
        self._staleness = np.array([times[name] for name in self.names], dtype=np.float64)
        self._needed = [set(match(pattern, self.names)) for pattern in sight.needed]
        self._blind = np.full(len(self.names), np.nan)
        self._since = -inf

    def start(self, clock: Clock) -> None:
        """Start all sensors; where one cannot be started, those before are stopped again."""
        for count, sensor in enumerate(self.sensors):
            try:
                sensor.start(clock)
            except BaseException:
                for started in self.sensors[:count]:
                    started.stop()
                raise

    def stop(self) -> None:
        """Stop all sensors, whatever one of them says."""
        for sensor in self.sensors:
            try:
                sensor.stop()
            except Exception as error:  # noqa: BLE001 - the others have to be stopped too
                self.failed[sensor.name] = f"could not be stopped: {error!r}"

    def reset(self, now: float, seed: int | None = None) -> None:
        """Begin a new interaction, of which nothing was seen yet; what was read up to now [s] belongs to the last."""
        self.synchroniser.fetch(now)
        self.session.reset(seed)
        self.last, self._since = None, now

    def sense(self) -> None:
        """Take in what came. A sensor that raises is not asked again: its channels become stale, `failed` says why."""
        for sensor in self.sensors:
            if sensor.name not in self.failed:
                try:
                    self.synchroniser.take(sensor.name, sensor.read())
                except Exception as error:  # noqa: BLE001 - whatever a device does, the robot has to be brought to rest
                    self.failed[sensor.name] = f"{type(error).__name__}: {error}"

    def observe(self, now: float) -> Iterator[tuple[FloatArray, Estimate]]:
        """Every new reading and what the session makes of it, one after the other; a blind one where all is stale."""
        until = now - self._delay
        readings = self.synchroniser.fetch(until, self._within)
        seen = [(time, values[self._order]) for time, values in readings if time > self._since]
        seen = [(time, values) for time, values in seen if not np.isnan(values).all()]
        if self._merge and len(seen) > 1:
            seen = [self._averaging(seen)]
        elif len(seen) > CATCH_UP:
            self.skipped += len(seen) - CATCH_UP
            seen = seen[-CATCH_UP:]
        if not seen and self.session.time is not None and self._stale(now).all():
            seen = [(until, self._blind)]
        for time, values in seen:
            last = self.session.time
            if last is not None and time < last:  # it waited for others that were read before it, or came late
                self.late += last - time > self._within and not np.isnan(values).all()
                time = last
            self.last = self.session.observe(time, values)
            yield values, self.last

    def unseen(self, now: float) -> tuple[str, ...]:
        """The channels that are stale, where what is left is not enough to know the partner by; else none."""
        stale = self._stale(now)
        gone = set(np.flatnonzero(stale).tolist())
        lacking = any(needed <= gone for needed in self._needed) if self._needed else len(gone) == len(self.names)
        return tuple(self.names[i] for i in sorted(gone)) if lacking else ()

    def _stale(self, now: float) -> Bool[np.ndarray, " D"]:
        return np.asarray(self.synchroniser.ages(now)[self._order] > self._staleness + self._delay)


def check_names(sensors: Sequence[Sensor]) -> None:
    """Raise OptionError where two sensors have one name."""
    names = [sensor.name for sensor in sensors]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise OptionError(f"expected sensors of different names, got {', '.join(twice)} twice")
