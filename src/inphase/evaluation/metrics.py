"""Errors and coverage, in the units of a channel's own spread so that channels can be averaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, Kind, quaternions

NINETY = 1.6449  # standard deviations on either side that hold 90 % of a Gaussian


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
