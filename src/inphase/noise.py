"""Observation noise: how far a reading lies from the model, and for how long it stays there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.errors import OptionError


@dataclass(frozen=True, eq=False)
class Noise:
    """The variance of every feature's residual, and the time over which it is correlated.

    var: (F,) in scaled units, the diagonal of R (Eq. 2.15). correlation_time: (F,) [s], 0 for white noise.
    Raises OptionError for a variance that is not positive or a negative time.
    """

    var: Float[np.ndarray, " F"]
    correlation_time: Float[np.ndarray, " F"]

    def __post_init__(self) -> None:
        freeze(self, var=self.var, correlation_time=self.correlation_time)
        if self.var.shape != self.correlation_time.shape or self.var.ndim != 1:
            raise OptionError(
                f"expected var (F,) and correlation_time (F,), got {self.var.shape}, {self.correlation_time.shape}"
            )
        if not ((self.var > 0).all() and np.isfinite(self.var).all()):
            raise OptionError(f"expected positive, finite noise variances, got {self.var}")
        if not ((self.correlation_time >= 0).all() and np.isfinite(self.correlation_time).all()):
            raise OptionError(f"expected correlation times >= 0, got {self.correlation_time}")

    def at(self, interval: Float[np.ndarray, " F"]) -> Float[np.ndarray, " F"]:
        """The variance to give a reading that comes `interval` [s] after the last one of its feature (inf: the first).

        A residual that decays as exp(-t/τ) repeats itself: of a sample, only the share tanh(interval / 2τ) is news
        (the information about a constant in N samples of an AR(1) process is 1 + (N - 1) tanh(dt / 2τ) times that of
        one). So the same recording says as much at 30 Hz as at 120 Hz. A repeat at once says nothing: inf.
        """
        white = self.correlation_time == 0
        news = np.where(white, 1.0, np.tanh(interval / np.where(white, 1.0, 2 * self.correlation_time)))
        with np.errstate(divide="ignore", over="ignore"):
            return np.asarray(self.var / news)
