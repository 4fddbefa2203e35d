"""How often what is done in a live run."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from inphase.errors import OptionError


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
