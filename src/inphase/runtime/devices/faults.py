"""What goes wrong with sensors, each as a wrapper around one that is well; they may be put around each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from heapq import heappop, heappush

import numpy as np

from inphase.channels import match
from inphase.errors import OptionError
from inphase.runtime.clock import Clock
from inphase.runtime.device import Sample, Sensor


class Fault:
    """A sensor as it is; the faults change what comes of it. Times are since the start, by the loop's clock."""

    def __init__(self, sensor: Sensor) -> None:
        self.name, self.signals = sensor.name, sensor.signals
        self._sensor = sensor
        self._clock: Clock | None = None
        self._begun = 0.0

    def start(self, clock: Clock) -> None:
        """Start the sensor."""
        self._clock, self._begun = clock, clock.now()
        self._sensor.start(clock)

    def read(self) -> list[Sample]:
        """What is left of all that came since the last call."""
        return [changed for sample in self._sensor.read() for changed in self.changed(sample)]

    def stop(self) -> None:
        """Stop the sensor."""
        self._sensor.stop()
        self._clock = None

    def changed(self, sample: Sample) -> list[Sample]:
        """What becomes of one sample."""
        return [sample]


class Delayed(Fault):
    """What comes is kept back; `delay` says for how long."""

    def __init__(self, sensor: Sensor) -> None:
        super().__init__(sensor)
        self._waiting: list[tuple[float, int, Sample]] = []
        self._count = 0

    def read(self) -> list[Sample]:
        """All that has come by now, in the order it came."""
        for sample in self._sensor.read():
            arrival = sample.received + self.delay()
            heappush(self._waiting, (arrival, self._count, replace(sample, received=arrival)))
            self._count += 1
        come: list[Sample] = []
        while self._clock is not None and self._waiting and self._waiting[0][0] <= self._clock.now():
            come.append(heappop(self._waiting)[2])
        return come

    def delay(self) -> float:
        """Of the next sample [s]."""
        return 0.0


class Late(Delayed):
    """Every sample comes `by` seconds late, and by an exponential time of mean `jitter` more; the order may change."""

    def __init__(self, sensor: Sensor, by: float, jitter: float = 0.0, seed: int = 0) -> None:
        super().__init__(sensor)
        self._by, self._jitter = _at_least_zero("by", by), _at_least_zero("jitter", jitter)
        self._rng = np.random.default_rng(seed)

    def delay(self) -> float:
        """Of the next sample [s]."""
        return self._by + self._jitter * float(self._rng.exponential())


class Reordered(Delayed):
    """A share of the samples, drawn at random, comes `by` seconds late, after others that were read later."""

    def __init__(self, sensor: Sensor, share: float, by: float, seed: int = 0) -> None:
        super().__init__(sensor)
        self._share, self._by = _share(share), _at_least_zero("by", by)
        self._rng = np.random.default_rng(seed)

    def delay(self) -> float:
        """Of the next sample [s]."""
        return self._by if self._rng.random() < self._share else 0.0


class Dead(Fault):
    """Nothing comes from `after` seconds on, for `length` seconds or for good."""

    def __init__(self, sensor: Sensor, after: float, length: float = np.inf) -> None:
        super().__init__(sensor)
        self._after, self._length = _at_least_zero("after", after), _at_least_zero("length", length)

    def changed(self, sample: Sample) -> list[Sample]:
        """The sample, or nothing."""
        return [] if 0 <= sample.received - self._begun - self._after < self._length else [sample]


class Drifting(Fault):
    """The device's clock begins `offset` seconds ahead, and gains `drift` seconds in one of the loop's."""

    def __init__(self, sensor: Sensor, drift: float, offset: float = 0.0) -> None:
        super().__init__(sensor)
        self._drift, self._offset = drift, offset
        self._first: float | None = None

    def changed(self, sample: Sample) -> list[Sample]:
        """The sample with another stamp."""
        self._first = sample.stamp if self._first is None else self._first
        gained = self._offset + self._drift * (sample.stamp - self._first)
        return [replace(sample, stamp=sample.stamp + gained)]


class Duplicated(Fault):
    """A share of the samples, drawn at random, comes twice."""

    def __init__(self, sensor: Sensor, share: float, seed: int = 0) -> None:
        super().__init__(sensor)
        self._share = _share(share)
        self._rng = np.random.default_rng(seed)

    def changed(self, sample: Sample) -> list[Sample]:
        """The sample, once or twice."""
        return [sample, sample] if self._rng.random() < self._share else [sample]


class NanBursting(Fault):
    """The signals that fit `only` (names or patterns; all unless told) are not read in bursts (begin, length) [s]."""

    def __init__(
        self, sensor: Sensor, bursts: Sequence[tuple[float, float]], only: Sequence[str] | str | None = None
    ) -> None:
        super().__init__(sensor)
        names = [signal.name for signal in sensor.signals]
        self._columns = list(range(len(names))) if only is None else match(only, names)
        self._bursts = [(_at_least_zero("begin", b), _at_least_zero("length", length)) for b, length in bursts]

    def changed(self, sample: Sample) -> list[Sample]:
        """The sample, blind in a burst."""
        since = sample.received - self._begun
        if not any(0 <= since - begin < length for begin, length in self._bursts):
            return [sample]
        values = sample.values.copy()
        values[self._columns] = np.nan
        return [replace(sample, values=values)]


def _at_least_zero(what: str, value: float) -> float:
    if not value >= 0:
        raise OptionError(f"fault: expected {what} >= 0 s, got {value}")
    return value


def _share(value: float) -> float:
    if not 0 <= value <= 1:
        raise OptionError(f"fault: expected a share between 0 and 1, got {value}")
    return value
