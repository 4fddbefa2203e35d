"""What the partner's last moments say of the controlled partner, without any model of time.

A phase model explains a new interaction by those that were demonstrated. How the robot's hand stands to the partner's
*now* often carries over where the whole course does not, and is not lost when the phase is. So a response is the
filter's and a regression's on what was just seen, each counting by its precision.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError

TINY = np.finfo(float).tiny
DOUBT = 3.0  # places' worth of the error everywhere


@dataclass(frozen=True, eq=False)
class Reflex:
    """Kernel ridge regression of the controlled features on the observed ones, now and a little before.

    A place is how the partner stands and how that changed from lag to lag, less `centre`, over `scale`. The kernel of
    two places a distance d apart is 1 / (1 + d² / 2 width²), which looks for demonstrations that stood and moved
    alike, and `trend` times their inner product, which is linear regression.

    lags: (L,) [s], increasing from 0. centre: (L, Fo), scale: (L,). places: (n, L · Fo) of demonstrations. gains:
    (n, Fc) of the kernels. mean: (Fc,). error_var: (n, Fc) squared error at each place, its demonstration held out.
    weight: how many times its precision the answer counts, 0 for not at all. fade: [s], over which what was seen goes
    stale. All in scaled units. Raises OptionError for parts that do not fit each other.
    """

    lags: Float[np.ndarray, " L"]
    centre: Float[np.ndarray, "L Fo"]
    scale: Float[np.ndarray, " L"]
    places: Float[np.ndarray, "n P"]
    gains: Float[np.ndarray, "n Fc"]
    mean: Float[np.ndarray, " Fc"]
    error_var: Float[np.ndarray, "n Fc"]
    width: float
    trend: float
    weight: float
    fade: float

    def __post_init__(self) -> None:
        arrays = {
            name: getattr(self, name) for name in ("lags", "centre", "scale", "places", "gains", "mean", "error_var")
        }
        freeze(self, **arrays)
        shapes = [self.lags.shape, self.centre.shape, self.scale.shape, self.places.shape]
        shapes += [self.gains.shape, self.mean.shape, self.error_var.shape]
        (lags,), (count, controlled), observed = self.lags.shape, self.gains.shape, self.observed
        expected = [(lags,), (lags, observed), (lags,), (count, lags * observed)]
        expected += [(count, controlled), (controlled,), (count, controlled)]
        if shapes != expected or 0 in (lags, observed, count, controlled):
            raise OptionError(f"reflex: expected arrays of the shapes {expected}, got {shapes}")
        if not (self.lags[0] == 0 and (np.diff(self.lags) > 0).all() and np.isfinite(self.lags).all()):
            raise OptionError(f"reflex: expected lags that increase from 0, got {self.lags.tolist()}")
        for name, array in arrays.items():
            if not np.isfinite(array).all():
                raise OptionError(f"reflex: expected finite numbers of {name}, got {array}")
        if not ((self.scale > 0).all() and (self.error_var >= 0).all()):
            raise OptionError("reflex: expected a positive scale, and errors that are not negative")
        for name, least in (("width", "> 0"), ("trend", ">= 0"), ("weight", ">= 0"), ("fade", "> 0")):
            value = getattr(self, name)
            if not (0 <= value < np.inf and (value > 0 or least == ">= 0")):
                raise OptionError(f"reflex: expected a finite {name} {least}, got {value}")

    @property
    def observed(self) -> int:
        """Fo, the number of observed features."""
        return int(self.centre.shape[-1])

    @property
    def memory(self) -> float:
        """How far back it looks [s]."""
        return float(self.lags[-1])

    def answer(self, moments: Float[np.ndarray, "L Fo"]) -> tuple[Float[np.ndarray, " Fc"], Float[np.ndarray, " Fc"]]:
        """(Fc,) the controlled features, and the variance of their error, for the observed ones at each lag."""
        here = place(moments, self.centre, self.scale)
        inner = self.places @ here
        alike = kernel(here @ here + self._lengths - 2 * inner, self.width)
        mean = self.mean + (alike + self.trend * inner) @ self.gains
        near = (alike * alike) ** 2  # only those close by tell of the error
        # Where nobody was near, the error is that of everywhere.
        var = (near @ self.error_var + DOUBT * self._usual_error_var) / (near.sum() + DOUBT)
        return mean, var

    @cached_property
    def _lengths(self) -> Float[np.ndarray, " n"]:
        return frozen((self.places**2).sum(1))

    @cached_property
    def _usual_error_var(self) -> Float[np.ndarray, " Fc"]:
        return frozen(self.error_var.mean(0))


def place(
    moments: Float[np.ndarray, "*n L Fo"], centre: Float[np.ndarray, "L Fo"], scale: Float[np.ndarray, " L"]
) -> Float[np.ndarray, "*n P"]:
    """(..., L · Fo) how the partner stands and how that changed from lag to lag; about 1 from the centre."""
    changes = np.concatenate([moments[..., :1, :], moments[..., :-1, :] - moments[..., 1:, :]], axis=-2)
    scaled = (changes - centre) / scale[:, None]
    return np.asarray(scaled.reshape(*scaled.shape[:-2], -1) / np.sqrt(scaled.shape[-1] * scaled.shape[-2]))


def kernel(apart: Float[np.ndarray, "*n"], width: float) -> Float[np.ndarray, "*n"]:
    """The rational quadratic kernel (of shape 1) of squared distances: 1 at 0, and far away it still remembers."""
    return np.asarray(1 / (1 + np.maximum(apart, 0.0) / (2 * width**2)))


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
        right = np.minimum(np.maximum(self.times.searchsorted(times), 1), len(self.times) - 1)
        left = np.maximum(right - 1, 0)
        step = np.maximum(self.times[right] - self.times[left], TINY)
        share = np.minimum(np.maximum((times - self.times[left]) / step, 0.0), 1.0)[:, None]
        filled = self.moments
        if np.isnan(filled[0]).any():  # what was read once is known ever after
            known = np.isfinite(filled)
            filled = np.where(known, filled, filled[known.argmax(0), np.arange(filled.shape[1])])
        return np.asarray((1 - share) * filled[left] + share * filled[right])
