"""A test in which the partner leads: where they want to shake hands, how fast, and who moves the robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import inphase
from experiments.handshake.demonstrations import familiar
from experiments.handshake.encounter import LASTS, Encounter, Told
from experiments.handshake.lead import RESPONDS, Led, as_written, live
from experiments.handshake.partner import Partner, Style
from experiments.handshake.robot import Arm

SPEEDS = ("fast", "normal", "slow", "still")
PAUSE = 3.0  # [s] that a partner waits longer who pauses
WIDEST = 1.5  # standard deviations of the places of the demonstrations, within which places are wanted


def leading(
    person: int, speed: str, again: int, ends: np.ndarray, seed: int, pause: float = 0.0
) -> tuple[Partner, np.random.Generator]:
    """Somebody who leads; the same whoever moves the robot. ends: (N, 3) [m] where hands were shaken in the training.

    They want to shake hands where the robot can: anywhere around the middle of those places, and at the same place
    whatever their speed.
    """
    rng = np.random.default_rng([seed, 4, person, SPEEDS.index(speed), again])
    style = Style.of(person, seed, familiar(person)).once(rng)
    away = style.place + np.random.default_rng([seed, 5, person, again]).standard_normal(3)
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
    world: Any = None,
) -> tuple[Told, Led]:
    """One encounter. method: "bip" as the dissertation writes it, or a filter of inphase in its live loop.

    look, world: of a film, as for `Encounter`.
    """
    encounter = Encounter(*who, look=look, model=world)
    session = model.session(filter=method, seed=seed, slips=method != "bip")
    found = (as_written if method == "bip" else live)(encounter, session)
    return encounter.told, found


def stacked(trials: list[tuple[Partner, Told, Led | None]]) -> dict[str, np.ndarray]:
    """Trials as arrays by name, (K, ...): what was read and true, and what was believed on a grid of 3 Hz.

    moments: (K, 3) [s] at the end of the regions of Fig. 15: the partner begins, has arrived, and all is over. beliefs:
    (K, 31, 4) phase, its std, velocity [1/s], its std. at_moments: (K, 3, 4) the same. responses: (K, 30, S, 28) times
    [s] and pressures [MPa] of what was planned, 3 times a second, NaN where nothing was.
    """
    told = [t for _, t, _ in trials]
    result = {
        "read": np.stack([t.read for t in told]).astype(np.float32),
        "truth": np.stack([t.truth for t in told]).astype(np.float32),
        "references": np.stack([t.references for t in told]).astype(np.float32),
        "clasped": np.array([p.clasped for p, _, _ in trials]),
        "moments": np.array([(p.began, p.arrives, LASTS) for p, _, _ in trials]),
    }
    led = [found for _, _, found in trials if found is not None]
    if led:
        grid = np.arange(round(LASTS * RESPONDS) + 1) / RESPONDS
        moments = np.where(np.isfinite(result["moments"]), result["moments"], LASTS)
        result |= {
            "beliefs": np.stack([_at(found.beliefs, grid) for found in led]),
            "at_moments": np.stack([_at(found.beliefs, m) for found, m in zip(led, moments, strict=True)]),
            "responses": np.stack([_first(found.responses, len(grid) - 1) for found in led]).astype(np.float32),
            "held": np.array([found.held for found in led]),
        }
    return result


def _at(beliefs: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The last belief at each time."""
    return np.asarray(beliefs[np.clip(np.searchsorted(beliefs[:, 0], times, side="right") - 1, 0, None), 1:])


def _first(responses: np.ndarray, count: int) -> np.ndarray:
    missing = np.full((max(count - len(responses), 0), *responses.shape[1:]), np.nan)
    return np.concatenate([responses[:count], missing])
