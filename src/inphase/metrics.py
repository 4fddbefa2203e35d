"""Errors and coverage, in the units of a channel's own spread so that channels can be averaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.channels import Channel, Kind, quaternions

NINETY = 1.6449  # standard deviations on either side that hold 90 % of a Gaussian
MARKS = (0.25, 0.5, 0.75)  # of an episode, where the final pose is compared


@dataclass(frozen=True)
class Scores:
    """How a prediction compares with what was read.

    nmse: squared error over the channel's training variance, averaged over samples and channels: 1 is what always
    answering the training mean would score. coverage: share of readings inside the predicted 90 % interval.
    nll: negative log predictive density a reading, in units of the channel's training standard deviation.
    """

    nmse: float
    coverage: float
    nll: float

    @classmethod
    def of(
        cls,
        error: Float[np.ndarray, "T C"],
        std: Float[np.ndarray, "T C"],
        spread: Float[np.ndarray, " C"],
    ) -> Scores:
        """The scores of errors with a predicted std, both in the channels' units; NaN errors are left out."""
        r, q = error / spread, np.maximum(std / spread, 1e-9)
        seen = np.isfinite(r)
        if not seen.any():
            return cls(float("nan"), float("nan"), float("nan"))
        r, q = r[seen], q[seen]
        nll = 0.5 * (r / q) ** 2 + np.log(q) + 0.5 * np.log(2 * np.pi)
        return cls(float(np.mean(r**2)), float(np.mean(np.abs(r) <= NINETY * q)), float(np.mean(nll)))


@dataclass(frozen=True, eq=False)
class Errors:
    """How far off the answers to one episode were, in the channels' units; NaN where the truth was not recorded.

    now: (T, C) of what the channels read at every sample. std: (T, C) as uncertain as the answer said it was.
    end: (T, C) of the final pose, as it was foreseen at every sample. spread: (C,) what errors are measured by.
    """

    now: Float[np.ndarray, "T C"]
    std: Float[np.ndarray, "T C"]
    end: Float[np.ndarray, "T C"]
    spread: Float[np.ndarray, " C"]

    def __post_init__(self) -> None:
        freeze(self, now=self.now, std=self.std, end=self.end, spread=self.spread)

    @property
    def scores(self) -> Scores:
        """Of the channels now, over the whole episode."""
        return Scores.of(self.now, self.std, self.spread)

    def final_pose(self, share: float) -> float:
        """nMSE of the final pose, as foreseen after that share of the episode; NaN where it was not recorded."""
        at = min(int(share * len(self.end)), len(self.end) - 1)
        error = self.end[at] / self.spread
        seen = np.isfinite(error)
        return float(np.mean(error[seen] ** 2)) if seen.any() else float("nan")


def difference(
    channels: Sequence[Channel], mean: Float[np.ndarray, "*T D"], truth: Float[np.ndarray, "*T D"]
) -> Float[np.ndarray, "*T D"]:
    """mean - truth, each on its manifold: angles by the shorter way round, quaternions up to their sign."""
    truth = np.array(truth, dtype=np.float64)
    for parts in quaternions(channels):
        at = list(parts)
        truth[..., at] *= np.where((mean[..., at] * truth[..., at]).sum(-1, keepdims=True) < 0, -1.0, 1.0)
    error = mean - truth
    for i, channel in enumerate(channels):
        if channel.kind is Kind.ANGLE:
            error[..., i] = (error[..., i] + np.pi) % (2 * np.pi) - np.pi
    return np.asarray(error)
