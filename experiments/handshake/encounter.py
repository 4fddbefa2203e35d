"""One encounter of robot and partner, 10 s long: what was read, and what only a simulation knows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.handshake import partner as person
from experiments.handshake.partner import Partner
from experiments.handshake.robot import Arm
from experiments.handshake.sensors import RATE, Camera, gauge
from experiments.handshake.trajectories import start
from experiments.handshake.world import STEP

LASTS = 10.0  # [s]
EVERY = round(person.STEP / STEP)  # steps of the simulation from one of the partner to the next


class Encounter:
    """Advanced by whoever leads the robot. rng: of the partner, the camera and the gauges.

    `times` [s], `read` (30,) and `truth` (6,) grow with every sample of the sensors: what they read, the partner's hand
    first, and where the hands are, the robot's first. look: is called with the arm 15 times a second.
    model: the world, where it is not the bare one.
    """

    def __init__(
        self,
        partner: Partner,
        rng: np.random.Generator,
        look: Callable[[Arm], None] | None = None,
        model: Any = None,
    ) -> None:
        self.partner, self.arm = partner, Arm(start(), model)
        self.arm.settle()
        self.camera, self._rng, self._look = Camera(rng), rng, look
        self.times: list[float] = []
        self.read: list[np.ndarray] = []
        self.truth: list[np.ndarray] = []
        self.references: list[np.ndarray] = []
        self._steps = 0
        place = partner.style.rest
        self.arm.put_partner(place)
        self._sample()

    @property
    def time(self) -> float:
        """[s] since the beginning."""
        return self._steps * STEP

    def until(self, time: float, lead: Callable[[float], np.ndarray] | None = None) -> None:
        """Go on to that time [s]. lead: the references (27,) [MPa] at a time; without it they stay."""
        arm = self.arm
        while self.time < time - STEP / 2:
            if self._steps % EVERY == 0:
                hand = arm.partner
                self.camera.watch(hand)
                arm.will(self.partner.step(self.time, arm.hand, hand), self.partner.force)
                if lead is not None:
                    arm.air.reference = np.asarray(lead(self.time), dtype=float)
            arm.step()
            self._steps += 1
            if self.time * RATE >= len(self.times):
                self._sample()

    def _sample(self) -> None:
        arm = self.arm
        if not self.times:
            self.camera.watch(arm.partner)
        self.times.append(self.time)
        self.read.append(np.concatenate([self.camera.read(), gauge(arm.air.pressure, self._rng)]))
        self.truth.append(np.concatenate([arm.hand, arm.partner]))
        self.references.append(arm.air.reference.copy())
        if self._look is not None and len(self.times) % 2 == 1:
            self._look(arm)

    @property
    def told(self) -> Told:
        """All of it."""
        return Told(np.array(self.times), np.array(self.read), np.array(self.truth), np.array(self.references))


@dataclass(frozen=True, eq=False)
class Told:
    """times: (T,) [s]. read: (T, 30) hand [m] and pressures [MPa]. truth: (T, 6) both hands [m], the robot's first.

    references: (T, 27) [MPa].
    """

    times: np.ndarray
    read: np.ndarray
    truth: np.ndarray
    references: np.ndarray

    @property
    def apart(self) -> np.ndarray:
        """(T,) [m] between both hands."""
        return np.asarray(np.linalg.norm(self.truth[:, :3] - self.truth[:, 3:], axis=1))
