"""A robot as a sensor: where it is, for a teacher who guides it by hand."""

from __future__ import annotations

from inphase.runtime.clock import Clock
from inphase.runtime.device import Robot, Sample


class RobotState:
    """The positions of a robot, under its own name; it is started and stopped with it, and never commanded."""

    def __init__(self, robot: Robot) -> None:
        self.name, self.signals = robot.name, robot.signals
        self._robot = robot
        self._last: float | None = None

    def start(self, clock: Clock) -> None:
        """Start the robot."""
        self._robot.start(clock)

    def read(self) -> list[Sample]:
        """Its state, if it is another than the last time; nothing where it does not answer."""
        state = self._robot.state()
        if state is None or state.stamp == self._last:
            return []
        self._last = state.stamp
        return [state]

    def stop(self) -> None:
        """Stop the robot."""
        self._robot.stop()
