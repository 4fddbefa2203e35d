"""How particles move on: a tempo that is positive, mostly usual, and may pause, and leaps (DESIGN 4, trap 7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from inphase.phase import PhaseModel
from inphase.tempo import Tempo

LONGEST_STEP = 0.02  # of a typical interaction: a long gap is crossed in several
MOST_STEPS = 200  # after four whole interactions out of sight nothing is known any more
REACH = 2.5  # standard deviations of other tempos that particles start with
GOLDEN = 0.6180339887498949
WAITING = 0.1  # of the particles, at the start, if there are pauses at all: some partners have not begun
PHASE_JITTER = 0.005  # after a typical interaction, so that particles that were copied part


@dataclass(frozen=True, eq=False)
class Motion:
    """Where each particle is and how it moves.

    phase: (P,). own, momentary: (P,) their sum is the logarithm of the tempo over the typical one. waiting: (P,)
    whether it stands still.
    """

    phase: Float[np.ndarray, " P"]
    own: Float[np.ndarray, " P"]
    momentary: Float[np.ndarray, " P"]
    waiting: Bool[np.ndarray, " P"]

    def __post_init__(self) -> None:
        for array in (self.phase, self.own, self.momentary, self.waiting):
            array.setflags(write=False)

    def pick(self, kept: Int[np.ndarray, " Q"]) -> Motion:
        """The motion of some particles, each as often as it is named."""
        return Motion(self.phase[kept], self.own[kept], self.momentary[kept], self.waiting[kept])

    def tempo(self, phase: PhaseModel) -> Float[np.ndarray, " P"]:
        """(P,) the phase velocity [1/s]."""
        return _tempos(self.own, self.momentary, self.waiting, phase)


def begin(
    phase: PhaseModel, tempo: Tempo, count: int, rng: np.random.Generator
) -> tuple[Motion, Float[np.ndarray, " P"]]:
    """`count` particles at the start of an interaction, and the logarithms of their weights.

    Half of them go at other tempos than the usual, evenly spread, and their weights make up for it: whether a partner
    who is twice as fast is found must not hang on the luck of the few that a draw would give.
    """
    from scipy.special import ndtri

    usual = round(count * (tempo.usual if tempo.usual in (0.0, 1.0) else 0.5))
    even = (np.arange(count - usual) + rng.random(count - usual)) / max(count - usual, 1)
    spread = REACH * (2 * even - 1)
    # Starts in steps of the golden ratio lie evenly among the tempos, too, however these are weighted.
    starts = np.concatenate([_shares(usual, rng), (GOLDEN * np.arange(count - usual) + rng.random()) % 1.0])
    own = np.concatenate([tempo.usual_std * ndtri(_shares(usual, rng)), tempo.other_std * spread])
    likely = np.concatenate([np.ones(usual), np.exp(-0.5 * spread**2)])
    share = np.repeat([tempo.usual, 1 - tempo.usual], [usual, count - usual])
    total = np.repeat([likely[:usual].sum(), likely[usual:].sum()], [usual, count - usual])
    motion = Motion(
        phase.confine(phase.starts(starts)),
        own,
        _mixed(count, tempo.steady, tempo.momentary_std, tempo.other_std, rng),
        (rng.permutation(count) < WAITING * count) & (tempo.stop_rate > 0),
    )
    return motion, np.log(share * likely / total)


def advance(motion: Motion, phase: PhaseModel, tempo: Tempo, dt: float, rng: np.random.Generator) -> Motion:
    """The particles dt [s] later.

    Tempo is constant but for stretches that begin at random, so that how often samples come makes no difference.
    """
    steps = min(int(np.ceil(phase.nominal_velocity * dt / LONGEST_STEP)), MOST_STEPS)
    for _ in range(steps):
        motion = _step(motion, phase, tempo, dt / steps, rng)
    return motion


def _step(motion: Motion, phase: PhaseModel, tempo: Tempo, dt: float, rng: np.random.Generator) -> Motion:
    count, typical = len(motion.phase), phase.nominal_velocity * dt
    rates = np.array([tempo.change_rate, tempo.stretch_rate, tempo.stop_rate, tempo.go_rate, tempo.leap_rate])
    changes, begins, stops, goes, leaps = rng.random((5, count)) < -np.expm1(-rates * typical)[:, None]
    own = np.where(changes, _mixed(count, tempo.usual, tempo.usual_std, tempo.other_std, rng), motion.own)
    momentary = _mixed(count, tempo.steady, tempo.momentary_std, tempo.other_std, rng)
    momentary = np.where(begins, momentary, motion.momentary)
    waiting = np.where(motion.waiting, ~goes, stops)
    jitter = PHASE_JITTER * np.sqrt(typical) * rng.standard_normal(count)
    leap = np.where(leaps, tempo.leap * rng.random(count), 0.0)
    moved = phase.confine(motion.phase + _tempos(own, momentary, waiting, phase) * dt + jitter + leap)
    return Motion(moved, own, momentary, waiting)


def _tempos(
    own: Float[np.ndarray, " P"], momentary: Float[np.ndarray, " P"], waiting: Bool[np.ndarray, " P"], phase: PhaseModel
) -> Float[np.ndarray, " P"]:
    return np.where(waiting, 0.0, phase.nominal_velocity * np.exp(own + momentary))


def _mixed(count: int, share: float, std: float, other_std: float, rng: np.random.Generator) -> Float[np.ndarray, " P"]:
    """Logarithms of tempo: a share of them narrow, the others wide."""
    from scipy.special import ndtri

    normal = ndtri(_shares(count, rng))
    return np.asarray(np.where(rng.random(count) < share, std, other_std) * normal)


def _shares(count: int, rng: np.random.Generator) -> Float[np.ndarray, " P"]:
    """Uniform draws, one of each of `count` equal parts of 0 … 1: few particles cover all that is likely."""
    return np.asarray((rng.permutation(count) + rng.random(count)) / count)
