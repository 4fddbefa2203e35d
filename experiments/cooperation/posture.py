"""What the rest of a body does so that the hands come where they are to be."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from experiments.bodies.person import SHARES, bent

LEAN, SQUAT = 1.15, 0.34  # [rad], [m] at most
SLACK = 0.97  # of an arm's length that is used
SMOOTH, EASY = 0.01, 0.08  # [m], of an effort: so that nothing about a body jerks
EFFORTS = np.linspace(-0.5, 1.0, 25)
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
    across = np.array([0.0, length["shoulders"] / 2, 0.0])
    most = (ease, ease + (LEAN - ease) * min(1.0, 0.6 + back), SQUAT * min(1.0, 1.6 * (1.0 - back)))

    legs = 0.985 * (length["shank"] + length["thigh"])
    apart = np.abs(feet[:, 1] - pelvis[1] - np.array([-0.5, 0.5]) * length["hips"])
    wide = min(float(np.linalg.norm(apart, 8)), 0.8 * legs)  # of the leg that is farther aside, smoothly
    high = length["ankle"] + np.sqrt(legs**2 - wide**2)

    def trunk(effort: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of so much of what it can do (E,): hips, the middle of the shoulders (E, 3), and upwards (E, 3)."""
        lean, drop = most[0] + (most[1] - most[0]) * effort, most[2] * effort
        hips = np.empty((len(effort), 3))
        hips[:, 0] = pelvis[0] - 0.16 * np.sin(lean)  # so that it does not fall over
        hips[:, 1] = pelvis[1]
        hips[:, 2] = high - drop
        up = np.stack([np.sin(lean), np.zeros_like(lean), np.cos(lean)], axis=1)
        return hips, hips + length["trunk"] * up, up

    def over(effort: np.ndarray) -> np.ndarray:
        """(E,) how far palms are beyond the arms' reach [m], the farther of both, smoothly."""
        shoulders = trunk(effort)[1] + np.stack([-across, across])[:, None]
        apart = np.linalg.norm(palms[:, None] - shoulders, axis=2)
        reach = length["upper_arm"] + length["forearm"] + length["hand"]
        return np.asarray(SMOOTH * np.logaddexp(*((apart - SLACK * reach) / SMOOTH)))

    needed = _root(over)
    effort = min(EASY * float(np.logaddexp(0.0, needed / EASY)), 1.0)  # it begins to bend before it must
    hips, neck, up = (each[0] for each in trunk(np.array([effort])))
    lean = most[0] + (most[1] - most[0]) * effort
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


def _root(over: Callable[[np.ndarray], np.ndarray]) -> float:
    """The least effort at which nothing is over its reach; below 0 where there is some to spare."""
    tried = over(EFFORTS)
    beyond = np.flatnonzero(tried > 0)
    if not len(beyond):
        return float(EFFORTS[0])
    i = int(beyond[-1])
    if i == len(EFFORTS) - 1:
        return 1.0
    low, high, off, left = EFFORTS[i], EFFORTS[i + 1], tried[i], tried[i + 1]
    for _ in range(3):  # by regula falsi
        middle = low + (high - low) * off / (off - left)
        value = float(over(np.array([middle]))[0])
        if value > 0:
            low, off = middle, value
        else:
            high, left = middle, value
    return float(low + (high - low) * off / (off - left))
