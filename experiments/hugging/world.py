"""The robot and a person in one room, as MuJoCo has them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from experiments.hugging.person import Body, add_person

FOLDER = Path(__file__).parent
SIDES = ("left", "right")
COMMANDED = 6  # of seven joints an arm: the hand's own turn stays as it is
JOINTS = tuple(f"{side}_{i}" for side in SIDES for i in range(1, COMMANDED + 1))
REST = {"left": (1.35, 1.45, 0.0, -0.45, 0.0, 1.6, 0.8), "right": (-1.35, 1.45, 0.0, -0.45, 0.0, 1.6, 0.8)}
FASTEST = np.array([2.1750] * 4 + [2.6100] * 2)  # [rad/s] of the joints that are commanded, as Franka gives them
PERIOD = 1 / 60  # [s] of whoever commands the joints, robot and person


@dataclass(frozen=True, eq=False)
class World:
    """A compiled model and where the joints are in it. commanded: the robot's position actuators, by JOINTS."""

    model: Any
    commanded: np.ndarray
    columns: np.ndarray  # of the same joints among the velocities
    places: np.ndarray  # of the same joints among the positions

    def begin(self) -> Any:
        """Simulation data with the robot at rest and the person where they come from."""
        import mujoco

        data = mujoco.MjData(self.model)
        for side in SIDES:
            for i, angle in enumerate(REST[side], 1):
                data.joint(f"{side}_{i}").qpos = angle
                data.actuator(f"{side}_{i}").ctrl = angle
        mujoco.mj_forward(self.model, data)
        return data

    def run(self, data: Any) -> None:
        """One period further."""
        import mujoco

        mujoco.mj_step(self.model, data, nstep=self.steps)

    @cached_property
    def steps(self) -> int:
        """Of physics in a period."""
        return round(PERIOD / self.model.opt.timestep)

    @cached_property
    def resting(self) -> np.ndarray:
        """(12,) the joints at rest [rad]."""
        return np.concatenate([REST[side][:COMMANDED] for side in SIDES])

    @cached_property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """(12,) the lowest and (12,) the highest angle of every commanded joint [rad]."""
        ranges = np.array([self.model.joint(name).range for name in JOINTS])
        return ranges[:, 0] + 0.02, ranges[:, 1] - 0.02


@lru_cache(maxsize=8)
def world(body: Body) -> World:
    """The room with the robot and somebody of that body."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(FOLDER / "world.xml"))
    for side in SIDES:
        arm = mujoco.MjSpec.from_file(str(FOLDER / "arm.xml"))
        spec.attach(arm, prefix=f"{side}_", site=spec.site(side))
    add_person(spec, body)
    model = spec.compile()
    joints = [model.joint(name) for name in JOINTS]
    return World(
        model,
        np.array([model.actuator(name).id for name in JOINTS]),
        np.array([joint.dofadr[0] for joint in joints]),
        np.array([joint.qposadr[0] for joint in joints]),
    )
