"""How a person's body moves for a hug: springs that are set as their visit says."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.hugging.partner import Visit
from experiments.hugging.person import ARM_JOINTS, FROM, TRUNK
from experiments.hugging.reach import reach
from experiments.hugging.world import PERIOD, World

CHEST = 0.095  # [m] where the robot's chest is
DOWN = {"swing": 0.05, "spread": 0.10, "twist": 0.0, "bend": 0.15}


class Person:
    """Moves a person's springs as a visit says; matches the strength with which they are held, if asked to."""

    def __init__(self, world: World, visit: Visit, rng: np.random.Generator, matches: bool) -> None:
        model = world.model
        self.visit, self.rng, self.matches = visit, rng, matches
        self.held = 1.0
        self.wanders = np.zeros(6)
        self.trunk = [model.actuator(f"person_{name}").id for name in TRUNK]
        self.arms = {s: [model.actuator(f"person_{s}_{j}").id for j in ARM_JOINTS] for s in ("left", "right")}
        self.legs = {s: [model.actuator(f"person_{s}_{j}").id for j in ("hip", "knee")] for s in ("left", "right")}
        touching = CHEST + visit.body.thick + 0.005
        self.near = FROM - touching + (visit.pressed if visit.kind != "apart" else -0.16)
        self.postures = {s: self._postures(world, s) for s in ("left", "right")}
        self.stride = 0.0

    def _postures(self, world: World, side: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The angles of an arm that hangs, is up, is around the robot, and what more of it squeezes."""
        index, sign = (0, -1) if side == "left" else (1, 1)
        over, shoulder = self.visit.over[index], self.visit.body.shoulder
        data = world.begin()
        apart = 0.0 if self.visit.kind != "apart" else 0.16
        data.joint("person_forward").qpos = self.near - (0.0 if apart else self.visit.pressed)
        here = FROM - self.near
        names = [f"person_{side}_{j}" for j in ARM_JOINTS]

        def arm(elbow: tuple[float, float, float], hand: tuple[float, float, float], first: tuple[float, ...]) -> Any:
            for name, angle in zip(names, first, strict=True):
                data.joint(name).qpos = angle
            places = {f"person_{side}_elbow": (elbow[0], sign * elbow[1], elbow[2])}
            places[f"person_{side}_hand"] = (hand[0], sign * hand[1], hand[2])
            return reach(world.model, data, names, places, {f"person_{side}_elbow": 0.4})

        if over:
            high = max(1.37, shoulder - 0.02)
            up = arm((here - 0.22, 0.34, high), (here - 0.47, 0.34, high + 0.06), (1.3, 0.3, 0.0, 0.4))
            first = (1.4, 0.3, 0.6, 0.9)
            elbow, hand = (0.06, 0.28, high + 0.03), (-0.135, 0.04, 1.36 + self.visit.hands[index])
        else:
            up = arm((here - 0.16, 0.34, shoulder - 0.20), (here - 0.42, 0.32, shoulder - 0.25), (0.7, 0.3, 0.0, 0.7))
            first = (0.8, 0.3, 0.6, 1.0)
            elbow, hand = (0.17, 0.30, shoulder - 0.24), (-0.135, 0.11, 1.03 + self.visit.hands[index])
        hand = (hand[0] + apart * 1.0, hand[1] + 0.8 * apart, hand[2])
        elbow = (elbow[0] + 0.6 * apart, elbow[1], elbow[2])
        around = arm(elbow, hand, first)
        tight = arm(elbow, (hand[0] + 0.10, hand[1], hand[2]), tuple(around))
        return np.array([DOWN[j] for j in ARM_JOINTS]), up, around, (tight - around) / 0.10

    def act(self, time: float, data: Any, held_with: float) -> None:
        """Set the springs. held_with: [N] how hard the robot's arms press."""
        visit = self.visit
        came, up, around = visit.at(time)
        if self.matches and around > 0.9:
            self.held += PERIOD / 1.0 * (np.clip(0.6 + held_with / 100.0, 0.6, 1.5) - self.held)
        self.wanders += PERIOD / 0.6 * -self.wanders + np.sqrt(2 * PERIOD / 0.6) * self.rng.standard_normal(6)
        pressing = around * self.held
        forward = came * (self.near - visit.pressed * (1 - pressing) * (visit.kind != "apart"))
        for actuator, value in zip(
            self.trunk,
            (
                forward + 0.004 * self.wanders[0],
                came * visit.aside + 0.006 * self.wanders[1],
                came * visit.turned + 0.02 * self.wanders[2],
                visit.lean * around + 0.01 * self.wanders[3],
            ),
            strict=True,
        ):
            data.ctrl[actuator] = value
        squeezing = visit.squeezed * around * self.held if visit.hugs else 0.0
        for i, (side, actuators) in enumerate(self.arms.items()):
            down, raised, closed, tighter = self.postures[side]
            posture = down + up * (raised - down) + around * (closed - raised) + squeezing * tighter
            posture = posture + 0.02 * self.wanders[4 + i]
            for actuator, angle in zip(actuators, posture, strict=True):
                data.ctrl[actuator] = angle
        self._walk(data)

    def _walk(self, data: Any) -> None:
        """Legs that fit how fast they go; they carry nothing."""
        speed = float(data.joint("person_forward").qvel[0])
        self.stride += PERIOD * 2 * np.pi * np.clip(abs(speed) / 0.65, 0.0, 1.6) * np.sign(speed)
        for side, turn in (("left", 0.0), ("right", np.pi)):
            much = np.clip(abs(speed) / 0.8, 0.0, 1.0)
            swing = np.sin(self.stride + turn)
            hip, knee = self.legs[side]
            data.ctrl[hip] = 0.38 * much * swing + 0.06 * much
            data.ctrl[knee] = 0.55 * much * max(0.0, np.cos(self.stride + turn)) + 0.05
