"""What the rest of a body does so that the hands come where they are to be."""

from __future__ import annotations

import numpy as np

from experiments.bodies.person import SHARES, bent

LEAN, SQUAT = 1.15, 0.34  # [rad], [m] at most
SLACK = 0.97  # of an arm's length that is used
EFFORTS = np.linspace(0.0, 1.0, 33)
RIGHT, LEFT = 0, 1
SIDES = ("right", "left")


def posture(
    height: float, back: float, pelvis: np.ndarray, feet: np.ndarray, palms: np.ndarray, ease: float = 0.0
) -> dict[str, np.ndarray]:
    """The skeleton [m] that has its palms (2, 3), right and left, there, bent no more than needed.

    back: how much of it the back does, the rest the knees. pelvis: (2,) above the floor. feet: (2, 3) the ankles' place
    less their height. ease: how far it leans where the arms need not [rad].
    """
    length = {name: share * height for name, share in SHARES.items()}
    reach = length["upper_arm"] + length["forearm"] + length["hand"]
    lean = ease + (LEAN - ease) * EFFORTS * min(1.0, 0.6 + back)
    drop = SQUAT * EFFORTS * min(1.0, 1.6 * (1.0 - back))
    hips = np.zeros((len(EFFORTS), 3))
    hips[:, 0] = pelvis[0] - 0.16 * np.sin(lean)  # so that it does not fall over
    hips[:, 1] = pelvis[1]
    hips[:, 2] = length["ankle"] + 0.985 * (length["shank"] + length["thigh"]) - drop
    up = np.stack([np.sin(lean), np.zeros_like(lean), np.cos(lean)], axis=1)
    neck = hips + length["trunk"] * up
    across = np.array([0.0, length["shoulders"] / 2, 0.0])
    shoulders = np.stack([neck - across, neck + across])  # (2, E, 3)
    over = (np.linalg.norm(palms[:, None] - shoulders, axis=2) - SLACK * reach).max(axis=0)
    effort = _first_below(over)
    lean, hips = float(np.interp(effort, EFFORTS, lean)), _at(effort, hips)
    up = np.array([np.sin(lean), 0.0, np.cos(lean)])
    neck = hips + length["trunk"] * up
    nod = np.array([np.sin(lean + 0.1), 0.0, np.cos(lean + 0.1)])
    joints = {"neck": neck + length["neck"] * up}
    joints["head"] = joints["neck"] + length["skull"] * nod + [0.02, 0.0, 0.0]
    for i, (side, sign) in enumerate(zip(SIDES, (-1, 1), strict=True)):
        shoulder = neck + sign * across
        lower = length["forearm"] + length["hand"]
        elbow = bent(shoulder, palms[i], length["upper_arm"], lower, np.array([-0.35, 0.5 * sign, -0.8]))
        forward = (palms[i] - elbow) / max(float(np.linalg.norm(palms[i] - elbow)), 1e-9)
        hip = hips + np.array([0.0, sign * length["hips"] / 2, 0.0])
        ankle = feet[i] + [0.0, 0.0, length["ankle"]]
        knee = bent(hip, ankle, length["thigh"], length["shank"], np.array([1.0, 0.1 * sign, 0.0]))
        joints |= {f"{side}_shoulder": shoulder, f"{side}_elbow": elbow}
        joints |= {f"{side}_wrist": elbow + length["forearm"] * forward, f"{side}_hip": hip}
        joints |= {f"{side}_knee": knee, f"{side}_ankle": ankle}
    return joints


def weight_middle(joints: dict[str, np.ndarray]) -> np.ndarray:
    """(3,) where the middle of the body's mass is (shares after Winter)."""
    hips = (joints["left_hip"] + joints["right_hip"]) / 2
    arms = sum(joints[f"{s}_elbow"] for s in SIDES) / 2
    legs = sum(joints[f"{s}_knee"] for s in SIDES) / 2
    return np.asarray(0.08 * joints["head"] + 0.25 * joints["neck"] + 0.25 * hips + 0.10 * arms + 0.32 * legs)


def _first_below(over: np.ndarray) -> float:
    """The least effort at which nothing is over its reach, between two that were tried."""
    below = np.flatnonzero(over <= 0)
    if not len(below):
        return 1.0
    i = int(below[0])
    if i == 0:
        return 0.0
    return float(EFFORTS[i - 1] + (EFFORTS[i] - EFFORTS[i - 1]) * over[i - 1] / (over[i - 1] - over[i]))


def _at(effort: float, way: np.ndarray) -> np.ndarray:
    return np.array([np.interp(effort, EFFORTS, column) for column in way.T])
