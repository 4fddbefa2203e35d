"""A person as a mannequin: shapes without contacts that are placed where a skeleton says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Point = Sequence[float] | np.ndarray

SKIN, HAIR, SHOES, WHITE = (0.87, 0.68, 0.55, 1), (0.25, 0.17, 0.11, 1), (0.16, 0.16, 0.18, 1), (0.95, 0.95, 0.95, 1)
SHIRT, TROUSERS = (0.80, 0.33, 0.25, 1), (0.22, 0.30, 0.46, 1)

# Lengths as shares of the height (Winter, Biomechanics and Motor Control of Human Movement).
SHARES = {
    "upper_arm": 0.186,
    "forearm": 0.146,
    "thigh": 0.245,
    "shank": 0.246,
    "ankle": 0.039,  # above the floor
    "hips": 0.120,  # apart
    "shoulders": 0.230,  # apart
    "trunk": 0.288,  # from hips to shoulders
    "neck": 0.052,  # from the shoulders' height to the skull's base
    "skull": 0.070,  # from there to the middle of the head
    "foot": 0.152,
    "hand": 0.055,  # from the wrist to the middle of the palm
}
# Segments: between which joints, radius as a share of the height, colour.
LIMBS: dict[str, tuple[str, str, float, str]] = {
    f"{side}_{name}": (f"{side}_{begin}", f"{side}_{end}", radius, colour)
    for side in ("left", "right")
    for name, begin, end, radius, colour in (
        ("upper_arm", "shoulder", "elbow", 0.028, "shirt"),
        ("forearm", "elbow", "wrist", 0.021, "skin"),
        ("thigh", "hip", "knee", 0.043, "trousers"),
        ("shank", "knee", "ankle", 0.030, "trousers"),
    )
}
JOINTS = ("head", "neck", *(f"{s}_{j}" for s in ("left", "right") for j in
          ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")))  # fmt: skip


class Person:
    """A mannequin of that height [m] in a world (mujoco.MjSpec), whose names begin with the prefix.

    Make it before the world is compiled, and `place` it afterwards, as often as it moves. It touches nothing.
    """

    def __init__(
        self, spec: Any, prefix: str = "person_", height: float = 1.75, shirt: Point = SHIRT, trousers: Point = TROUSERS
    ) -> None:
        self.prefix, self.height = prefix, height
        self.lengths = {name: share * height for name, share in SHARES.items()}
        colours = {"skin": SKIN, "shirt": shirt, "trousers": trousers}
        self._spec = spec
        for name, (_, _, radius, colour) in LIMBS.items():
            length = self.lengths[name.split("_", 1)[1]]
            part = self._part(name)
            self._capsule(part, (0, 0, -length / 2), (0, 0, length / 2), radius * height, colours[colour])
        for side in ("left", "right"):
            self._ball(self._part(f"{side}_hand"), (0, 0, 0.03 * height), 0.026 * height, SKIN)
            foot, half = self._part(f"{side}_foot"), 0.5 * self.lengths["foot"]
            self._capsule(foot, (-0.4 * half, 0, 0), (1.2 * half, 0, -0.008 * height), 0.026 * height, SHOES)
        self._trunk(colours["shirt"], colours["trousers"])
        self._head()

    def place(self, data: Any, joints: Mapping[str, Point], look: Point | None = None) -> None:
        """Put every part where the skeleton has it. joints: [m] by the names in JOINTS. look: where the face points."""
        at = {name: np.asarray(joints[name], dtype=np.float64) for name in JOINTS}
        for name, (begin, end, _, _) in LIMBS.items():
            self._set(data, name, (at[begin] + at[end]) / 2, _along(at[end] - at[begin]))
        across = at["left_hip"] - at["right_hip"]
        ahead = np.cross(across, [0, 0, 1])
        ahead = ahead / max(np.linalg.norm(ahead), 1e-9)
        for side in ("left", "right"):
            self._set(data, f"{side}_hand", at[f"{side}_wrist"], _along(at[f"{side}_wrist"] - at[f"{side}_elbow"]))
            self._set(data, f"{side}_foot", at[f"{side}_ankle"] - [0, 0, 0.012 * self.height], _facing(ahead))
        hips, shoulders = (
            (at["left_hip"] + at["right_hip"]) / 2,
            (at["left_shoulder"] + at["right_shoulder"]) / 2,
        )
        up, wide = shoulders - hips, at["left_shoulder"] - at["right_shoulder"]
        self._set(data, "trunk", (hips + shoulders) / 2, _frame(np.cross(wide, up), up))
        self._set(data, "pelvis", hips, _frame(ahead, np.array([0.0, 0.0, 1.0])))
        self._set(data, "neck", (at["neck"] + shoulders) / 2, _along(at["neck"] - shoulders))
        self._set(data, "head", at["head"], _facing(ahead if look is None else np.asarray(look, dtype=np.float64)))

    def _trunk(self, shirt: Point, trousers: Point) -> None:
        h = self.height
        half, wide = self.lengths["trunk"] / 2, self.lengths["shoulders"] / 2
        trunk = self._part("trunk")
        self._capsule(trunk, (0, -0.80 * wide, 0.86 * half), (0, 0.80 * wide, 0.86 * half), 0.040 * h, shirt)
        self._ellipsoid(trunk, (0, 0, 0.35 * half), (0.062 * h, 0.98 * wide, 0.80 * half), shirt)
        self._ellipsoid(trunk, (0, 0, -0.45 * half), (0.058 * h, 0.088 * h, 0.75 * half), shirt)
        pelvis = self._part("pelvis")
        side = 0.42 * self.lengths["hips"]
        self._capsule(pelvis, (0, -side, 0.01 * h), (0, side, 0.01 * h), 0.05 * h, trousers)

    def _head(self) -> None:
        h = self.height
        self._capsule(self._part("neck"), (0, 0, -0.03 * h), (0, 0, 0.03 * h), 0.028 * h, SKIN)
        head = self._part("head")
        self._ellipsoid(head, (0, 0, 0), (0.054 * h, 0.044 * h, 0.066 * h), SKIN)
        self._ellipsoid(head, (-0.010 * h, 0, 0.016 * h), (0.054 * h, 0.047 * h, 0.060 * h), HAIR)
        self._ball(head, (0.055 * h, 0, -0.008 * h), 0.009 * h, SKIN)  # the nose
        for y in (-0.018 * h, 0.018 * h):
            self._ball(head, (0.046 * h, y, 0.008 * h), 0.008 * h, WHITE)
            self._ball(head, (0.051 * h, y, 0.008 * h), 0.0045 * h, SHOES)

    def _part(self, name: str) -> Any:
        return self._spec.worldbody.add_body(name=f"{self.prefix}{name}", mocap=True)

    def _capsule(self, part: Any, begin: Point, end: Point, radius: float, colour: Point) -> None:
        import mujoco

        fromto = [*begin, *end]
        _shape(part, mujoco.mjtGeom.mjGEOM_CAPSULE, colour, fromto=fromto, size=[radius, 0, 0])

    def _ball(self, part: Any, at: Point, radius: float, colour: Point) -> None:
        import mujoco

        _shape(part, mujoco.mjtGeom.mjGEOM_SPHERE, colour, pos=list(at), size=[radius, 0, 0])

    def _ellipsoid(self, part: Any, at: Point, radii: Point, colour: Point) -> None:
        import mujoco

        _shape(part, mujoco.mjtGeom.mjGEOM_ELLIPSOID, colour, pos=list(at), size=list(radii))

    def _set(self, data: Any, name: str, position: np.ndarray, quaternion: np.ndarray) -> None:
        mocap = data.model.body(f"{self.prefix}{name}").mocapid[0]
        data.mocap_pos[mocap], data.mocap_quat[mocap] = position, quaternion


def standing(height: float, at: Point = (0, 0), facing: float = 0.0) -> dict[str, np.ndarray]:
    """The skeleton of a person of that height [m] who stands at (x, y) and looks along an angle [rad], arms hanging."""
    length = {name: share * height for name, share in SHARES.items()}
    turn = np.array([[np.cos(facing), -np.sin(facing), 0], [np.sin(facing), np.cos(facing), 0], [0, 0, 1]])
    knees = length["ankle"] + length["shank"]
    hips, joints = knees + length["thigh"], {}
    shoulders = hips + length["trunk"]
    joints["neck"] = np.array([0, 0, shoulders + length["neck"]])
    joints["head"] = joints["neck"] + [0.01 * height, 0, length["skull"]]
    for side, sign in (("left", 1), ("right", -1)):
        y, wide = sign * length["hips"] / 2, sign * length["shoulders"] / 2
        elbow = shoulders - length["upper_arm"]
        at_joint = {"hip": (y, hips), "knee": (y, knees), "ankle": (y, length["ankle"]), "shoulder": (wide, shoulders)}
        at_joint |= {"elbow": (1.1 * wide, elbow), "wrist": (1.1 * wide, elbow - length["forearm"])}
        joints |= {f"{side}_{name}": np.array([0, *place]) for name, place in at_joint.items()}
    return {name: turn @ place + [at[0], at[1], 0] for name, place in joints.items()}


def bent(root: Point, end: Point, upper: float, lower: float, towards: Point) -> np.ndarray:
    """Where the joint between two segments is: an elbow or a knee, as far `towards` that direction as lengths allow.

    root, end: (..., 3). upper, lower: of the segments [m]. A limb whose end is out of reach is stretched, and straight.
    """
    root, end = np.asarray(root, dtype=np.float64), np.asarray(end, dtype=np.float64)
    way, towards = end - root, np.asarray(towards, dtype=np.float64)
    distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)
    along = way / distance
    share = (upper**2 - lower**2 + distance**2) / (2 * distance)
    off = np.sqrt(np.maximum(upper**2 - share**2, 0.0))
    share = np.where(off > 0, share, distance * upper / (upper + lower))
    side = towards - along * (along * towards).sum(-1, keepdims=True)
    return np.asarray(
        root + along * share + side / np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-9) * off
    )


def _shape(part: Any, kind: Any, colour: Point, **shape: Any) -> None:
    part.add_geom(type=kind, rgba=list(colour), contype=0, conaffinity=0, mass=0, group=1, **shape)


def _along(direction: np.ndarray) -> np.ndarray:
    """The quaternion (w, x, y, z) that turns z there by the shortest way."""
    z = direction / max(float(np.linalg.norm(direction)), 1e-9)
    if z[2] < -0.999999:
        return np.array([0.0, 1.0, 0.0, 0.0])
    quaternion = np.array([1 + z[2], -z[1], z[0], 0.0])
    return np.asarray(quaternion / np.linalg.norm(quaternion))


def _facing(direction: np.ndarray) -> np.ndarray:
    """The quaternion (w, x, y, z) that turns x there, y staying level."""
    up = np.array([0.0, 0.0, 1.0])
    return _frame(direction, up - direction * (up @ direction) / max(float(direction @ direction), 1e-9))


def _frame(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The quaternion (w, x, y, z) of a frame with that z, and x as near as it can be."""
    import mujoco

    z = z / max(float(np.linalg.norm(z)), 1e-9)
    y = np.cross(z, x)
    y = y / max(float(np.linalg.norm(y)), 1e-9)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.column_stack([np.cross(y, z), y, z]).ravel())
    return quaternion
