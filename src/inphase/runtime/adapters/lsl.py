"""Streams of the lab streaming layer (LSL): samples in, markers out.

The stamps of a stream are kept as they are: they are another clock, whose offset and drift `SourceClock` finds. LSL's
own `time_correction` is not added: it is learned anew every few seconds, and each time it would make the stamps jump;
what it knows better is the shortest delay on the way, which is about 0.1 ms.

Streams are looked for on this machine alone unless `scope="network"` is asked for (see `lsl_library`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from inphase.channels import check_unique, spread
from inphase.errors import OptionError, listing
from inphase.io.mcap_messages import event as as_json
from inphase.recording import RecordedEvent
from inphase.runtime.adapters.lsl_library import load_lsl
from inphase.runtime.clock import Clock
from inphase.runtime.device import Sample, Signal

SECOND = 1.0  # [s] for which a second stream of the same name is waited for
CHUNK = 1024  # samples that are taken at once
BUFFER = 10  # [s] of samples that wait to be read, or hundreds of samples of a stream without a rate


class LslSensor:
    """The channels of one stream.

    stream: its name. kind: its type, as LSL has it ("EEG", "MoCap"); any unless told. channels: where each channel
    stands, by the label or the number from 0. units: by channel or pattern; a stream that says another one is refused.
    timeout: [s] for which it is looked for at the start. A stream that vanishes gives nothing until it is back.
    Raises OptionError and ChannelError; `start` where there is no such stream, or it does not have these channels.
    """

    def __init__(
        self,
        name: str,
        stream: str,
        channels: Mapping[str, str | int],
        *,
        kind: str = "",
        units: Mapping[str, str] | None = None,
        timeout: float = 3.0,
        scope: str = "machine",
    ) -> None:
        if not channels:
            raise OptionError(f"{name}: expected at least one channel, got none")
        if not timeout > 0:
            raise OptionError(f"{name}: expected a timeout > 0 s, got {timeout}")
        check_unique(list(channels))
        unit_of = spread(units or {}, list(channels))
        self._lsl = load_lsl(scope)
        self.name = name
        self.signals = tuple(Signal(channel, unit_of.get(channel, "")) for channel in channels)
        self._places = {channel: str(place) for channel, place in channels.items()}
        self._wanted = f"name={_quoted(stream)}" + (f" and type={_quoted(kind)}" if kind else "")
        self._timeout = timeout
        self._clock: Clock | None = None
        self._inlet: Any = None
        self._search: Any = None
        self._columns: list[int] = []

    def start(self, clock: Clock) -> None:
        """Find the stream and begin to listen."""
        self.stop()
        found = self._lsl.resolve_bypred(self._wanted, 1, self._timeout)
        if found:  # the first was enough for that: a second takes a moment longer
            found = self._lsl.resolve_bypred(self._wanted, 2, SECOND) or found
        if len(found) != 1:
            there = found or self._lsl.resolve_streams(1.0)
            names = listing(f"{s.name()!r} of type {s.type()!r} from {s.hostname()}" for s in there)
            raise OptionError(f"{self.name}: expected one LSL stream with {self._wanted}, found {names}")
        if found[0].channel_format() == self._lsl.cf_string:
            raise OptionError(f"{self.name}: expected a stream of numbers, got one of texts with {self._wanted}")
        inlet = self._open(found[0])
        try:
            self._columns = self._find(inlet.info(self._timeout))
            inlet.open_stream(self._timeout)
        except (self._lsl.util.TimeoutError, self._lsl.util.LostError):
            raise OptionError(
                f"{self.name}: the stream with {self._wanted} was found, and did not answer in {self._timeout:g} s"
            ) from None
        self._inlet, self._clock = inlet, clock

    def read(self) -> list[Sample]:
        """All that came since the last call."""
        if self._clock is None or not self._listening():
            return []
        rows, stamps = list[list[float]](), list[float]()
        try:
            while True:
                values, times = self._inlet.pull_chunk(timeout=0.0, max_samples=CHUNK)
                rows += values
                stamps += times
                if len(times) < CHUNK:
                    break
        except self._lsl.util.LostError:  # others liblsl finds again by itself
            self._inlet, self._search = None, self._lsl.ContinuousResolver(pred=self._wanted)
        now = self._clock.now()
        return [
            Sample(np.array([row[i] for i in self._columns], dtype=np.float64), stamp, now)
            for row, stamp in zip(rows, stamps, strict=True)
        ]

    def stop(self) -> None:
        """Let go of the stream."""
        self._clock = self._inlet = self._search = None

    def _open(self, info: Any) -> Any:
        # liblsl's own recovery knows a stream by its source_id, and cannot ask for a name with an apostrophe.
        recover = bool(info.source_id()) and "'" not in info.name() + info.type() + info.source_id()
        return self._lsl.StreamInlet(info, max_buflen=BUFFER, recover=recover)

    def _listening(self) -> bool:
        """Whether there is a stream; of one that was lost, whether it is back."""
        if self._inlet is None:
            back = [info for info in self._search.results() if info.channel_count() > max(self._columns)]
            if back:
                self._inlet, self._search = self._open(back[0]), None
        return self._inlet is not None

    def _find(self, info: Any) -> list[int]:
        """Where the channels stand in a sample."""
        labels, units = [""] * info.channel_count(), [""] * info.channel_count()
        part = info.desc().child("channels").child("channel")
        for i in range(len(labels)):
            labels[i], units[i] = part.child_value("label"), part.child_value("unit")
            part = part.next_sibling("channel")
        columns = []
        for signal in self.signals:
            place = self._places[signal.name]
            fits = [i for i, label in enumerate(labels) if label == place]
            if not fits and place.isascii() and place.isdecimal() and int(place) < len(labels):
                fits = [int(place)]
            if len(fits) != 1:
                offered = listing(label or str(i) for i, label in enumerate(labels))
                raise OptionError(f"{self.name}: expected one channel {place!r} in the stream, which has {offered}")
            unit = units[fits[0]]
            if unit and signal.unit and unit != signal.unit:
                raise OptionError(
                    f"{self.name}: {signal.name!r} is in {unit!r} in the stream, expected {signal.unit!r}"
                )
            columns += fits
        return columns


class LslMarkers:
    """A stream of all that happens in a run, one JSON text an event: time [s, the loop's clock], kind, reason, states.

    It is a listener: call it with an event. stream: its name. kind: its type. Never waits.
    """

    def __init__(
        self, name: str = "markers", stream: str = "inphase", *, kind: str = "Markers", scope: str = "machine"
    ) -> None:
        self._lsl = load_lsl(scope)
        self.name = name
        self._info = self._lsl.StreamInfo(stream, kind, 1, 0, "string", f"inphase {stream}")
        self._outlet: Any = None

    def start(self) -> None:
        """Offer the stream."""
        self._outlet = self._lsl.StreamOutlet(self._info)

    def __call__(self, event: RecordedEvent) -> None:
        """Send one event; nothing where it has not begun."""
        if self._outlet is not None:
            self._outlet.push_sample([as_json(event)])

    def stop(self) -> None:
        """Take the stream away."""
        self._outlet = None


def _quoted(text: str) -> str:
    quote = '"' if "'" in text else "'"
    if quote in text:
        raise OptionError(f"expected a name with one kind of quotation mark at most, got {text!r}")
    return f"{quote}{text}{quote}"
