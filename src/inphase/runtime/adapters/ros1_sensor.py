"""ROS 1: any topic as a sensor.

Header stamps are those of another clock, whose offset and drift the synchroniser finds, so the machines' clocks need
not agree. So it is with simulated time (`/use_sim_time`): stamps count simulated seconds, which fits as long as the
simulation runs at about real time, and one that is paused or set back begins a new clock.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from inphase.channels import spread
from inphase.errors import OptionError, listing
from inphase.runtime.adapters.message_fields import Field, stamp_of
from inphase.runtime.adapters.ros1_node import leave, message_class, subscribe
from inphase.runtime.clock import Clock
from inphase.runtime.device import Sample, Signal


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
        if self._subscriber is not None:
            leave(self._subscriber.unregister)
        self._subscriber = None
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


def _check_place(name: str, type: str, field: Field, example: Any) -> None:
    """Raise OptionError unless messages like this one may have a number there."""
    path, bracket, _ = field.place.partition("[")
    value = example
    for part in path.split("."):
        there = getattr(value, "__slots__", ())
        if part not in there:
            expected = f"one of {listing(there)}" if there else "no part of what is no message"
            raise OptionError(f"{name}: {type} has no {field.place!r}: expected {expected}, got {part!r}")
        value = getattr(value, part)
    if hasattr(value, "_type") or isinstance(value, str):
        kind = getattr(value, "_type", "text")
        raise OptionError(f"{name}: expected a number of {type} at {field.place!r}, got {kind}")
    if bool(bracket) != isinstance(value, (list, tuple, bytes)):
        expected = "a number" if bracket else f"a list, of which {path}[0] is the first entry"
        raise OptionError(f"{name}: {path!r} of {type} is {expected}, got {field.place!r}")
