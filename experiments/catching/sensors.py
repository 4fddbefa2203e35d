"""Five modalities that watch a throw, each with its own rate, delay and noise, and the arm's encoders.

They are sensors as docs/devices.md says, and serve recordings and live runs alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import floor

import numpy as np

from experiments.bodies.arm import JOINTS
from experiments.catching.world import STEP, World
from inphase.runtime import Clock, Sample, Signal

LASTS = 0.4  # [s] the part of a sensor's noise that drifts
SHOE_CELLS = ("heel_in", "heel_out", "toe_in", "toe_out")
MARKERS = {
    "hand_left": "left_wrist",
    "hand_right": "right_wrist",
    "foot_left": "left_ankle",
    "foot_right": "right_ankle",
}


@dataclass(frozen=True)
class Kind:
    """How a modality reads. rate [1/s]; delay [s] from a reading to its coming; noise, drift: [unit] of readings, white
    and lasting; lost: the share of readings that are not there."""

    signals: tuple[Signal, ...]
    rate: float
    delay: float
    noise: np.ndarray
    drift: np.ndarray
    lost: float = 0.0


def _signals(names: list[str], unit: str) -> tuple[Signal, ...]:
    return tuple(Signal(name, unit) for name in names)


KINDS = {
    "body": Kind(
        _signals([f"{name}_{axis}" for name in MARKERS for axis in "xyz"], "m"),
        100.0,
        0.020,
        np.full(12, 0.004),
        np.full(12, 0.006),
    ),
    "imu": Kind(
        _signals([f"imu_force_{a}" for a in "xyz"], "m/s2") + _signals([f"imu_turn_{a}" for a in "xyz"], "rad/s"),
        200.0,
        0.008,
        np.repeat([0.4, 0.05], 3),
        np.repeat([0.3, 0.05], 3),
    ),
    "shoes": Kind(
        _signals([f"shoe_{side}_{cell}" for side in ("left", "right") for cell in SHOE_CELLS], "N"),
        50.0,
        0.025,
        np.full(8, 4.0),
        np.full(8, 8.0),
    ),
    "head": Kind(_signals([f"head_q{axis}" for axis in "xyzw"], ""), 60.0, 0.015, np.full(3, 0.010), np.full(3, 0.02)),
    "ball": Kind(
        _signals([f"ball_{axis}" for axis in "xyz"], "m"), 90.0, 0.025, np.full(3, 0.008), np.full(3, 0.005), lost=0.03
    ),
    "joints": Kind(_signals(list(JOINTS), "rad"), 125.0, 0.0, np.full(6, 2e-4), np.zeros(6)),
}  # fmt: skip
MODALITIES = ("body", "imu", "shoes", "head", "ball")
UNITS = {signal.name: signal.unit for kind in KINDS.values() for signal in kind.signals}
OBSERVED = [signal.name for name in MODALITIES for signal in KINDS[name].signals]


class Watch:
    """One modality. silent: [s] from when on it says nothing any more. hidden: [s] until when it sees nothing."""

    def __init__(
        self, name: str, world: World, rng: np.random.Generator, *, silent: float = np.inf, hidden: float = -np.inf
    ) -> None:
        self.name, self.kind, self.signals = name, KINDS[name], KINDS[name].signals
        self.silent, self.hidden = silent, hidden
        self._world, self._rng = world, rng
        self._truth: Callable[[float], np.ndarray] = _truths(world)[name]
        self._begins = rng.uniform(0, 1 / self.kind.rate)
        self._drift = self.kind.drift * rng.standard_normal(len(self.kind.drift))
        self._next = 0
        self._gaps = [_gap(rng) for _ in MARKERS] if name == "body" else []
        self._clock: Clock | None = None

    def start(self, clock: Clock) -> None:
        """Begin to read; the clock is the throw's, too."""
        self._clock = clock

    def read(self) -> list[Sample]:
        """All that came since the last call."""
        if self._clock is None:
            return []
        now, kind = self._clock.now(), self.kind
        self._world.to(now)
        due = floor((min(now, self.silent) - kind.delay - self._begins) * kind.rate * (1 + 1e-12)) + 1
        samples = []
        while self._next < due:
            stamp = self._begins + self._next / kind.rate
            self._next += 1
            samples.append(Sample(self._reading(stamp), stamp, stamp + kind.delay))
        return samples

    def stop(self) -> None:
        """Fall silent."""
        self._clock = None

    def _reading(self, time: float) -> np.ndarray:
        rng, kind = self._rng, self.kind
        keep = np.exp(-1 / (kind.rate * LASTS))
        self._drift = keep * self._drift + np.sqrt(1 - keep**2) * kind.drift * rng.standard_normal(len(kind.drift))
        off = self._drift + kind.noise * rng.standard_normal(len(kind.noise))
        lost = rng.random() < kind.lost
        truth = self._truth(time)
        if self.name == "head":
            return _quaternion(*(truth + off[:2]), off[2])
        values = truth + off
        if self.name == "shoes":
            values = np.clip(np.round(values / 4.0), 0, 255) * 4.0  # eight bits
        for i, (begin, end) in enumerate(self._gaps):
            if begin <= time < end:
                values[3 * i : 3 * i + 3] = np.nan
        if lost or time < self.hidden:
            values[:] = np.nan
        return np.asarray(values)


def _gap(rng: np.random.Generator) -> tuple[float, float]:
    """When a marker is covered: in one throw of four, for a tenth of a second or so."""
    if rng.random() > 0.25:
        return np.inf, np.inf
    begin = rng.uniform(0, 1.6)
    return begin, begin + rng.uniform(0.05, 0.15)


def _truths(world: World) -> dict[str, Callable[[float], np.ndarray]]:
    throw = world.throw
    body = np.concatenate([throw.joints[name] for name in MARKERS.values()], axis=1)

    def of(values: np.ndarray) -> Callable[[float], np.ndarray]:
        return lambda time: values[min(round(time / STEP), len(values) - 1)]

    def logged(what: str) -> Callable[[float], np.ndarray]:
        return lambda time: np.asarray(getattr(world.log[min(round(time / STEP), len(world.log) - 1)], what))

    return {
        "body": of(body),
        "imu": of(throw.imu),
        "shoes": of(throw.pressures),
        "head": of(throw.look),
        "ball": logged("ball"),
        "joints": logged("joints"),
    }


def _quaternion(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """(4,) x, y, z, w of a head that looks along -x at 0, turned to its left and up, and tilted."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("ZYX", [np.pi + yaw, -pitch, roll]).as_quat())


def watches(world: World, seed: list[int], **options: dict[str, float]) -> list[Watch]:
    """All five. options: by modality. Each has a seed of its own: [*seed, 0] draws the same as seed alone."""
    return [
        Watch(n, world, np.random.default_rng([*seed, 1 + i]), **options.get(n, {})) for i, n in enumerate(MODALITIES)
    ]
