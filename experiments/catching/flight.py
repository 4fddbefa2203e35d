"""A ball in the air: gravity and drag."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

GRAVITY = 9.81
RADIUS, MASS = 0.045, 0.10  # [m] as in 3.4.1, [kg]
DRAG = 0.5 * 1.2 * 0.47 * np.pi * RADIUS**2  # [N s²/m²], half of the air's density, a sphere's coefficient, and area


def drag(velocity: np.ndarray) -> np.ndarray:
    """(3,) the force of the air [N]."""
    return -DRAG * np.sqrt(velocity @ velocity) * velocity


def acceleration(velocity: np.ndarray) -> np.ndarray:
    """(3,) of a ball that flies [m/s²]."""
    return drag(velocity) / MASS - [0.0, 0.0, GRAVITY]


def fly(position: np.ndarray, velocity: np.ndarray, duration: float, steps: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """(3,) where a ball is after that long [s], and (3,) how fast; Runge and Kutta of the fourth order."""
    p, v, dt = np.array(position, dtype=np.float64), np.array(velocity, dtype=np.float64), duration / steps
    for _ in range(steps):
        a1 = acceleration(v)
        a2 = acceleration(v + dt / 2 * a1)
        a3 = acceleration(v + dt / 2 * a2)
        a4 = acceleration(v + dt * a3)
        p = p + dt * v + dt**2 / 6 * (a1 + a2 + a3)
        v = v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return p, v


def aimed(position: np.ndarray, target: np.ndarray, duration: float) -> np.ndarray:
    """(3,) the velocity with which a ball has to leave to be at the target after that long [s]."""
    velocity = (np.asarray(target) - position) / duration + [0.0, 0.0, GRAVITY * duration / 2]
    for _ in range(4):
        velocity = velocity + (target - fly(position, velocity, duration, 12)[0]) / duration
    return np.asarray(velocity)


def crossing(
    position: np.ndarray, velocity: np.ndarray, ahead: Callable[[np.ndarray], float], longest: float = 2.0
) -> tuple[float, np.ndarray, np.ndarray] | None:
    """When [s], where and how fast a ball passes a surface; None where it does not.

    ahead: (3,) → how far a place is before the surface [m]. longest: [s] that the ball is followed.
    """
    p, v, dt = np.array(position, dtype=np.float64), np.array(velocity, dtype=np.float64), 0.02
    far = ahead(p)
    if far <= 0:
        return None
    for step in range(round(longest / dt)):
        then, faster = fly(p, v, dt, 2)
        left = ahead(then)
        if left <= 0:
            part = dt * far / (far - left)
            return step * dt + part, *fly(p, v, part, 2)
        p, v, far = then, faster, left
    return None
