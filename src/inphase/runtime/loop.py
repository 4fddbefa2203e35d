"""The live loop: sense → observe → respond → smooth → limit → command, each at its rate, by one clock."""

from __future__ import annotations

import gc
import signal
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from inphase.errors import OptionError
from inphase.result import Estimate
from inphase.runtime.actuation import Actuation
from inphase.runtime.clock import Clock
from inphase.runtime.conduct import Conduct
from inphase.runtime.device import Robot, Sensor, check_signals
from inphase.runtime.interrupts import interrupts
from inphase.runtime.journal import Journal
from inphase.runtime.perception import Perception, Sight
from inphase.runtime.playing import Play, Player
from inphase.runtime.run_report import REPORT, RunReport
from inphase.runtime.safety import Answer, State
from inphase.runtime.schedule import Schedule
from inphase.runtime.timing import Timing
from inphase.session import Session

T = TypeVar("T")
STAGES = ("sense", "observe", "respond", "command", "cycle", "late")
SETTLES = 10  # commands after the end of the response, so that what smoothing and limits hold back is sent too


@dataclass(frozen=True)
class Rates:
    """How often [1/s] sensors are looked at, the session observes, a response is made, and a command is sent.

    observe: None for every reading by itself; else all that came since the last time is one observation, averaged.
    Raises OptionError for a rate that is not positive, or an `observe` above `sense`.
    """

    sense: float = 60.0
    observe: float | None = None
    respond: float = 30.0
    command: float = 60.0

    def __post_init__(self) -> None:
        for name in ("sense", "observe", "respond", "command"):
            rate = getattr(self, name)
            if rate is not None and not 0 < rate < inf:
                raise OptionError(f"rates: expected {name} > 0 [1/s], got {rate}")
        if self.observe is not None and self.observe > self.sense:
            raise OptionError(f"rates: expected observe <= sense, got {self.observe:g} and {self.sense:g} [1/s]")


class Loop:
    """Leads a robot through an interaction, by what sensors read of its partner.

    `run` does all; `begin`, `cycle` and `end` are its parts, for whoever has a loop already. Any thread may call
    `reset`, `go_on`, `interrupt` and `finish`, and read `estimate` and `state`; the rest belongs to one thread.
    shared_clock: the sensors whose stamps are of the loop's clock. Raises OptionError where sensors or robot do not
    fit the session's model, naming every channel.
    """

    def __init__(
        self,
        session: Session,
        sensors: Sequence[Sensor],
        robot: Robot,
        clock: Clock,
        conduct: Conduct,
        *,
        rates: Rates | None = None,
        play: Play | None = None,
        sight: Sight | None = None,
        shared_clock: Sequence[str] = (),
        journal: Journal | None = None,
    ) -> None:
        model, self.rates, play = session.model, rates or Rates(), play or Play()
        controlled = model.channels[len(model.observed) :]
        found = check_signals(controlled, [robot])
        self.clock, self.journal = clock, journal or Journal()
        self.perception = Perception(
            session,
            sensors,
            sight or Sight(),
            1 / self.rates.sense,
            shared_clock,
            merge=self.rates.observe is not None,
        )
        columns = [found[channel.name][1] for channel in controlled]
        self.player = Player(play, controlled, columns, len(robot.signals), model.phase.periodic)
        self.actuation = Actuation(robot, conduct, self.rates.command, play.horizon, clock, self.journal)
        self.timings = {stage: Timing() for stage in STAGES}
        self.cycles = self.overruns = self.missed = 0
        self._begun = self._ended = 0.0
        self._closing = inf  # when the interaction has been over for long enough
        self._ending = ""  # why it ends
        self._responded: Estimate | None = None
        self._asked: deque[Callable[[], None]] = deque()  # by other threads, for the next cycle

    def __repr__(self) -> str:
        devices = ", ".join([*(sensor.name for sensor in self.perception.sensors), self.actuation.robot.name])
        return f"Loop({self.perception.session.model!r} with {devices}; {self.rates})"

    # ------------------------------------------------------------------------------------------------ from any thread

    @property
    def estimate(self) -> Estimate | None:
        """The newest."""
        return self.perception.last

    @property
    def state(self) -> State:
        """What the robot does."""
        return self.actuation.state

    def reset(self) -> None:
        """Begin a new interaction with the next cycle."""
        self._asked.append(self._reset)

    def go_on(self) -> None:
        """Say that a robot that waits or has stopped may go on, once all is well."""
        self._asked.append(self.actuation.guard.go_on)

    def interrupt(self) -> None:
        """Do with the next cycle what the policy says of an interrupt; a second time, come to rest and end."""
        guard = self.actuation.guard
        guard.interrupts += 1
        if guard.interrupts > 1:
            self.finish("it was interrupted")

    def finish(self, reason: str) -> None:
        """Come to rest and end."""
        self._ending = self._ending or reason

    # ------------------------------------------------------------------------------------------------------ the loop

    def run(self, duration: float | None = None, *, watch: bool = True) -> RunReport:
        """Begin, go on until the interaction is over, the robot has stopped or `duration` [s] have passed, and end.

        watch: with the watchdog, a thread that looks at real time. Whatever happens, the robot is brought to rest
        first; what made the program fail is raised after that. Ctrl-C and SIGTERM are an `interrupt`, unless the
        program has handlers of its own for them.
        """
        from threadpoolctl import threadpool_limits

        # One thread: the products are small, and two wait for each other.
        with threadpool_limits(limits=1), interrupts(self._signalled):
            self.begin()
            try:
                if watch:
                    self.actuation.watchdog.start()
                while not self.over:
                    try:
                        self.clock.wait_until(self.due)
                        if duration is not None and self.clock.now() >= self._begun + duration:
                            self.finish(f"{duration:g} s have passed")
                        self.cycle()
                    except KeyboardInterrupt:
                        self.interrupt()
            finally:
                self.end()
        if self.actuation.guard.failure is not None:
            raise self.actuation.guard.failure
        return self.report

    def begin(self) -> None:
        """Start all devices; raises OptionError where the robot does not answer."""
        self.actuation.start()
        try:
            self.perception.start(self.clock)
        except BaseException:
            self.actuation.stop()
            raise
        gc.collect()
        gc.freeze()  # what is there stays, and the collector need not look at it again
        self._begun = now = self.clock.now()
        rates = self.rates
        steady = (rates.sense, rates.observe or rates.sense, rates.respond, rates.command)
        self._schedules = [Schedule(rate, now) for rate in steady]
        devices = [self.actuation.robot.name, *(sensor.name for sensor in self.perception.sensors)]
        self.journal.tell(now, "start", ", ".join(devices))

    @property
    def due(self) -> float:
        """When the next cycle is due [s]."""
        return min(schedule.due for schedule in self._schedules)

    @property
    def over(self) -> bool:
        """Whether the robot is at rest and nothing more is to be done."""
        if self.actuation.guard.failure is not None and self.actuation.guard.situation.waits:
            return self.actuation.at_rest  # nobody can make it go on
        return (bool(self._ending) and self.actuation.at_rest) or self.state is State.STOPPED

    def cycle(self) -> None:
        """Do whatever is due."""
        now = self.clock.now()
        self.timings["late"].add(now - self.due)
        while self._asked:
            self._asked.popleft()()
        sense, observe, respond, command = self._schedules
        for schedule, stage in ((sense, self._sense), (observe, self._observe), (respond, self._respond)):
            if schedule.is_due(now):
                schedule.done(now)
                try:
                    if self.actuation.guard.failure is None:
                        stage(now)
                except Exception as error:  # noqa: BLE001 - whatever it is, the robot has to be brought to rest
                    self.actuation.guard.failure = error
        sending = self.clock.now()  # what took too long before makes one command of several
        if command.is_due(sending):
            self._command(sending, command.done(sending))
        after = self.clock.now()
        self.timings["cycle"].add(after - now)
        self.cycles += 1
        self.overruns += after > self.due

    def end(self) -> None:
        """Bring the robot to rest, and stop all devices."""
        self.actuation.stop()
        self.perception.stop()
        gc.unfreeze()
        self._ended = self.clock.now()
        self._tell_failed(self._ended)
        self.journal.tell(self._ended, "end", self._reason)
        self.journal.tell(self._ended, REPORT, self.report.as_json)

    @property
    def report(self) -> RunReport:
        """The figures so far."""
        return RunReport(
            duration=(self._ended or self.clock.now()) - self._begun,
            cycles=self.cycles,
            overruns=self.overruns,
            commands=self.actuation.commands,
            missed=self.missed,
            timings={stage: timing.spread for stage, timing in self.timings.items()},
            samples={
                sensor: {fate.value: count for fate, count in counts.items()}
                for sensor, counts in self.perception.synchroniser.counts.items()
            },
            skipped=self.perception.skipped,
            late=self.perception.late,
            unrecorded=self.journal.lost,
            recorder_failure=self.journal.failure,
            lag=self.actuation.lag,
            ended=self._reason,
            stopped=self.state is State.STOPPED,
        )

    def _signalled(self, number: int) -> None:
        """Whoever asks to terminate does not wait until someone says that the robot may go on."""
        if number == signal.SIGTERM and self.actuation.conduct.policy.interrupt is Answer.HOLD:
            self.finish("it was asked to terminate")
        else:
            self.interrupt()

    # --------------------------------------------------------------------------------------------------- its stages

    def _sense(self, now: float) -> None:
        self._timed("sense", self.perception.sense)
        self._tell_failed(now)

    def _tell_failed(self, now: float) -> None:
        for sensor, reason in self.perception.failed.items():
            self.journal.tell_once(now, "sensor", f"{sensor} failed and is not read any more: {reason}")

    def _observe(self, now: float) -> None:
        begun = self.clock.now()
        for values, estimate in self.perception.observe(now):  # each is recorded before the next one can fail
            self.journal.step(values, estimate)
        self.timings["observe"].add(self.clock.now() - begun)

    def _respond(self, now: float) -> None:
        estimate = self.perception.last
        if estimate is None:
            return
        if estimate is not self._responded:  # else the last response still says all there is to say
            self._responded = estimate
            response = self._timed("respond", partial(self.player.respond, self.perception.session, estimate))
            if response is not None:
                self.journal.response(now, response)
        if not self.player.over:
            self._closing = inf
        elif self._closing == inf:  # what is left of it is played to its end
            self._closing = max(self.player.ends, now) + SETTLES / self.rates.command
        elif now >= self._closing and self.state not in (State.RETREATING, State.STOPPING):  # which have their own end
            self.finish("the interaction is over")

    def _command(self, now: float, missed: int) -> None:
        self.missed += missed
        course = None if self._ending else self._wanted
        command = partial(self.actuation.command, now, course, self.estimate, self.perception.unseen(now), missed)
        self._timed("command", command)
        if self.journal.failure is not None:
            self.journal.tell_once(now, "recorder", self.journal.failure)

    def _wanted(self, times: Float[np.ndarray, " S"], near: Float[np.ndarray, " D"]) -> Float[np.ndarray, "S D"]:
        try:
            return self.player.wanted(times, near)
        except Exception as error:  # noqa: BLE001 - it is not the robot that fails
            self.actuation.guard.failure = error
            return np.full((len(times), len(near)), np.nan)

    def _reset(self) -> None:
        now = self.clock.now()
        self.perception.reset(now)
        self.player.reset()
        self._closing = inf
        self.journal.tell(now, "reset", "a new interaction begins")

    def _timed(self, stage: str, call: Callable[[], T]) -> T:
        begun = self.clock.now()
        answer = call()
        self.timings[stage].add(self.clock.now() - begun)
        return answer

    @property
    def _reason(self) -> str:
        if self.state is State.STOPPED:
            troubles = [e.reason for e in self.journal.events if e.kind == "safety" and e.after != "STOPPED"]
            return troubles[-1] if troubles else self.state.value
        return self._ending or self.state.value
