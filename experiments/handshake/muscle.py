"""McKibben muscles and what fills them: force by pressure and contraction, friction of the braid, valves with a PID.

All arrays are (27,), one number a muscle. Pressures are over that of the air [MPa], lengths in [m], forces in [N].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MEGA = 1e6
AIR, SUPPLY = 0.1, 0.8  # [MPa] absolute
BRAID = np.deg2rad(25.0)  # the angle of its threads to the axis, at rest
A, B = 3 / np.tan(BRAID) ** 2, 1 / np.sin(BRAID) ** 2
FRICTION = 0.06  # of the braid, of the force the pressure gives at rest length
PRESLIDE = 0.002  # [m] within which the friction turns round
DEAD = 3e-5  # [m³] of the tube to the valve
CONDUCTANCE = 3.0e-4  # [m³/s] of an open valve, at sonic flow
STRETCHED = 0.999  # of the length of its threads, which is as long as a muscle gets
SPOOL, BACKLASH = 0.02, 0.02  # [s] lag of the valve, share of its way within which nothing flows
P_GAIN, I_GAIN = 4.0, 5.0  # of the controller [1/MPa], [1/MPa s]; its D is 0


@dataclass(frozen=True, eq=False)
class Muscles:
    """Of what size they are. diameter, length: at rest [m]."""

    diameter: np.ndarray
    length: np.ndarray

    @property
    def area(self) -> np.ndarray:
        """At rest [m²]."""
        return np.pi / 4 * self.diameter**2

    def pull(self, contraction: np.ndarray) -> np.ndarray:
        """[N/MPa] at a contraction (L0 - L) / L0: F = p A0 (a (1 - e)² - b), never a push (Chou and Hannaford 1996)."""
        return MEGA * self.area * np.maximum(A * (1 - contraction) ** 2 - B, 0.0)

    def volume(self, contraction: np.ndarray) -> np.ndarray:
        """[m³] of a cylinder whose braid keeps the length of its threads; p dV is the work of `pull`."""
        cos = np.cos(BRAID)
        short = np.minimum(1 - contraction, STRETCHED / cos)  # threads that lie along the muscle leave no room
        return self.area * self.length * short * (1 - (short * cos) ** 2) / np.sin(BRAID) ** 2


class Pneumatics:
    """What is in the muscles: pressures, friction and valves, stepped at 500 Hz.

    reference: what the PID of every valve makes of its pressure sensor; whoever commands sets it.
    """

    def __init__(self, muscles: Muscles, pressure: np.ndarray, contraction: np.ndarray) -> None:
        self.muscles = muscles
        self.pressure, self.reference = pressure.copy(), pressure.copy()
        self.bent = np.zeros(len(pressure))  # -1 … 1, how far the braid's friction has turned round
        self.spool = np.zeros(len(pressure))
        self._sum = np.zeros(len(pressure))
        self._contraction = contraction.copy()
        self._volume = muscles.volume(contraction) + DEAD

    def step(self, contraction: np.ndarray, dt: float) -> np.ndarray:
        """The tension [N] of all muscles, dt [s] later."""
        volume = self.muscles.volume(contraction) + DEAD
        absolute = self.pressure + AIR
        flow = self._valve(absolute, dt)
        # Isothermal, p V = n R T: what flows in and what the muscle's own stretching does.
        absolute = (absolute * self._volume + flow * dt) / volume
        self.pressure = np.maximum(absolute - AIR, 0.0)
        slid = (contraction - self._contraction) * self.muscles.length
        # Dahl's friction: it follows the way, not the speed, so that where a muscle stops depends on whence it came.
        turn = np.exp(-np.abs(slid) / PRESLIDE)
        self.bent = np.sign(slid) * (1 - turn) + self.bent * turn
        self._contraction, self._volume = contraction.copy(), volume
        friction = FRICTION * MEGA * self.muscles.area * (A - B) * self.pressure * self.bent
        return np.maximum(self.pressure * self.muscles.pull(contraction) - friction, 0.0)

    def _valve(self, absolute: np.ndarray, dt: float) -> np.ndarray:
        """[MPa m³/s] into the muscles: the PID moves the spool, and the spool lets air in or out."""
        error = self.reference - self.pressure
        wanted = P_GAIN * error + I_GAIN * self._sum
        free = np.abs(wanted) < 1
        self._sum += np.where(free, error, 0.0) * dt  # no more where the valve is wide open
        self.spool += (np.clip(wanted, -1, 1) - self.spool) * (dt / SPOOL)
        opened = np.sign(self.spool) * np.maximum(np.abs(self.spool) - BACKLASH, 0.0)
        into = np.sqrt(np.maximum(SUPPLY**2 - absolute**2, 0.0))
        out = np.sqrt(np.maximum(absolute**2 - AIR**2, 0.0))
        return CONDUCTANCE * opened * np.where(opened > 0, into, out)
