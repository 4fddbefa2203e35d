"""The live loop: from its beginning to its end, and what others may ask of it on the way."""

from __future__ import annotations

import gc
import signal
import sys
from collections import deque
from collections.abc import Callable, Sequence

from inphase.result import Estimate
from inphase.runtime.actuation import Actuation
from inphase.runtime.clock import Clock
from inphase.runtime.conduct import Conduct
from inphase.runtime.device import Robot, Sensor, check_signals
from inphase.runtime.interrupts import interrupts
from inphase.runtime.journal import Journal
from inphase.runtime.perception import Perception, Sight
from inphase.runtime.playing import Play, Player
from inphase.runtime.rates import Rates
from inphase.runtime.run_report import REPORT, RunReport
from inphase.runtime.safety import Answer, State
from inphase.runtime.stages import Stages
from inphase.session import Session

TURN = 0.0002  # [s] for which another thread of Python may keep the loop waiting; it is 5 ms otherwise


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
        self.stages = Stages(self.perception, self.player, self.actuation, self.journal, clock, self.rates)
        self._begun = self._ended = 0.0
        self._ending = ""  # why it ends
        self._final: RunReport | None = None
        self._switching = sys.getswitchinterval()
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
        self._asked.append(self.stages.reset)

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
        gc.collect()
        gc.freeze()  # what is there stays, and the collector need not look at it again
        self._switching = sys.getswitchinterval()
        sys.setswitchinterval(TURN)
        try:
            self.actuation.start()
            try:
                self.perception.start(self.clock)
            except BaseException:
                self.actuation.stop()
                raise
        except BaseException:
            self._unfreeze()
            raise
        self._begun = now = self.clock.now()
        self.stages.begin(now)
        devices = [self.actuation.robot.name, *(sensor.name for sensor in self.perception.sensors)]
        self.journal.tell(now, "start", ", ".join(devices))

    @property
    def due(self) -> float:
        """When the next cycle is due [s]."""
        return self.stages.due

    @property
    def over(self) -> bool:
        """Whether the robot is at rest and nothing more is to be done."""
        if self.actuation.guard.failure is not None and self.actuation.guard.situation.waits:
            return self.actuation.at_rest  # nobody can make it go on
        return (bool(self._ending) and self.actuation.at_rest) or self.state is State.STOPPED

    def cycle(self) -> None:
        """Do whatever is due."""
        while self._asked:
            self._asked.popleft()()
        self.stages.cycle(bool(self._ending))
        self.journal.flush()
        if self.stages.over:
            self.finish("the interaction is over")

    def end(self) -> None:
        """Bring the robot to rest, and stop all devices."""
        self.actuation.stop()
        self.perception.stop()
        self._unfreeze()
        self._ended = self.clock.now()
        self.stages.tell_failed(self._ended)
        self.journal.tell(self._ended, "end", self._reason)
        self._final = self.report
        self.journal.tell(self._ended, REPORT, self._final.as_json)

    def _unfreeze(self) -> None:
        gc.unfreeze()
        sys.setswitchinterval(self._switching)

    @property
    def report(self) -> RunReport:
        """The figures so far; those of the whole run once it has ended."""
        if self._final is not None:
            return self._final
        return RunReport(
            duration=(self._ended or self.clock.now()) - self._begun,
            cycles=self.stages.cycles,
            overruns=self.stages.overruns,
            commands=self.actuation.commands,
            missed=self.stages.missed,
            timings={stage: timing.spread for stage, timing in self.stages.timings.items()},
            samples={
                sensor: {fate.value: count for fate, count in counts.items()}
                for sensor, counts in self.perception.synchroniser.counts.items()
            },
            skipped=self.perception.skipped + self.perception.synchroniser.unfetched,
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

    @property
    def _reason(self) -> str:
        if self.state is State.STOPPED:
            troubles = [e.reason for e in self.journal.events if e.kind == "safety" and e.after != "STOPPED"]
            return troubles[-1] if troubles else self.state.value
        return self._ending or self.state.value
