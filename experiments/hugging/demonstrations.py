"""Hugs that are taught: by four people, with the same operator, as recordings that a model learns from (3.3.2.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import inphase
from experiments.hugging import camera, pads
from experiments.hugging.hug import OBSERVED, Hug, hug
from experiments.hugging.partner import SHIRTS, Partner
from experiments.hugging.teleoperator import Teleoperator
from experiments.hugging.world import JOINTS, world

TRAINED, NOVEL = 4, 2
MADE, KEPT = 150, 121  # hugs that are taught, and of them with contact on all sides, as in 3.3.2.2
CHEST, BACK = 60.0, 25.0  # [raw] of a hug that is one: median over the time the operator presses
CONTROLLED = (*(f"joint_{name}" for name in JOINTS), *(f"force_{name}" for name in pads.ARMS))
FORCES = {side: [CONTROLLED.index(f"force_{n}") for n in pads.ARMS if n.startswith(side)] for side in ("left", "right")}
UNITS = {"pose_*": "px", "touch_*": "raw", "joint_*": "rad", "force_*": "raw"}


def people(seed: int) -> list[Partner]:
    """All six: four who teach it, and two whom it has never met."""
    return [Partner.meet(np.random.default_rng([seed, 1, i]), SHIRTS[i]) for i in range(TRAINED + NOVEL)]


def taught(number: int, seed: int) -> Hug:
    """One of the hugs that were taught."""
    rng = np.random.default_rng([seed, 2, number])
    partner = people(seed)[number % TRAINED]
    place = world(partner.body)
    operator = Teleoperator(place, partner.body.shoulder, rng)
    return hug(place, partner.once(rng), operator, rng, matches=True)


def some(numbers: list[int], seed: int) -> dict[str, Any]:
    """Several, as arrays: times_… (T,), values_… (T, 95); what was felt by the partner, to be told."""
    found: dict[str, Any] = {}
    for number in numbers:
        made = taught(number, seed)
        found |= {f"times_{number}": made.times, f"values_{number}": made.values.astype(np.float32)}
        held = (made.clock > made.visit.holds_from + 0.8) & (made.clock < made.visit.withdraws)
        found[f"hold_{number}"] = made.pressing[held].mean(0)
        found[f"kept_{number}"] = significant(made)
    return found


def significant(made: Hug) -> bool:
    """Whether chest and back were pressed while the operator pressed."""
    touch = made.read[made.wanted.max(1) > 40, len(camera.NAMES) :]
    chest, back = (_median(touch, groups) for groups in (pads.CHEST, pads.BACK))
    return bool(chest >= CHEST and back >= BACK)


def _median(touch: np.ndarray, groups: Mapping[str, int]) -> float:
    columns = [pads.NAMES.index(name) for group in groups for name in pads.SENSORS[group]]
    return float(np.median(touch[:, columns].max(1))) if len(touch) else 0.0


def dataset(found: Mapping[str, Mapping[str, Any]]) -> inphase.Dataset:
    """Those that were taught and are kept, by number."""
    arrays = {name: value for part in found.values() for name, value in part.items()}
    numbers = sorted(int(name.split("_")[1]) for name in arrays if name.startswith("kept_") and arrays[name])
    numbers = numbers[:KEPT]
    return inphase.Dataset.from_arrays(
        [arrays[f"times_{n}"] for n in numbers],
        [np.asarray(arrays[f"values_{n}"], dtype=np.float64) for n in numbers],
        OBSERVED,
        CONTROLLED,
        units=UNITS,
        groups={"pose_*": "pose", "touch_*": "touch", "force_*": "force", "joint_*": "joint"},
        names=[f"hug {n}, partner {n % TRAINED}" for n in numbers],
    )
