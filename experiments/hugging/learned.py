"""A model of all hugs that were taught, and a robot that is moved by what it says."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import inphase
from experiments.hugging.demonstrations import dataset
from experiments.hugging.hug import OBSERVED
from experiments.hugging.showing import partner_alone, partner_now
from experiments.hugging.world import JOINTS

LOOKAHEAD = 0.025  # of an interaction of ten seconds: the operator was 0.2 to 0.3 s late


def learn(taught: Mapping[str, Mapping[str, Any]], calibrate: bool) -> dict[str, Any]:
    """The model that goes online, as the bytes of its file: what the partner does, nothing else set."""
    with threadpool_limits(limits=1), tempfile.TemporaryDirectory() as folder:
        shown = partner_alone(dataset(taught))
        path = Path(folder) / "hugging.inphase"
        inphase.fit(shown.dataset, basis=shown.bases, calibrate=calibrate).save(path)
        return {"saved": np.frombuffer(path.read_bytes(), dtype=np.uint8)}


def model(stored: Mapping[str, Any]) -> inphase.Model:
    """The model that was learned."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hugging.inphase"
        path.write_bytes(np.asarray(stored["saved"]).tobytes())
        return inphase.Model.load(path)


class Learned:
    """Moves the robot: every row is observed, and what is said for a little later goes to the retargeting (3.2.1)."""

    def __init__(self, session: inphase.Session) -> None:
        self.session = session
        self.beliefs: list[tuple[float, ...]] = []
        self.said = np.zeros(0)

    def answer(
        self, time: float, row: np.ndarray | None, look: tuple[float, float, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """What the model says; `look` is the operator's, and not for it."""
        if row is not None:
            estimate = self.session.observe(time, partner_now(dict(zip(OBSERVED, row.tolist(), strict=True))))
            self.said = self.session.respond(lookahead=LOOKAHEAD, samples=1).mean[0]
            velocity = (estimate.phase_velocity, estimate.phase_velocity_std)
            self.beliefs.append((estimate.phase, estimate.phase_std, *velocity, estimate.status.trustworthy))
        return self.said[: len(JOINTS)], np.clip(self.said[len(JOINTS) :], 0.0, 255.0)
