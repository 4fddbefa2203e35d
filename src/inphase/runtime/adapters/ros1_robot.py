"""ROS 1: a robot whose joints are read from joint states and moved by joint trajectories.

Commands are stamped in ROS time, which is simulated where `/use_sim_time` is set: then they fit as long as the
simulation runs at about real time.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inphase.channels import check_unique, spread
from inphase.errors import OptionError, listing
from inphase.runtime.adapters.message_fields import Field, stamp_of
from inphase.runtime.adapters.ros1_node import WAIT, Master, join_ros, leave, message_class, subscribe, within
from inphase.runtime.clock import Clock
from inphase.runtime.device import Command, Sample, Signal

TRAJECTORY, POINT = "trajectory_msgs/JointTrajectory", "trajectory_msgs/JointTrajectoryPoint"
STATE = "sensor_msgs/JointState"
WAITING = 10  # commands that a slow receiver may leave waiting; rospy drops the oldest


class Ros1Robot:
    """Joints that are read from a JointState topic and moved by a JointTrajectory topic.

    joints: the robot's name of every signal, or a list where they have the same. command, state: topics; joints may
    come in several messages. silent_after: [s] after which a robot whose joints were not all read again does not
    answer. stamped: commands say when they begin in ROS time; without that they begin when they arrive, which is for
    machines whose clocks differ. shortest: [s] from now to the first point that is sent: what is due earlier is left
    out, but for a last point, which is then due. Points have positions only. Raises OptionError where ROS or a type
    is not installed, or for values that do not fit.
    """

    def __init__(
        self,
        name: str,
        joints: Mapping[str, str] | Sequence[str],
        command: str,
        state: str = "/joint_states",
        units: Mapping[str, str] | None = None,
        silent_after: float = 0.5,
        stamped: bool = True,
        shortest: float = 0.01,
    ) -> None:
        by_signal = dict(joints) if isinstance(joints, Mapping) else {joint: joint for joint in joints}
        if not by_signal or len(by_signal) != len(joints):
            raise OptionError(f"{name}: expected joints of different names, got {listing(joints)}")
        check_unique(list(by_signal.values()))
        if not 0 < silent_after < np.inf:
            raise OptionError(f"{name}: expected a finite silent_after > 0 s, got {silent_after}")
        if not 0 <= shortest < np.inf:
            raise OptionError(f"{name}: expected a finite shortest >= 0 s, got {shortest}")
        self.name, self.joints = name, tuple(by_signal.values())
        unit_of = spread(units or {}, list(by_signal))
        self.signals = tuple(Signal(signal, unit_of.get(signal, "")) for signal in by_signal)
        self._topics, self._silent_after, self._stamped, self._shortest = (
            (command, state),
            silent_after,
            stamped,
            shortest,
        )
        self._trajectory, self._point, _ = (message_class(type) for type in (TRAJECTORY, POINT, STATE))
        self._places = [Field(f"position[{joint}]") for joint in self.joints]
        self._taking = threading.Lock()
        self._latest = np.full((3, len(self.joints)), np.nan)  # position, stamp, received; replaced, never changed
        self._clock: Clock | None = None
        self._ros: Any = None
        self._subscriber: Any = None
        self._publisher: Any = None

    def start(self, clock: Clock) -> None:
        """Subscribe and advertise, and wait for who takes commands to connect, where there is one by now.

        Raises OptionError where no master answers, or the state's topic is of another type.
        """
        self.stop()
        self._clock, self._ros = clock, join_ros()
        command, state = self._topics
        self._subscriber = subscribe(self.name, state, STATE, self._take)
        self._publisher = within(
            self.name, lambda: self._ros.Publisher(command, self._trajectory, queue_size=WAITING, tcp_nodelay=True)
        )

        if Master().subscribed(self._ros.resolve_name(command)):
            end = time.monotonic() + WAIT
            while not self.listeners and time.monotonic() < end:
                time.sleep(0.01)

    def state(self) -> Sample | None:
        """The latest position of every joint, as old as the oldest; None where one was silent for too long."""
        clock, (positions, stamps, received) = self._clock, self._latest
        if clock is None or not (clock.now() - received <= self._silent_after).all():  # NaN is not
            return None
        oldest = int(np.argmin(received))
        return Sample(positions, float(stamps[oldest]), float(received[oldest]))

    def command(self, command: Command) -> None:
        """Publish what is still to come of it; nothing where the node was shut down."""
        if command.positions.shape[1] != len(self.joints):
            raise OptionError(
                f"{self.name}: expected {len(self.joints)} positions ({listing(self.joints)}), "
                f"got {command.positions.shape[1]}"
            )
        clock, ros, publisher = self._clock, self._ros, self._publisher
        if clock is None or publisher is None:
            return
        message = self._trajectory(joint_names=list(self.joints))
        stamp, due = ros.Time.now(), command.times - clock.now()
        first = min(int(np.searchsorted(due, self._shortest)), len(due) - 1)
        message.header.stamp = stamp if self._stamped else ros.Time()
        message.points = [
            self._point(positions=row, time_from_start=ros.Duration.from_sec(max(after, self._shortest)))
            for row, after in zip(command.positions[first:].tolist(), due[first:].tolist(), strict=True)
        ]
        publisher.publish(message)

    def stop(self) -> None:
        """Unsubscribe, and command nothing any more; the robot ends what it was last told."""
        self._clock = None
        leave(*(handle.unregister for handle in (self._subscriber, self._publisher) if handle is not None))
        self._subscriber = self._publisher = None
        self._latest = np.full((3, len(self.joints)), np.nan)

    @property
    def listeners(self) -> int:
        """How many nodes take its commands."""
        return int(self._publisher.get_num_connections()) if self._publisher is not None else 0

    def _take(self, message: Any) -> None:
        clock = self._clock
        if clock is None:
            return
        received, stamp = clock.now(), stamp_of(message)
        with self._taking:
            latest = self._latest.copy()
            for i, place in enumerate(self._places):
                if np.isfinite(position := place.of(message)):
                    latest[:, i] = position, received if stamp is None else stamp, received
            self._latest = latest
