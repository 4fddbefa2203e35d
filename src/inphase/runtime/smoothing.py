"""A new response is blended into what is being played, by an alpha-beta filter (2.4).

Each response begins where the partner is believed to be *now*, so that one seldom goes on where the one before it was
left: played as they come, they make the robot jump.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.errors import OptionError
from inphase.result import Response


@dataclass(frozen=True, eq=False)
class Motion:
    """Where each channel of a robot is sent, and how far it goes from one command to the next; read-only.

    positions: (D,) [unit]. steps: (D,) [unit per command].
    """

    positions: Float[np.ndarray, " D"]
    steps: Float[np.ndarray, " D"]

    def __post_init__(self) -> None:
        freeze(self, positions=self.positions, steps=self.steps)

    @classmethod
    def at_rest(cls, positions: Float[np.ndarray, " D"]) -> Motion:
        """(D,) standing there."""
        return cls(positions, np.zeros(len(positions)))


@dataclass(frozen=True)
class AlphaBeta:
    """How fast what is played turns into what is wanted: each command goes on as the last, and corrects the error.

    alpha: 0 … 1, the share of the error that is corrected in a command. beta: 0 … 1, the share that is added to the
    step; without it the largest that does not swing, (1 - √(1 - alpha))². Both 1: what is wanted is played as it
    is. A wanted course of constant velocity is followed without a lag, and one whose steps grow by g with every
    command g · (1 - alpha) / beta behind. Commands are sent at a steady rate: shares are by command, not by time, so
    that a cycle that comes late or early cannot make the filter swing. Raises OptionError for a share that is not
    0 < share <= 1.
    """

    alpha: float = 0.5
    beta: float | None = None

    def __post_init__(self) -> None:
        for name in ("alpha", "beta"):
            value = getattr(self, name)
            if not (value is None and name == "beta") and not 0 < value <= 1:
                raise OptionError(f"smoothing: expected 0 < {name} <= 1, got {value}")

    @property
    def step_share(self) -> float:
        """The beta that is used."""
        return float((1 - np.sqrt(1 - self.alpha)) ** 2) if self.beta is None else self.beta

    def step(self, motion: Motion, wanted: Float[np.ndarray, " D"]) -> Motion:
        """The next command, for (D,) the positions that are wanted then; where one is not finite the channel stays."""
        known = np.isfinite(wanted)
        expected = motion.positions + motion.steps
        error = np.where(known, wanted, expected) - expected
        # With alpha 1 to the last bit what is wanted, not what is expected and the error added again.
        corrected = wanted if self.alpha == 1 else expected + self.alpha * error
        return Motion(
            positions=np.where(known, corrected, motion.positions),
            steps=np.where(known, motion.steps + self.step_share * error, 0.0),
        )

    def blend(self, motion: Motion, wanted: Float[np.ndarray, "S D"]) -> tuple[Motion, ...]:
        """The next S commands for (S, D) what is wanted at each: what is played until another response comes.

        Whoever sends them all at once goes on from that one which was reached when the next response comes.
        """
        motions = []
        for row in wanted:
            motion = self.step(motion, row)
            motions.append(motion)
        return tuple(motions)


def wanted_at(response: Response, times: Float[np.ndarray, " S"]) -> Float[np.ndarray, "S D"]:
    """(S, D) the response's means at these times [s], linear between its samples and standing before and after."""
    known = response.times
    after = np.clip(np.searchsorted(known, times, side="right"), 1, max(len(known) - 1, 1))
    if len(known) == 1:
        return np.tile(response.mean[0], (len(times), 1))
    span = known[after] - known[after - 1]
    share = np.clip((times - known[after - 1]) / np.where(span > 0, span, 1.0), 0.0, 1.0)[:, None]
    return np.asarray((1 - share) * response.mean[after - 1] + share * response.mean[after])
