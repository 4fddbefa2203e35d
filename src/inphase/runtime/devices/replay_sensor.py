"""A recording as a sensor: what was read then comes again, at its times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inphase.channels import Channel, Role, match
from inphase.errors import OptionError
from inphase.recording import Recording
from inphase.runtime.clock import Clock
from inphase.runtime.device import Sample, Signal
from inphase.trajectory import Demonstration


class ReplaySensor:
    """The channels of a recording, sample by sample, in its time or `speed` times as fast.

    channels: those of a demonstration's columns; a `Recording` has its own. only: the names or patterns of those that
    are offered; the observed ones unless told. Stamps begin at the first time of the recording, and run with the clock.
    Raises OptionError for a speed that is not positive or channels that do not fit, ChannelError for unknown names.
    """

    def __init__(
        self,
        recorded: Demonstration | Recording,
        channels: Sequence[Channel] | None = None,
        *,
        only: Sequence[str] | str | None = None,
        speed: float = 1.0,
        name: str = "replay",
    ) -> None:
        if isinstance(recorded, Recording):
            channels = recorded.channels
        if channels is None or len(channels) != recorded.values.shape[1]:
            got = "none" if channels is None else str(len(channels))
            raise OptionError(f"{name}: expected {recorded.values.shape[1]} channels, one for each column, got {got}")
        if not 0 < speed < np.inf:
            raise OptionError(f"{name}: expected a finite speed > 0, got {speed}")
        names = [channel.name for channel in channels]
        observed = [i for i, channel in enumerate(channels) if channel.role is Role.OBSERVED]
        columns = observed if only is None else match(only, names)
        self.name = name
        self.signals = tuple(Signal(channels[i].name, channels[i].unit) for i in columns)
        self._values = recorded.values[:, columns]
        self._after = (recorded.times - recorded.times[:1]) / speed
        self._first = float(recorded.times[0]) if len(recorded.times) else 0.0
        self._clock: Clock | None = None
        self._begun = 0.0
        self._next = 0

    def start(self, clock: Clock) -> None:
        """Begin with the first sample, now."""
        self._clock, self._begun, self._next = clock, clock.now(), 0

    def read(self) -> list[Sample]:
        """All that came since the last call."""
        if self._clock is None:
            return []
        due, now = self._next, self._clock.now()
        while due < len(self._after) and self._begun + self._after[due] <= now:  # of a long recording few are new
            due += 1
        samples = [
            Sample(self._values[i], self._first + float(self._after[i]), self._begun + float(self._after[i]))
            for i in range(self._next, due)
        ]
        self._next = due
        return samples

    def stop(self) -> None:
        """Fall silent."""
        self._clock = None

    @property
    def finished(self) -> bool:
        """Whether the last sample was read."""
        return self._next == len(self._after)
