"""What is done in a cycle, in its order: sense → observe → respond → smooth → limit → command."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from inphase.result import Estimate
from inphase.runtime.actuation import Actuation
from inphase.runtime.clock import Clock
from inphase.runtime.journal import Journal
from inphase.runtime.perception import Perception
from inphase.runtime.playing import Player
from inphase.runtime.rates import Rates
from inphase.runtime.safety import State
from inphase.runtime.schedule import Schedule
from inphase.runtime.timing import Timing

T = TypeVar("T")
TIMED = ("sense", "observe", "respond", "command", "cycle", "late")
SETTLES = 10  # commands after the end of the response, so that what smoothing and limits hold back is sent too


class Stages:
    """Does each stage when it is due, and takes down how long it took.

    over: whether the interaction has come to its end, and its response has been played.
    """

    def __init__(
        self,
        perception: Perception,
        player: Player,
        actuation: Actuation,
        journal: Journal,
        clock: Clock,
        rates: Rates,
    ) -> None:
        self.timings = {stage: Timing() for stage in TIMED}
        self.cycles = self.overruns = self.missed = 0
        self.over = False
        self._perception, self._player, self._actuation, self._journal = perception, player, actuation, journal
        self._clock, self._rates = clock, rates
        self._schedules: list[Schedule] = []
        self._closing = inf  # when the interaction has been over for long enough
        self._responded: Estimate | None = None

    def begin(self, now: float) -> None:
        """All is due now [s]."""
        rates = self._rates
        steady = (rates.sense, rates.observe or rates.sense, rates.respond, rates.command)
        self._schedules = [Schedule(rate, now) for rate in steady]

    @property
    def due(self) -> float:
        """When the next cycle is due [s]."""
        return min(schedule.due for schedule in self._schedules)

    def cycle(self, ending: bool) -> None:
        """Do whatever is due; `ending` has the robot come to rest."""
        now, guard = self._clock.now(), self._actuation.guard
        self.timings["late"].add(now - self.due)
        sense, observe, respond, command = self._schedules
        for schedule, stage in ((sense, self._sense), (observe, self._observe), (respond, self._respond)):
            if schedule.is_due(now):
                schedule.done(now)
                try:
                    if guard.failure is None:
                        stage(now)
                except Exception as error:  # noqa: BLE001 - whatever it is, the robot has to be brought to rest
                    guard.failure = error
        sending = self._clock.now()  # what took too long before makes one command of several
        if command.is_due(sending):
            self._command(sending, command.done(sending), ending)
        after = self._clock.now()
        self.timings["cycle"].add(after - now)
        self.cycles += 1
        self.overruns += after > self.due

    def reset(self) -> None:
        """Begin a new interaction."""
        now = self._clock.now()
        self._perception.reset(now)
        self._player.reset()
        self._closing, self.over = inf, False
        self._journal.tell(now, "reset", "a new interaction begins")

    def tell_failed(self, now: float) -> None:
        """Say which sensors failed, each once."""
        for sensor, reason in self._perception.failed.items():
            self._journal.tell_once(now, "sensor", f"{sensor} failed and is not read any more: {reason}")

    def _sense(self, now: float) -> None:
        self._timed("sense", self._perception.sense)
        self.tell_failed(now)

    def _observe(self, now: float) -> None:
        begun = self._clock.now()
        for values, estimate in self._perception.observe(now):  # each is recorded before the next one can fail
            self._journal.step(values, estimate)
        self.timings["observe"].add(self._clock.now() - begun)

    def _respond(self, now: float) -> None:
        estimate = self._perception.last
        if estimate is None:
            return
        if estimate is not self._responded:  # else the last response still says all there is to say
            self._responded = estimate
            response = self._timed("respond", partial(self._player.respond, self._perception.session, estimate))
            if response is not None:
                self._journal.response(now, response)
        if not self._player.over:
            self._closing = inf
        elif self._closing == inf:  # what is left of it is played to its end
            self._closing = max(self._player.ends, now) + SETTLES / self._rates.command
        # A retreat and a stop have an end of their own.
        self.over = now >= self._closing and self._actuation.state not in (State.RETREATING, State.STOPPING)

    def _command(self, now: float, missed: int, ending: bool) -> None:
        self.missed += missed
        course, unseen = None if ending else self._wanted, self._perception.unseen(now)
        command = partial(self._actuation.command, now, course, self._perception.last, unseen, missed)
        self._timed("command", command)
        if self._journal.failure is not None:
            self._journal.tell_once(now, "recorder", self._journal.failure)

    def _wanted(self, times: Float[np.ndarray, " S"], near: Float[np.ndarray, " D"]) -> Float[np.ndarray, "S D"]:
        try:
            return self._player.wanted(times, near)
        except Exception as error:  # noqa: BLE001 - it is not the robot that fails
            self._actuation.guard.failure = error
            return np.full((len(times), len(near)), np.nan)

    def _timed(self, stage: str, call: Callable[[], T]) -> T:
        begun = self._clock.now()
        answer = call()
        self.timings[stage].add(self._clock.now() - begun)
        return answer
