"""Record demonstrations from sensors into a folder: start, stop, discard and do again, one file an episode."""

from __future__ import annotations

import enum
import tempfile
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from types import TracebackType

import numpy as np

from inphase.channels import Channel, check_channels
from inphase.errors import DataError, InphaseError, OptionError, listing
from inphase.runtime.clock import Clock
from inphase.runtime.combine import SensorRecording
from inphase.runtime.device import Sample, Sensor, check_signals
from inphase.runtime.episode import Episode, delete, described, joined, next_number, write_next
from inphase.runtime.sensor_log import SensorLog
from inphase.runtime.synchronise import Synchroniser

PRESSED = 0.5  # of the trigger, above which it is


class State(str, enum.Enum):
    """What is being done; the value is the sentence to show."""

    IDLE = "waits for a start"
    RECORDING = "records"
    UNWRITTEN = "holds an episode that could not be written"


class Demonstrations:
    """Records episodes of these channels from sensors, each into a CSV file of its own: 001.csv, 002.csv, ...

    All is read by `step`, which is to be called at a rate of a few dozen a second, whether it records or not; a robot
    that is guided by hand is read as a `RobotState`. To be used in a `with` statement, which starts and stops the
    sensors. An episode is held in memory until it is written; one that ends badly leaves no file.

    channels: the observed ones, then the controlled. rate: [1/s] of the files. staleness: as for `combine`.
    shared_clock: names of the sensors whose stamps are of the loop's clock. silence: [s] after which a sensor that
    gives nothing is told. trigger: a signal, such as that of a pedal, for `pressed`. The folder is made where only it
    is missing. Raises OptionError for sensors that do not fit the channels, or a folder that cannot be written to.
    """

    def __init__(
        self,
        sensors: Sequence[Sensor],
        channels: Sequence[Channel],
        folder: str | PathLike[str],
        clock: Clock,
        *,
        rate: float = 60.0,
        staleness: float | Mapping[str, float] | None = None,
        shared_clock: Collection[str] = (),
        silence: float = 1.0,
        trigger: str = "",
    ) -> None:
        for what, value in (("rate [1/s]", rate), ("silence [s]", silence)):
            if not 0 < value < np.inf:
                raise OptionError(f"expected a finite {what} > 0, got {value}")
        check_channels(channels)
        names = [sensor.name for sensor in sensors]
        if len(set(names)) < len(names):
            raise OptionError(f"expected sensors of different names, got {listing(names)}")
        self.channels, self.rate = tuple(channels), rate
        self.folder = _writable(Path(folder))
        found = check_signals(channels, sensors)
        columns = {name: sorted(column for device, column in found.values() if device == name) for name in names}
        self._sources = {
            sensor.name: SensorLog(sensor, columns[sensor.name], sensor.name in shared_clock)
            for sensor in sensors
            if columns[sensor.name] or trigger in [signal.name for signal in sensor.signals]
        }
        used = {name: source.signals for name, source in self._sources.items() if source.columns}
        if unknown := [name for name in shared_clock if name not in names]:
            raise OptionError(f"no sensor is called {listing(unknown)}; the sensors are {listing(names)}")
        Synchroniser(used, 1.0 if staleness is None else staleness, channels)  # raises where they cannot be combined
        self._clock, self._staleness, self._silence = clock, staleness, silence
        self._trigger = _place(trigger, sensors) if trigger else None
        self._pressed: bool | None = None
        self._began = 0.0
        self._held: dict[str, SensorRecording] = {}  # of an episode that could not be written
        self._kept: list[Episode] = []
        self._undoable = False
        self._open = ExitStack()
        self.state = State.IDLE
        self.number = next_number(self.folder)  # of the episode that is recorded now, or next

    def __enter__(self) -> Demonstrations:
        with ExitStack() as stack:
            for source in self._sources.values():
                stack.callback(source.sensor.stop)  # harmless before a start, and due after half of one
                source.sensor.start(self._clock)
                source.heard = self._clock.now()
            self._open = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()

    # ------------------------------------------------------------------------------------------------------ what is

    @property
    def kept(self) -> tuple[Episode, ...]:
        """The episodes of this session that are in their files."""
        return tuple(self._kept)

    @property
    def elapsed(self) -> float:
        """How long the episode is by now [s]; 0 where none is recorded."""
        return self._clock.now() - self._began if self.state is State.RECORDING else 0.0

    @property
    def counts(self) -> Mapping[str, int]:
        """By sensor, the samples of the episode by now."""
        return {name: len(source.samples) for name, source in self._sources.items() if source.columns}

    @property
    def silent(self) -> Mapping[str, str]:
        """The sensors that give nothing, and what is known of it."""
        return {name: source.trouble for name, source in self._sources.items() if source.trouble}

    @property
    def pressed(self) -> bool | None:
        """Whether the trigger is above one half; None before it was read."""
        return self._pressed

    # ------------------------------------------------------------------------------------------------- what is to do

    def step(self) -> list[str]:
        """Read all sensors once; returns what is to be told at once: a sensor that fell silent, or is back."""
        told = []
        for name, source in self._sources.items():
            before = source.trouble
            samples = source.read(self._clock.now(), self._silence)
            if self.state is State.RECORDING:
                source.samples += [sample for sample in samples if sample.received >= self._began]
            if self._trigger is not None and name == self._trigger[0]:
                self._press(samples, self._trigger[1])
            if source.trouble and not before:
                told.append(f"{name}: {source.trouble}")
            elif before and not source.trouble:
                told.append(f"{name} is back")
        return told

    def start(self) -> None:
        """Begin an episode now; raises OptionError where one is being recorded or has still to be written."""
        if self.state is not State.IDLE:
            raise OptionError(f"expected to begin an episode, but it {self.state.value}: stop or discard it first")
        self.step()  # what came before belongs to nothing
        for source in self._sources.values():
            source.samples = []
        self._began, self.state = self._clock.now(), State.RECORDING

    def stop(self) -> Episode:
        """End the episode and keep it.

        Raises DataError where what was read makes no demonstration, which is then discarded; OptionError where it
        cannot be written, which can be tried again by another `stop`, and where nothing is recorded.
        """
        if self.state is State.IDLE:
            raise OptionError("expected to end an episode, but none is being recorded")
        if self.state is State.RECORDING:
            self.step()
            self._held = self._recorded()
        try:
            demonstration, counts = joined(self._held, self.channels, self.rate, self._staleness)
        except DataError as error:
            raise DataError(f"{error}; it is not kept") from None
        try:
            path = write_next(self.folder, demonstration, self.channels)
        except (OSError, InphaseError) as error:
            self.state = State.UNWRITTEN
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise OptionError(f"the episode could not be written into {self.folder}: {reason}") from None
        self.state, self._undoable, self.number = State.IDLE, True, int(path.stem) + 1
        self._kept.append(described(path, demonstration, counts, self.channels, self._kept))
        return self._kept[-1]

    def discard(self) -> str:
        """Drop the episode that is recorded, or delete the last that was kept; returns what it was.

        Only the last one: it can be followed by another discard once another was recorded, so that a key which is
        pressed twice costs one episode. Raises OptionError where there is nothing to discard.
        """
        if self.state is not State.IDLE:
            unwritten = self.state is State.UNWRITTEN
            was = "the episode that could not be written" if unwritten else f"the {self.elapsed:.1f} s recorded"
            self.state, self._undoable = State.IDLE, False
            return was
        if not self._undoable:
            raise OptionError("nothing to discard since the last start or discard")
        path = self._kept[-1].path
        try:
            delete(path)
        except OSError as error:
            raise OptionError(f"cannot delete {path}: {error.strerror}") from None
        self._undoable = False
        self._kept.pop()
        self.number = next_number(self.folder)
        return path.name

    def redo(self) -> str:
        """Discard the last episode, if there is one to discard, and begin another; returns what was discarded."""
        was = self.discard() if self._undoable or self.state is not State.IDLE else ""
        self.start()
        return was

    def _recorded(self) -> dict[str, SensorRecording]:
        """What was read since the start; else nothing is being recorded any more."""
        length, self.state = self.elapsed, State.IDLE
        self._undoable = False
        sources = {name: source for name, source in self._sources.items() if source.columns}
        if nothing := [name for name, source in sources.items() if not source.samples]:
            raise DataError(f"the episode: nothing came of {listing(nothing)} in {length:.1f} s; it is not kept")
        return {name: source.recording() for name, source in sources.items()}

    def _press(self, samples: Sequence[Sample], column: int) -> None:
        values = [sample.values[column] for sample in samples if np.isfinite(sample.values[column])]
        self._pressed = bool(values[-1] > PRESSED) if values else self._pressed


def _writable(folder: Path) -> Path:
    """The folder, once it is there and takes a file; better told now than after the first episode."""
    try:
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise OptionError(f"cannot record into {folder}: {error.strerror}") from None


def _place(trigger: str, sensors: Sequence[Sensor]) -> tuple[str, int]:
    """Sensor and column of the trigger."""
    places = [(s.name, column) for s in sensors for column, signal in enumerate(s.signals) if signal.name == trigger]
    if len(places) != 1:
        offered = [signal.name for sensor in sensors for signal in sensor.signals]
        raise OptionError(f"expected one sensor with the trigger {trigger!r}, got {len(places)}: {listing(offered)}")
    return places[0]
