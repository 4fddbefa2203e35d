"""Running command lines beside the page: told what they print, stopped when asked, and ended when the page is."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from inphase.errors import InphaseError
from inphase.studio.command import Command

MOST = 64_000_000  # characters that are kept of what a command prints
SHOWN = 200_000  # of what it says on standard error
GRACE = 8.0  # [s] from asking a command to stop until it is told, and from telling until it is killed
CHUNK = 65536
FRAME = "╭╮╰╯─│ "

Call = Callable[[], None]
T = TypeVar("T")


@dataclass(frozen=True)
class Outcome:
    """How a command ended: its exit code, what it printed and said on standard error, and whether it was stopped."""

    command: Command
    code: int
    output: str
    said: str
    stopped: bool = False

    @property
    def fine(self) -> bool:
        """Whether it did what it was asked to."""
        return self.code == 0

    @property
    def error(self) -> str:
        """What went wrong in one line; empty where nothing did."""
        if self.stopped:
            return "stopped"
        if self.fine:
            return ""
        lines = [line.strip(FRAME) for line in self.said.splitlines() if line.strip(FRAME)]
        if not lines:
            return f"ended with exit code {self.code}"
        told = [line for line in lines if line.startswith("inphase: ")]
        # A mistake in options stands first, in a frame; what a program did not expect stands last.
        return told[-1] if told else lines[-1 if "Traceback" in self.said else 0]


class Job:
    """A command that runs, in a process group of its own."""

    def __init__(self, command: Command) -> None:
        self.command = command
        self.doing = ""
        self.share: float | None = None  # that is done, where it is known
        self.stopped = False
        self.over = False
        self._process: asyncio.subprocess.Process | None = None
        self._ending: asyncio.Task[None] | None = None

    def stop(self) -> None:
        """Ask it to stop, as Ctrl-C does; what does not is killed."""
        if not (self.over or self.stopped):
            self.stopped = True
            if self._process is not None:
                self._ending = asyncio.get_running_loop().create_task(self._end())

    def kill(self) -> None:
        """End it at once."""
        self.stopped = True
        self._signal(signal.SIGKILL)

    async def _end(self) -> None:
        for sent in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            if self.over:
                return
            self._signal(sent)
            await asyncio.sleep(GRACE)

    def _signal(self, sent: signal.Signals) -> None:
        if self._process is not None and not self.over:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, sent)  # it leads its own group: its workers end with it

    async def run(self, folder: Path, changed: Call) -> Outcome:
        """Run it there; changed: called where what it is doing, or how much is done, is another."""
        self._process = process = await asyncio.create_subprocess_exec(
            *self.command.run_as,
            cwd=folder,
            env=_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        if self.stopped:  # before it was there
            self._signal(signal.SIGKILL)
        assert process.stdout is not None
        assert process.stderr is not None
        output, said = await asyncio.gather(_all(process.stdout), self._listen(process.stderr, changed))
        code = await process.wait()
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)  # what it has left behind
        self.over = True
        return Outcome(self.command, code, output, said, self.stopped)

    async def _listen(self, stream: asyncio.StreamReader, changed: Call) -> str:
        """What it says less the lines that tell how far it is."""
        kept, rest = "", b""
        while chunk := await stream.read(CHUNK):
            *lines, rest = (rest + chunk).split(b"\n")
            before = self.doing, self.share
            for line in lines:
                kept += self._heard(line.decode("utf-8", "replace"))
            kept, rest = kept[-SHOWN:], rest[-SHOWN:]
            if (self.doing, self.share) != before:
                changed()
        return kept + self._heard(rest.decode("utf-8", "replace")).rstrip("\n")

    def _heard(self, line: str) -> str:
        if line.startswith("doing "):
            self.doing, self.share = line[len("doing ") :].strip(), None
            return ""
        if line.startswith("progress "):
            with suppress(ValueError):
                self.share = min(max(float(line[len("progress ") :]), 0.0), 1.0)
            return ""
        return line + "\n"


def _environment() -> dict[str, str]:
    """Of a command: it runs elsewhere, and still is the inphase that runs here."""
    told = {"INPHASE_PROGRESS": "plain", "PYTHONUNBUFFERED": "1", "PYTHONIOENCODING": "utf-8"}
    if places := os.environ.get("PYTHONPATH"):
        told["PYTHONPATH"] = os.pathsep.join(os.path.abspath(place) for place in places.split(os.pathsep))
    return {**os.environ, **told}


async def _all(stream: asyncio.StreamReader) -> str:
    parts, size = [], 0
    while chunk := await stream.read(CHUNK):
        if size < MOST:
            parts.append(chunk)
        size += len(chunk)
    return b"".join(parts).decode("utf-8", "replace")


class Worker:
    """Runs the commands of one page.

    folder: where they run. bring: has a function called where the page may be changed.
    """

    def __init__(self, folder: Path, bring: Callable[[Call], object]) -> None:
        self.folder, self._bring = folder, bring
        self.jobs: list[Job] = []
        self._tasks: set[asyncio.Task[None]] = set()

    def run(
        self,
        command: Command,
        done: Callable[[Outcome], None],
        changed: Callable[[Job], None] = lambda job: None,
    ) -> Job:
        """Start it and return at once; done: told how it ended. changed: told when there is news of how far it is."""
        job = Job(command)
        self.jobs.append(job)
        task = asyncio.get_running_loop().create_task(self._see_through(job, done, changed))
        self._tasks.add(task)  # or it is collected while it runs
        task.add_done_callback(self._tasks.discard)
        return job

    async def _see_through(self, job: Job, done: Callable[[Outcome], None], changed: Callable[[Job], None]) -> None:
        try:
            outcome = await job.run(self.folder, lambda: self._tell(lambda: changed(job)))
        except OSError as error:
            outcome = Outcome(job.command, 1, "", f"cannot be run: {error.strerror}")
        job.over = True
        self.jobs.remove(job)
        self._tell(lambda: done(outcome))

    def think(self, work: Callable[[], T], done: Callable[[T], None], failed: Callable[[InphaseError], None]) -> None:
        """Have something worked out in a thread, which touches nothing of the page; done and failed: told what came."""
        task = asyncio.get_running_loop().create_task(self._think(work, done, failed))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _think(
        self, work: Callable[[], T], done: Callable[[T], None], failed: Callable[[InphaseError], None]
    ) -> None:
        try:
            found = await asyncio.to_thread(work)
        except InphaseError as error:
            refused = error
            self._tell(lambda: failed(refused))
        else:
            self._tell(lambda: done(found))

    def _tell(self, call: Call) -> None:
        self._bring(call)

    def close(self) -> None:
        """End all that runs, at once, and tell nobody any more."""
        self._bring = lambda call: None
        for job in self.jobs:
            job.kill()

    async def closed(self) -> None:
        """Close it, and wait until nothing runs: what was only being started ends too."""
        self.close()
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=GRACE)
