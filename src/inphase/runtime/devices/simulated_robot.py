"""A robot that follows its commands as a real one does: late, within its limits, and not always answering."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, floor

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase.arrays import FloatArray, frozen
from inphase.errors import OptionError, listing
from inphase.runtime.clock import Clock
from inphase.runtime.device import Command, Sample, Signal


class SimulatedRobot:
    """Joints that go towards what is commanded by a first-order lag, never faster or further than they can.

    home: (D,) where they stand at first. time_constant: [s] of the lag, 0 for none. low, high, velocity: one number or
    (D,), infinite for no limit. step: [s] of the simulation, which is the same however often it is asked. A trajectory
    is followed by linear interpolation: the last point holds, and until the first is due the former target does.
    `answers` may be set to False: it then says nothing and takes nothing, and moves on by its last command.
    Raises OptionError for values that do not fit.
    """

    def __init__(
        self,
        signals: Sequence[Signal],
        home: ArrayLike,
        *,
        time_constant: float = 0.05,
        low: ArrayLike | float = -np.inf,
        high: ArrayLike | float = np.inf,
        velocity: ArrayLike | float = np.inf,
        step: float = 0.001,
        name: str = "robot",
    ) -> None:
        self.name, self.signals, self.answers = name, tuple(signals), True
        self._home, self._low, self._high, self._velocity = (
            self._by_joint(what, value)
            for what, value in (("home", home), ("low", low), ("high", high), ("velocity", velocity))
        )
        if not (np.isfinite(self._home) & (self._low <= self._home) & (self._home <= self._high)).all():
            raise OptionError(f"{name}: expected low <= home <= high, got {self._low}, {self._home}, {self._high}")
        if not (self._velocity >= 0).all():
            raise OptionError(f"{name}: expected velocities >= 0, got {self._velocity}")
        if not (0 <= time_constant < np.inf and 0 < step < np.inf):
            raise OptionError(f"{name}: expected time_constant >= 0 and step > 0 [s], got {time_constant} and {step}")
        self._share = 1 - exp(-step / time_constant) if time_constant > 0 else 1.0
        self._step = step
        self._clock: Clock | None = None
        self._begun, self._steps = 0.0, 0
        self._command: Command | None = None
        self._position = self._before = self._home

    def start(self, clock: Clock) -> None:
        """Stand at home, now."""
        self._clock = clock
        self._begun, self._steps = clock.now(), 0
        self._command = None
        self._position = self._before = self._home

    def state(self) -> Sample | None:
        """Where the joints are; None where it does not answer."""
        if self._clock is None or not self.answers:
            return None
        self._move()
        at = self._begun + self._steps * self._step
        return Sample(self._position, at, at)

    def command(self, command: Command) -> None:
        """Take over from the last command; raises OptionError for another number of positions."""
        if command.positions.shape[1] != len(self.signals):
            raise OptionError(
                f"{self.name}: expected {len(self.signals)} positions "
                f"({listing(s.name for s in self.signals)}), got {command.positions.shape[1]}"
            )
        if self._clock is None or not self.answers:
            return
        self._move()
        self._before, self._command = self._target(self._begun + self._steps * self._step), command

    def stop(self) -> None:
        """Stand still and fall silent."""
        if self._clock is not None:
            self._move()
        self._clock = None

    def _by_joint(self, what: str, value: ArrayLike | float) -> FloatArray:
        array = np.asarray(value, dtype=np.float64)
        if array.shape not in ((), (len(self.signals),)) or np.isnan(array).any():
            raise OptionError(f"{self.name}: expected {what} of {len(self.signals)} joints, got {value!r}")
        return frozen(np.broadcast_to(array, (len(self.signals),)))

    def _move(self) -> None:
        """Simulate up to now, in whole steps."""
        assert self._clock is not None
        until = floor((self._clock.now() - self._begun) / self._step * (1 + 1e-12))
        farthest = self._velocity * self._step
        while self._steps < until:
            self._steps += 1
            way = self._share * (self._target(self._begun + self._steps * self._step) - self._position)
            position = self._position + np.clip(way, -farthest, farthest)
            self._position = np.clip(position, self._low, self._high)

    def _target(self, time: float) -> Float[np.ndarray, " D"]:
        command = self._command
        if command is None or time < command.times[0]:
            return self._before
        after = int(np.searchsorted(command.times, time, side="right"))
        if after == len(command.times):
            return np.asarray(command.positions[-1])
        (t0, t1), (p0, p1) = command.times[after - 1 : after + 1], command.positions[after - 1 : after + 1]
        return np.asarray(p0 + (time - t0) / (t1 - t0) * (p1 - p0))
