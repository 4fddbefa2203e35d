"""What may be sent to a robot: never beyond its limits of position, velocity and acceleration, whatever is wanted.

The velocity changes first and then the robot moves with it for the whole cycle. So braking from a velocity v takes at
most v² / 2a, however long the cycles are, and a robot that keeps that much room before a position limit can always
stop in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.errors import OptionError

FURTHEST = 1e12  # no robot is told to go beyond: a larger number is no position
SHORTEST = 1e-9  # [s]; two cycles less than that apart are one


@dataclass(frozen=True, eq=False)
class Limits:
    """What each channel of a robot may do; inf for no limit.

    low, high: (D,) [unit]. velocity: (D,) [unit/s]. acceleration: (D,) [unit/s²]. Raises OptionError for a NaN, for a
    velocity or acceleration that is not positive, and for low above high.
    """

    low: Float[np.ndarray, " D"]
    high: Float[np.ndarray, " D"]
    velocity: Float[np.ndarray, " D"]
    acceleration: Float[np.ndarray, " D"]

    def __post_init__(self) -> None:
        freeze(self, low=self.low, high=self.high, velocity=self.velocity, acceleration=self.acceleration)
        shapes = [self.low.shape, self.high.shape, self.velocity.shape, self.acceleration.shape]
        if self.low.ndim != 1 or len(set(shapes)) > 1:
            raise OptionError(f"limits: expected four numbers for each channel, got the shapes {shapes}")
        for i, (low, high) in enumerate(zip(self.low, self.high, strict=True)):
            if not (low <= high and low < np.inf and high > -np.inf):
                raise OptionError(f"limits: expected low <= high of channel {i}, got {low:g} and {high:g}")
            for name in ("velocity", "acceleration"):
                if not getattr(self, name)[i] > 0:
                    raise OptionError(f"limits: expected {name} > 0 of channel {i}, got {getattr(self, name)[i]:g}")

    def __len__(self) -> int:
        return len(self.low)

    @classmethod
    def none(cls, channels: int) -> Limits:
        """So many channels that may do anything."""
        unlimited = np.full(channels, np.inf)
        return cls(-unlimited, unlimited, unlimited, unlimited)

    def limited(
        self,
        positions: Float[np.ndarray, " D"],
        velocities: Float[np.ndarray, " D"],
        wanted: Float[np.ndarray, " D"],
        dt: float,
        wanted_velocities: Float[np.ndarray, " D"] | None = None,
    ) -> tuple[Float[np.ndarray, " D"], Float[np.ndarray, " D"]]:
        """(D,) the positions to send now, and (D,) the velocities with which they are reached.

        positions, velocities: (D,) what this method answered last; a robot starts where it stands, at rest. wanted:
        (D,); a channel for which that is no finite position is held: it comes to rest as soon as it may. dt: [s] since
        `positions` were sent; where no time has passed nothing changes. wanted_velocities: (D,) how `wanted` moves;
        without them it is taken to stand, and one that moves is followed some way behind.

        Velocities are (sent - sent before) / dt, accelerations (velocity - velocity before) / dt; both are kept for
        any sequence of cycles that begins at rest. A robot that stands outside its position limits is never sent
        further out, and is sent back in by whatever is wanted of it.
        """
        if not (SHORTEST <= dt < np.inf):
            return positions.copy(), velocities.copy()
        known = np.abs(wanted) <= FURTHEST  # NaN is not
        goal = np.clip(np.where(known, wanted, positions), self.low, self.high)
        moving = np.zeros(len(self)) if wanted_velocities is None else np.nan_to_num(wanted_velocities)
        with np.errstate(over="ignore"):
            moving = np.clip(moving, -self.velocity, self.velocity)
            moving = np.where(np.abs(moving) * dt <= FURTHEST, moving, 0.0)
            ideal = moving + approach(goal - positions - moving * dt, self.acceleration, dt)
            ideal = np.clip(np.where(known, ideal, 0.0), -self.velocity, self.velocity)
            lowest = np.minimum(approach(self.low - positions, self.acceleration, dt), 0.0)
            highest = np.maximum(approach(self.high - positions, self.acceleration, dt), 0.0)
            ideal = np.clip(ideal, lowest, highest)
            change = self.acceleration * dt
            reached = np.clip(ideal, velocities - change, velocities + change)
        # What is cut here is rounding, or the speed of a robot that was too fast before it was told to anyone.
        sent = np.clip(positions + reached * dt, np.minimum(self.low, positions), np.maximum(self.high, positions))
        return sent, reached


def approach(
    distance: Float[np.ndarray, " D"], acceleration: Float[np.ndarray, " D"], dt: float
) -> Float[np.ndarray, " D"]:
    """(D,) the fastest velocity for the next dt [s] from which braking ends before the distance is used up.

    It solves v · dt + v² / 2a = distance, and has the distance's sign.
    """
    finite = np.isfinite(distance)
    near = np.where(finite, distance, 0.0)
    braking = np.sqrt(np.abs(near)) * np.sqrt(2 / acceleration)
    return np.asarray(np.where(finite, 2 * (near / (dt + np.hypot(dt, braking))), distance))
