"""The world: an arm with a box on a stand, a ball, and a person who is only there to be seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from experiments.bodies.arm import JOINTS, add_arm
from experiments.bodies.person import Person
from experiments.bodies.room import add_camera, add_room
from experiments.catching.flight import DRAG, MASS, RADIUS
from experiments.catching.thrower import Throw

STAND = 0.60  # [m] from the floor to the arm's base
WIDTH, DEPTH, WALL = 0.32, 0.20, 0.005  # of the box [m], 32 cm wide as in 3.4.1
STEP = 0.002  # [s]
# The box waits before the robot, its opening forward and up.
HOME = np.array([-0.264, -1.116, 2.077, -1.905, 1.413, -1.357])


@lru_cache(maxsize=2)
def built(height: float | None = None) -> Any:
    """The model (mujoco.MjModel); with a person of that height [m], where one is to be seen."""
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    add_room(spec)
    stand = {"contype": 0, "conaffinity": 1, "rgba": [0.32, 0.34, 0.37, 1]}
    cylinder, plate = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_BOX
    spec.worldbody.add_geom(type=cylinder, fromto=[0, 0, 0, 0, 0, STAND], size=[0.09, 0, 0], **stand)
    spec.worldbody.add_geom(type=plate, pos=[0, 0, 0.015], size=[0.25, 0.25, 0.015], **stand)
    flange = add_arm(spec, pos=(0, 0, STAND), turned=np.pi)
    _add_box(flange)
    ball = spec.worldbody.add_body(name="ball", pos=[STANDS_FAR, 0, RADIUS])
    ball.add_freejoint(name="ball")
    ball.add_geom(
        name="ball",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[RADIUS, 0, 0],
        mass=MASS,
        rgba=[0.85, 0.10, 0.10, 1],
        condim=6,
        friction=[0.8, 0.02, 0.01],
        solref=[0.02, 0.9],  # soft: it hardly bounces
    )
    if height is not None:
        Person(spec, height=height)
    add_camera(spec, "side", at=(1.55, -3.7, 1.9), to=(1.80, 0, 1.2), fovy=44)
    add_camera(spec, "robot", at=(-1.9, -1.2, 2.0), to=(1.3, 0.05, 1.0), fovy=48)
    return spec.compile()


STANDS_FAR = 6.0  # [m]: where the ball lies before it is held


def _add_box(flange: Any) -> None:
    """Five boards on the flange, the opening away from it, and the site `opening` in its middle, z out of the box."""
    half, cardboard = WIDTH / 2, [0.80, 0.62, 0.40, 0.45]
    holder = flange.parent
    turn = {"pos": list(flange.pos), "quat": list(flange.quat)}
    box = holder.add_body(name="box", **turn)
    board = {"type": mujoco.mjtGeom.mjGEOM_BOX, "contype": 0, "conaffinity": 1, "mass": 0.08, "rgba": cardboard}
    board |= {"solref": [0.02, 0.9]}
    box.add_geom(pos=[0, 0, 0.02], size=[half, half, WALL], **board)
    for x, y in ((half, 0), (-half, 0), (0, half), (0, -half)):
        size = [WALL if x else half, WALL if y else half, DEPTH / 2]
        box.add_geom(pos=[x, y, 0.02 + DEPTH / 2], size=size, **board)
    box.add_site(name="opening", pos=[0, 0, 0.02 + DEPTH], size=[0.005, 0, 0], group=4)


@dataclass(frozen=True)
class Moment:
    """What was where at a time [s]. ball: (3,), NaN while it cannot be seen. joints: (6,)."""

    time: float
    ball: np.ndarray
    joints: np.ndarray


class World:
    """A throw that happens while the arm goes where it is sent.

    `target` (6,) is where the joints are sent; `to` goes on to a time [s], by the clock of the throw.
    """

    def __init__(self, throw: Throw, start: np.ndarray = HOME, *, seen: bool = False) -> None:
        self.throw = throw
        self.model = built(throw.style.height if seen else None)
        self.data = mujoco.MjData(self.model)
        self.target = np.array(start)
        self.entered: float | None = None  # [s] when the ball came through the opening
        self.nearest = np.inf  # [m] that the ball came to the middle of the opening
        self.log: list[Moment] = []
        self._held = True
        self._ball = self.model.joint("ball")
        self._q, self._v = int(self._ball.qposadr[0]), int(self._ball.dofadr[0])
        self._joints = [int(self.model.joint(f"ur5_{name}").qposadr[0]) for name in JOINTS]
        self._body, self._opening = self.model.body("ball").id, self.model.site("opening").id
        self.data.qpos[self._joints] = start
        self.data.ctrl[:] = start
        self._hold()
        mujoco.mj_forward(self.model, self.data)
        self._note()

    @property
    def time(self) -> float:
        """[s]"""
        return float(self.data.time)

    @property
    def joints(self) -> np.ndarray:
        """(6,) where they are [rad]."""
        return np.array(self.data.qpos[self._joints])

    @property
    def ball(self) -> np.ndarray:
        """(3,) its middle [m]."""
        return np.array(self.data.qpos[self._q : self._q + 3])

    @property
    def opening(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) the middle of the box's opening [m], and (3, 3) its frame, z out of the box."""
        at, frame = self.data.site_xpos[self._opening], self.data.site_xmat[self._opening]
        return at.copy(), frame.reshape(3, 3).copy()

    @property
    def inside(self) -> bool:
        """Whether the ball is in the box."""
        at, frame = self.opening
        x, y, z = frame.T @ (self.ball - at)
        return bool(abs(x) < WIDTH / 2 and abs(y) < WIDTH / 2 and -DEPTH < z < 0)

    def to(self, time: float) -> None:
        """Go on to that time [s], in whole steps."""
        while self.data.time < time - STEP / 2:
            self.step()

    def step(self) -> None:
        """One step of the simulation."""
        self.data.ctrl[:] = self.target
        if self._held:
            self._hold()
            if self.data.time >= self.throw.release - STEP / 2:
                self.data.qvel[self._v : self._v + 3] = self.throw.velocity
                self._held = False
        if not self._held:
            velocity = self.data.qvel[self._v : self._v + 3]
            self.data.xfrc_applied[self._body, :3] = -DRAG * np.sqrt(velocity @ velocity) * velocity
        mujoco.mj_step(self.model, self.data)
        if self.entered is None and not self._held:
            self.nearest = min(self.nearest, float(np.linalg.norm(self.ball - self.opening[0])))
            self.entered = self.time if self.inside else None
        self._note()

    def show(self) -> None:
        """Put the person where they are, to be looked at."""
        i = min(round(self.data.time / STEP), len(self.throw.times) - 1)
        yaw, pitch = self.throw.look[i]
        look = [-np.cos(pitch) * np.cos(yaw), -np.cos(pitch) * np.sin(yaw), np.sin(pitch)]
        joints = {name: places[i] for name, places in self.throw.joints.items()}
        person = Person.__new__(Person)
        person.prefix, person.height = "person_", self.throw.style.height
        person.place(self.data, joints, look)
        mujoco.mj_forward(self.model, self.data)

    def _hold(self) -> None:
        i = min(round(self.data.time / STEP), len(self.throw.times) - 1)
        self.data.qpos[self._q : self._q + 7] = [*self.throw.hand[i], 1, 0, 0, 0]
        self.data.qvel[self._v : self._v + 6] = 0

    def _note(self) -> None:
        hidden = self._held or self.entered is not None
        self.log.append(Moment(self.time, np.full(3, np.nan) if hidden else self.ball, self.joints))
