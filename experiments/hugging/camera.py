"""The camera behind the partner, and what a pose estimator makes of its picture: seven points, 30 times a second."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.hugging.world import World

POINTS = ("neck", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist")
NAMES = tuple(f"pose_{point}_{axis}" for point in POINTS for axis in ("x", "y"))
WIDTH, HEIGHT = 640, 480
LATE = 2  # frames of 30 Hz until the estimate is there
WHITE, LASTING, LASTS = 1.5, 3.0, 0.4  # [px], [px], [s]
HIDDEN = 0.10  # [m] in front of a point where something hides it
LOST = 0.02  # of what could be seen


class Pose:
    """Estimates of one recording: what the estimator gets wrong lasts, and is somebody's own.

    Points are told from where the neck was when it was first seen: all begin at the same place, 2 m away, and who is
    taller is not nearer.
    """

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        self.world, self.rng = world, rng
        self.own = 3.0 * rng.standard_normal(len(NAMES))
        self.lasting = LASTING * rng.standard_normal(len(NAMES))
        self.waiting: list[np.ndarray] = []
        self.first: np.ndarray | None = None
        model = world.model
        self.sites = [model.site(f"person_{point}").id for point in POINTS]
        self.camera = model.camera("watching").id
        self.focal = HEIGHT / 2 / np.tan(np.radians(model.cam_fovy[self.camera]) / 2)

    def frame(self, data: Any) -> np.ndarray:
        """(14,) the points in the picture of two frames ago, from the first neck [px]; NaN where hidden or lost."""
        decay = np.exp(-1 / 30 / LASTS)
        fresh = np.sqrt(1 - decay**2) * LASTING * self.rng.standard_normal(len(NAMES))
        self.lasting = decay * self.lasting + fresh
        wrong = self.own + self.lasting + WHITE * self.rng.standard_normal(len(NAMES))
        picture = self.project(data).ravel() + wrong
        gone = self.hidden(data) | (self.rng.random(len(POINTS)) < LOST)
        picture[np.repeat(gone, 2)] = np.nan
        if self.first is None and np.isfinite(picture[:2]).all():
            self.first = picture[:2].copy()
        self.waiting.append(picture - np.tile([np.nan] * 2 if self.first is None else self.first, len(POINTS)))
        return self.waiting.pop(0) if len(self.waiting) > LATE else np.full(len(NAMES), np.nan)

    def project(self, data: Any) -> np.ndarray:
        """(7, 2) where the points are in the picture [px], without error."""
        frame = data.cam_xmat[self.camera].reshape(3, 3)
        seen = (data.site_xpos[self.sites] - data.cam_xpos[self.camera]) @ frame
        return np.stack(
            [WIDTH / 2 + self.focal * seen[:, 0] / -seen[:, 2], HEIGHT / 2 - self.focal * seen[:, 1] / -seen[:, 2]], 1
        )

    def hidden(self, data: Any) -> np.ndarray:
        """(7,) whether something stands between the camera and the point."""
        import mujoco

        eye, geom = data.cam_xpos[self.camera], np.zeros(1, dtype=np.int32)
        found = []
        for site in self.sites:
            ray = data.site_xpos[site] - eye
            far = float(np.linalg.norm(ray))
            hit = mujoco.mj_ray(self.world.model, data, eye, ray / far, None, 1, -1, geom)
            found.append(0 <= hit < far - HIDDEN)
        return np.array(found)
