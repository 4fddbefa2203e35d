"""All that touches time or wires: devices, the live loop and its safety, recordings of runs, and of demonstrations.

Devices to try out and to copy are in `inphase.runtime.devices`, those of others in `inphase.runtime.adapters`.
"""

from inphase.replay import provenance_of, replay, session_of
from inphase.runtime.clock import Clock, FakeClock, SystemClock
from inphase.runtime.combine import SensorRecording, combine
from inphase.runtime.conduct import Conduct
from inphase.runtime.configuration import Configuration, read_configuration
from inphase.runtime.demonstrations import Demonstrations
from inphase.runtime.device import Command, Robot, Sample, Sensor, Signal, check_signals
from inphase.runtime.journal import Journal
from inphase.runtime.limits import Limits
from inphase.runtime.live import Run, prepared
from inphase.runtime.loop import Loop
from inphase.runtime.perception import Sight
from inphase.runtime.playing import Play
from inphase.runtime.rates import Rates
from inphase.runtime.recorder import Recorder
from inphase.runtime.run_report import RunReport
from inphase.runtime.safety import Answer, Policy, State, Trouble
from inphase.runtime.smoothing import AlphaBeta
from inphase.runtime.source_clock import SourceClock
from inphase.runtime.synchronise import Synchroniser
from inphase.runtime.timing import Spread
from inphase.runtime.track import Fate

__all__ = [
    "AlphaBeta",
    "Answer",
    "Clock",
    "Command",
    "Conduct",
    "Configuration",
    "Demonstrations",
    "FakeClock",
    "Fate",
    "Journal",
    "Limits",
    "Loop",
    "Play",
    "Policy",
    "Rates",
    "Recorder",
    "Robot",
    "Run",
    "RunReport",
    "Sample",
    "Sensor",
    "SensorRecording",
    "Sight",
    "Signal",
    "SourceClock",
    "Spread",
    "State",
    "Synchroniser",
    "SystemClock",
    "Trouble",
    "check_signals",
    "combine",
    "prepared",
    "provenance_of",
    "read_configuration",
    "replay",
    "session_of",
]
