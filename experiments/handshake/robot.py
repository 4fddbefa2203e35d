"""The robot as it is led: references of pressure go in, pressures come out, and the arm goes where they take it."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.handshake.anatomy import ARMS, JOINTS, MUSCLES, SIZES, contraction
from experiments.handshake.muscle import Pneumatics
from experiments.handshake.world import STEP, world

REST = np.full(len(MUSCLES), 0.2)  # [MPa], before the start's own pressures are known


class Arm:
    """World and muscles together, stepped by 2 ms; `air.reference` (27,) [MPa] is what the valves are told.

    model: another world than the bare one, with something to look at.
    """

    def __init__(self, pressure: np.ndarray, model: Any = None) -> None:
        import mujoco

        self.model = world() if model is None else model
        self.data = mujoco.MjData(self.model)
        self._step = mujoco.mj_step
        self.joints = np.array([self.model.joint(name).qposadr[0] for name in JOINTS])
        self.motors = np.array([self.model.actuator(name).id for name in MUSCLES])
        self.grip, self.theirs = self.model.site("grip").id, self.model.site("partner_grip").id
        self._hand, self._theirs = self.model.body("hand").id, self.model.body("partner_hand").id
        self._will = self.model.body("partner_will").mocapid[0]
        self.air = Pneumatics(SIZES, pressure, contraction(self.angles))
        mujoco.mj_forward(self.model, self.data)

    @property
    def time(self) -> float:
        """[s] since the beginning."""
        return float(self.data.time)

    @property
    def angles(self) -> np.ndarray:
        """(10,) of the joints [rad]; nobody but the simulation knows them."""
        return np.asarray(self.data.qpos[self.joints])

    @property
    def hand(self) -> np.ndarray:
        """(3,) where the palm is to be shaken [m]."""
        return np.array(self.data.site_xpos[self.grip])

    @property
    def partner(self) -> np.ndarray:
        """(3,) the same of the partner's [m]."""
        return np.array(self.data.site_xpos[self.theirs])

    def step(self) -> None:
        """2 ms on."""
        self.data.ctrl[self.motors] = self.air.step(contraction(self.data.qpos[self.joints]), STEP)
        self._step(self.model, self.data)

    def put_partner(self, place: np.ndarray) -> None:
        """Have the partner's hand begin there."""
        import mujoco

        at = self.model.joint("partner_hand").qposadr[0]
        self.data.qpos[at : at + 7] = *place, 1.0, 0.0, 0.0, 0.0
        self.data.qvel[self.model.joint("partner_hand").dofadr[0] :][:6] = 0.0
        self.data.mocap_pos[self._will] = place
        mujoco.mj_forward(self.model, self.data)

    def will(self, place: np.ndarray, force: np.ndarray) -> None:
        """Where the partner wants their hand, and the force (3,) [N] of their fingers on the robot's."""
        self.data.mocap_pos[self._will] = place
        for body, sign in ((self._hand, 1.0), (self._theirs, -1.0)):
            self.data.xfrc_applied[body, :3] = sign * force

    def settle(self, seconds: float = 3.0) -> None:
        """Wait until it hangs as its pressures have it, and begin to count from there."""
        for _ in range(round(seconds / STEP)):
            self.step()
        self.data.time = 0.0


def torques(model: Any, data: Any, angles: np.ndarray) -> np.ndarray:
    """(10,) [N m] that hold the arm against gravity at these angles."""
    import mujoco

    joints = [model.joint(name).qposadr[0] for name in JOINTS]
    data.qpos[joints], data.qvel[:] = angles, 0.0
    mujoco.mj_forward(model, data)
    return np.array(data.qfrc_bias[[model.joint(name).dofadr[0] for name in JOINTS]])


def pull(angles: np.ndarray) -> np.ndarray:
    """(10, 27) torque of every muscle [N m/MPa] at these angles, without friction."""
    return np.asarray(ARMS.T * SIZES.pull(contraction(angles)))
