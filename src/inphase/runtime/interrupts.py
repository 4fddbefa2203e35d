"""Ctrl-C and a request to terminate, as words to a loop: none of its cycles is torn apart by them."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
OWN = (signal.SIG_DFL, signal.default_int_handler)  # handlers that nobody has chosen
PATIENCE = 2  # times that they are words


@contextmanager
def interrupts(call: Callable[[int], object]) -> Iterator[None]:
    """Inside, those signals call `call` with their number; the third is a KeyboardInterrupt wherever the program is.

    Handlers of others stay, and so does all outside of the main thread, where Python has no signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before: dict[signal.Signals, Any] = {}
    came = 0

    def interrupt(number: int, frame: object) -> None:
        nonlocal came
        came += 1
        if came > PATIENCE:
            raise KeyboardInterrupt
        call(number)

    try:
        for number in SIGNALS:
            if signal.getsignal(number) in OWN:
                before[number] = signal.signal(number, interrupt)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
