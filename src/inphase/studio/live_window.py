"""The last seconds of a run that is followed, in a memory that does not grow."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel
from inphase.io import News
from inphase.recording import RecordedCommand, RecordedEvent
from inphase.result import Estimate, Response
from inphase.runtime.run_report import REPORT, RunReport

POINTS = 600  # of each curve in the window: what comes closer together is drawn only now and then
EVENTS = 200  # that are remembered

T = TypeVar("T")


class Recent(Generic[T]):
    """What happened in the last seconds, at most `POINTS` a window, and the last of all."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._kept: deque[tuple[float, T]] = deque(maxlen=2 * POINTS)
        self.last: tuple[float, T] | None = None

    def put(self, time: float, what: T) -> None:
        """One more; what happened at no time is not kept."""
        if not math.isfinite(time):
            return
        self.last = time, what
        if not self._kept or abs(time - self._kept[-1][0]) >= self._seconds / POINTS:
            self._kept.append(self.last)

    def since(self, time: float) -> list[tuple[float, T]]:
        """All from then on; what happened before is forgotten."""
        while self._kept and self._kept[0][0] < time:
            self._kept.popleft()
        ends = [self.last] if self.last is not None and (not self._kept or self._kept[-1] is not self.last) else []
        return [*self._kept, *(end for end in ends if end[0] >= time)]


@dataclass(frozen=True, eq=False)
class Course:
    """How one channel went. Times (T,) [s] of the run; what was not known is NaN."""

    times: Float[np.ndarray, " T"]
    mean: Float[np.ndarray, " T"]
    std: Float[np.ndarray, " T"]


class LiveWindow:
    """Hears the news of a run; the last `seconds` of it stand in `estimates`, `course`, `sent` and `read`.

    begin: when it began [s]; `newest`, of its sample, `events`, newest first, of `told` in all, and `report` are of the
    whole run; times are given from the begin on.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.clear()

    def clear(self) -> None:
        """Forget all."""
        self.begin: float | None = None
        self.newest = math.nan
        self.channels: tuple[Channel, ...] = ()
        self.events: deque[RecordedEvent] = deque(maxlen=EVENTS)
        self.told = 0
        self.state = ""
        self.report: RunReport | None = None
        self._count = 0
        self._estimates = Recent[Estimate](self.seconds)
        self._samples = Recent[Float[np.ndarray, " D"]](self.seconds)
        self._responses = Recent[Response](self.seconds)
        self._sent = Recent[RecordedCommand](self.seconds)
        self._response: Response | None = None

    def hear(self, news: News, channels: Sequence[Channel]) -> None:
        """What came since the last look."""
        if news.anew:
            self.clear()
        self.channels = tuple(channels)
        for event in news.events:
            self._hear_event(event)
        for time, values in zip(news.times.tolist(), news.values, strict=True):
            self._samples.put(time, values)
        for estimate in news.estimates:
            self._estimates.put(estimate.time, estimate)
            self.newest = estimate.time if math.isfinite(estimate.time) else self.newest
            self.begin = self.newest if self.begin is None and self.newest == self.newest else self.begin
        for _, response in sorted(news.responses.items()):
            if len(response.times):
                self._response = response
                self._responses.put(float(response.times[0]), response)
        for command in news.commands:
            if len(command.times):
                self._sent.put(command.time, command)

    def _hear_event(self, event: RecordedEvent) -> None:
        if event.kind == REPORT:
            self.report = _report(event.reason)
            return
        if event.kind == "start" and math.isfinite(event.time):
            self.begin = event.time
        self.state = event.after or self.state
        self.events.appendleft(event)
        self.told += 1

    @property
    def estimate(self) -> Estimate | None:
        """The newest."""
        return None if self._estimates.last is None else self._estimates.last[1]

    @property
    def now(self) -> float:
        """The time of the newest sample, from the begin on [s]; 0 where there is none."""
        return 0.0 if self.begin is None or self.newest != self.newest else self.newest - self.begin

    @property
    def estimates(self) -> tuple[Float[np.ndarray, " T"], list[Estimate]]:
        """Times and estimates of the window."""
        found = self._estimates.since(self._oldest)
        return self._since_begin([time for time, _ in found]), [estimate for _, estimate in found]

    def read(self, name: str) -> Course:
        """What a channel read; without a standard deviation."""
        names = [channel.name for channel in self.channels]
        found = self._samples.since(self._oldest) if name in names else []
        values = np.array([row[names.index(name)] for _, row in found], dtype=np.float64)
        return Course(self._since_begin([time for time, _ in found]), values, np.full(len(values), np.nan))

    def course(self, name: str) -> Course:
        """What the responses said of a channel for the time they were made for: the first of each."""
        found = [(time, r) for time, r in self._responses.since(self._oldest) if name in r.channels]
        rows = [(r.mean[0, i], r.std[0, i]) for _, r in found for i in [r.channels.index(name)]]
        mean, std = np.array(rows, dtype=np.float64).reshape(-1, 2).T
        return Course(self._since_begin([time for time, _ in found]), mean, std)

    def response(self, name: str) -> Course:
        """What the newest response says of a channel from now on."""
        made = self._response
        if made is None or name not in made.channels:
            return Course(np.zeros(0), np.zeros(0), np.zeros(0))
        i, every = made.channels.index(name), -(-len(made.times) // POINTS)
        times = self._since_begin(made.times[::every].tolist())
        return Course(times, made.mean[::every, i], made.std[::every, i])

    def sent(self, name: str) -> Course:
        """What the robot was sent for a signal of that name: the first point of each command."""
        found = [
            (c.times[0], c.positions[0, c.signals.index(name)])
            for _, c in self._sent.since(self._oldest)
            if name in c.signals
        ]
        times, positions = np.array(found, dtype=np.float64).reshape(-1, 2).T
        return Course(self._since_begin(times.tolist()), positions, np.full(len(positions), np.nan))

    @property
    def _oldest(self) -> float:
        return self.newest - self.seconds if self.newest == self.newest else -math.inf

    def _since_begin(self, times: Sequence[float]) -> Float[np.ndarray, " T"]:
        return np.array(times, dtype=np.float64) - (self.begin or 0.0)


def _report(told: str) -> RunReport | None:
    """None for one that cannot be read: it is shown beside what can."""
    try:
        report = RunReport.of_json(told)
        return report if report.lines else None
    except (ValueError, TypeError, AttributeError, LookupError):
        return None
