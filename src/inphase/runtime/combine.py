"""Recordings of several sensors, each at its own rate and by its own clock, as one demonstration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.channels import Channel
from inphase.errors import DataError, OptionError, listing
from inphase.runtime.device import Sample, Signal
from inphase.runtime.synchronise import Synchroniser, by_channel
from inphase.runtime.track import Fate
from inphase.trajectory import Demonstration

STALE_AFTER = 3.0  # median steps of a recorded sensor, as `inphase.preprocess` tells a gap


@dataclass(frozen=True, eq=False)
class SensorRecording:
    """What one sensor read, at its own rate and by its own clock.

    stamps: (T,) [s]. values: (T, D) by its signals, NaN where not read. received: (T,) [s] by a clock that all
    sensors share; None where the stamps already are.
    Raises DataError for parts that do not fit, or no sample at all.
    """

    signals: tuple[Signal, ...]
    stamps: Float[np.ndarray, " T"]
    values: Float[np.ndarray, "T D"]
    received: Float[np.ndarray, " T"] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "signals", tuple(self.signals))
        freeze(self, stamps=self.stamps, values=self.values)
        if self.received is not None:
            freeze(self, received=self.received)
        expected = (len(self.stamps), len(self.signals))
        if self.values.shape != expected or len(self.times) != len(self.stamps) or not len(self.stamps):
            raise DataError(
                f"recording of {listing(s.name for s in self.signals)}: expected values (T, D) = {expected} with T > 0 "
                f"and as many times received, got {self.values.shape} and {len(self.times)}"
            )

    @property
    def times(self) -> Float[np.ndarray, " T"]:
        """(T,) when the samples came [s]."""
        return self.stamps if self.received is None else self.received

    @property
    def samples(self) -> list[Sample]:
        """One by one, in the order they came."""
        order = np.argsort(self.times, kind="stable")
        return [Sample(self.values[i], float(self.stamps[i]), float(self.times[i])) for i in order]


def combine(
    recordings: Mapping[str, SensorRecording],
    rate: float,
    channels: Sequence[Channel] = (),
    *,
    staleness: float | Mapping[str, float] | None = None,
    name: str = "demonstration",
) -> Demonstration:
    """Recordings of several sensors as one demonstration, `rate` samples a second, its columns in their order.

    It begins when the last sensor has begun, and ends with the first that ends; one that ends by more than its
    staleness before all others has died: it is NaN from there. staleness: three median steps of each sensor unless
    told. Raises OptionError for a rate that is not positive, DataError for sensors
    that were not recorded at the same time, or one whose clock was set on the way.
    """
    return combine_counted(recordings, rate, channels, staleness=staleness, name=name)[0]


def combine_counted(
    recordings: Mapping[str, SensorRecording],
    rate: float,
    channels: Sequence[Channel] = (),
    *,
    staleness: float | Mapping[str, float] | None = None,
    name: str = "demonstration",
) -> tuple[Demonstration, Mapping[str, Mapping[Fate, int]]]:
    """What `combine` gives, and by sensor, what became of its samples."""
    if not 0 < rate < inf:
        raise OptionError(f"expected a rate > 0 [1/s], got {rate}")
    if staleness is None:
        staleness = {s.name: _usual(r, column) for r in recordings.values() for column, s in enumerate(r.signals)}
    together = Synchroniser(
        {sensor: r.signals for sensor, r in recordings.items()},
        staleness,
        channels,
        shared_clock=[sensor for sensor, r in recordings.items() if r.received is None],
        history=inf,
        window=inf,
    )
    for sensor, recording in recordings.items():
        together.take(sensor, recording.samples)
        if together.counts[sensor].get(Fate.RESTARTED):
            raise DataError(
                f"{sensor}: expected the stamps of one clock, got one that was set on the way; cut it there"
            )
    spans = {sensor: together.span(sensor) for sensor in recordings}
    begin, last = (max(span[i] for span in spans.values()) for i in (0, 1))
    stale = by_channel(staleness, together.names)
    holds = {sensor: max(stale[signal.name] for signal in r.signals) for sensor, r in recordings.items()}
    if any(span[1] <= begin for span in spans.values()):
        got = ", ".join(f"{sensor} from {first:g} to {end:g} s" for sensor, (first, end) in spans.items())
        raise DataError(f"{name}: expected sensors that were recorded at the same time, got {got}")
    end = min(span[1] for sensor, span in spans.items() if last - span[1] <= holds[sensor])
    times = begin + np.arange(int((end - begin) * rate * (1 + 1e-12)) + 1) / rate
    return Demonstration(times, np.stack([together.at(float(time)) for time in times]), name), together.counts


def _usual(recording: SensorRecording, column: int) -> float:
    """How long a reading of that column may stand for what follows [s]."""
    steps = np.diff(np.unique(recording.stamps[np.isfinite(recording.values[:, column])]))
    return STALE_AFTER * float(np.median(steps)) if len(steps) else 1.0  # read once: there is nothing to go by
