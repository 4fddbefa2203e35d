"""Who demonstrates: knows where the ball will come, holds the box there, and is as careful as people are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from experiments.bodies.arm import JOINTS, VELOCITY
from experiments.catching.flight import crossing
from experiments.catching.thrower import Throw
from experiments.catching.world import HOME, STAND, World, built

LAG = 0.04  # [s] by which the arm is late: who guides it by hand does not see that
SHOULDER = np.array([0.0, 0.0, STAND + 0.16])  # [m] of the arm
LENGTH = 0.80  # [m] from there to the box's opening: how far people stretch an arm that they guide
NEAR = 0.01  # [m] to where the box is wanted: as near is there
FASTEST = 0.95 * VELOCITY


@dataclass(frozen=True)
class Plan:
    """Where the joints are led: from home, from a time on [s], to a pose (6,) at another."""

    begin: float
    end: float
    pose: np.ndarray
    wobble: np.ndarray  # (2, 6) amplitude [rad] and phase of a hand that is not steady

    def at(self, time: float) -> np.ndarray:
        """(6,) with the least jerk."""
        s = float(np.clip((time - self.begin) / (self.end - self.begin), 0, 1))
        ease = s**3 * (10 - 15 * s + 6 * s**2)
        return np.asarray(
            HOME + ease * (self.pose - HOME) + 4 * s * (1 - s) * self.wobble[0] * np.sin(5 * s + self.wobble[1])
        )


def plan(throw: Throw, rng: np.random.Generator) -> Plan | None:
    """How to catch that throw; None where the ball does not come within reach, or too soon.

    The box goes where the ball comes within arm's length, its opening towards it.
    """
    length = LENGTH + rng.normal(0, 0.015)
    came = crossing(throw.position, throw.velocity, lambda place: float(np.linalg.norm(place - SHOULDER)) - length)
    if came is None:
        return None
    time, place, velocity = came
    off = rng.normal(0, 0.012, 3)
    pose = reached(place + off, -velocity)
    if pose is None:
        return None
    catch = throw.release + time
    begin = throw.release + rng.uniform(-0.12, 0.08)
    end = catch - rng.uniform(0.05, 0.12)
    if (1.875 * np.abs(pose - HOME) / (end - begin) > FASTEST).any():
        return None
    return Plan(begin, end, pose, np.stack([rng.normal(0, 0.012, len(HOME)), rng.uniform(0, 6.3, len(HOME))]))


def demonstrate(throw: Throw, planned: Plan) -> World:
    """The world after the throw was caught, or was not, and the ball has had half a second to come to rest."""
    world = World(throw)
    falls = throw.release + 1.6
    while world.time < (falls if world.entered is None else world.entered + 0.5):
        world.target = planned.at(world.time + LAG)
        world.step()
    return world


def reached(place: np.ndarray, towards: np.ndarray) -> np.ndarray | None:
    """(6,) the joints with which the box's opening is there and looks that way; None where the arm cannot."""
    import mink

    configuration, tasks, opening = _kinematics()
    z = towards / np.linalg.norm(towards)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    frame = mink.SO3.from_matrix(np.column_stack([x, np.cross(z, x), z]))
    opening.set_target(mink.SE3.from_rotation_and_translation(frame, np.asarray(place)))
    configuration.update(_whole(HOME))
    limits = [mink.ConfigurationLimit(configuration.model)]
    for _ in range(60):
        velocity = mink.solve_ik(configuration, tasks, 0.1, "daqp", 1e-4, limits=limits)
        velocity[len(JOINTS) :] = 0.0  # the ball is no joint of the arm
        configuration.integrate_inplace(velocity, 0.1)
        error = opening.compute_error(configuration)
        if np.linalg.norm(error[:3]) < 1e-3 and np.linalg.norm(error[3:]) < 1e-2:
            break
    if np.linalg.norm(error[:3]) > NEAR or np.linalg.norm(error[3:]) > 0.1:
        return None
    return np.array(configuration.q[: len(JOINTS)])


@lru_cache(maxsize=1)
def _kinematics() -> tuple[Any, list[Any], Any]:
    import mink

    model = built()
    configuration = mink.Configuration(model)
    opening = mink.FrameTask("opening", "site", position_cost=1.0, orientation_cost=0.3, gain=0.8)
    posture = mink.PostureTask(model, cost=1e-3)
    posture.set_target(_whole(HOME))
    return configuration, [opening, posture], opening


def _whole(joints: np.ndarray) -> np.ndarray:
    """(13,) all coordinates of the model: those of the arm stand first, the ball's follow."""
    return np.array([*joints, 6.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0])
