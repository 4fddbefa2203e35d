"""How a robot is led: its limits, the smoothing, and what is done about troubles."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.errors import OptionError
from inphase.runtime.limits import Limits
from inphase.runtime.safety import Policy
from inphase.runtime.smoothing import AlphaBeta


@dataclass(frozen=True, eq=False)
class Conduct:
    """What a robot may do, and what it does when something is wrong.

    limits, retreat: by the robot's signals; retreat is (D,) where retreats end, None without any. silence: [s] without
    an answer after which a robot is lost. late_commands: how many in a row that are left out count as missed deadlines.
    watchdog: [s] the loop may stand still before the robot is braked; None for five commands and at least 0.1 s.
    Raises OptionError for values out of range, and a retreat without a pose or without a velocity to reach it with.
    """

    limits: Limits
    smoothing: AlphaBeta = field(default_factory=AlphaBeta)
    policy: Policy = field(default_factory=Policy)
    retreat: Float[np.ndarray, " D"] | None = None
    silence: float = 0.2
    late_commands: int = 3
    watchdog: float | None = None

    def __post_init__(self) -> None:
        for name in ("silence", "late_commands", "watchdog"):
            value = getattr(self, name)
            if value is not None and not 0 < value < inf:
                raise OptionError(f"safety: expected {name} > 0, got {value}")
        if self.retreat is not None:
            freeze(self, retreat=self.retreat)
            self._check_pose(self.retreat)
        if self.policy.retreats:
            what = f"safety: as {self.policy.retreats[0]} is answered by a retreat, expected"
            if self.retreat is None:
                raise OptionError(f"{what} a pose to retreat to, got none")
            if not np.isfinite(self.limits.velocity).all():
                raise OptionError(f"{what} a finite velocity limit of every signal, got {self.limits.velocity}")

    def _check_pose(self, pose: Float[np.ndarray, " D"]) -> None:
        if pose.shape != (len(self.limits),):
            raise OptionError(f"safety: expected a retreat of {len(self.limits)} positions, got {pose.shape}")
        if not ((self.limits.low <= pose) & (pose <= self.limits.high)).all():
            raise OptionError(f"safety: expected a retreat within the limits of position, got {pose}")
