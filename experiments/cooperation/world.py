"""The two worlds: a table with a can out of reach, and a large box between a low stand and a table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.bodies.arm import JOINTS as ARM
from experiments.bodies.arm import add_arm
from experiments.bodies.person import Person
from experiments.bodies.room import add_camera, add_room

STEP = 1 / 480  # [s] of the physics
PINCH = 0.185  # [m] from the flange to between the fingers' pads
OPEN, CLOSED = 0.8, -0.5  # [rad] of the gripper's fingers
WOOD, STEEL, CARD, TAPE = (0.74, 0.60, 0.44, 1), (0.45, 0.47, 0.50, 1), (0.78, 0.62, 0.42, 1), (0.62, 0.46, 0.28, 1)
HIDES = 2  # the group of all that a camera does not see through


@dataclass(frozen=True)
class Place:
    """What stands where in a world. thing: half its edges [m]. base: of the robot [m]. eye: of the camera [m]."""

    name: str
    thing: tuple[float, float, float]
    mass: float
    tops: tuple[tuple[float, float, float, float, float], ...]  # x, y, half x, half y, height of what things stand on
    base: tuple[float, float, float]
    eye: tuple[float, float, float]
    look: tuple[float, float, float]
    film: tuple[float, float, float]  # where it is filmed from …
    stage: tuple[float, float, float]  # … and what


HANDOVER = Place(
    "handover",
    thing=(0.03, 0.03, 0.08),
    mass=0.3,
    tops=((1.05, 0.0, 0.72, 0.60, 0.74),),
    base=(1.64, 0.0, 0.74),
    eye=(2.1, -0.9, 1.75),
    look=(0.0, 0.0, 1.1),
    film=(0.55, -2.75, 1.75),
    stage=(0.72, 0.0, 0.92),
)
LIFT = Place(
    "lift",
    thing=(0.17, 0.30, 0.19),
    mass=4.0,
    tops=((0.62, -0.05, 0.20, 0.36, 0.32), (0.62, 0.80, 0.24, 0.36, 0.68)),
    base=(1.55, 0.35, 0.50),
    eye=(2.9, 0.35, 1.25),
    look=(0.0, 0.35, 0.9),
    film=(-0.95, -2.75, 1.95),
    stage=(0.72, 0.32, 0.72),
)
HANDLE = 0.05  # [m] that the box's handle stands out on the robot's side


class World:
    """A compiled world with its person. thing: the can or box, which is free."""

    def __init__(self, place: Place, height: float = 1.75, shirt: Any = (0.80, 0.33, 0.25, 1)) -> None:
        import mujoco

        spec = mujoco.MjSpec()
        spec.option.timestep = STEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = 10
        add_room(spec)
        for i, top in enumerate(place.tops):
            _table(spec, f"table{i}", *top)
        _pedestal(spec, place)
        robot(spec, place)
        for geom in spec.geoms:
            if geom.name != "floor" and geom.group == 1:
                geom.group = HIDES
        self.person = Person(spec, height=height, shirt=shirt)
        _thing(spec, place)
        add_camera(spec, "film", place.film, place.stage, fovy=36)
        add_camera(spec, "kinect", place.eye, place.look, fovy=50)
        self.place, self.model = place, spec.compile()
        self.data = mujoco.MjData(self.model)
        self.arm = np.array([self.model.joint(f"arm_{name}").qposadr[0] for name in ARM])
        self.servos = np.array([self.model.actuator(f"arm_{name}").id for name in ARM])
        self.fingers = self.model.actuator("gripper_close").id
        self.finger = self.model.joint("gripper_thumb").qposadr[0]
        self.thing = self.model.body("thing").id
        self.pinch = self.model.site("gripper_pinch").id

    def put(self, position: np.ndarray) -> None:
        """Where the thing is when all begins."""
        at = self.model.joint("thing").qposadr[0]
        self.data.qpos[at : at + 7] = [*position, 1, 0, 0, 0]

    def command(self, joints: np.ndarray, closed: float) -> None:
        """What the robot's servos are to reach: joints (6,) [rad], and the gripper from 0, open, to 1."""
        self.data.ctrl[self.servos] = joints
        self.data.ctrl[self.fingers] = OPEN + (CLOSED - OPEN) * float(np.clip(closed, 0.0, 1.0))

    @property
    def joints(self) -> np.ndarray:
        """(6,) what the arm's encoders read [rad]."""
        return self.data.qpos[self.arm].copy()


def robot(spec: Any, place: Place) -> None:
    """The arm with its gripper, into a world."""
    import mujoco

    flange = add_arm(spec, prefix="arm_", pos=place.base)
    gripper = mujoco.MjSpec.from_file(str(Path(__file__).with_name("gripper.xml")))
    spec.attach(gripper, prefix="gripper_", site=flange)


def _table(spec: Any, name: str, x: float, y: float, wide: float, deep: float, height: float) -> None:
    import mujoco

    box = mujoco.mjtGeom.mjGEOM_BOX
    common = {"group": HIDES, "friction": [0.6, 0.005, 0.0001]}
    spec.worldbody.add_geom(
        name=name, type=box, size=[wide, deep, 0.015], pos=[x, y, height - 0.015], rgba=WOOD, **common
    )
    for i, (sx, sy) in enumerate(((-1, -1), (-1, 1), (1, -1), (1, 1))):
        leg = [x + sx * (wide - 0.04), y + sy * (deep - 0.04), (height - 0.03) / 2]
        spec.worldbody.add_geom(
            name=f"{name}_leg{i}", type=box, size=[0.02, 0.02, (height - 0.03) / 2], pos=leg, rgba=STEEL, **common
        )


def _pedestal(spec: Any, place: Place) -> None:
    import mujoco

    x, y, z = place.base
    if any(abs(x - t[0]) < t[2] and abs(y - t[1]) < t[3] and z == t[4] for t in place.tops):
        return  # it stands on a table
    size = [0.11, 0.11, z / 2]
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=size, pos=[x, y, z / 2], rgba=STEEL, group=HIDES, contype=0, conaffinity=0
    )


def _thing(spec: Any, place: Place) -> None:
    import mujoco

    box = mujoco.mjtGeom.mjGEOM_BOX
    body = spec.worldbody.add_body(name="thing")
    body.add_freejoint(name="thing")
    rough = {"friction": [0.8, 0.01, 0.0005], "condim": 4, "group": HIDES}
    x, _, z = place.thing
    if place is HANDOVER:
        can = mujoco.mjtGeom.mjGEOM_CYLINDER
        band = {"mass": 0, "contype": 0, "conaffinity": 0, "group": HIDES}
        body.add_geom(type=can, size=[x, z, 0], mass=place.mass, rgba=(0.93, 0.67, 0.15, 1), **rough)
        body.add_geom(type=can, size=[x + 5e-4, 0.3 * z, 0], rgba=(0.95, 0.95, 0.92, 1), **band)
        return
    body.add_geom(type=box, size=place.thing, mass=place.mass - 0.2, rgba=CARD, **rough)
    body.add_geom(type=box, size=[x + 1e-3, 0.03, z + 1e-3], rgba=TAPE, mass=0, contype=0, conaffinity=0, group=HIDES)
    body.add_geom(
        type=box,
        size=[HANDLE / 2, 0.02, 0.06],
        pos=[x + HANDLE / 2, 0, 0],
        mass=0.2,
        rgba=(0.25, 0.26, 0.28, 1),
        **rough,
    )
