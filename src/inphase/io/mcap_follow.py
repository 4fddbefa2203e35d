"""Follow a recording while a live run writes it: what was appended since the last look, and nothing twice."""

from __future__ import annotations

import errno
import io
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.channels import Channel
from inphase.errors import InphaseError
from inphase.io.mcap_recording import UNREADABLE
from inphase.io.mcap_records import MAGIC, Records, last_time
from inphase.io.mcap_run import Gathered
from inphase.recording import RecordedCommand, RecordedEvent
from inphase.result import Estimate, Response

AT_ONCE = 4 * 2**20  # bytes
TAIL = 64  # bytes before what comes next, by which a file that was written over is known


@dataclass(frozen=True, eq=False)
class News:
    """What came since the last look, in the order of the file.

    anew: the file is another than before: forget what it told. times: (T,) [s]. values: (T, D) of all channels, NaN
    where one was not seen; both are read-only. responses: by the number of the estimate that each stands beside,
    counted from the first of the file.
    """

    times: Float[np.ndarray, " T"]
    values: Float[np.ndarray, "T D"]
    estimates: tuple[Estimate, ...] = ()
    responses: Mapping[int, Response] = field(default_factory=dict)
    commands: tuple[RecordedCommand, ...] = ()
    events: tuple[RecordedEvent, ...] = ()
    anew: bool = False

    def __post_init__(self) -> None:
        freeze(self, times=self.times, values=self.values)


def follow_recording(path: str | PathLike[str], *, last: float | None = None) -> Follower:
    """A follower of the recording there, which need not be there yet.

    last: of what is more than so many seconds older than the newest message when the file is first looked at, events
    alone are told [s]; all of it unless given.
    """
    return Follower(Path(path), last)


def has_end(path: Path) -> bool:
    """Whether a recording was closed, by its last bytes alone; raises OSError where it cannot be read."""
    with _opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        file.seek(max(size - len(MAGIC), 0))
        return size > len(MAGIC) and file.read(len(MAGIC)) == MAGIC


class Follower:
    """Gives what a recording tells as it grows; see `follow_recording`.

    It opens the file for reading for as long as a look takes, holds no lock and writes nothing: the run that writes it
    knows nothing of it, and cannot be slowed or stopped by it but as by any other program on the machine. It reads
    what was appended, and of a record that is not whole yet its head alone.

    trouble: why nothing more is taken, or could be at the last look; empty while all is well.
    """

    def __init__(self, path: Path, last: float | None) -> None:
        self.path, self.last = path, last
        self._forget()

    def __repr__(self) -> str:
        return f"Follower({str(self.path)!r}, {self._records.offset} of {self.size} bytes)"

    def _forget(self) -> None:
        self.trouble = ""
        self.size = 0  # [bytes] of the file when it was last looked at
        self._broken = False
        self._since = 0  # [ns]
        self._records, self._gathered = Records(), Gathered()
        self._file: tuple[int, int] | None = None
        self._seen = b""

    @property
    def there(self) -> bool:
        """Whether there was a file at the last look."""
        return self._file is not None

    @property
    def ended(self) -> bool:
        """Whether its recorder has closed it."""
        return self._records.ended

    @property
    def waiting(self) -> int:
        """How many bytes of the data are there and not taken: the rest of a record, or what was too much for a look."""
        return 0 if self.ended else self.size - self._records.offset

    @property
    def name(self) -> str:
        """What the run is called."""
        described = self._gathered.described
        return (described[0] if described else "") or self.path.stem

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Those of the model; none until the file has said them."""
        return self._gathered.channels

    @property
    def provenance(self) -> Mapping[str, str]:
        """Of what the run was made; empty until the file has said it."""
        return {} if self._gathered.described is None else self._gathered.described[2]

    def news(self, at_most: int = AT_ONCE) -> News:
        """What came since the last look; raises nothing for what is wrong with the file: `trouble` says it.

        at_most: bytes after which the rest is left for the next look; a record is taken as a whole.
        """
        anew = False
        try:
            with _opened(self.path) as file:
                found = os.fstat(file.fileno())
                if self._is_another(file, found):
                    anew = True
                    self._forget()
                if self._file is None and self.last is not None:
                    self._since = last_time(file, found.st_size) - int(self.last * 1e9)
                self._file, self.size = (found.st_dev, found.st_ino), found.st_size
                if not self._broken:
                    self.trouble = ""
                    self._take(file, at_most)
        except FileNotFoundError:
            anew = self.there
            self._forget()
        except OSError as error:  # it may go away
            self.trouble = f"{self.path}: cannot be read: {error.strerror or error}"
        return self._told(anew)

    def _take(self, file: io.BufferedIOBase, at_most: int) -> None:
        try:
            for record in self._records.take(file, self.size, at_most):
                self._gathered.take(record, self._since)
        except InphaseError as error:
            self._break(str(error))
        except UNREADABLE as error:
            self._break(f"its content is not that of a recording: {error!r}")
        if self._records.damage:
            self._break(self._records.damage)
        elif self.ended and self._gathered.described is None:
            self._break("expected a recording of inphase, got an MCAP file that tells of none")
        file.seek(max(self._records.offset - TAIL, 0))
        self._seen = file.read(self._known - file.tell())

    def _break(self, why: str) -> None:
        self.trouble, self._broken = f"{self.path}: {why}", True

    def _is_another(self, file: io.BufferedIOBase, found: os.stat_result) -> bool:
        """Whether this is not the file of the last look, gone on: replaced, cut, or written over."""
        if self._file is None:
            return False
        if self._file != (found.st_dev, found.st_ino) or found.st_size < self._records.offset:
            return True
        file.seek(max(self._records.offset - TAIL, 0))
        return file.read(len(self._seen)) != self._seen

    @property
    def _known(self) -> int:
        """Up to where the file can be no other without being another: what was taken, and how what is wrong begins."""
        return self._records.offset + (TAIL if self._broken else 0)

    def _told(self, anew: bool) -> News:
        told = self._gathered
        news = News(
            told.times,
            told.values,
            tuple(told.estimates),
            told.responses,
            tuple(told.commands),
            tuple(told.events),
            anew,
        )
        told.clear()
        return news


def _opened(path: Path) -> io.BufferedReader:
    """To be read; raises OSError for what is no file, as a pipe, which would be waited for."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, "it is no file")
    return path.open("rb")
