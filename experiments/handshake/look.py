"""Somebody to look at: a person who stands before the robot, and whose right arm goes where their hand is."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from experiments.bodies.person import Person, bent, standing
from experiments.bodies.room import add_camera, add_room
from experiments.handshake.robot import Arm

HEIGHT, STANDS = 1.74, (1.06, 0.02)  # [m]
PALM = np.array([0.045, 0.012, 0.0])  # [m] from where the hand is shaken to the middle of the palm, towards the person


@cache
def dressed(written: str) -> tuple[Any, Person]:
    """The world of that MJCF with room, camera and person, compiled; nothing in it moves otherwise."""
    import mujoco

    spec = mujoco.MjSpec.from_string(written)
    add_room(spec)
    add_camera(spec, "side", (0.42, -2.45, 1.50), (0.50, 0.0, 1.08), 36.0)
    person = Person(spec, height=HEIGHT, shirt=(0.24, 0.45, 0.62, 1))
    return spec.compile(), person


def place(arm: Arm, person: Person) -> None:
    """Put the person where they are now: they lean a little to reach."""
    import mujoco

    joints = standing(HEIGHT, STANDS, np.pi)
    lean = np.clip(0.75 - arm.partner[0], 0.0, 0.5) * 0.25
    for name in ("head", "neck", "left_shoulder", "right_shoulder", "left_elbow", "left_wrist"):
        joints[name] = joints[name] - [lean, 0, 0.1 * lean]
    wrist = arm.partner + PALM
    joints["right_wrist"] = wrist
    lengths = person.lengths
    joints["right_elbow"] = bent(
        joints["right_shoulder"], wrist, lengths["upper_arm"], lengths["forearm"], (0.3, 0.2, -1.0)
    )
    person.place(arm.data, joints, look=(-1.0, 0.0, -0.15))
    mujoco.mj_kinematics(arm.model, arm.data)
