"""A person who throws a ball underhand: what differs from person to person, and from throw to throw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from experiments.bodies.person import SHARES, bent
from experiments.catching.flight import GRAVITY, aimed

STANDS = 3.7  # [m] before the robot
STEP = 0.002  # [s] of the person's time
DURATION = 2.6  # [s] that is followed
AIM_AT = 0.60  # [m] before the robot's base: where the ball is to come


@dataclass(frozen=True)
class Style:
    """What a person keeps from throw to throw. Angles [rad], lengths [m], times [s]."""

    height: float
    weight: float
    backswing: float
    backswing_time: float
    whip: float  # how late the arm gets fast: the swing takes so many times what its last speed would need
    stretch: float  # of the arm, of its whole length
    stride: float
    lean: float
    twist: float
    flight: float  # how long their throws usually fly
    gaze: float  # share of the direction in which the head turns
    gaze_off: np.ndarray  # (2,) yaw and pitch by which the head looks past it
    cells: np.ndarray  # (8,) how much each cell of the shoes feels
    mount: np.ndarray  # (3,) the turn by which the IMU sits askew


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


def style(rng: np.random.Generator) -> Style:
    """Someone."""
    return Style(
        height=float(np.clip(rng.normal(1.74, 0.08), 1.55, 1.95)),
        weight=float(np.clip(rng.normal(72, 10), 50, 100)),
        backswing=float(np.clip(rng.normal(0.65, 0.12), 0.35, 0.95)),
        backswing_time=float(rng.uniform(0.24, 0.33)),
        whip=float(rng.uniform(1.7, 1.95)),
        stretch=float(rng.uniform(0.90, 0.98)),
        stride=float(rng.uniform(0.15, 0.40)),
        lean=float(rng.uniform(0.10, 0.30)),
        twist=float(rng.uniform(0.10, 0.35)),
        flight=float(np.clip(rng.normal(0.92, 0.05), 0.8, 1.05)),
        gaze=float(rng.uniform(0.6, 0.95)),
        gaze_off=rng.normal(0, [0.04, 0.06]),
        cells=rng.lognormal(0, 0.25, 8),
        mount=rng.normal(0, 0.10, 3),
    )


def throw(who: Style, rng: np.random.Generator) -> Throw:
    """One throw: an aim, a wind-up for it that is never twice the same, and an arm and fingers that miss a little."""
    target = np.array([AIM_AT, np.clip(rng.normal(0, 0.30), -0.6, 0.6), rng.uniform(0.80, 1.20)])
    flight = float(np.clip(rng.normal(who.flight, 0.06), 0.72, 1.15))
    wild = _Wild(
        lead=rng.uniform(0.0, 0.12),
        backswing=who.backswing * rng.lognormal(0, 0.10) * (1 + 0.8 * (flight - 0.92)),
        backswing_time=who.backswing_time * rng.lognormal(0, 0.07),
        whip=who.whip * rng.lognormal(0, 0.03),
        stride=who.stride * rng.lognormal(0, 0.15),
        lean=who.lean * rng.lognormal(0, 0.15),
        twist=who.twist * rng.lognormal(0, 0.15) + 0.3 * np.arctan2(target[1], STANDS),
        place=rng.normal(0, [0.04, 0.04]),
        plane=rng.normal(0.05, 0.05),
        start=rng.normal(0.2, 0.06),
        free_arm=rng.normal(0, 0.05, 3),
        gaze=rng.normal(0, [0.03, 0.05]),
        gaze_time=rng.normal(0.0, 0.05),
        toes=rng.normal(0, 0.06, 2),
    )
    motor = rng.normal(0, [0.08, 0.08, 0.10])  # [m/s] by which the arm misses the intended speed
    slip = rng.normal(0, 0.05, 3)  # [m/s] by which the ball leaves the fingers otherwise than they move
    length = who.stretch * (SHARES["upper_arm"] + SHARES["forearm"] + SHARES["hand"]) * who.height
    swing = _Swing(0.8, 0.0, 8.0)
    for _ in range(5):
        body = _body(who, wild, swing)
        i = round(body.release / STEP)
        wanted = aimed(body.shoulder[i] + length * _ray(swing.angle, swing.azimuth), target, flight) + motor
        arm = wanted - (body.shoulder[i + 1] - body.shoulder[i - 1]) / (2 * STEP)
        ahead = float(np.hypot(arm[0], arm[1]))
        swing = _Swing(np.arctan2(arm[2], ahead), np.arctan2(-arm[1], -arm[0]), float(np.linalg.norm(arm)) / length)
    body = _body(who, wild, swing)
    hand = _hand(who, wild, swing, body, length)
    i = round(body.release / STEP)
    left = (hand[i + 1] - hand[i - 1]) / (2 * STEP)
    joints = _skeleton(who, wild, body, hand)
    return Throw(
        who,
        TIMES,
        joints,
        hand,
        _look(who, wild, body, target),
        _pressures(who, wild, body, hand),
        _imu(who, joints),
        i * STEP,
        hand[i],
        left + slip,
    )


TIMES = np.arange(round(DURATION / STEP) + 1) * STEP


@dataclass(frozen=True)
class _Wild:
    """What differs from throw to throw; as in Style."""

    lead: float
    backswing: float
    backswing_time: float
    whip: float
    stride: float
    lean: float
    twist: float
    place: np.ndarray
    plane: float
    start: float
    free_arm: np.ndarray
    gaze: np.ndarray
    gaze_time: float
    toes: np.ndarray


@dataclass(frozen=True)
class _Swing:
    """How the arm stands and turns at release [rad, rad, rad/s]."""

    angle: float
    azimuth: float
    rate: float


@dataclass(frozen=True)
class _Body:
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


def _body(who: Style, wild: _Wild, swing: _Swing) -> _Body:
    t, h = TIMES, who.height
    back = wild.lead
    forth = back + wild.backswing_time
    release = forth + wild.whip * (wild.backswing + swing.angle) / swing.rate
    pace = release - forth
    stepping = _ease(t, forth - 0.4 * wild.backswing_time, release - 0.1 * pace)
    lift = 0.25 * wild.stride * 4 * stepping * (1 - stepping)
    stand = np.array([STANDS + wild.place[0], wild.place[1], 0.0])
    ankle = stand + np.array([0, -0.11, SHARES["ankle"] * h])
    left_ankle = ankle + np.outer(stepping, [-wild.stride, 0, 0]) + np.outer(lift, [0, 0, 1])
    sway = _ease(t, back, forth) * 0.04 - _ease(t, forth, release + 0.1) * (0.04 + 0.55 * wild.stride)
    dip = 0.02 * _ease(t, back, forth) - 0.02 * _ease(t, forth, release)
    hips_height = (SHARES["ankle"] + SHARES["shank"] + SHARES["thigh"] - 0.006) * h
    hips = stand + np.column_stack([sway, 0 * t, hips_height - dip - 0.12 * wild.stride * _ease(t, forth, release)])
    lean = 0.04 - 0.08 * _ease(t, back, forth) + (wild.lean + 0.04) * _ease(t, forth, release + 0.15)
    twist = wild.twist * _ease(t, back, forth) - 1.5 * wild.twist * _ease(t, forth, release + 0.05)
    trunk = np.column_stack([-np.sin(lean), 0 * t, np.cos(lean)])
    across = np.column_stack([np.sin(twist), np.cos(twist), 0 * t])
    shoulder = hips + SHARES["trunk"] * h * trunk + SHARES["shoulders"] / 2 * h * across
    return _Body(back, forth, release, hips, shoulder, trunk, twist, left_ankle, lift)


def _hand(who: Style, wild: _Wild, swing: _Swing, body: _Body, length: float) -> np.ndarray:
    """(T, 3) the arm is a pendulum: it goes back, and swings to the angle, in the plane and at the rate wanted."""
    t, after = TIMES, 0.40
    angle = wild.start + (-wild.backswing - wild.start) * _ease(t, body.back, body.forth)
    forth = (t >= body.forth) & (t < body.release)
    angle[forth] = _quintic(
        t[forth] - body.forth, body.release - body.forth, -wild.backswing, 0.0, swing.angle, swing.rate
    )
    over = t >= body.release
    end = swing.angle + 0.40 * swing.rate * after
    angle[over] = _quintic(np.minimum(t[over] - body.release, after), after, swing.angle, swing.rate, end, 0.0)
    behind = swing.azimuth + wild.plane
    azimuth = behind - wild.plane * _ease(t, body.forth, body.forth + 0.6 * (body.release - body.forth))
    bend = 0.80 + 0.20 * _ease(t, body.back, body.forth) - 0.25 * _ease(t, body.release + 0.05, body.release + after)
    return np.asarray(body.shoulder + length * bend[:, None] * _ray(angle, azimuth))


def _skeleton(who: Style, wild: _Wild, body: _Body, hand: np.ndarray) -> dict[str, np.ndarray]:
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
    swinging = _ease(t, body.back, body.forth) - 1.6 * _ease(t, body.forth, body.release + 0.1)
    free = np.column_stack([-0.10 - 0.14 * swinging, -0.10 + 0 * t, -0.44 + 0.08 * np.abs(swinging)]) + wild.free_arm
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


def _look(who: Style, wild: _Wild, body: _Body, target: np.ndarray) -> np.ndarray:
    """(T, 2) first at the ball in the hand, then where it is to go, then after it."""
    t = TIMES
    eyes = body.hips + np.array([0, 0, 0.41 * who.height])
    to = target - eyes
    yaw = np.arctan2(-to[:, 1], -to[:, 0])  # from -x, to the left of the person
    up = np.arctan2(to[:, 2], np.hypot(to[:, 0], to[:, 1]))
    begin = body.back + wild.gaze_time
    turned = _ease(t, begin - 0.15, begin + 0.30)
    follows = 0.30 * (_ease(t, body.release, body.release + 0.25) - _ease(t, body.release + 0.4, body.release + 0.8))
    off = who.gaze_off + wild.gaze
    yaw = turned * (who.gaze * yaw + off[0]) - 0.05 * (1 - turned)
    pitch = turned * (who.gaze * up + off[1]) - 0.35 * (1 - turned) + follows
    return np.column_stack([yaw, pitch])


def _pressures(who: Style, wild: _Wild, body: _Body, hand: np.ndarray) -> np.ndarray:
    """(T, 8) what carries the person, and pushes them and their arm forward."""
    t = TIMES
    centre = 0.95 * (body.hips + 0.5 * SHARES["trunk"] * who.height * body.trunk) + 0.05 * hand
    pushed = np.gradient(np.gradient(_smooth(centre, 0.03), STEP, axis=0), STEP, axis=0)
    total = who.weight * np.maximum(GRAVITY + pushed[:, 2], 1.0)
    left = 0.5 - 0.28 * _ease(t, body.back, body.forth) + 0.58 * _ease(t, body.release - 0.12, body.release + 0.02)
    left = left * np.clip(1 - body.lift / 0.01, 0, 1)
    ahead = np.clip(pushed[:, 0] / GRAVITY, -0.6, 0.6)  # a push to -x needs the centre of pressure behind
    cells = []
    for side, share, bias in ((0, left, wild.toes[0]), (1, 1 - left, wild.toes[1])):
        toes = np.clip(0.45 + bias - 0.6 * ahead + (0.15 - 0.3 * side) * _ease(t, body.forth, body.release), 0.05, 0.95)
        inner = np.clip(0.5 + (0.3 if side else -0.3) * body.twist, 0.1, 0.9)
        load = share * total
        cells += [load * (1 - toes) * inner, load * (1 - toes) * (1 - inner), load * toes * inner]
        cells += [load * toes * (1 - inner)]
    return np.asarray(_smooth(np.column_stack(cells), 0.012) * who.cells)


def _imu(who: Style, joints: Mapping[str, np.ndarray]) -> np.ndarray:
    """(T, 6) at the wrist, in the forearm's frame, a little askew."""
    wrist, elbow = joints["right_wrist"], joints["right_elbow"]
    along = _unit(wrist - elbow)
    outward = _unit(np.cross(along, [0.0, 1.0, 0.0]))  # the arm's pendulum turns about an axis that is nearly y
    frames = np.stack([outward, np.cross(along, outward), along], axis=2) @ _turned(who.mount)
    # A sensor that is strapped to skin does not feel faster than that.
    pushed = np.gradient(np.gradient(_smooth(wrist, 0.012), STEP, axis=0), STEP, axis=0)
    pushed = pushed + np.array([0, 0, GRAVITY])
    spin = frames.transpose(0, 2, 1) @ np.gradient(_smooth(frames, 0.012), STEP, axis=0)
    turning = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    return np.concatenate([np.einsum("tij,ti->tj", frames, pushed), turning], axis=1)


def _ray(angle: np.ndarray | float, azimuth: np.ndarray | float) -> np.ndarray:
    """Where an arm points that is swung so far forward from hanging, in a plane turned so far from -x."""
    return np.stack([-np.sin(angle) * np.cos(azimuth), -np.sin(angle) * np.sin(azimuth), -np.cos(angle)], axis=-1)


def _ease(t: np.ndarray, begin: float, end: float) -> np.ndarray:
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


def _smooth(values: np.ndarray, std: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, std / STEP, axis=0, mode="nearest"))


def _unit(rows: np.ndarray) -> np.ndarray:
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _turned(axis: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(axis).as_matrix())
