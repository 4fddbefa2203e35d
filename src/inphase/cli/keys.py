"""Single keys of a terminal, lines of a pipe, and signals: what tells a command that runs what to do next."""

from __future__ import annotations

import enum
import os
import re
import select
import signal
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import FrameType, MappingProxyType, TracebackType
from typing import Any


class Key(str, enum.Enum):
    """What is asked for; the values are the keys to press, or the words to write into a pipe."""

    TOGGLE = "space or enter"
    START = "start"
    STOP = "stop"
    DISCARD = "d"
    REDO = "r"
    QUIT = "q"
    END = "the end of the pipe"
    INTERRUPT = "Ctrl-C"
    HELP = "any other key"


KEYS: Mapping[str, Key] = MappingProxyType(
    {" ": Key.TOGGLE, "\n": Key.TOGGLE, "\r": Key.TOGGLE, "d": Key.DISCARD, "r": Key.REDO, "q": Key.QUIT}
)
WORDS: Mapping[str, Key] = MappingProxyType(
    {
        "": Key.TOGGLE,
        "start": Key.START,
        "stop": Key.STOP,
        **dict.fromkeys(("d", "discard"), Key.DISCARD),
        **dict.fromkeys(("r", "redo"), Key.REDO),
        **dict.fromkeys(("q", "quit"), Key.QUIT),
    }
)
SIGNALS: Mapping[str, Key] = MappingProxyType(  # by name: not every system has them all
    {
        "SIGUSR1": Key.TOGGLE,
        "SIGUSR2": Key.DISCARD,
        "SIGINT": Key.INTERRUPT,
        "SIGTERM": Key.INTERRUPT,
        "SIGHUP": Key.INTERRUPT,
    }
)
# What an arrow or a function key sends: letters among them mean no key. And the beginning of one.
ESCAPED = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|O.|[^\[O])", re.DOTALL)
BEGUN = re.compile(r"\x1b(?:\[[0-?]*[ -/]*|O)?$")

Handler = Callable[[int, FrameType | None], Any] | int | None


class Keys:
    """What was pressed, written or signalled since the last look; to be used in a `with` statement.

    A terminal gives each key as it is pressed, and is put back as it was however the block ends, and for as long as it
    is suspended (Ctrl-Z). Of a pipe, every line is a word; where it ends after some, that is `Key.END`, and where there
    never was any, as in /dev/null, signals alone are heard. The first interrupt is a `Key.INTERRUPT`, another does what
    it did before. Signals are heard on the main thread alone.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        """descriptor: of a file to read from, standard input unless told."""
        self._descriptor = _standard_input() if descriptor is None else descriptor
        self._is_terminal = self._descriptor is not None and os.isatty(self._descriptor)
        self._usual: list[Any] | None = None  # the terminal's settings
        self._before: dict[int, Handler] = {}  # the handlers of signals
        self._asked: list[Key] = []
        self._text, self._heard = "", False

    def __enter__(self) -> Keys:
        try:
            heard = threading.current_thread() is threading.main_thread()
            for name, key in SIGNALS.items():
                if heard and hasattr(signal, name):
                    self._listen(getattr(signal, name), key)
            if self._is_terminal:
                if heard:
                    self._before[signal.SIGTSTP] = signal.signal(signal.SIGTSTP, self._suspend)
                self._take()
        except BaseException:
            self._let_go()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._let_go()

    @property
    def is_terminal(self) -> bool:
        """Whether keys are pressed, and not written into a pipe."""
        return self._is_terminal

    def read(self) -> list[Key]:
        """All since the last call, in order; never waits."""
        asked, self._asked = self._asked, []
        return asked + (self._pressed() if self._is_terminal else self._written())

    def _pressed(self) -> list[Key]:
        text = ESCAPED.sub("", self._text + self._new())
        begun = BEGUN.search(text)
        self._text = begun.group() if begun else ""
        return [KEYS.get(letter.lower(), Key.HELP) for letter in text[: len(text) - len(self._text)]]

    def _written(self) -> list[Key]:
        *lines, self._text = (self._text + self._new()).split("\n")
        words = [line.strip().lower() for line in lines]
        self._heard = self._heard or bool(words)
        ended = [Key.END] if self._descriptor is None and self._heard else []
        self._heard = self._heard and not ended  # told once
        return [WORDS.get(word, Key.HELP) for word in words] + ended

    def _new(self) -> str:
        """What there is to read by now; nothing more after the end."""
        data = b""
        while self._descriptor is not None and select.select([self._descriptor], [], [], 0)[0]:
            try:
                piece = os.read(self._descriptor, 4096)
            except OSError:  # the terminal is gone
                piece = b""
            if not piece:
                self._descriptor = None
                data += b"\n" if self._text or data[-1:] not in (b"", b"\n") else b""  # the last line may lack its end
            data += piece
        return data.decode("utf-8", "replace")

    # ----------------------------------------------------------------------------------------------------- signals

    def _listen(self, number: int, key: Key) -> None:
        def heard(_: int, __: FrameType | None) -> None:
            self._asked.append(key)
            if key is Key.INTERRUPT:  # who asks twice does not want to wait
                signal.signal(number, self._before[number])

        self._before[number] = signal.getsignal(number)
        signal.signal(number, heard)

    def _suspend(self, number: int, _: FrameType | None) -> None:
        self._give_back()
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)  # stands still here, until it is continued
        signal.signal(number, self._suspend)
        self._take()

    def _let_go(self) -> None:
        self._give_back()
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        self._before.clear()

    # ----------------------------------------------------------------------------------------------------- terminal

    def _take(self) -> None:
        """Keys at once, and unseen; Ctrl-C and Ctrl-Z as ever."""
        import termios
        import tty

        assert self._descriptor is not None
        self._usual = termios.tcgetattr(self._descriptor)
        tty.setcbreak(self._descriptor)

    def _give_back(self) -> None:
        import termios

        if self._usual is not None and self._descriptor is not None:
            with suppress(termios.error):  # it is gone
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._usual)
        self._usual = None


def _standard_input() -> int | None:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # none, or one that was replaced or closed
        return None
