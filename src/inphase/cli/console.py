"""Where the commands print, and a sign of life where they take long."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console

PATIENCE = 1.0  # [s] before a command that says nothing says what it does
# Set to `plain`, what is being done is told on standard error as lines that a program reads: `doing learning from 8
# demonstrations`, `progress 0.37`.
PROGRESS = "INPHASE_PROGRESS"
WIDE = 160  # columns where nobody looks: a row stays on its line, for those who search


class Output(Console):
    """A console that prints what it is given as it is: names may hold brackets and colons. Lines are not broken.

    A closed pipe raises, as it does for `print`.
    """

    def __init__(self, quiet: bool = False, stderr: bool = False) -> None:
        looked_at = (sys.stderr if stderr else sys.stdout).isatty() or "COLUMNS" in os.environ
        width = None if looked_at else WIDE
        super().__init__(
            quiet=quiet, stderr=stderr, width=width, highlight=False, markup=False, emoji=False, soft_wrap=True
        )

    def on_broken_pipe(self) -> None:
        """Leave it to `main`."""
        raise BrokenPipeError


def counted(number: int, thing: str) -> str:
    """'1 episode', '2 episodes'."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Say on standard error, if that is a terminal, what is being done once it has taken more than a second.

    For a program that watches: INPHASE_PROGRESS=plain.
    """
    if _watched():
        _say(f"doing {what}")
        yield
        return
    console = Output(stderr=True)
    if not console.is_terminal:
        yield
        return
    status = console.status(f"{what} …")
    timer = threading.Timer(PATIENCE, status.start)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # it may be about to start
        status.stop()


@contextmanager
def working(what: str) -> Iterator[Callable[[float], None] | None]:
    """A bar with the time that is left, on standard error if that is a terminal; to be told the share that is done.

    For a program that watches: INPHASE_PROGRESS=plain.
    """
    if _watched():
        _say(f"doing {what}")
        yield lambda share: _say(f"progress {share:.3f}")
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Output(stderr=True)
    if not console.is_terminal:
        yield None
        return
    shown = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), TextColumn("left"))
    with Progress(*shown, console=console, transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


def _watched() -> bool:
    return os.environ.get(PROGRESS) == "plain"


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
