"""Record a live run as MCAP, off the loop's thread: whatever the disk does, the loop goes on."""

from __future__ import annotations

import io
import math
import queue
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from os import PathLike
from pathlib import Path
from types import TracebackType

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import ArrayLike

from inphase.channels import Channel
from inphase.errors import ObservationError, OptionError, listing
from inphase.io import mcap_messages as messages
from inphase.io.atomic import check_target
from inphase.io.model_file import model_bytes, model_hash
from inphase.model import Model
from inphase.recording import RecordedCommand, RecordedEvent
from inphase.result import Estimate, Response

FLUSH_EVERY = 0.25  # [s]: what a killed process may lose, and a chunk of the file
LARGEST_TIME = 2**63  # [ns]
TELLS = "recorder"  # the kind of event that tells what is not in the file

Message = tuple[str, float, Callable[[], str]]  # topic, time, what writes its text: not on the loop's thread


class Recorder:
    """Writes one interaction to an MCAP file on a thread of its own, from a bounded queue.

    What is put waits for nothing. What does not fit into the queue is lost, counted (`lost`) and told by an event in
    the file at the place of the gap; when the file cannot be written any more, `failure` says why and all else is lost.
    The file is readable at any time, but for the last quarter of a second; after a loss of power, for what the system
    had not written yet. Times are those of the loop's clock [s]. Any thread may put, but only one samples.
    """

    def __init__(
        self,
        target: str | PathLike[str] | io.BufferedIOBase,
        channels: Sequence[Channel],
        provenance: Mapping[str, str] | None = None,
        *,
        model: Model | None = None,
        name: str = "",
        capacity: int = 4096,
    ) -> None:
        """Open a new file, or take a stream that is open, and begin to write.

        channels: all of the model. provenance: see `replay.provenance_of`. model: kept in the file, so that nothing
        else is needed to replay it. capacity: samples, responses, commands and events that may wait. Raises OptionError
        where the file is there already or cannot be written, or the model is not the one that the provenance names.
        """
        if capacity < 1:
            raise OptionError(f"expected a capacity of at least 1, got {capacity}")
        named = (provenance or {}).get("model", "none")
        if model is not None and named != model_hash(model):
            raise OptionError(
                f"expected a provenance that names the model, {model_hash(model)[:12]}…, got {named[:12]}: "
                "see provenance_of"
            )
        self.names = tuple(channel.name for channel in channels)
        self.failure: str | None = None
        self._capacity = capacity
        self._refused = self._untold = 0  # what did not fit, and what of it no event tells yet
        self._pending = self._unwritten = 0  # what is in the chunk that is not flushed, and what failed
        self._last, self._ended = 0.0, False
        self._queue: queue.SimpleQueue[tuple[Message, ...] | None] = queue.SimpleQueue()
        self._target = str(target) if isinstance(target, (str, PathLike)) else "the stream"
        self._own = _created(target) if isinstance(target, (str, PathLike)) else None
        # Not compressed: a quarter of a second of digits packs to half, and unpacking is the one way in which a file
        # of a stranger can ask for more memory than it has bytes. `mcap compress` does it afterwards.
        self._writer = Writer(
            self._own or target,  # type: ignore[arg-type]
            chunk_size=2**63,  # time alone ends a chunk
            compression=CompressionType.NONE,
        )
        self._ids: dict[str, int] = {}
        try:
            self._begin(messages.describe_run(name, channels, provenance or {}), model)
        except OSError as error:
            if self._own:
                _discard(self._own)
            raise OptionError(f"cannot write {self._target}: {error.strerror or error}") from None
        self._thread = threading.Thread(target=self._run, name="inphase recorder", daemon=True)
        self._thread.start()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def lost(self) -> int:
        """How many samples, responses, commands and events are not in the file and never will be."""
        return self._refused + self._unwritten

    # ------------------------------------------------------------------------------------------- on the loop's thread

    def put_step(self, values: ArrayLike | Mapping[str, float], estimate: Estimate) -> bool:
        """A sample as `Session.observe` was given it, and the estimate that came of it: both are written or neither.

        Returns whether it found a place in the queue. Raises ObservationError for more values than channels, or an
        unknown name.
        """
        if isinstance(values, Mapping):
            unknown = [name for name in values if name not in self.names]
            if unknown:
                raise ObservationError(f"unknown channel {listing(unknown)}; the channels are {listing(self.names)}")
            names, array = tuple(values), np.array(list(values.values()), dtype=np.float64)
        else:
            names, array = self.names, np.array(values, dtype=np.float64)
            if array.ndim != 1 or len(array) > len(names):
                raise ObservationError(f"expected at most {len(names)} values, got shape {array.shape}")
        at = estimate.time
        return self._put(
            (messages.OBSERVATION, at, partial(messages.observation, at, names, array)),
            (messages.ESTIMATE, at, partial(messages.estimate, estimate)),
        )

    def put_response(self, time: float, response: Response) -> bool:
        """A response made at a time; returns whether it found a place in the queue."""
        return self._put((messages.RESPONSE, time, partial(messages.response, response)))

    def put_command(self, command: RecordedCommand) -> bool:
        """What was really sent to the robot; returns whether it found a place in the queue."""
        return self._put((messages.COMMAND, command.time, partial(messages.command, command)))

    def put_event(self, event: RecordedEvent) -> bool:
        """What happened; returns whether it found a place in the queue."""
        return self._put((messages.EVENT, event.time, partial(messages.event, event)))

    def _put(self, *put: Message) -> bool:
        if self.failure is not None or self._queue.qsize() >= self._capacity:
            self._refused += 1
            self._untold += 1
            return False
        self._last = put[0][1]
        self._queue.put((*self._gap(), *put))
        return True

    def _gap(self) -> tuple[Message, ...]:
        """What is to be told of a loss before the next message."""
        if not self._untold:
            return ()
        told = RecordedEvent(self._last, TELLS, f"{self._untold} lost here: the queue was full")
        self._untold = 0
        return ((messages.EVENT, told.time, partial(messages.event, told)),)

    def close(self, timeout: float = 5.0) -> None:
        """Write what waits and end the file, in at most `timeout` [s]; what was not written by then is lost."""
        if not self._thread.is_alive():
            return
        gap = () if self.failure is not None else self._gap()
        if gap:
            self._queue.put(gap)
        self._queue.put(None)
        self._thread.join(timeout)
        if self._thread.is_alive():
            self.failure = f"cannot write {self._target}: it did not take what was left within {timeout:g} s"
            self._unwritten += self._pending + self._queue.qsize() - (not self._ended)  # less the None above

    # ---------------------------------------------------------------------------------------------- on its own thread

    def _begin(self, described: dict[str, str], model: Model | None) -> None:
        self._writer.start(library="inphase")
        self._writer.add_metadata(messages.DESCRIPTION, described)
        if model is not None:
            self._writer.add_attachment(0, 0, messages.MODEL, "application/octet-stream", model_bytes(model))
        for topic in messages.FIELDS:
            schema = self._writer.register_schema(f"inphase{topic}", "jsonschema", messages.schema(topic))
            self._ids[topic] = self._writer.register_channel(topic, "json", schema)
        self._writer.flush()

    def _run(self) -> None:
        try:
            self._write_all()
            self._writer.flush()
            self._pending = 0
            self._writer.finish()
            if self._own:
                self._own.close()
        except (OSError, ValueError) as error:  # a ValueError is what a closed stream raises
            reason = error.strerror if isinstance(error, OSError) else None
            self.failure = f"cannot write {self._target}: {reason or error}"
            self._unwritten += self._pending
            if self._own:
                with suppress(OSError):
                    self._own.close()
            if not self._ended:
                while self._queue.get() is not None:
                    self._unwritten += 1

    def _write_all(self) -> None:
        """Write what comes, until None does."""
        due = 0.0
        while True:
            try:
                put = self._queue.get(timeout=max(due - time.monotonic(), 0.0) if self._pending else None)
            except queue.Empty:
                put = ()
            if put is None:
                self._ended = True
                return
            if put:
                if not self._pending:
                    due = time.monotonic() + FLUSH_EVERY
                self._pending += 1
                self._write(put)
            if time.monotonic() >= due:
                self._writer.flush()
                self._pending = 0

    def _write(self, put: tuple[Message, ...]) -> None:
        try:
            texts = [(topic, at, text().encode()) for topic, at, text in put]
        except (TypeError, ValueError, AttributeError, OverflowError) as error:  # of another type than was promised
            self._unwritten += 1
            told = RecordedEvent(put[0][1], TELLS, f"one of {put[0][0]} lost, it cannot be written: {error}")
            texts = [(messages.EVENT, told.time, messages.event(told).encode())]
        for topic, at, data in texts:
            stamp = int(min(max(at * 1e9, 0.0), LARGEST_TIME)) if math.isfinite(at) else 0
            self._writer.add_message(self._ids[topic], stamp, data, stamp)


def _discard(file: io.BufferedWriter) -> None:
    with suppress(OSError):
        file.close()
    Path(file.name).unlink(missing_ok=True)


def _created(path: str | PathLike[str]) -> io.BufferedWriter:
    try:
        return check_target(path).open("xb")
    except FileExistsError:
        raise OptionError(f"cannot write {path}: it is there already, and a recording is never overwritten") from None
    except OSError as error:
        raise OptionError(f"cannot write {path}: {error.strerror}") from None
