"""What one sensor gives while demonstrations are recorded, and how it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inphase.errors import ObservationError
from inphase.runtime.combine import SensorRecording
from inphase.runtime.device import Sample, Sensor


class SensorLog:
    """The samples of one sensor that belong to the episode, and whether it gives any.

    columns: those of its signals that are recorded; none for one that is only watched. shared: whether its stamps are
    of the loop's clock.
    """

    def __init__(self, sensor: Sensor, columns: Sequence[int], shared: bool) -> None:
        self.sensor, self.columns, self._shared = sensor, list(columns), shared
        self.signals = tuple(sensor.signals[column] for column in columns)
        self.samples: list[Sample] = []
        self.heard = 0.0  # when something was last read [s]
        self.trouble = ""

    def read(self, now: float, patience: float) -> list[Sample]:
        """All that came; `trouble` says why it is nothing."""
        try:
            samples = self.sensor.read()
            if wrong := [len(s.values) for s in samples if len(s.values) != len(self.sensor.signals)]:
                raise ObservationError(f"expected {len(self.sensor.signals)} values, got {wrong[0]}")
        except Exception as error:  # noqa: BLE001 - whatever it is, the other sensors go on
            self.trouble = f"cannot be read: {error}"
            return []
        watched = self.columns or list(range(len(self.sensor.signals)))
        if any(np.isfinite(sample.values[watched]).any() for sample in samples):
            self.heard, self.trouble = now, ""
        elif now - self.heard > patience:
            self.trouble = self.trouble or f"nothing was read for {patience:g} s"
        return samples

    def recording(self) -> SensorRecording:
        """The samples of the episode."""
        return SensorRecording(
            self.signals,
            np.array([sample.stamp for sample in self.samples]),
            np.array([sample.values[self.columns] for sample in self.samples]),
            None if self._shared else np.array([sample.received for sample in self.samples]),
        )
