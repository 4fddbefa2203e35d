"""One hug in the simulator, whoever moves the robot: a teleoperator who teaches it, or what was learned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np

from experiments.hugging import camera
from experiments.hugging.moved import Person
from experiments.hugging.pads import ARM, ARMS, NAMES, Pads, largest
from experiments.hugging.partner import Visit
from experiments.hugging.person import FROM
from experiments.hugging.retarget import Retargeting
from experiments.hugging.world import FASTEST, PERIOD, SIDES, World

OBSERVED = (*camera.NAMES, *NAMES)
EVERY = 2  # periods a row: 30 Hz
HEART = (0.24, 0.0)  # [m] where whoever is hugged stands


class Mover(Protocol):
    """Whoever moves the robot."""

    def answer(
        self, time: float, row: np.ndarray | None, look: tuple[float, float, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """(12,) the joints [rad] and (8,) the contact forces [raw] that are wanted.

        row: (75,) what the robot's sensors read, by OBSERVED; None between two rows. look: what an operator sees.
        """
        ...


@dataclass(frozen=True, eq=False)
class Hug:
    """What was recorded. times: (T,) [s]. read: (T, 75). commanded: (T, 12) [rad] and wanted: (T, 8) [raw].

    Of every period (P,), which no sensor tells: pressing: (P, 2) [N] of either arm on the partner; pressed: (P,) [N] of
    all contacts of the partner; near: (P,) [m] the partner from the robot; raised: (P,) [m] the higher hand; holding:
    (P, 2) [N] of either arm on the partner's trunk; gap: (P,) [m] between the hands, from side to side.
    """

    visit: Visit
    times: np.ndarray
    read: np.ndarray
    commanded: np.ndarray
    wanted: np.ndarray
    clock: np.ndarray
    pressing: np.ndarray
    pressed: np.ndarray
    near: np.ndarray
    raised: np.ndarray
    holding: np.ndarray
    gap: np.ndarray

    @property
    def values(self) -> np.ndarray:
        """(T, 95) as a demonstration has them."""
        return np.concatenate([self.read, self.commanded, self.wanted], axis=1)


def hug(
    world: World,
    visit: Visit,
    mover: Mover,
    rng: np.random.Generator,
    *,
    matches: bool,
    until: float | None = None,
    watch: Callable[[Any], None] | None = None,
) -> Hug:
    """Play it. matches: whether the partner answers the robot's strength, as when it is taught. watch: every period."""
    data, pads, pose = world.begin(), Pads.of(world), camera.Pose(world, rng)
    person, sense = Person(world, visit, rng, matches), Arms(world, pads)
    retargeting = Retargeting(len(world.commanded))
    command, low, high = world.resting.copy(), *world.limits
    rows: list[tuple[Any, ...]] = []
    truth: list[tuple[Any, ...]] = []
    for i in range(round((visit.over_at if until is None else until) / PERIOD)):
        time = i * PERIOD
        pressing, holding, pressed = sense.on_partner(data)
        near = FROM - float(data.joint("person_forward").qpos[0])
        row, touch = None, pads.read(pads.forces(world, data), data, rng)
        if i % EVERY == 0:
            row = np.concatenate([pose.frame(data), touch])
        joints, wanted = mover.answer(time, row, (near, *visit.at(time)[1:]))
        change = retargeting.step(wanted, largest(touch), sense.inward(data), PERIOD)
        aim = np.clip(joints + change, low, high)
        command = command + np.clip(aim - command, -FASTEST_12 * PERIOD, FASTEST_12 * PERIOD)
        data.ctrl[world.commanded] = command
        if row is not None:
            rows.append((time, row, command.copy(), wanted))
        left, right = (data.site(f"{side}_hand").xpos for side in SIDES)
        truth.append((time, pressing, pressed, near, max(left[2], right[2]), holding, left[1] - right[1]))
        person.act(time, data, float(pressing.sum()))
        if watch is not None:
            watch(data)
        world.run(data)
    times, read, commanded, said = (np.array(part) for part in zip(*rows, strict=True))
    return Hug(visit, times, read, commanded, said, *(np.array(part) for part in zip(*truth, strict=True)))


FASTEST_12 = 0.7 * np.tile(FASTEST, 2)  # a hug is given slowly


class Arms:
    """What the robot's arms do to whoever is between them."""

    def __init__(self, world: World, pads: Pads) -> None:
        model = world.model
        self.world, self.pads = world, pads
        self.side = {model.geom(f"{s}_{ARM[part][0]}").id: k for k, s in enumerate(SIDES) for part in ARM}
        self.side |= {model.geom(i).id: k for k, s in enumerate(SIDES) for i in _sphere(model, s)}
        self.trunk = {model.geom(f"person_{part}").id for part in ("hips", "belly", "ribs", "chest")}
        self.bodies = [model.body(f"{name.split('_')[0]}_{ARM[name.split('_')[1]][1]}").id for name in ARMS]
        self.middle = [(ARM[name.split("_")[1]][2] + ARM[name.split("_")[1]][3]) / 2 for name in ARMS]

    def on_partner(self, data: Any) -> tuple[np.ndarray, np.ndarray, float]:
        """(2,) [N] how hard the left and the right arm press on the partner, (2,) on their trunk, and all together."""
        arms, trunk, together, wrench = np.zeros(2), np.zeros(2), 0.0, np.zeros(6)
        for i in range(data.ncon):
            geoms = (data.contact[i].geom1, data.contact[i].geom2)
            mujoco.mj_contactForce(self.world.model, data, i, wrench)
            together += float(wrench[0])
            for geom in geoms:
                if geom in self.side:
                    arms[self.side[geom]] += wrench[0]
                    trunk[self.side[geom]] += wrench[0] * any(other in self.trunk for other in geoms)
        return arms, trunk, together

    def inward(self, data: Any) -> np.ndarray:
        """(8, 12) [m/rad] how fast every group moves towards whoever stands in front, as a joint turns."""
        found, jacobian = np.zeros((len(ARMS), len(self.world.columns))), np.zeros((3, self.world.model.nv))
        for k, (body, along) in enumerate(zip(self.bodies, self.middle, strict=True)):
            place = data.xpos[body] + data.xmat[body].reshape(3, 3)[:, 2] * along
            mujoco.mj_jac(self.world.model, data, jacobian, None, place, body)
            towards = np.array([HEART[0] - place[0], HEART[1] - place[1]])
            found[k] = (towards / max(np.linalg.norm(towards), 0.05)) @ jacobian[:2, self.world.columns]
        return found


def _sphere(model: Any, side: str) -> list[int]:
    body = model.body(f"{side}_link1")
    return list(range(int(body.geomadr[0]), int(body.geomadr[0] + body.geomnum[0])))
