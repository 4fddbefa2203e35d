"""The robot's muscles: which joint each one turns, how strongly, and where it is drawn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from experiments.handshake.muscle import Muscles

JOINTS = (
    "scapula_elevation",
    "scapula_protraction",
    "scapula_rotation",
    "shoulder_flexion",
    "shoulder_abduction",
    "shoulder_rotation",
    "elbow_flexion",
    "forearm_pronation",
    "wrist_flexion",
    "wrist_deviation",
)
RANGES = np.deg2rad(
    [(-15, 30), (-20, 35), (-10, 40), (-40, 120), (-25, 100), (-60, 70), (2, 130), (-70, 70), (-50, 50), (-25, 25)]
)


class Muscle(NamedTuple):
    """arms: by joint [cm], positive where its contraction turns the joint that way. diameter [mm], length [cm].

    drawn: from and to, each a body and a place on it [cm].
    """

    arms: dict[str, float]
    diameter: float
    length: float
    drawn: tuple[str, tuple[float, float, float], str, tuple[float, float, float]]
    still: bool = False  # never commanded to another pressure


SE, SP, SR, GF, GA, GR, EF, FP, WF, WD = JOINTS
MUSCLES: dict[str, Muscle] = {
    "trapezius_upper": Muscle({SE: 5, SR: 2}, 22, 25, ("torso", (-4, -3, 148), "scapula", (0, -15, 4))),
    "trapezius_lower": Muscle({SE: -4, SR: 3, SP: -1}, 18, 25, ("torso", (-8, -3, 112), "scapula", (-4, -12, 1))),
    "serratus": Muscle({SP: 4, SR: 3}, 20, 25, ("torso", (7, -13, 112), "scapula", (-4, -13, -7))),
    "rhomboid": Muscle({SP: -4, SR: -3}, 20, 25, ("torso", (-8, -2, 130), "scapula", (-5, -11, -3))),
    "levator": Muscle({SE: 3, SR: -2}, 14, 25, ("torso", (-2, -4, 150), "scapula", (-3, -9, 4)), True),
    "pectoralis_minor": Muscle({SE: -3, SP: 3, SR: -1}, 14, 22, ("torso", (9, -7, 120), "scapula", (3, -13, -1)), True),
    "deltoid_front": Muscle({GF: 4, GA: 1.5, GR: 1}, 22, 22, ("scapula", (4, -15, 3), "upper_arm", (3, -1, -12))),
    "deltoid_middle": Muscle({GA: 4}, 22, 22, ("scapula", (0, -20, 4), "upper_arm", (0, -4, -12))),
    "deltoid_back": Muscle({GF: -4, GA: 1.5, GR: -1}, 18, 22, ("scapula", (-5, -16, 3), "upper_arm", (-3, -1, -12))),
    "pectoralis_major": Muscle({GF: 2, GA: -3, GR: 2.5}, 22, 28, ("torso", (11, -3, 122), "upper_arm", (2, 1, -8))),
    "latissimus": Muscle({GF: -3, GA: -3, GR: 1.5}, 22, 30, ("torso", (-8, -8, 100), "upper_arm", (-1, 2, -8))),
    "supraspinatus": Muscle({GA: 3}, 16, 22, ("scapula", (-2, -8, 4), "upper_arm", (0, -3, 0))),
    "infraspinatus": Muscle({GR: -3, GA: 0.5}, 18, 22, ("scapula", (-5, -10, -3), "upper_arm", (-3, -2, -2))),
    "teres_major": Muscle({GF: -2.5, GA: -2, GR: 1}, 16, 22, ("scapula", (-5, -12, -8), "upper_arm", (-1, 2, -7))),
    "subscapularis": Muscle({GR: 2.5, GA: -0.5}, 16, 22, ("scapula", (3, -10, -3), "upper_arm", (3, 1, -2)), True),
    "coracobrachialis": Muscle({GF: 2.5, GA: -2}, 14, 24, ("scapula", (4, -14, 0), "upper_arm", (2, 2, -15))),
    "biceps": Muscle({EF: 4, GF: 1.5, FP: -1}, 22, 28, ("scapula", (4, -17, 1), "forearm", (3, 0, -4))),
    "brachialis": Muscle({EF: 4}, 20, 22, ("upper_arm", (3, 1, -14), "forearm", (2, 1, -4))),
    "brachioradialis": Muscle({EF: 4.5}, 18, 26, ("upper_arm", (3, -2, -20), "forearm", (3, -2, -15))),
    "triceps_long": Muscle({EF: -3, GF: -1.5}, 20, 28, ("scapula", (-3, -17, -3), "forearm", (-4, 0, 1))),
    "triceps_lateral": Muscle({EF: -3}, 18, 24, ("upper_arm", (-3, -2, -8), "forearm", (-4, -1, 1))),
    "pronator": Muscle({FP: 1.5}, 12, 18, ("upper_arm", (1, 3, -28), "forearm", (2, 2, -10)), True),
    "supinator": Muscle({FP: -1.5}, 12, 18, ("upper_arm", (1, -3, -28), "forearm", (2, -2, -10)), True),
    "flexor_radialis": Muscle({WF: 1.8, WD: 1.2}, 12, 18, ("forearm", (2, 2, -5), "hand", (1.5, 1.5, -2)), True),
    "flexor_ulnaris": Muscle({WF: 1.8, WD: -1.2}, 12, 18, ("forearm", (-2, 2, -5), "hand", (-1.5, 1.5, -2)), True),
    "extensor_radialis": Muscle({WF: -1.8, WD: 1.2}, 12, 18, ("forearm", (2, -2, -5), "hand", (1.5, -1.5, -2)), True),
    "extensor_ulnaris": Muscle({WF: -1.8, WD: -1.2}, 12, 18, ("forearm", (-2, -2, -5), "hand", (-1.5, -1.5, -2)), True),
}
NAMES = tuple(MUSCLES)
STILL = np.array([muscle.still for muscle in MUSCLES.values()])
ARMS = np.array([[muscle.arms.get(joint, 0.0) / 100 for joint in JOINTS] for muscle in MUSCLES.values()])  # [m]
SLACK = 0.12  # the contraction of every muscle where all joints are at 0
SIZES = Muscles(
    np.array([muscle.diameter / 1000 for muscle in MUSCLES.values()]),
    np.array([muscle.length / 100 for muscle in MUSCLES.values()]),
)


def contraction(joints: np.ndarray) -> np.ndarray:
    """(27,) of all muscles, with the joints at these angles (10,) [rad]: they run over pulleys."""
    return SLACK + (ARMS @ joints) / SIZES.length
