"""What of a response is wanted of the robot at which time: lookahead, start and stop phase, and the nearest branch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, Kind, quaternions
from inphase.errors import OptionError
from inphase.result import Estimate, Response, Status
from inphase.runtime.smoothing import wanted_at
from inphase.session import Session

MOST_SAMPLES = 10_000  # of a response: more is a mistake


@dataclass(frozen=True)
class Play:
    """Which part of the responses a robot plays, and how far ahead.

    samples: of a response. lookahead: of phase, 0 … 1 (4.2.8.3), or control_lag: [s] by which the robot is behind what
    it is sent, as `lag_of` measures it (3.4.2); not both. start: the phase before which the robot waits. stop: the
    phase up to which it goes. horizon: [s] of a trajectory sent with every command; None for single points.
    Raises OptionError for values out of range.
    """

    samples: int = 50
    lookahead: float = 0.0
    control_lag: float = 0.0
    start: float = 0.0
    stop: float = 1.0
    horizon: float | None = None

    def __post_init__(self) -> None:
        if not 2 <= self.samples <= MOST_SAMPLES:
            raise OptionError(f"response: expected 2 to {MOST_SAMPLES} samples, got {self.samples}")
        if not 0 <= self.lookahead <= 1:
            raise OptionError(f"response: expected a lookahead of phase between 0 and 1, got {self.lookahead}")
        if not 0 <= self.control_lag < inf:
            raise OptionError(f"response: expected control_lag >= 0 [s], got {self.control_lag}")
        if self.lookahead and self.control_lag:
            raise OptionError("response: give either lookahead (of phase) or control_lag [s], got both")
        if not 0 <= self.start < self.stop <= 1:
            raise OptionError(f"response: expected 0 <= start < stop <= 1, got {self.start} and {self.stop}")
        if self.horizon is not None and not 0 < self.horizon < inf:
            raise OptionError(f"response: expected a horizon > 0 [s], got {self.horizon}")


class Player:
    """Holds the response that is played, and says what it wants at a time.

    channels: the controlled ones. columns: where each stands among the robot's signals, of which there are `width`;
    those that no channel controls are held. periodic: an interaction without an end.
    """

    def __init__(
        self, play: Play, channels: Sequence[Channel], columns: Sequence[int], width: int, periodic: bool = False
    ) -> None:
        self.play = play
        self.response: Response | None = None
        self.over = False
        self._periodic = periodic
        self._ahead = 0.0
        self._columns, self._width = list(columns), width
        self._angles = np.array([channel.kind is Kind.ANGLE for channel in channels], dtype=bool)
        self._quaternions = [list(parts) for parts in quaternions(channels)]

    def reset(self) -> None:
        """Forget the response."""
        self.response, self.over = None, False

    def respond(self, session: Session, estimate: Estimate) -> Response | None:
        """Ask for a response if there is something to play yet."""
        self.over = not self._periodic and (estimate.status is Status.FINISHED or estimate.phase >= self.play.stop)
        if estimate.phase < self.play.start and not self._periodic:
            self.response = None
            return None
        stop = 1.0 if self._periodic else self.play.stop
        if stop < 1 and estimate.phase + self.play.lookahead >= stop:
            self.response, self._ahead = session.respond(samples=self.play.samples, start=stop), 0.0
            return self.response
        response = session.respond(self.play.lookahead, self.play.samples)
        # What lies ahead in phase is wanted now; what a lag eats up is wanted by so much sooner.
        ahead = float(response.times[0]) - (session.time or 0.0)
        self._ahead = ahead if self.play.lookahead else self.play.control_lag
        self.response = response
        return response

    def wanted(self, times: Float[np.ndarray, " S"], near: Float[np.ndarray, " D"]) -> Float[np.ndarray, "S D"]:
        """(S, D) where the robot's signals are wanted at those times [s], NaN where nothing is.

        near: (D,) where it was sent last: of the angles and rotations that are the same turn, the nearest are meant.
        """
        wanted = np.full((len(times), self._width), np.nan)
        if self.response is not None:
            course = wanted_at(self._until_stop(self.response), times + self._ahead)
            wanted[:, self._columns] = self._branch(course, near[self._columns])
        return wanted

    @property
    def ends(self) -> float:
        """When the response that is played has come to its end [s]."""
        return -inf if self.response is None else float(self._until_stop(self.response).times[-1]) - self._ahead

    def _until_stop(self, response: Response) -> Response:
        if self.play.stop == 1 or self._periodic:
            return response
        kept = max(int(np.searchsorted(response.phases, self.play.stop, side="right")), 1)
        return Response(
            response.times[:kept], response.phases[:kept], response.mean[:kept], response.std[:kept], response.channels
        )

    def _branch(self, wanted: Float[np.ndarray, "S D"], near: Float[np.ndarray, " D"]) -> Float[np.ndarray, "S D"]:
        if self._angles.any():
            turns = np.round((near - wanted[0]) / (2 * np.pi))
            wanted[:, self._angles] += (2 * np.pi * turns)[self._angles]
        for parts in self._quaternions:
            if near[parts] @ wanted[0, parts] < 0:
                wanted[:, parts] *= -1
        return wanted
