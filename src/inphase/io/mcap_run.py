"""What the messages of a recording tell, gathered: of a whole file, or of what came since the last look."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel
from inphase.io.mcap_messages import (
    COMMAND,
    DESCRIPTION,
    ESTIMATE,
    EVENT,
    OBSERVATION,
    RESPONSE,
    described_run,
    read_command,
    read_estimate,
    read_event,
    read_observation,
    read_response,
)
from inphase.recording import RecordedCommand, RecordedEvent
from inphase.result import Estimate, Response

if TYPE_CHECKING:
    from mcap.records import McapRecord

    from inphase.io.mcap_messages import Described


class Gathered:
    """Takes records in their order; what they told stands in its lists until `clear`.

    described: name, channels and provenance; None until the file has said them, and messages before that are not
    taken. responses: by the number of the estimate they stand beside, the last of several; `count` estimates came in
    all, those that were cleared away too.
    """

    def __init__(self) -> None:
        self.described: Described | None = None
        self.count = 0
        self._index: dict[str, int] = {}
        self._topics: dict[int, str] = {}
        self.clear()

    def clear(self) -> None:
        """Forget what the messages told."""
        self._samples: list[tuple[float, Float[np.ndarray, " D"]]] = []
        self.estimates: list[Estimate] = []
        self.responses: dict[int, Response] = {}
        self.commands: list[RecordedCommand] = []
        self.events: list[RecordedEvent] = []

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All of the model; none until the file has said them."""
        return () if self.described is None else self.described[1]

    @property
    def times(self) -> Float[np.ndarray, " T"]:
        """Of the samples [s]."""
        return np.array([time for time, _ in self._samples], dtype=np.float64)

    @property
    def values(self) -> Float[np.ndarray, "T D"]:
        """Of the samples, NaN where a channel was not seen."""
        rows = [values for _, values in self._samples]
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self.channels))

    def take(self, record: McapRecord, since: int = 0) -> None:
        """One more; raises DataError, or what a wrong entry raises, for a message that cannot be read.

        since: of messages before that time [ns], events alone are read, and estimates counted.
        """
        from mcap.records import Channel as Topic
        from mcap.records import Message, Metadata

        if isinstance(record, Metadata) and record.name == DESCRIPTION:
            self.described = described_run(record.metadata)
            self._index = {channel.name: i for i, channel in enumerate(self.channels)}
        elif isinstance(record, Topic):
            self._topics[record.id] = record.topic
        elif isinstance(record, Message) and self.described is not None:
            topic = self._topics.get(record.channel_id, "")
            if record.log_time >= since or topic == EVENT:
                self._tell(topic, record.data)
            elif topic == ESTIMATE:
                self.count += 1

    def _tell(self, topic: str, data: bytes) -> None:
        if topic == OBSERVATION:
            self._samples.append(read_observation(json.loads(data), self._index))
        elif topic == ESTIMATE:
            self.estimates.append(read_estimate(json.loads(data)))
            self.count += 1
        elif topic == RESPONSE and self.count:
            self.responses[self.count - 1] = read_response(json.loads(data))
        elif topic == COMMAND:
            self.commands.append(read_command(json.loads(data)))
        elif topic == EVENT:
            self.events.append(read_event(json.loads(data)))
