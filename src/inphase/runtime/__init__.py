"""All that touches time or wires: clocks, devices, and what keeps them in step."""

from inphase.runtime.clock import Clock, FakeClock, SystemClock
from inphase.runtime.device import Command, Robot, Sample, Sensor, Signal, check_signals
from inphase.runtime.source_clock import SourceClock
from inphase.runtime.synchronise import SensorRecording, Synchroniser, combine
from inphase.runtime.track import Fate

__all__ = [
    "Clock",
    "Command",
    "FakeClock",
    "Fate",
    "Robot",
    "Sample",
    "Sensor",
    "SensorRecording",
    "Signal",
    "SourceClock",
    "Synchroniser",
    "SystemClock",
    "check_signals",
    "combine",
]
