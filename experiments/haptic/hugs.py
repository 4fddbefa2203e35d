"""Hugs that never were: a partner, a robot of 61 force sensors, and the one who moves it, as in 3.3.2.

Everything is drawn from a seed. A partner has a height and a manner of hugging of their own, which differ a little from
hug to hug: how hard every side of the robot is pressed, and where. Contact is in about a third of the phase.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import inphase

# The groups of sensors, 3 to 5 each: 8 that are pressed, 4 that the robot's own arms squeeze, 4 that nothing reaches.
SIDES = ("left", "right")
PRESSED = {
    f"{side}_{place}": size
    for side in SIDES
    for place, size in zip(("hand", "fore", "upper", "back"), (4, 4, 3, 5), strict=True)
}
SQUEEZED = {"left_elbow": 4, "right_elbow": 4, "left_armpit": 3, "right_armpit": 3}
UNREACHED = {"hip_left": 4, "hip_right": 4, "neck": 4, "tail": 3}
GROUPS = PRESSED | SQUEEZED | UNREACHED
SENSORS = {group: [f"touch_{group}_{i}" for i in range(size)] for group, size in GROUPS.items()}
POSE = ("partner_height", "partner_near", "partner_lean", "hand_left_x", "hand_left_y", "hand_right_x", "hand_right_y")
JOINTS = tuple(f"joint_{side}_{i}" for side in SIDES for i in range(6))
FORCES = tuple(f"force_{group}" for group in PRESSED)

LARGEST = 255  # [raw] an 8-bit converter
REST, TREMBLE = 3.0, 1.0  # [raw] of a sensor that nothing presses


@dataclass(frozen=True, eq=False)
class Partner:
    """How somebody hugs. height: in standard deviations; strength: (8,) of all pressed groups; place: -1 … 1."""

    height: float
    strength: np.ndarray
    place: float

    @classmethod
    def meet(cls, rng: np.random.Generator) -> Partner:
        """Anybody."""
        return cls(rng.standard_normal(), 0.25 * rng.standard_normal(len(PRESSED)), rng.uniform(-0.6, 0.6))

    def once(self, rng: np.random.Generator) -> Partner:
        """This time: harder or softer on either side, and on every part of it, and a little elsewhere."""
        sides = np.repeat(0.35 * rng.standard_normal(2), len(PRESSED) // 2)
        own = 0.3 * rng.standard_normal(len(PRESSED))
        return Partner(
            self.height + 0.15 * rng.standard_normal(),
            np.exp(self.strength + sides + own),
            float(np.clip(self.place + 0.3 * rng.standard_normal(), -1, 1)),
        )


def hugs(count: int = 60, partners: int = 4, rate: float = 10.0, seed: int = 0) -> inphase.Dataset:
    """`count` hugs of as many partners in turn; observed are the partner's pose and all sensors."""
    rng = np.random.default_rng(seed)
    people = [Partner.meet(rng) for _ in range(partners)]
    made = [_hug(people[i % partners].once(rng), rate, rng) for i in range(count)]
    observed = [*POSE, *(name for names in SENSORS.values() for name in names)]
    return inphase.Dataset.from_arrays(
        [t for t, _ in made],
        [v for _, v in made],
        observed,
        [*JOINTS, *FORCES],
        units={"joint_*": "rad", "force_*": "raw", "touch_*": "raw"},
        groups={name: "touch" for names in SENSORS.values() for name in names} | {"force_*": "force"},
        names=[f"hug {i}, partner {i % partners}" for i in range(count)],
    )


def _hug(who: Partner, rate: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) [s] and values (T, D) of one hug."""
    times = np.arange(round(6.0 * np.exp(0.12 * rng.standard_normal()) * rate)) / rate
    phase = times / times[-1]
    begins, ends = 1 / 3 + 0.015 * rng.standard_normal(), 2 / 3 + 0.015 * rng.standard_normal()
    arms = _step(phase, begins - 0.1, 0.04) - _step(phase, ends + 0.1, 0.04)  # raised
    contact = _step(phase, begins + 0.03, 0.012) - _step(phase, ends - 0.03, 0.012)
    moving = np.exp(-0.5 * ((phase - begins + 0.1) / 0.03) ** 2) + np.exp(-0.5 * ((phase - ends - 0.1) / 0.03) ** 2)
    firm = np.log(who.strength)
    pose = [
        1.7 + 0.1 * who.height + 0 * phase,
        2.0 - 1.6 * (_step(phase, 0.2, 0.06) - _step(phase, 0.85, 0.05)),
        (0.2 + 0.03 * firm.mean()) * contact,
        *(
            part
            for side in range(2)
            for part in (
                (0.5 + 0.05 * firm[4 * side : 4 * side + 4].mean()) * arms,
                (1.1 + 0.1 * who.height + 0.1 * who.place) * arms,
            )
        ),
    ]
    pose = [curve + 0.01 * rng.standard_normal(len(phase)) for curve in pose]
    touch = [curve for group in GROUPS for curve in _felt(group, who, contact, moving, rng)]
    reach = [
        0.3 * np.sin(i + 1.0)
        + (0.8 + 0.1 * i + 0.1 * who.height * np.cos(i) + 0.08 * firm[4 * side + i % 4] + 0.08 * who.place * np.sin(i))
        * arms
        + 0.15 * firm[4 * side + i % 4] * contact
        for side in range(2)
        for i in range(6)
    ]
    joints = [curve + 0.01 * rng.standard_normal(len(phase)) for curve in reach]
    pushed = [_raw(60 * strength * contact, rng) for strength in who.strength]
    return times, np.stack([*pose, *touch, *joints, *pushed], axis=1)


def _felt(
    group: str, who: Partner, contact: np.ndarray, moving: np.ndarray, rng: np.random.Generator
) -> list[np.ndarray]:
    """What the sensors of a group read: one of them, mostly, and never twice the same."""
    size = GROUPS[group]
    if group in UNREACHED:
        return [_raw(0 * contact, rng) for _ in range(size)]
    squeezed = [rng.exponential(25.0 if group in SQUEEZED else 2.0) * moving for _ in range(size)]
    if group in SQUEEZED:
        return [_raw(curve, rng) for curve in squeezed]
    strength = who.strength[list(PRESSED).index(group)]
    where = np.linspace(-1, 1, size)
    share = np.exp(-0.5 * ((where - who.place - 0.1 * rng.standard_normal()) * (size - 1) / 2 / 0.6) ** 2)
    return [_raw(70 * strength * part * contact + own, rng) for part, own in zip(share, squeezed, strict=True)]


def _raw(force: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """As the converter gives it: whole numbers from 0 to 255."""
    return np.clip(np.round(REST + force + TREMBLE * rng.standard_normal(len(force))), 0, LARGEST)


def _step(phase: np.ndarray, at: float, width: float) -> np.ndarray:
    return 0.5 + 0.5 * np.tanh((phase - at) / (2 * width))
