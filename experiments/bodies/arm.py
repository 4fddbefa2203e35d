"""The arm of the UR5 class, put into a world."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
VELOCITY = np.pi  # [rad/s] that every joint can do, by the data sheet
TORQUE = np.array([150.0, 150.0, 150.0, 28.0, 28.0, 28.0])  # [Nm]


def add_arm(spec: Any, prefix: str = "ur5_", pos: Sequence[float] = (0, 0, 0), turned: float = 0.0) -> Any:
    """Attach an arm to a world (mujoco.MjSpec), its names after the prefix; returns the site of its flange.

    pos: of its base [m]. turned: about the vertical [rad]; all joints at 0, the arm lies along the base's -x.
    """
    import mujoco

    arm = mujoco.MjSpec.from_file(str(Path(__file__).with_name("ur5.xml")))
    frame = spec.worldbody.add_frame(pos=list(pos), quat=[np.cos(turned / 2), 0, 0, np.sin(turned / 2)])
    spec.attach(arm, prefix=prefix, frame=frame)
    return spec.site(f"{prefix}flange")
