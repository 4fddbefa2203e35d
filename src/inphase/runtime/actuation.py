"""The robot's side of the loop: where it stands, what is wrong, what it is sent, and who brakes it."""

from __future__ import annotations

from collections import deque

import numpy as np
from jaxtyping import Float

from inphase.arrays import FloatArray
from inphase.errors import OptionError
from inphase.result import Estimate
from inphase.runtime.clock import Clock
from inphase.runtime.conduct import Conduct
from inphase.runtime.device import Robot, Sample
from inphase.runtime.guard import Guard
from inphase.runtime.journal import Journal
from inphase.runtime.lag import lag_of
from inphase.runtime.safety import State
from inphase.runtime.sender import Course, Sender
from inphase.runtime.watchdog import Watchdog

FIRST_ANSWER = 5.0  # [s] a robot may take for it
MOST_BRAKING = 10.0  # [s] to bring the robot to rest at the end, before the program leaves it
REMEMBERED = 4096  # commands by which the robot's lag is measured
THERE = 1e-6  # [unit]: as near to where retreats end


class Actuation:
    """Sends the robot what is wanted of it, as long as nothing is wrong; `watchdog` brakes it where the loop does not.

    rate: of commands [1/s]. horizon: [s] of trajectories; None for single points.
    """

    def __init__(
        self, robot: Robot, conduct: Conduct, rate: float, horizon: float | None, clock: Clock, journal: Journal
    ) -> None:
        self.robot, self.conduct = robot, conduct
        self.commands = 0
        self._signals = tuple(signal.name for signal in robot.signals)
        self._clock, self._journal, self._period = clock, journal, 1 / rate
        patience = conduct.watchdog or max(5 * self._period, 0.1)
        self.sender = Sender(robot, conduct.limits, conduct.smoothing, self._period, horizon=horizon, silence=patience)
        self.guard = Guard(conduct.policy, conduct.late_commands, clock.now())
        self.watchdog = Watchdog(patience, self.brake, clock.now, again=self._period)
        self._well = 0.0  # when the robot last answered and took its commands
        self._refused = ""  # why the last command could not be sent
        self._followed: deque[tuple[float, FloatArray, FloatArray]] = deque(maxlen=REMEMBERED)

    @property
    def state(self) -> State:
        """What the robot does."""
        return self.guard.state

    @property
    def at_rest(self) -> bool:
        """Whether the robot is sent nowhere else."""
        return self.sender.at_rest(self._clock.now())

    @property
    def lag(self) -> float:
        """How far the robot was behind what it was sent of late [s]; NaN where that cannot be told."""
        if not self._followed:
            return float("nan")
        times, sent, measured = zip(*self._followed, strict=True)
        return lag_of(np.array(times), np.array(sent), np.array(measured))

    def start(self) -> None:
        """Start the robot and wait for its first answer; raises OptionError where none comes."""
        self.robot.start(self._clock)
        try:
            begun = self._clock.now()
            while (sample := self._answer()) is None:
                if self._clock.now() - begun > FIRST_ANSWER:
                    reason = f": {self._refused}" if self._refused else ""
                    raise OptionError(
                        f"{self.robot.name}: expected an answer within {FIRST_ANSWER:g} s, got none{reason}"
                    )
                self._clock.wait_until(self._clock.now() + 0.01)
        except BaseException:
            self.robot.stop()
            raise
        self._well = self._clock.now()
        self.sender.begin(sample.values, self._well)

    def command(
        self, now: float, course: Course | None, estimate: Estimate | None, unseen: tuple[str, ...], missed: int
    ) -> None:
        """React to what is wrong, and send what follows from it: `course` only where all is well.

        course: None brings the robot to rest, whatever else would be done. unseen, missed: as for `Guard.react`.
        """
        standing = self._look(now)
        braked = f"the loop stood still for {self.watchdog.patience:g} s" if self.watchdog.barked else ""
        event = self.guard.react(
            now, estimate, unseen, missed, braked, at_rest=self.sender.at_rest(now), arrived=self._arrived(now)
        )
        if event is not None:
            self._journal.tell(now, "safety", event.reason, event.before.name, event.after.name)
        if self.state is State.RETREATING and course is not None:
            course = self._retreat
        moves = self.state in (State.RUNNING, State.RETREATING) and self.guard.lost_robot is None
        self._send(now, course if moves else None)
        if standing is not None:
            self._followed.append((now, self.sender.positions(now), standing))
        self.watchdog.feed()

    def brake(self) -> None:
        """Bring the robot to rest, one step; from any thread."""
        now = self._clock.now()
        if not self.sender.at_rest(now):
            self._send(now, None)
            self._journal.flush()

    def stop(self) -> None:
        """Bring the robot to rest, and let go of it."""
        self.watchdog.stop()
        latest = self._clock.now() + MOST_BRAKING
        while not self.at_rest and self._clock.now() < latest:
            self.brake()
            self._clock.wait_until(self._clock.now() + self._period)
        try:
            self.robot.stop()
        except Exception as error:  # noqa: BLE001 - the sensors have to be stopped too
            told = f"{self.robot.name} could not be stopped: {type(error).__name__}: {error}"
            self._journal.tell(self._clock.now(), "robot", told)

    def _send(self, now: float, course: Course | None) -> None:
        try:
            command = self.sender.send(course, now)
        except Exception as error:  # noqa: BLE001 - a robot that fails is a lost one, and the policy says what then
            self._refused = f"{type(error).__name__}: {error}"
            return
        self._refused = ""
        self.commands += 1
        self._journal.command(now, command, self._signals)

    def _look(self, now: float) -> FloatArray | None:
        """Where the robot stands; None where it does not say. It is lost while it refuses, or is silent for too long.

        One that was lost for so long may have been moved: what it is sent begins where it stands. One that only missed
        a command is still on its way, and goes on from where it was sent.
        """
        sample, was_lost = self._answer(), self.guard.lost_robot is not None
        self.guard.lost_robot = self._refused or None
        if sample is None:
            if not self._refused and now - self._well > self.conduct.silence:
                self.guard.lost_robot = f"{self.robot.name} has said nothing for {self.conduct.silence:g} s"
            return None
        if was_lost and now - self._well > self.conduct.silence:
            self.sender.begin(sample.values, now)
        if not self._refused:
            self._well = min(sample.received, now)
            if was_lost:
                self._journal.tell(now, "robot", f"{self.robot.name} answers again")
        return sample.values

    def _answer(self) -> Sample | None:
        """Where the robot says it stands; None where it says nothing, or nothing new."""
        try:
            sample = self.robot.state()
        except Exception as error:  # noqa: BLE001 - as for its commands
            self._refused = f"{type(error).__name__}: {error}"
            return None
        if sample is None or not np.isfinite(sample.values).all():
            return None
        return sample if self._clock.now() - sample.received <= self.conduct.silence else None

    def _arrived(self, now: float) -> bool:
        pose = self.conduct.retreat
        if pose is None or self.guard.lost_robot is not None:
            return False
        return bool(np.abs(self.sender.positions(now) - pose).max(initial=0.0) <= THERE)

    def _retreat(self, times: Float[np.ndarray, " S"], near: Float[np.ndarray, " D"]) -> Float[np.ndarray, "S D"]:
        pose = near if self.conduct.retreat is None else self.conduct.retreat
        return np.tile(pose, (len(times), 1))
