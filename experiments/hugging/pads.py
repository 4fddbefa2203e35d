"""The 61 force sensors in the robot's padding (Figs. 25, 26): where they are, and what they read.

A contact presses on every sensor near it, the less the further away: a sensor feels what padding passes on. Readings
are those of an 8-bit converter behind a resistor that gives way with force, 0 … 255; padding that an arm bends by
moving is felt, too, as in 3.2.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.hugging.world import SIDES, World

ARM = {  # by segment: the geom that carries it, along its axis from … to [m], how many, and how far from the axis
    "hand": ("hand", "link7", 0.06, 0.19, 4, 0.045),
    "wrist": ("wrist", "link5", -0.15, -0.02, 5, 0.062),
    "fore": ("fore", "link5", -0.29, -0.17, 5, 0.070),
    "upper": ("upper", "link3", -0.24, -0.06, 4, 0.075),
}
CHEST = {f"chest_{side}_{row}": 3 for row in ("high", "low") for side in SIDES}
BACK = {"back_left_high": 3, "back_right_high": 3, "back_left_low": 3, "back_right_low": 4}
TORSO = {  # [m] to either side and up from the middle: on the back, where arms lie that hug it
    "chest_high": ((0.03, 0.13), (0.08, 0.18), (0.13, 0.13)),
    "chest_low": ((0.03, -0.07), (0.08, -0.02), (0.13, -0.07)),
    "back_high": ((0.04, 0.25), (0.15, 0.23), (0.13, 0.14)),
    "back_low": ((0.15, -0.15), (0.13, -0.08), (0.05, -0.10), (0.05, -0.02)),
}
ARMS = tuple(f"{side}_{segment}" for side in SIDES for segment in ARM)
GROUPS = {name: ARM[name.split("_")[1]][4] for name in ARMS} | CHEST | BACK
SENSORS = {group: tuple(f"touch_{group}_{i}" for i in range(count)) for group, count in GROUPS.items()}
NAMES = tuple(name for names in SENSORS.values() for name in names)
PASSED_ON = 0.045  # [m] how far padding passes a force on
GAP = 0.5  # a contact that is further from all sensors than this sum of shares is felt in part
HALF = 30.0  # [N] at which a sensor reads half of all it can
LARGEST, REST, TREMBLE = 255, 3.0, 1.0  # [raw]
CREASES = {
    "wrist": (6, 14.0),
    "fore": (4, 12.0),
    "upper": (4, 10.0),
}  # by segment: the joint that bends it, [raw s/rad]


@dataclass(frozen=True, eq=False)
class Pads:
    """Where the sensors are. bodies: (61,) the body of each. places: (61, 3) in its frame [m]. carrier: geom → body."""

    bodies: np.ndarray
    places: np.ndarray
    geoms: dict[int, int]
    bending: np.ndarray  # (61,) the joint whose motion creases each, -1 for none
    crease: np.ndarray  # (61,)

    @classmethod
    def of(cls, world: World) -> Pads:
        """Those of this robot."""
        model = world.model
        bodies, places, bending, crease = [], [], [], []
        for name in ARMS:
            side, segment = name.split("_")
            _, link, start, end, count, radius = ARM[segment]
            for i in range(count):
                turn, along = 2 * np.pi * i / count, start + (end - start) * (0.25 + 0.5 * (i % 2))
                bodies.append(model.body(f"{side}_{link}").id)
                places.append((radius * np.cos(turn), radius * np.sin(turn), along))
                joint, much = CREASES.get(segment, (0, 0.0))
                bending.append(model.joint(f"{side}_{joint}").dofadr[0] if much else -1)
                crease.append(much * (0.3 + 0.7 * ((i * 0.618) % 1)))
        torso = model.body("torso").id
        for group in (*CHEST, *BACK):
            where, side, row = group.split("_")
            front, sign = (1 if where == "chest" else -1), (1 if side == "left" else -1)
            for across, height in TORSO[f"{where}_{row}"][: GROUPS[group]]:
                bodies.append(torso)
                places.append((0.095 * front, sign * across, height))
                bending.append(-1)
                crease.append(0.0)
        geoms = {
            model.geom(f"{side}_{ARM[segment][0]}").id: model.body(f"{side}_{ARM[segment][1]}").id
            for side in SIDES
            for segment in ARM
        }
        geoms[model.geom("torso").id] = torso
        return cls(np.array(bodies), np.array(places), geoms, np.array(bending), np.array(crease))

    def forces(self, world: World, data: Any) -> np.ndarray:
        """(61,) what presses on each [N]."""
        felt = np.zeros(len(self.bodies))
        for body, point, force in contacts(world, data, self.geoms):
            near = np.flatnonzero(self.bodies == body)
            places = data.xpos[body] + self.places[near] @ data.xmat[body].reshape(3, 3).T
            far = ((places - point) ** 2).sum(1)
            share = np.exp(-0.5 * far / PASSED_ON**2)
            felt[near] += force * share / max(share.sum(), GAP)
        return felt

    def read(self, forces: np.ndarray, data: Any, rng: np.random.Generator) -> np.ndarray:
        """(61,) what they read of forces [N], 0 … 255."""
        creased = np.where(self.bending >= 0, self.crease * np.abs(data.qvel[self.bending]), 0.0)
        raw = LARGEST * forces / (forces + HALF) + REST + creased + TREMBLE * rng.standard_normal(len(forces))
        return np.asarray(np.clip(np.round(raw), 0, LARGEST))


def contacts(world: World, data: Any, geoms: dict[int, int]) -> list[tuple[int, np.ndarray, float]]:
    """Of every contact with one of these geoms: its body, where it is (3,), and how hard it presses [N]."""
    import mujoco

    found, wrench = [], np.zeros(6)
    for i in range(data.ncon):
        contact = data.contact[i]
        for geom in (contact.geom1, contact.geom2):
            if geom in geoms:
                mujoco.mj_contactForce(world.model, data, i, wrench)
                found.append((geoms[geom], contact.pos.copy(), max(float(wrench[0]), 0.0)))
    return found


def largest(readings: np.ndarray, groups: tuple[str, ...] = ARMS) -> np.ndarray:
    """(G,) the largest reading of every group."""
    return np.array([readings[[NAMES.index(name) for name in SENSORS[group]]].max() for group in groups])
