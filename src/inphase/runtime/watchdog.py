"""A watchdog in a thread of its own: it calls when the loop has not fed it for too long."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

from inphase.errors import OptionError


class Watchdog:
    """Calls `bark` when it was not fed for `patience` [s]: once, or every `again` [s] until the next meal.

    now: the clock [s] it looks at. The thread sleeps until the next meal is due, so that feeding costs nothing. What
    `bark` raises is kept in `failure`, for the loop to report: the watchdog stays on watch. Use it in a `with`, or
    start and stop it. Raises OptionError for a patience that is not positive.
    """

    def __init__(
        self,
        patience: float,
        bark: Callable[[], object],
        now: Callable[[], float] = time.perf_counter,
        again: float | None = None,
    ) -> None:
        if not 0 < patience < threading.TIMEOUT_MAX:
            raise OptionError(f"watchdog: expected a finite patience > 0, got {patience}")
        self.patience = patience
        self.failure: Exception | None = None
        self._bark, self._again = bark, again
        self._now = now
        self._meal = (0, now())  # its number and time: one assignment, so that no lock is needed
        self._barked_after: int | None = None
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Watchdog:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    @property
    def barked(self) -> bool:
        """Whether it has called since it was last fed."""
        return self._barked_after == self._meal[0]

    def feed(self) -> None:
        """Say that the loop goes on; for each cycle."""
        self._meal = (self._meal[0] + 1, self._now())

    def check(self) -> float:
        """Bark if it is time to; how long [s] nothing has to be looked after. It is what the thread does."""
        number, fed = self._meal
        left = fed + self.patience - self._now()
        if left > 0:
            return left
        if self._barked_after == number and self._again is None:
            return self.patience
        self._barked_after = number
        try:
            self._bark()
        except Exception as failure:  # noqa: BLE001 - whatever it is, the next lapse has to be seen too
            self.failure = failure
        return self._again or self.patience

    def start(self) -> None:
        """Fed as of now, keep watch until it is stopped."""
        if self._thread is not None:
            return
        self._over.clear()
        self.feed()
        self._thread = threading.Thread(target=self._watch, name="inphase watchdog", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Watch no longer; when it returns no bark is under way, unless it is the bark that stops it."""
        thread, self._thread = self._thread, None
        self._over.set()
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    def _watch(self) -> None:
        left = self.check()
        while not self._over.wait(left):
            left = self.check()
