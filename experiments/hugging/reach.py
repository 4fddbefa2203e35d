"""Postures by inverse kinematics: the joints that bring some places of a body where they are wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

DAMPING, COMFORT = 0.05, 0.02  # [m] of a step, and how much a posture that is near the first one is liked
STEPS = 120


def reach(
    model: Any, data: Any, joints: Sequence[str], places: Mapping[str, Sequence[float]], weights: Mapping[str, float]
) -> np.ndarray:
    """The angles (J,) of these joints with which the sites are nearest to their places [m], from those in `data`.

    weights: how much each site counts. By damped least squares, inside the joints' ranges; `data` is left there.
    """
    import mujoco

    at = np.array([model.joint(name).qposadr[0] for name in joints])
    columns = np.array([model.joint(name).dofadr[0] for name in joints])
    limited = np.array([bool(model.joint(name).limited[0]) for name in joints])
    ranges = np.array([model.joint(name).range for name in joints])
    low = np.where(limited, ranges[:, 0] + 0.03, -np.pi)
    high = np.where(limited, ranges[:, 1] - 0.03, np.pi)
    home = data.qpos[at].copy()
    for _ in range(STEPS):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        rows, errors = [COMFORT * np.eye(len(at))], [COMFORT * (home - data.qpos[at])]
        for site, place in places.items():
            jacobian = np.zeros((3, model.nv))
            mujoco.mj_jacSite(model, data, jacobian, None, model.site(site).id)
            rows.append(weights.get(site, 1.0) * jacobian[:, columns])
            errors.append(weights.get(site, 1.0) * (np.asarray(place) - data.site(site).xpos))
        matrix, error = np.concatenate(rows), np.concatenate(errors)
        step = np.linalg.solve(matrix.T @ matrix + DAMPING**2 * np.eye(len(at)), matrix.T @ error)
        data.qpos[at] = np.clip(data.qpos[at] + np.clip(step, -0.2, 0.2), low, high)
    return data.qpos[at].copy()
