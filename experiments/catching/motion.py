"""How a thrower's body moves: trunk and feet, the swinging arm, and the skeleton that follows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.bodies.person import SHARES, bent
from experiments.catching.style import STANDS, Style, Variation

STEP = 0.002  # [s] of the person's time
DURATION = 2.6  # [s] that is followed
TIMES = np.arange(round(DURATION / STEP) + 1) * STEP


@dataclass(frozen=True)
class Swing:
    """How the arm stands and turns at release [rad, rad, rad/s]."""

    angle: float
    azimuth: float
    rate: float


@dataclass(frozen=True)
class Body:
    """Trunk and feet over time, and when the parts of the throw begin [s]."""

    back: float  # the backswing
    forth: float  # the swing
    release: float
    hips: np.ndarray
    shoulder: np.ndarray  # the throwing one
    trunk: np.ndarray  # (T, 3) its direction
    twist: np.ndarray
    left_ankle: np.ndarray
    lift: np.ndarray  # of the left foot [m]


def body_path(who: Style, variation: Variation, swing: Swing) -> Body:
    """A wind-up, a stride and a lean that end in the release."""
    t, h = TIMES, who.height
    back = variation.lead
    forth = back + variation.backswing_time
    release = forth + variation.whip * (variation.backswing + swing.angle) / swing.rate
    pace = release - forth
    stepping = ease(t, forth - 0.4 * variation.backswing_time, release - 0.1 * pace)
    lift = 0.25 * variation.stride * 4 * stepping * (1 - stepping)
    stand = np.array([STANDS + variation.place[0], variation.place[1], 0.0])
    ankle = stand + np.array([0, -0.11, SHARES["ankle"] * h])
    left_ankle = ankle + np.outer(stepping, [-variation.stride, 0, 0]) + np.outer(lift, [0, 0, 1])
    sway = ease(t, back, forth) * 0.04 - ease(t, forth, release + 0.1) * (0.04 + 0.55 * variation.stride)
    dip = 0.02 * ease(t, back, forth) - 0.02 * ease(t, forth, release)
    hips_height = (SHARES["ankle"] + SHARES["shank"] + SHARES["thigh"] - 0.006) * h
    hips = stand + np.column_stack([sway, 0 * t, hips_height - dip - 0.12 * variation.stride * ease(t, forth, release)])
    lean = 0.04 - 0.08 * ease(t, back, forth) + (variation.lean + 0.04) * ease(t, forth, release + 0.15)
    twist = variation.twist * ease(t, back, forth) - 1.5 * variation.twist * ease(t, forth, release + 0.05)
    trunk = np.column_stack([-np.sin(lean), 0 * t, np.cos(lean)])
    across = np.column_stack([np.sin(twist), np.cos(twist), 0 * t])
    shoulder = hips + SHARES["trunk"] * h * trunk + SHARES["shoulders"] / 2 * h * across
    return Body(back, forth, release, hips, shoulder, trunk, twist, left_ankle, lift)


def hand_path(who: Style, variation: Variation, swing: Swing, body: Body, length: float) -> np.ndarray:
    """(T, 3) the arm is a pendulum: it goes back, and swings to the angle, in the plane and at the rate wanted."""
    t, after = TIMES, 0.40
    angle = variation.start + (-variation.backswing - variation.start) * ease(t, body.back, body.forth)
    forth = (t >= body.forth) & (t < body.release)
    angle[forth] = _quintic(
        t[forth] - body.forth, body.release - body.forth, -variation.backswing, 0.0, swing.angle, swing.rate
    )
    over = t >= body.release
    end = swing.angle + 0.40 * swing.rate * after
    angle[over] = _quintic(np.minimum(t[over] - body.release, after), after, swing.angle, swing.rate, end, 0.0)
    behind = swing.azimuth + variation.plane
    azimuth = behind - variation.plane * ease(t, body.forth, body.forth + 0.6 * (body.release - body.forth))
    bend = 0.80 + 0.20 * ease(t, body.back, body.forth) - 0.25 * ease(t, body.release + 0.05, body.release + after)
    return np.asarray(body.shoulder + length * bend[:, None] * ray(angle, azimuth))


def skeleton(who: Style, variation: Variation, body: Body, hand: np.ndarray) -> dict[str, np.ndarray]:
    """(T, 3) of every joint, by name: what hangs between trunk, feet and hand."""
    h, t = who.height, TIMES
    length = {name: share * h for name, share in SHARES.items()}
    across = np.column_stack([np.sin(body.twist), np.cos(body.twist), 0 * t])  # to the right: they face -x
    top = body.hips + length["trunk"] * body.trunk
    joints = {"neck": top + length["neck"] * body.trunk}
    joints["head"] = joints["neck"] + [-0.015 * h, 0, length["skull"]]
    for side, sign in (("right", 1), ("left", -1)):
        joints[f"{side}_shoulder"] = top + sign * length["shoulders"] / 2 * across
        joints[f"{side}_hip"] = body.hips + np.array([0, sign * length["hips"] / 2, 0])
    right_ankle = body.hips[:1] * [1, 1, 0] + [0, 0.11, length["ankle"]]
    joints["right_ankle"] = np.tile(right_ankle, (len(t), 1))
    joints["left_ankle"] = body.left_ankle
    swinging = ease(t, body.back, body.forth) - 1.6 * ease(t, body.forth, body.release + 0.1)
    free = (
        np.column_stack([-0.10 - 0.14 * swinging, -0.10 + 0 * t, -0.44 + 0.08 * np.abs(swinging)]) + variation.free_arm
    )
    joints["left_wrist"] = joints["left_shoulder"] + free * h / 1.74
    reach = length["upper_arm"] + length["forearm"]
    way = hand - joints["right_shoulder"]
    far = np.linalg.norm(way, axis=1, keepdims=True)
    joints["right_wrist"] = joints["right_shoulder"] + way * np.minimum(1 - length["hand"] / far, 0.998 * reach / far)
    for side in ("right", "left"):
        for joint, root, end, upper, lower, ahead in (
            ("elbow", "shoulder", "wrist", "upper_arm", "forearm", (1.0, 0.3 * (1 if side == "right" else -1), -0.3)),
            ("knee", "hip", "ankle", "thigh", "shank", (-1.0, 0.0, 0.0)),
        ):
            between = joints[f"{side}_{root}"], joints[f"{side}_{end}"]
            joints[f"{side}_{joint}"] = bent(*between, length[upper], length[lower], ahead)
    return joints


def ray(angle: np.ndarray | float, azimuth: np.ndarray | float) -> np.ndarray:
    """Where an arm points that is swung so far forward from hanging, in a plane turned so far from -x."""
    return np.stack([-np.sin(angle) * np.cos(azimuth), -np.sin(angle) * np.sin(azimuth), -np.cos(angle)], axis=-1)


def ease(t: np.ndarray, begin: float, end: float) -> np.ndarray:
    """From 0 to 1 with the least jerk."""
    s = np.clip((t - begin) / (end - begin), 0, 1)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def _quintic(t: np.ndarray, duration: float, p0: float, v0: float, p1: float, v1: float) -> np.ndarray:
    """From one place and velocity to another, without acceleration at both ends."""
    s, way = t / duration, p1 - p0
    a, b = v0 * duration, v1 * duration
    return np.asarray(
        p0
        + a * s
        + (10 * way - 6 * a - 4 * b) * s**3
        + (-15 * way + 8 * a + 7 * b) * s**4
        + (6 * way - 3 * a - 3 * b) * s**5
    )
