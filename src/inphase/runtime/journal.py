"""What happens in a run: written by a recorder, told to listeners, and the last of it remembered."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

from inphase.arrays import FloatArray
from inphase.recording import RecordedCommand, RecordedEvent
from inphase.result import Estimate, Response
from inphase.runtime.device import Command
from inphase.runtime.recorder import Recorder

Listener = Callable[[RecordedEvent], None]
REMEMBERED = 1000  # events


class Journal:
    """Takes down a run; nothing in it waits, and what goes wrong with a recorder or a listener is an event itself.

    What a cycle leaves is given to the recorder by `flush`, when the cycle is over: its thread would run in between.

    listeners: called with every event, on the loop's thread: they must not wait.
    """

    def __init__(self, recorder: Recorder | None = None, listeners: Sequence[Listener] = ()) -> None:
        self.events: deque[RecordedEvent] = deque(maxlen=REMEMBERED)
        self.recorder, self.listeners = recorder, list(listeners)
        self._known: set[tuple[str, str]] = set()
        self._waiting: deque[Callable[[], object]] = deque()

    @property
    def lost(self) -> int:
        """How many samples, responses, commands and events are not in the recording."""
        return 0 if self.recorder is None else self.recorder.lost

    @property
    def failure(self) -> str | None:
        """Why nothing is recorded any more."""
        return None if self.recorder is None else self.recorder.failure

    def step(self, values: FloatArray, estimate: Estimate) -> None:
        """A sample and what the session made of it."""
        if self.recorder is not None:
            self._waiting.append(partial(self.recorder.put_step, values, estimate))

    def response(self, time: float, response: Response) -> None:
        """A response made at that time [s]."""
        if self.recorder is not None:
            self._waiting.append(partial(self.recorder.put_response, time, response))

    def command(self, time: float, command: Command, signals: tuple[str, ...]) -> None:
        """What a robot with these signals was sent at that time [s]."""
        if self.recorder is not None:
            recorded = RecordedCommand(time, command.times, command.positions, signals)
            self._waiting.append(partial(self.recorder.put_command, recorded))

    def flush(self) -> None:
        """Give the recorder what waits for it."""
        while self._waiting:
            try:
                put = self._waiting.popleft()
            except IndexError:  # another thread was quicker
                return
            put()

    def tell(self, time: float, kind: str, reason: str, before: str = "", after: str = "") -> None:
        """An event at that time [s]."""
        event = RecordedEvent(time, kind, reason, before, after)
        self.events.append(event)
        if self.recorder is not None:
            self._waiting.append(partial(self.recorder.put_event, event))
            self.flush()
        failed = []
        for listener in tuple(self.listeners):
            try:
                listener(event)
            except Exception as error:  # noqa: BLE001 - who listens must not be able to stop a robot's loop
                self.listeners.remove(listener)
                failed.append(f"one failed and hears nothing more: {type(error).__name__}: {error}")
        for told in failed:  # when all have heard of the event itself
            self.tell(time, "listener", told)

    def tell_once(self, time: float, kind: str, reason: str) -> None:
        """An event that lasts, and is told when it begins."""
        if (kind, reason) not in self._known:
            self._known.add((kind, reason))
            self.tell(time, kind, reason)
