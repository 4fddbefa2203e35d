"""The one way to the robot: smooth → limit → command, whoever sends, so that the limits hold for all that is sent."""

from __future__ import annotations

import threading
from collections.abc import Callable
from math import ceil

import numpy as np
from jaxtyping import Float

from inphase.arrays import FloatArray
from inphase.errors import OptionError
from inphase.runtime.device import Command, Robot
from inphase.runtime.limits import Limits
from inphase.runtime.smoothing import AlphaBeta, Motion

MOST_POINTS = 1000  # of a trajectory that is sent with every command
LONGEST_BRAKING = 2000  # points of a trajectory; a robot that takes longer to stand is braked by the next command

Course = Callable[[Float[np.ndarray, " S"], Float[np.ndarray, " D"]], Float[np.ndarray, "S D"]]


class Sender:
    """Sends single points, or trajectories that all end at rest.

    period: [s] from one command to the next. horizon: [s] of a trajectory; None for single points. silence: [s] without
    a command after which the robot stands where it was sent last. Raises OptionError for limits of other channels.

    A trajectory goes on with the point that the one before it has reached and the next one, and is new from there: all
    that is ever sent lies on one grid of times, and so the limits hold across commands too. It ends at rest, so that a
    robot that is sent nothing more, because the program died, comes to rest within its limits by itself.
    """

    def __init__(
        self,
        robot: Robot,
        limits: Limits,
        smoothing: AlphaBeta,
        period: float,
        *,
        horizon: float | None = None,
        silence: float = 0.1,
    ) -> None:
        if len(limits) != len(robot.signals):
            raise OptionError(
                f"{robot.name}: expected limits for {len(robot.signals)} signals, got them for {len(limits)}"
            )
        self._robot, self._limits, self._smoothing = robot, limits, smoothing
        self._period, self._silence = period, silence
        self._points = 0 if horizon is None else max(ceil(min(horizon / period, MOST_POINTS + 1)), 1)
        if self._points > MOST_POINTS:
            longest = MOST_POINTS * period
            raise OptionError(f"response: expected a horizon of at most {longest:g} s at this rate, got {horizon:g}")
        self._hold = np.full(len(limits), np.nan)
        self._lock = threading.RLock()  # the watchdog brakes from a thread of its own
        self.begin(np.zeros(len(limits)), 0.0)

    def begin(self, positions: Float[np.ndarray, " D"], now: float) -> None:
        """(D,) where the robot stands, at rest; nothing is sent."""
        with self._lock:
            self._times = [now]
            self._positions: list[FloatArray] = [np.array(positions, dtype=np.float64)]
            self._velocities: list[FloatArray] = [np.zeros(len(positions))]
            self._motions = [Motion.at_rest(positions)]

    def positions(self, now: float) -> Float[np.ndarray, " D"]:
        """(D,) where the robot is sent at that time [s]; between two points of a trajectory on their line."""
        with self._lock:
            place = self._reached(now)
            here, following = self._positions[place], self._positions[place : place + 2][-1]
            share = min(max((now - self._times[place]) / self._period, 0.0), 1.0)
            return np.asarray(here + share * (following - here))

    def at_rest(self, now: float) -> bool:
        """Whether it is not sent anywhere else from that time on [s]."""
        with self._lock:
            return not any(velocity.any() for velocity in self._velocities[self._reached(now) :])

    def send(self, course: Course | None, now: float) -> Command:
        """Send what is wanted by a course of (S,) times [s], near (D,) the last position; None brings it to rest.

        Answers what was really sent; raises whatever the robot does.
        """
        with self._lock:
            command = self._trajectory(course, now) if self._points else self._point(course, now)
            self._robot.command(command)
        return command

    def _reached(self, now: float) -> int:
        """The last point whose time has come."""
        return max(int(np.searchsorted(self._times, now, side="right")) - 1, 0)

    def _point(self, course: Course | None, now: float) -> Command:
        now = max(now, self._times[-1])  # who waited for the other thread looked at the clock before it
        dt = now - self._times[-1]
        if dt > self._silence:  # it has come to rest there, and goes on as from any rest
            self.begin(self._positions[-1], now)
            dt = self._period
        wanted = self._hold if course is None else course(np.array([now]), self._positions[-1])[0]
        self._extend(now, wanted, dt)
        del self._times[:-1], self._positions[:-1], self._velocities[:-1], self._motions[:-1]
        return Command(np.array(self._times), np.stack(self._positions))

    def _trajectory(self, course: Course | None, now: float) -> Command:
        reached = self._reached(now)
        if reached == len(self._times) - 1:  # all was played, and ended at rest
            self.begin(self._positions[-1], now)
            reached = 0
        del self._times[:reached], self._positions[:reached], self._velocities[:reached], self._motions[:reached]
        del self._times[2:], self._positions[2:], self._velocities[2:], self._motions[2:]
        times = self._times[-1] + self._period * np.arange(1, self._points + 1)
        if course is not None:
            for time, wanted in zip(times, course(times, self._positions[-1]), strict=True):
                self._extend(float(time), wanted, self._period)
        while self._velocities[-1].any() and len(self._times) < LONGEST_BRAKING:
            self._extend(self._times[-1] + self._period, self._hold, self._period)
        return Command(np.array(self._times), np.stack(self._positions))

    def _extend(self, time: float, wanted: Float[np.ndarray, " D"], dt: float) -> None:
        """One more point: smoothed, then limited."""
        motion = self._smoothing.step(self._motions[-1], wanted)
        position, velocity = self._limits.limited(
            self._positions[-1],
            self._velocities[-1],
            np.where(np.isfinite(wanted), motion.positions, np.nan),
            dt,
            motion.steps / self._period,
        )
        held = ~np.isfinite(wanted)  # what is held goes on from where it comes to rest
        if held.any():
            motion = Motion(np.where(held, position, motion.positions), np.where(held, 0.0, motion.steps))
        self._times.append(time)
        self._positions.append(position)
        self._velocities.append(velocity)
        self._motions.append(motion)
