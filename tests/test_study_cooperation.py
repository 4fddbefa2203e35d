"""The cooperation study's world: bodies, forces, sensors and demonstrations that obey their laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import system_packages

pytest.importorskip("mujoco")
pytest.importorskip("mink")

import mujoco

from experiments.bodies.person import SHARES
from experiments.cooperation.demonstrations import distorted
from experiments.cooperation.guide import RATE, frame, led
from experiments.cooperation.people import Track, someone
from experiments.cooperation.plan import plan
from experiments.cooperation.posture import posture, weight_middle
from experiments.cooperation.sensors import CONTROLLED, OBSERVED, TICK, TRACKED, Moment, Sensors, hidden
from experiments.cooperation.trial import Hand, Trial, demonstrated
from experiments.cooperation.world import HANDOVER, LIFT, STEP, Place, World
from inphase.trajectory import Demonstration

FEET = np.array([[0.0, -0.12, 0.0], [0.0, 0.12, 0.0]])
HANGING = np.array([[0.07, -0.25, 0.80], [0.07, 0.25, 0.80]])
PLAIN = replace(
    someone(0, 0),
    mounts=np.stack([np.eye(3)] * 2),
    electrodes=np.ones((2, 4, 3)),
    soles=np.ones((2, 4)),
)


@pytest.fixture(scope="module", params=[HANDOVER, LIFT], ids=lambda place: place.name)
def shown(request: pytest.FixtureRequest) -> tuple[Place, Trial]:
    return request.param, demonstrated(plan(request.param, 0, 3), np.random.default_rng(0))
