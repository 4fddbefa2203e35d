"""What the partner's last moments say of the controlled partner, without any model of time.

A phase model explains a new interaction by those that were demonstrated. How the robot's hand stands to the partner's
*now* often carries over where the whole course does not, and is not lost when the phase is. So a share of the response
is a regression on what was just seen; how large it is, held-out demonstrations decide.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from inphase.arrays import freeze
from inphase.errors import OptionError

Gains: TypeAlias = Float[np.ndarray, "Z M"]


@dataclass(frozen=True, eq=False)
class Reflex:
    """A linear regression of the controlled features on the observed ones, now and a little before.

    lags: (L,) [s], increasing from 0. mean: (n,), cov: (n, n) of the observed features lag after lag, then of the
    controlled ones: n = L · Fo + Fc, in scaled units; cov holds the regularisation, too. observed: Fo, the first
    features of the layout. share: 0 … 1 of the response. fade: [s], over which a response forgets what was seen.
    Raises OptionError for parts that do not fit each other.
    """

    lags: Float[np.ndarray, " L"]
    mean: Float[np.ndarray, " n"]
    cov: Float[np.ndarray, "n n"]
    observed: int
    share: float
    fade: float

    def __post_init__(self) -> None:
        freeze(self, lags=self.lags, mean=self.mean, cov=self.cov)
        size = len(self.mean)
        if self.cov.shape != (size, size) or not 0 < self.observed * len(self.lags) < size:
            raise OptionError(
                f"reflex: expected mean (n,) and cov (n, n) of more than {self.observed} features at {len(self.lags)} "
                f"lags, got {self.mean.shape} and {self.cov.shape}"
            )
        if not (self.lags[0] == 0 and (np.diff(self.lags) > 0).all() and np.isfinite(self.lags).all()):
            raise OptionError(f"reflex: expected lags that increase from 0, got {self.lags.tolist()}")
        if not (np.isfinite(self.mean).all() and np.isfinite(self.cov).all()):
            raise OptionError("reflex: expected a finite mean and covariance")
        if not (0 <= self.share <= 1 and 0 < self.fade < np.inf):
            raise OptionError(f"reflex: expected a share in 0 … 1 and a fade > 0, got {self.share} and {self.fade}")

    @property
    def memory(self) -> float:
        """How far back it looks [s]."""
        return float(self.lags[-1])

    def gains(self, seen: Bool[np.ndarray, " Fo"]) -> Gains:
        """The regression on the features that are seen: one that is not has no influence (DESIGN 4, trap 1)."""
        if seen.all():
            return self._gains_of_all
        return self._gains(seen)

    def answer(
        self, moments: Float[np.ndarray, "L Fo"], seen: Bool[np.ndarray, " Fo"], gains: Gains
    ) -> Float[np.ndarray, " Fc"]:
        """(Fc,) the controlled features, for the observed ones at each lag, and the `gains` of those that are seen."""
        count = len(self.lags) * self.observed
        off = (moments.ravel() - self.mean[:count])[np.tile(seen, len(self.lags))]
        return np.asarray(self.mean[count:] + gains @ off)

    @cached_property
    def _gains_of_all(self) -> Gains:
        return self._gains(np.ones(self.observed, dtype=bool))

    def _gains(self, seen: Bool[np.ndarray, " Fo"]) -> Gains:
        rows = np.flatnonzero(np.tile(seen, len(self.lags)))
        controlled = np.arange(len(self.lags) * self.observed, len(self.mean))
        return np.linalg.solve(self.cov[np.ix_(rows, rows)], self.cov[np.ix_(rows, controlled)]).T


@dataclass(frozen=True, eq=False)
class Memory:
    """The partner's last moments, as long as a reflex looks back.

    times: (K,) [s]. moments: (K, Fo) what each observed feature read then or, where it was not seen, had read last;
    NaN before its first reading. last_seen: (Fo,) [s], -inf where never.
    """

    times: Float[np.ndarray, " K"]
    moments: Float[np.ndarray, "K Fo"]
    last_seen: Float[np.ndarray, " Fo"]

    @classmethod
    def empty(cls, features: int) -> Memory:
        """Nothing seen yet of so many observed features."""
        return cls(np.empty(0), np.empty((0, features)), np.full(features, -np.inf))

    def after(self, time: float, seen: Int[np.ndarray, " M"], values: Float[np.ndarray, " M"], span: float) -> Memory:
        """The memory with one more sample, of the observed features `seen`, and without what is older than `span`.

        Two samples of one time are one.
        """
        now = self.moments[-1].copy() if len(self.moments) else np.full(len(self.last_seen), np.nan)
        last_seen = self.last_seen.copy()
        now[seen], last_seen[seen] = values, time
        # The last sample before the span is kept: between it and the next lies the oldest moment that is asked for.
        first = max(int(np.searchsorted(self.times, time - span, side="right")) - 1, 0)
        end = len(self.times) - int(len(self.times) > 0 and self.times[-1] == time)
        times, moments = np.append(self.times[first:end], time), np.vstack([self.moments[first:end], now])
        return Memory(times, moments, last_seen)

    def at(self, times: Float[np.ndarray, " L"]) -> Float[np.ndarray, "L Fo"]:
        """The features at these times, linear between samples; before a feature's first reading, as it first read."""
        right = np.clip(np.searchsorted(self.times, times), 1, max(len(self.times) - 1, 1))
        right = np.minimum(right, len(self.times) - 1)
        left = np.maximum(right - 1, 0)
        step = np.maximum(self.times[right] - self.times[left], np.finfo(float).tiny)
        share = np.clip((times - self.times[left]) / step, 0.0, 1.0)[:, None]
        known = np.isfinite(self.moments)
        first = self.moments[known.argmax(0), np.arange(self.moments.shape[1])]
        filled = np.where(known, self.moments, first)
        return np.asarray((1 - share) * filled[left] + share * filled[right])
