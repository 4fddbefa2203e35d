"""ROS 1: any topic as a sensor, and a robot that is commanded by joint trajectories.

Header stamps are those of another clock, whose offset and drift the synchroniser finds, so the machines' clocks need
not agree. So it is with simulated time (`/use_sim_time`): stamps count simulated seconds, which fits as long as the
simulation runs at about real time, and one that is paused or set back begins a new clock. Commands are stamped in ROS
time, simulated or not.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inphase.channels import check_unique, spread
from inphase.errors import OptionError, listing
from inphase.runtime.adapters.message_fields import Field, stamp_of
from inphase.runtime.adapters.ros1_node import join_ros, leave, message_class, subscribe, within
from inphase.runtime.clock import Clock
from inphase.runtime.device import Command, Sample, Signal

TRAJECTORY, POINT, STATE = (
    "trajectory_msgs/JointTrajectory",
    "trajectory_msgs/JointTrajectoryPoint",
    "sensor_msgs/JointState",
)
WAITING = 10  # commands that a slow receiver may leave waiting; rospy drops the oldest


class Ros1Sensor:
    """The numbers of a topic's messages, each by its place.

    type: such as sensor_msgs/JointState. fields: the place of every signal, such as position[elbow], pose.position.x
    or data[3]; what a message has not is NaN. units: by signal or pattern. capacity: messages that may wait to be read;
    of more, the oldest are dropped and counted (`dropped`). A message is stamped by its header, or by its receipt
    where that has none. Raises OptionError where ROS or the type is not installed, or has no such place.
    """

    def __init__(
        self,
        name: str,
        topic: str,
        type: str,
        fields: Mapping[str, str],
        units: Mapping[str, str] | None = None,
        capacity: int = 1000,
    ) -> None:
        if not fields:
            raise OptionError(f'{name}: expected fields, such as {{ giver_x = "position[elbow]" }}, got none')
        if capacity < 1:
            raise OptionError(f"{name}: expected a capacity of at least 1, got {capacity}")
        self.name, self.topic, self.type = name, topic, type
        unit_of = spread(units or {}, list(fields))
        self.signals = tuple(Signal(signal, unit_of.get(signal, "")) for signal in fields)
        self.dropped = 0
        self._fields = [Field(place) for place in fields.values()]
        example = message_class(type)()
        for field in self._fields:
            _check_place(name, type, field, example)
        self._samples: deque[Sample] = deque(maxlen=capacity)
        self._unseen = np.ones(len(fields), dtype=bool)
        self._taking = threading.Lock()  # of rospy's threads, one for each publisher: the loop never waits for it
        self._clock: Clock | None = None
        self._subscriber: Any = None

    def start(self, clock: Clock) -> None:
        """Subscribe; raises OptionError where no master answers, or the topic is of another type."""
        self.stop()
        self._clock = clock
        self._subscriber = subscribe(self.name, self.topic, self.type, self._take)

    def read(self) -> list[Sample]:
        """All that came since the last call, in the order it came."""
        return [self._samples.popleft() for _ in range(len(self._samples))]

    def stop(self) -> None:
        """Unsubscribe, and forget what was not read."""
        self._clock = None
        subscriber, self._subscriber = self._subscriber, None
        leave(subscriber)
        self._samples.clear()

    @property
    def unseen(self) -> tuple[str, ...]:
        """The signals for which no message has held a number yet: a joint that is misspelled, say."""
        return tuple(signal.name for signal, unseen in zip(self.signals, self._unseen, strict=True) if unseen)

    def _take(self, message: Any) -> None:
        clock = self._clock
        if clock is None:
            return
        received, stamp = clock.now(), stamp_of(message)
        values = np.array([field.of(message) for field in self._fields])
        with self._taking:
            self._unseen &= np.isnan(values)
            self.dropped += len(self._samples) == self._samples.maxlen
            self._samples.append(Sample(values, received if stamp is None else stamp, received))


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
        self._taking = threading.Lock()
        self._latest = np.full((3, len(self.joints)), np.nan)  # position, stamp, received; replaced, never changed
        self._clock: Clock | None = None
        self._ros: Any = None
        self._subscriber: Any = None
        self._publisher: Any = None

    def start(self, clock: Clock) -> None:
        """Subscribe and advertise; raises OptionError where no master answers, or a topic is of another type."""
        self.stop()
        self._clock, self._ros = clock, join_ros()
        command, state = self._topics
        self._subscriber = subscribe(self.name, state, STATE, self._take)
        self._publisher = within(
            self.name, lambda: self._ros.Publisher(command, self._trajectory, queue_size=WAITING, tcp_nodelay=True)
        )

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
        if clock is None or publisher is None or ros.is_shutdown():
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
        subscriber, publisher = self._subscriber, self._publisher
        self._subscriber = self._publisher = None
        leave(subscriber, publisher)
        self._latest = np.full((3, len(self.joints)), np.nan)

    def _take(self, message: Any) -> None:
        clock = self._clock
        if clock is None:
            return
        received, stamp = clock.now(), stamp_of(message)
        by_joint = dict(zip(message.name, message.position, strict=False))  # some state velocities alone
        with self._taking:
            latest = self._latest.copy()
            for i, joint in enumerate(self.joints):
                if np.isfinite(position := by_joint.get(joint, np.nan)):
                    latest[:, i] = position, received if stamp is None else stamp, received
            self._latest = latest


def _check_place(name: str, type: str, field: Field, example: Any) -> None:
    """Raise OptionError unless messages like this one may have a number there."""
    path, bracket, _ = field.place.partition("[")
    value = example
    for part in path.split("."):
        there = getattr(value, "__slots__", ())
        if part not in there:
            raise OptionError(f"{name}: {type} has no {field.place!r}: expected one of {listing(there)}, got {part!r}")
        value = getattr(value, part)
    if hasattr(value, "_type") or isinstance(value, str):
        kind = getattr(value, "_type", "text")
        raise OptionError(f"{name}: expected a number of {type} at {field.place!r}, got {kind}")
    if bool(bracket) != isinstance(value, (list, tuple, bytes)):
        expected = "a number" if bracket else f"a list, of which {path}[0] is the first entry"
        raise OptionError(f"{name}: {path!r} of {type} is {expected}, got {field.place!r}")
