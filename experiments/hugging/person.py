"""A person of capsules, whose joints are springs as strong as a person's, on legs that only show how they walk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

SKIN, HAIR, SHIRT, TROUSERS, SHOES = (
    "0.87 0.68 0.55 1",
    "0.25 0.17 0.12 1",
    "0.80 0.40 0.27 1",
    "0.25 0.29 0.38 1",
    "0.15 0.15 0.17 1",
)
FROM = 2.0  # [m] away from the robot's axis
# Springs: [N/m] or [N m/rad], damping, and what they can do at most. A person gives way when squeezed, a little.
TRUNK = {
    "forward": ("slide", (1, 0, 0), 2500.0, 900.0, 350.0),
    "aside": ("slide", (0, 1, 0), 2500.0, 900.0, 350.0),
    "turn": ("hinge", (0, 0, 1), 250.0, 60.0, 80.0),
    "lean": ("hinge", (0, 1, 0), 300.0, 80.0, 150.0),
}
ARM = {  # positive is forward, outward, inward, bent
    "swing": ((0, -1, 0), 60.0, 7.0, 45.0),
    "spread": ((1, 0, 0), 60.0, 7.0, 45.0),
    "twist": ((0, 0, 1), 30.0, 3.0, 30.0),
    "bend": ((0, -1, 0), 40.0, 3.0, 35.0),
}
LEG = {"hip": (300.0, 15.0), "knee": (200.0, 10.0)}
ARM_JOINTS = tuple(ARM)


@dataclass(frozen=True)
class Body:
    """How somebody is built. height: [m]; girth: 1 for a chest of 0.22 m by 0.34 m; shirt: its colour."""

    height: float = 1.72
    girth: float = 1.0
    shirt: str = SHIRT

    @property
    def pelvis(self) -> float:
        """[m] above the floor."""
        return 0.53 * self.height

    @property
    def shoulder(self) -> float:
        """[m] above the floor."""
        return 0.815 * self.height

    @property
    def depth(self) -> float:
        """[m] of the chest, front to back."""
        return 2 * self.thick

    @property
    def thick(self) -> float:
        """[m] half of it."""
        return 0.11 * self.girth


def add_person(spec: Any, body: Body) -> None:
    """Somebody who faces the robot, in a world's specification; names begin with person_."""
    import mujoco

    h, thick = body.height, body.thick
    root = spec.worldbody.add_body(name="person_trunk", pos=[FROM, 0, body.pelvis], quat=[0, 0, 0, 1])
    for name, (kind, axis, kp, kv, most) in TRUNK.items():
        _joint(spec, root, name, kind, axis, kp, kv, most)

    def capsule(to: Any, name: str, a: Any, b: Any, size: float, mass: float, rgba: str, touches: bool = True) -> Any:
        geom = to.add_geom(
            name=f"person_{name}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*a, *b], size=[size, 0, 0], mass=mass
        )
        geom.rgba = [float(part) for part in rgba.split()]
        limb = any(part in name for part in ("upper", "fore", "hand"))
        # Arms are steered past the robot's arms by eye, which these have not: they meet its torso alone.
        geom.contype, geom.conaffinity = (0, 0) if not touches else (4, 0) if limb else (2, 1)
        geom.friction, geom.solref, geom.solimp[:3] = [0.4, 0.005, 0.0001], [0.02, 1], [0.5, 0.95, 0.03]
        return geom

    wide = 0.155 * body.girth * h / 1.72
    rise = body.shoulder - body.pelvis
    for name, z, size, half, mass in (
        ("hips", 0.02, 1.02 * thick, 0.65 * wide, 10.0),
        ("belly", 0.36 * rise, 0.98 * thick, 0.62 * wide, 11.0),
        ("ribs", 0.62 * rise, thick, 0.68 * wide, 11.0),
        ("chest", 0.86 * rise, 0.95 * thick, 0.75 * wide, 10.0),
    ):
        rgba = TROUSERS if name == "hips" else body.shirt
        capsule(root, name, (0, -half, z), (0, half, z), size, mass, rgba)
    capsule(root, "neck", (0, 0, rise), (0.01, 0, rise + 0.05 * h), 0.05, 1.0, SKIN, touches=False)
    head = capsule(root, "head", (0.02, 0, rise + 0.095 * h), (0.02, 0, rise + 0.125 * h), 0.085, 4.0, SKIN, False)
    head.name = "person_head"
    capsule(root, "hair", (-0.01, 0, rise + 0.115 * h), (-0.01, 0, rise + 0.14 * h), 0.086, 0.1, HAIR, False)
    root.add_site(name="person_neck", pos=[-0.04, 0, rise + 0.03 * h])
    root.add_site(name="person_heart", pos=[0, 0, 0.75 * rise])
    for side, sign in (("left", 1), ("right", -1)):
        upper_length, fore_length = 0.172 * h, 0.155 * h
        upper = root.add_body(name=f"person_{side}_upper", pos=[0, sign * (wide + 0.045), rise - 0.01])
        for name in ("swing", "spread", "twist"):
            axis, kp, kv, most = ARM[name]
            outward = axis if name == "swing" else tuple(sign * part for part in axis)
            _joint(spec, upper, f"{side}_{name}", "hinge", outward, kp, kv, most)
        capsule(upper, f"{side}_upper", (0, 0, 0), (0, 0, -upper_length), 0.044, 2.0, body.shirt)
        upper.add_site(name=f"person_{side}_shoulder", pos=[0, 0, 0])
        upper.add_site(name=f"person_{side}_elbow", pos=[0, 0, -upper_length])
        fore = upper.add_body(name=f"person_{side}_fore", pos=[0, 0, -upper_length])
        axis, kp, kv, most = ARM["bend"]
        _joint(spec, fore, f"{side}_bend", "hinge", axis, kp, kv, most)
        capsule(fore, f"{side}_fore", (0, 0, 0), (0, 0, -fore_length), 0.036, 1.3, SKIN)
        capsule(fore, f"{side}_hand", (0, 0, -fore_length - 0.03), (0, 0, -fore_length - 0.10), 0.036, 0.5, SKIN)
        fore.add_site(name=f"person_{side}_wrist", pos=[0, 0, -fore_length])
        fore.add_site(name=f"person_{side}_hand", pos=[0, 0, -fore_length - 0.07])
        thigh = root.add_body(name=f"person_{side}_thigh", pos=[0, sign * 0.55 * wide, 0])
        _joint(spec, thigh, f"{side}_hip", "hinge", (0, -1, 0), *LEG["hip"], 200.0)
        long = body.pelvis / 2 - 0.02
        capsule(thigh, f"{side}_thigh", (0, 0, -0.03), (0, 0, -long), 0.07, 6.0, TROUSERS, touches=False)
        shin = thigh.add_body(name=f"person_{side}_shin", pos=[0, 0, -long])
        _joint(spec, shin, f"{side}_knee", "hinge", (0, 1, 0), *LEG["knee"], 150.0)
        capsule(shin, f"{side}_shin", (0, 0, 0), (0, 0, -long + 0.03), 0.05, 3.0, TROUSERS, touches=False)
        capsule(shin, f"{side}_foot", (-0.03, 0, -long + 0.01), (0.14, 0, -long), 0.04, 0.8, SHOES, touches=False)
    for one in spec.bodies:
        if one.name.startswith("person_"):
            one.gravcomp = 1.0  # muscles carry themselves


def _joint(spec: Any, to: Any, name: str, kind: str, axis: Any, kp: float, kv: float, most: float) -> None:
    """A joint with the spring that moves it."""
    import mujoco

    joint = to.add_joint(name=f"person_{name}", axis=list(axis))
    joint.type = mujoco.mjtJoint.mjJNT_SLIDE if kind == "slide" else mujoco.mjtJoint.mjJNT_HINGE
    joint.armature = 0.02
    spring = spec.add_actuator(name=f"person_{name}", target=f"person_{name}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    spring.set_to_position(kp=kp, kv=kv)
    spring.forcerange, spring.forcelimited = [-most, most], mujoco.mjtLimited.mjLIMITED_TRUE
