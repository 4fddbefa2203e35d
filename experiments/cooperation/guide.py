"""Kinesthetic teaching: where the robot's joints go while somebody leads its tool (inverse kinematics by mink)."""

from __future__ import annotations

import numpy as np

from experiments.bodies.arm import add_arm
from experiments.cooperation.plan import Plan
from experiments.cooperation.world import HANDOVER, PINCH, Place

RATE = 120.0  # [Hz] of the ticks at which a world is told anything
READY = (-0.1, -1.67, 1.96, -2.5, -1.4, 1.4)  # [rad] where the search for the first pose begins


def frame(at: np.ndarray, pitch: float, place: Place) -> np.ndarray:
    """(3, 3) how the tool is held there: it looks away from the robot and down, and closes level."""
    out = np.array([at[0] - place.base[0], at[1] - place.base[1], 0.0]) if place is HANDOVER else np.array([-1.0, 0, 0])
    out /= np.linalg.norm(out)
    z = np.cos(pitch) * out - np.array([0.0, 0.0, np.sin(pitch)])
    y = np.cross([0.0, 0.0, 1.0], z)
    y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, z), y, z])


def led(plan: Plan) -> np.ndarray:
    """(T, 6) the arm's joints at every tick, the tool led along its way [rad]."""
    import mink
    import mujoco

    spec = mujoco.MjSpec()
    flange = add_arm(spec, prefix="arm_", pos=plan.place.base)
    flange.parent.add_site(name="pinch", pos=np.add(flange.pos, [0.0, -PINCH, 0.0]), quat=[0.5**0.5, 0.5**0.5, 0, 0])
    model = spec.compile()
    configuration = mink.Configuration(model)
    configuration.update(np.array(READY))
    tool = mink.FrameTask("pinch", "site", position_cost=1.0, orientation_cost=0.3, lm_damping=1e-3)
    still = mink.DampingTask(model, cost=1e-2)
    limits = [mink.ConfigurationLimit(model)]
    times = np.arange(0.0, plan.duration, 1 / RATE)
    found = np.empty((len(times), 6))
    for i, time in enumerate(times):
        x, y, z, pitch = plan.tool(time)
        at = np.array([x, y, z])
        turned = mink.SO3.from_matrix(frame(at, pitch, plan.place))
        tool.set_target(mink.SE3.from_rotation_and_translation(turned, at))
        for _ in range(60 if i == 0 else 1):
            velocity = mink.solve_ik(configuration, [tool, still], 1 / RATE, "daqp", damping=1e-6, limits=limits)
            configuration.integrate_inplace(velocity, 1 / RATE)
        found[i] = configuration.q
    return found
