"""What a thrower's head, shoes and forearm do, as perfect sensors would read it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import sosfilt, sosfilt_zi
from scipy.spatial.transform import Rotation

from experiments.bodies.person import SHARES
from experiments.catching.flight import GRAVITY
from experiments.catching.motion import STEP, TIMES, Body, ease
from experiments.catching.style import Style, Variation


def look_at(who: Style, variation: Variation, body: Body, target: np.ndarray) -> np.ndarray:
    """(T, 2) first at the ball in the hand, then where it is to go, then after it."""
    t = TIMES
    eyes = body.hips + np.array([0, 0, 0.41 * who.height])
    to = target - eyes
    yaw = np.arctan2(-to[:, 1], -to[:, 0])  # from -x, to the left of the person
    up = np.arctan2(to[:, 2], np.hypot(to[:, 0], to[:, 1]))
    begin = body.back + variation.gaze_time
    turned = ease(t, begin - 0.15, begin + 0.30)
    follows = 0.30 * (ease(t, body.release, body.release + 0.25) - ease(t, body.release + 0.4, body.release + 0.8))
    off = who.gaze_off + variation.gaze
    yaw = turned * (who.gaze * yaw + off[0]) - 0.05 * (1 - turned)
    pitch = turned * (who.gaze * up + off[1]) - 0.35 * (1 - turned) + follows
    return np.column_stack([yaw, pitch])


def pressures(who: Style, variation: Variation, body: Body, hand: np.ndarray) -> np.ndarray:
    """(T, 8) what carries the person, and pushes them and their arm forward."""
    t = TIMES
    centre = 0.95 * (body.hips + 0.5 * SHARES["trunk"] * who.height * body.trunk) + 0.05 * hand
    pushed = np.gradient(np.gradient(_smooth(centre, 0.03), STEP, axis=0), STEP, axis=0)
    total = who.weight * np.maximum(GRAVITY + pushed[:, 2], 1.0)
    left = 0.5 - 0.28 * ease(t, body.back, body.forth) + 0.58 * ease(t, body.release - 0.12, body.release + 0.02)
    left = left * np.clip(1 - body.lift / 0.01, 0, 1)
    ahead = np.clip(pushed[:, 0] / GRAVITY, -0.6, 0.6)  # a push to -x needs the centre of pressure behind
    cells = []
    for side, share, bias in ((0, left, variation.toes[0]), (1, 1 - left, variation.toes[1])):
        toes = np.clip(0.45 + bias - 0.6 * ahead + (0.15 - 0.3 * side) * ease(t, body.forth, body.release), 0.05, 0.95)
        inner = np.clip(0.5 + (0.3 if side else -0.3) * body.twist, 0.1, 0.9)
        load = share * total
        cells += [load * (1 - toes) * inner, load * (1 - toes) * (1 - inner), load * toes * inner]
        cells += [load * toes * (1 - inner)]
    return np.asarray(_smooth(np.column_stack(cells), 0.012) * who.cells)


def imu(who: Style, joints: Mapping[str, np.ndarray]) -> np.ndarray:
    """(T, 6) at the wrist, in the forearm's frame, a little askew."""
    wrist, elbow = joints["right_wrist"], joints["right_elbow"]
    along = _unit(wrist - elbow)
    outward = _unit(np.cross(along, [0.0, 1.0, 0.0]))  # the arm's pendulum turns about an axis that is nearly y
    frames = np.stack([outward, np.cross(along, outward), along], axis=2) @ Rotation.from_rotvec(who.mount).as_matrix()
    # A sensor that is strapped to skin does not feel faster than that.
    pushed = np.gradient(np.gradient(_smooth(wrist, 0.012), STEP, axis=0), STEP, axis=0)
    pushed = pushed + np.array([0, 0, GRAVITY])
    spin = frames.transpose(0, 2, 1) @ np.gradient(_smooth(frames, 0.012), STEP, axis=0)
    turning = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    return np.concatenate([np.einsum("tij,ti->tj", frames, pushed), turning], axis=1)


def _smooth(values: np.ndarray, span: float) -> np.ndarray:
    """As something soft follows them, about so late [s] and never early: critically damped."""
    follows = 1 - np.exp(-2 * STEP / span)
    sections = np.tile([follows, 0.0, 0.0, 1.0, follows - 1.0, 0.0], (2, 1))
    begun = sosfilt_zi(sections)[..., None] * values[0].ravel()
    smooth, _ = sosfilt(sections, values.reshape(len(values), -1), axis=0, zi=begun)
    return np.asarray(smooth.reshape(values.shape))


def _unit(rows: np.ndarray) -> np.ndarray:
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))
