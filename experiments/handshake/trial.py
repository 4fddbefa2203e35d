"""A test in which the partner leads: where they want to shake hands, how fast, and who moves the robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import inphase
from experiments.handshake.demonstrations import familiar
from experiments.handshake.encounter import Encounter, Told
from experiments.handshake.lead import Led, as_written, live
from experiments.handshake.partner import Partner, Style
from experiments.handshake.robot import Arm

SPEEDS = ("fast", "normal", "slow", "still")
PAUSE = 3.0  # [s] that a partner waits longer who pauses
WIDEST = 1.5  # standard deviations of the places of the demonstrations, within which places are wanted


def leading(
    person: int, speed: str, again: int, ends: np.ndarray, seed: int, pause: float = 0.0
) -> tuple[Partner, np.random.Generator]:
    """Somebody who leads; the same whoever moves the robot. ends: (N, 3) [m] where hands were shaken in the training.

    They want to shake hands where the robot can: anywhere around the middle of those places.
    """
    rng = np.random.default_rng([seed, 4, person, SPEEDS.index(speed), again])
    style = Style.of(person, seed, familiar(person)).once(rng)
    away = style.place + rng.standard_normal(3)
    away *= min(1.0, WIDEST / np.linalg.norm(away))
    goal = ends.mean(0) + np.linalg.cholesky(np.cov(ends.T)) @ away
    tempo = style.tempi.get(speed, 1.0)
    return Partner(style, rng, goal=goal, speed=tempo, still=speed == "still", pause=pause), rng


def led(
    method: str,
    model: inphase.Model,
    who: tuple[Partner, np.random.Generator],
    seed: int,
    look: Callable[[Arm], None] | None = None,
) -> tuple[Told, Led]:
    """One encounter. method: "bip" as the dissertation writes it, or a filter of inphase in its live loop."""
    encounter = Encounter(*who, look=look, drawn=look is not None)
    session = model.session(filter=method, seed=seed)
    found = (as_written if method == "bip" else live)(encounter, session)
    return encounter.told, found


def kept(told: Told, found: Led | None = None, partner: Partner | None = None) -> Mapping[str, Any]:
    """As numbers and arrays by name."""
    result: dict[str, Any] = {"times": told.times, "read": told.read, "truth": told.truth, "asked": told.references}
    if found is not None:
        result |= {"beliefs": found.beliefs, "responded": found.asked, "responses": found.responses, "held": found.held}
    if partner is not None:
        result |= {"began": partner.began, "arrives": partner.arrives, "clasped": partner.clasped}
    return result
