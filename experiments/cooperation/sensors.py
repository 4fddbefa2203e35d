"""Six modalities, 74 channels: what sensors make of a moment, each at its own rate, with its own noise and delay."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.bodies.arm import JOINTS as ARM
from experiments.cooperation.people import Someone, turned
from experiments.cooperation.posture import SIDES, weight_middle
from experiments.cooperation.world import HIDES, Place

TICK = 1 / 120  # [s] between two moments
SYNC = 4  # ticks between two rows: 30 Hz
GRAVITY = 9.81
TRACKED = ("head", *(f"{s}_{j}" for s in SIDES for j in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")))
CELLS = ("heel", "inner", "outer", "toes")
GROUPS: dict[str, tuple[str, ...]] = {
    "skeleton": tuple(f"{joint}_{axis}" for joint in TRACKED for axis in "xyz"),
    "imu": tuple(f"{side}_{kind}_{axis}" for side in SIDES for kind in ("accel", "gyro") for axis in "xyz"),
    "emg": tuple(f"{side}_emg{i}" for side in SIDES for i in range(1, 5)),
    "shoes": tuple(f"{side}_{cell}" for side in SIDES for cell in CELLS),
    "arm": tuple(f"arm_{joint}" for joint in ARM),
    "gripper": ("gripper",),
}
OBSERVED = tuple(name for group in ("skeleton", "imu", "emg", "shoes") for name in GROUPS[group])
CONTROLLED = GROUPS["arm"] + GROUPS["gripper"]
UNITS = {"*_accel_?": "m/s²", "*_gyro_?": "rad/s", "*_emg?": "mV", "arm_*": "rad"} | {
    pattern: unit for joint in TRACKED for pattern, unit in ((f"{joint}_[xyz]", "m"),)
}
UNITS |= {f"{side}_{cell}": "N" for side in SIDES for cell in CELLS}
PERIODS = {"skeleton": 4, "imu": 1, "emg": 2, "shoes": 2}  # ticks between two readings: 30, 120, 60, 60 Hz
DELAYS = {"skeleton": 6, "imu": 1, "emg": 2, "shoes": 2}  # ticks until they arrive
JITTER, LASTING = 0.006, 0.008  # [m] of a joint that is seen: from one picture to the next, and for a second
LOST, HIDDEN = 0.3, 0.13  # the share of hidden joints that is given up; [m] how far off the others are guessed
POOR = 0.035  # [m] how far off all joints are while more than a third of them is hidden


@dataclass(frozen=True, eq=False)
class Moment:
    """What is true at a tick. load: (2, 3) what pulls at either hand [N]. grip: (2,) how hard the fingers close."""

    joints: Mapping[str, np.ndarray]
    load: np.ndarray
    grip: np.ndarray
    lifted: np.ndarray  # (2,) how high the feet are [m]
    hidden: np.ndarray  # (13,) of the tracked joints


class Wander:
    """Noise that lasts: each value forgets itself within so many readings, and has that standard deviation."""

    def __init__(self, count: int, size: float, readings: float, rng: np.random.Generator) -> None:
        self._keep, self._size, self._rng = np.exp(-1 / readings), size, rng
        self.value = size * rng.standard_normal(count)

    def step(self) -> np.ndarray:
        """(count,) the next of them."""
        new = self._size * np.sqrt(1 - self._keep**2)
        self.value = self._keep * self.value + new * self._rng.standard_normal(len(self.value))
        return self.value


class Sensors:
    """Takes in every moment; every fourth makes a row of what arrived last of each modality (67,)."""

    def __init__(self, person: Someone, rng: np.random.Generator) -> None:
        self.person, self._rng = person, rng
        self._ticks = -1
        joints = len(TRACKED)
        self._seen_off, self._guess = Wander(3 * joints, LASTING, 30, rng), Wander(3 * joints, HIDDEN, 12, rng)
        self._poor = Wander(3 * joints, POOR, 8, rng)
        self._given_up = np.zeros(joints, dtype=bool)
        self._was_hidden = np.zeros(joints, dtype=bool)
        self._worn = [turned(0.05 * rng.standard_normal(3)) @ mount for mount in person.mounts]  # put on anew each time
        self._bias = Wander(12, 0.05, 600, rng)
        self._fitted = person.electrodes * np.exp(0.1 * rng.standard_normal((2, 4, 3)))
        self._crackle = Wander(8, 0.35, 5, rng)
        self._settled = person.soles * np.exp(0.05 * rng.standard_normal((2, 4)))
        self._shoe_off = Wander(8, 0.05, 60, rng)
        self._places: deque[np.ndarray] = deque(maxlen=3)  # of the forearms' middles
        self._frames: deque[np.ndarray] = deque(maxlen=2)
        self._middles: deque[np.ndarray] = deque(maxlen=3)
        self._push = np.zeros(3)
        self._on_the_way: dict[str, deque[tuple[int, np.ndarray]]] = {name: deque() for name in PERIODS}
        self._newest = {name: np.full(len(GROUPS[name]), np.nan) for name in PERIODS}

    def take(self, moment: Moment) -> np.ndarray | None:
        """Every TICK; a row where one is due."""
        self._ticks += 1
        self._follow(moment)
        readings = {"skeleton": self._skeleton, "imu": self._imu, "emg": self._emg, "shoes": self._shoes}
        for name, read in readings.items():
            way = self._on_the_way[name]
            if self._ticks % PERIODS[name] == 0:
                reading = read(moment)
                if self._ticks == 0:
                    self._newest[name] = reading
                way.append((self._ticks + DELAYS[name], reading))
            while way and way[0][0] <= self._ticks:
                self._newest[name] = way.popleft()[1]
        if self._ticks % SYNC:
            return None
        return np.concatenate([self._newest[name] for name in PERIODS])

    def _follow(self, moment: Moment) -> None:
        """Keep what rates of change are made of."""
        pairs = [(moment.joints[f"{s}_elbow"], moment.joints[f"{s}_wrist"]) for s in SIDES]
        place, middle = np.stack([(a + b) / 2 for a, b in pairs]), weight_middle(dict(moment.joints))
        frames = np.stack([_forearm(b - a) @ worn for (a, b), worn in zip(pairs, self._worn, strict=True)])
        if not self._places:
            self._places.extend([place] * 2)
            self._frames.append(frames)
            self._middles.extend([middle] * 2)
        self._places.append(place)
        self._frames.append(frames)
        self._middles.append(middle)
        a, b, c = self._middles
        self._push += TICK / 0.06 * ((a - 2 * b + c) / TICK**2 - self._push)

    def _skeleton(self, moment: Moment) -> np.ndarray:
        true = np.array([moment.joints[name] for name in TRACKED])
        off = self._seen_off.step() + JITTER * self._rng.standard_normal(true.size)
        guess, poor = self._guess.step(), self._poor.step()
        new = moment.hidden & ~self._was_hidden
        self._given_up[new] = self._rng.random(int(new.sum())) < LOST
        self._was_hidden = moment.hidden.copy()
        if 3 * moment.hidden.sum() > len(TRACKED):
            off = off + poor
        read = true + off.reshape(-1, 3) + np.where(moment.hidden[:, None], guess.reshape(-1, 3), 0.0)
        read[moment.hidden & self._given_up] = np.nan
        return np.asarray(read.ravel())

    def _imu(self, moment: Moment) -> np.ndarray:
        a, b, c = self._places
        push, bias = (a - 2 * b + c) / TICK**2 + [0.0, 0.0, GRAVITY], self._bias.step().reshape(2, 2, 3)
        read = np.empty((2, 2, 3))
        for i, (was, now) in enumerate(zip(*self._frames, strict=True)):
            turn = was.T @ now / TICK
            spin = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
            read[i] = now.T @ push[i], spin
        read[:, 0] += bias[:, 0] * 2 + 0.25 * self._rng.standard_normal((2, 3))
        read[:, 1] += bias[:, 1] * 0.4 + 0.04 * self._rng.standard_normal((2, 3))
        return np.asarray(read.ravel())

    def _emg(self, moment: Moment) -> np.ndarray:
        crackle = self._crackle.step().reshape(2, 4)
        read = np.empty((2, 4))
        for i, side in enumerate(SIDES):
            shoulder, elbow, wrist = (moment.joints[f"{side}_{j}"] for j in ("shoulder", "elbow", "wrist"))
            pull = float(np.linalg.norm(moment.load[i])) / 60
            raised = float(np.clip(1 + (wrist[2] - shoulder[2]) / (0.33 * self.person.height), 0, 1.5))
            flexors = moment.grip[i] * (0.6 + 0.5 * pull)
            extensors = 0.08 + 0.35 * raised + 0.3 * moment.grip[i]
            bend = 0.06 + 0.5 * pull + 0.25 * float(np.clip(1 + (wrist[2] - elbow[2]) / 0.25, 0, 1.5))
            muscles = np.array([flexors, extensors, bend])
            read[i] = self._fitted[i] @ muscles * np.exp(crackle[i]) + 0.02 * np.abs(self._rng.standard_normal(4))
        return np.asarray(read.ravel())

    def _shoes(self, moment: Moment) -> np.ndarray:
        carried = -float(moment.load[:, 2].sum())
        middle = self._middles[-1]
        down = self.person.weight * (GRAVITY + self._push[2]) + carried
        hands = np.mean([moment.joints[f"{s}_wrist"] for s in SIDES], axis=0)
        at = middle[:2] - middle[2] / GRAVITY * self._push[:2]
        at = at + (hands[:2] - at) * np.clip(carried / max(down, 1.0), -0.3, 0.3)
        ankles = np.array([moment.joints[f"{s}_ankle"] for s in SIDES])
        left = np.clip((at[1] - ankles[0, 1]) / max(ankles[1, 1] - ankles[0, 1], 0.05), 0.0, 1.0)
        shares = np.array([1 - left, left]) * np.clip(1 - moment.lifted / 0.01, 0.0, 1.0)
        shares /= max(float(shares.sum()), 1e-9)
        read = np.empty((2, 4))
        for i in range(2):
            ahead = np.clip((at[0] - ankles[i, 0] + 0.05) / 0.2, 0.02, 0.98)
            read[i] = down * shares[i] * np.array([1 - ahead, 0.45 * ahead, 0.35 * ahead, 0.2 * ahead])
        off = np.exp(self._shoe_off.step().reshape(2, 4))
        return np.asarray((read * self._settled * off + 2.0 * self._rng.standard_normal((2, 4))).ravel())


def hidden(model: Any, data: Any, joints: Mapping[str, np.ndarray], place: Place) -> np.ndarray:
    """(13,) which of the tracked joints the camera does not see for the things and the robot before them."""
    import mujoco

    eye, groups = np.array(place.eye), np.zeros(6, dtype=np.uint8)
    groups[HIDES] = 1
    ways = np.array([joints[name] for name in TRACKED]) - eye
    lengths = np.linalg.norm(ways, axis=1)
    found, hit = np.empty(len(ways)), np.empty(len(ways), dtype=np.int32)
    mujoco.mj_multiRay(
        model, data, eye, (ways / lengths[:, None]).ravel(), groups, 1, -1, hit, found, None, len(ways), 10.0
    )
    return np.asarray((found >= 0) & (found < lengths - 0.06))  # the thing that a hand holds does not hide all of it


def _forearm(along: np.ndarray) -> np.ndarray:
    """(3, 3) axes of a forearm: x forward or up, z from elbow to wrist."""
    z = along / max(float(np.linalg.norm(along)), 1e-9)
    x = np.array([z[2], 0.0, -z[0]]) / max(float(np.hypot(z[0], z[2])), 1e-9)
    y = np.array([z[1] * x[2], z[2] * x[0] - z[0] * x[2], -z[1] * x[0]])
    return np.column_stack([x, y, z])
