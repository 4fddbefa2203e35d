"""A person who throws a ball underhand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from experiments.bodies.person import SHARES
from experiments.catching.felt import imu, look_at, pressures
from experiments.catching.flight import aimed
from experiments.catching.motion import STEP, TIMES, Swing, body_path, hand_path, ray, skeleton
from experiments.catching.style import Style, varied

AIM_AT = 0.60  # [m] before the robot's base: where the ball is to come


@dataclass(frozen=True)
class Throw:
    """All of a throw, without any sensor. Arrays are over `times`.

    joints: (T, 3) by name. hand: (T, 3) where the ball is held. look: (T, 2) yaw and pitch of the head. pressures:
    (T, 8) [N] on heel and toes, inside and outside, of the left and the right shoe. imu: (T, 6) specific force [m/s²]
    and rate of turn [rad/s] of the throwing forearm. release: [s]. position, velocity: (3,) of the ball then.
    """

    style: Style
    times: np.ndarray
    joints: Mapping[str, np.ndarray]
    hand: np.ndarray
    look: np.ndarray
    pressures: np.ndarray
    imu: np.ndarray
    release: float
    position: np.ndarray
    velocity: np.ndarray


def throw(who: Style, rng: np.random.Generator) -> Throw:
    """One throw: an aim, a wind-up for it that is never twice the same, and an arm and fingers that miss a little."""
    target = np.array([AIM_AT, np.clip(rng.normal(0, 0.30), -0.6, 0.6), rng.uniform(0.80, 1.20)])
    flight = float(np.clip(rng.normal(who.flight, 0.06), 0.72, 1.15))
    variation = varied(who, target[1], flight, rng)
    motor = rng.normal(0, [0.08, 0.08, 0.10])  # [m/s] by which the arm misses the intended speed
    slip = rng.normal(0, 0.05, 3)  # [m/s] by which the ball leaves the fingers otherwise than they move
    length = who.stretch * (SHARES["upper_arm"] + SHARES["forearm"] + SHARES["hand"]) * who.height
    swing = Swing(0.8, 0.0, 8.0)
    for _ in range(5):
        body = body_path(who, variation, swing)
        i = round(body.release / STEP)
        wanted = aimed(body.shoulder[i] + length * ray(swing.angle, swing.azimuth), target, flight) + motor
        arm = wanted - (body.shoulder[i + 1] - body.shoulder[i - 1]) / (2 * STEP)
        ahead = float(np.hypot(arm[0], arm[1]))
        swing = Swing(np.arctan2(arm[2], ahead), np.arctan2(-arm[1], -arm[0]), float(np.linalg.norm(arm)) / length)
    body = body_path(who, variation, swing)
    hand = hand_path(who, variation, swing, body, length)
    i = round(body.release / STEP)
    left = (hand[i + 1] - hand[i - 1]) / (2 * STEP)
    joints = skeleton(who, variation, body, hand)
    return Throw(
        who,
        TIMES,
        joints,
        hand,
        look_at(who, variation, body, target),
        pressures(who, variation, body, hand),
        imu(who, joints),
        i * STEP,
        hand[i],
        left + slip,
    )
