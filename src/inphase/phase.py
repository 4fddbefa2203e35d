"""How the interaction's progress is believed to evolve: the temporal block of the state (Eq. 2.4, 2.5)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import factorial, sqrt

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError

ORDERS = (0, 1, 2)


@dataclass(frozen=True, eq=False)
class PhaseModel:
    """A prior over phase and its derivatives, and the white noise that drives the highest one.

    mean: (K,) at the start, [1, 1/s, 1/s²][:K]; cov: (K, K). K = order + 1: phase alone, with velocity, with
    acceleration (4.2.7.1). diffusion: spectral density of the noise [1/s^(2 K - 1)]. nominal_velocity: of the
    demonstrations [1/s]. periodic: the phase rolls over from 1 to 0 (4.2.7.3).
    Raises OptionError for shapes or values that make no prior, or a mean phase outside 0 … 1.
    """

    mean: Float[np.ndarray, " K"]
    cov: Float[np.ndarray, "K K"]
    diffusion: float
    nominal_velocity: float
    periodic: bool = False

    def __post_init__(self) -> None:
        freeze(self, mean=self.mean, cov=self.cov)
        size = len(self.mean)
        if size - 1 not in ORDERS or self.cov.shape != (size, size):
            raise OptionError(
                f"expected a phase prior of order 0, 1 or 2 with mean (K,) and cov (K, K), "
                f"got {self.mean.shape} and {self.cov.shape}"
            )
        if not (0 <= self.diffusion < np.inf and 0 < self.nominal_velocity < np.inf):
            raise OptionError(
                f"expected a finite diffusion >= 0 and nominal_velocity > 0, "
                f"got {self.diffusion} and {self.nominal_velocity}"
            )
        finite = np.isfinite(self.mean).all() and np.isfinite(self.cov).all()
        scale = np.abs(self.cov).max() if finite else 1.0
        if (
            not finite
            or np.abs(self.cov - self.cov.T).max() > 1e-12 * scale
            or np.linalg.eigvalsh(self.cov).min() < -1e-12 * scale
        ):
            raise OptionError(f"expected a finite mean and a covariance, got {self.mean.tolist()}, {self.cov.tolist()}")
        if not 0 <= self.mean[0] <= 1:
            raise OptionError(f"expected a phase between 0 and 1 at the start, got {self.mean[0]:g}")

    @property
    def order(self) -> int:
        """0: phase alone; 1: with velocity; 2: with acceleration."""
        return len(self.mean) - 1

    def starting(self, phase: float, std: float) -> PhaseModel:
        """The same prior for interactions that begin elsewhere: at `phase`, 0 … 1, give or take `std`.

        Raises OptionError for a phase that is none, or a standard deviation that is negative or not finite.
        """
        if not 0 <= std < np.inf:
            raise OptionError(f"expected a finite standard deviation >= 0 of the phase at the start, got {std}")
        mean, cov = self.mean.copy(), self.cov.copy()
        mean[0], cov[0], cov[:, 0] = phase, 0.0, 0.0  # another start says nothing of the tempo
        cov[0, 0] = std**2
        return replace(self, mean=mean, cov=cov)

    def starts(self, shares: Float[np.ndarray, " E"]) -> Float[np.ndarray, " E"]:
        """Quantiles (E,) of the phase at the start, at shares (E,) between 0 and 1: of uniform draws it makes starts.

        Nobody begins outside the interaction: the prior is cut off at 0 and 1. A periodic one is neither cut nor
        wrapped.
        """
        from scipy.special import ndtr, ndtri

        mean, std = self.mean[0], np.sqrt(self.cov[0, 0])
        if self.periodic:
            return np.asarray(mean + std * ndtri(shares))
        low, high = ndtr((np.array([0.0, 1.0]) - mean) / max(std, np.finfo(float).tiny))
        return np.asarray(np.clip(mean + std * ndtri(low + shares * (high - low)), 0.0, 1.0))  # against rounding alone

    def transition(self, dt: float) -> Float[np.ndarray, "K K"]:
        """The phase block of G in Eq. 2.4, dt [s] later: a Taylor step."""
        powers, factorials = _taylor(len(self.mean))
        return np.asarray(dt**powers / factorials)

    def process_cov(self, dt: float) -> Float[np.ndarray, "K K"]:
        """The phase block of Q in Eq. 2.5, dt [s] later.

        Continuous white noise of spectral density q on the highest derivative n, integrated over the step:
        Q_ij = q ∫₀^dt s^(n-i)/(n-i)! · s^(n-j)/(n-j)! ds. For order 1 that is q [[dt³/3, dt²/2], [dt²/2, dt]]. Of the
        two models Eq. 2.5 names, this one does not depend on how a stretch of time is cut into samples:
        Q(a + b) = F(b) Q(a) F(b)ᵀ + Q(b). (The matrix printed there mixes the entries of both.)
        """
        scale = self.process_scale(dt)
        return np.asarray(np.outer(scale, scale) * unit_process_cov(self.order))

    def process_scale(self, dt: float) -> Float[np.ndarray, " K"]:
        """(K,) what the rows and columns of `unit_process_cov` are multiplied by, dt [s] later."""
        return np.asarray(sqrt(self.diffusion) * dt ** _half_powers(self.order))

    def confine(self, phases: Float[np.ndarray, "*E"]) -> Float[np.ndarray, "*E"]:
        """Phases brought back to where they make sense: into [0, 1], or when periodic within half a turn of their mean.

        That mean is one on the circle, in [0, 1): an ensemble that straddles 1 keeps its spread, and members that are
        whole cycles apart are at the same place.
        """
        if not self.periodic:
            return np.asarray(np.minimum(np.maximum(phases, 0.0), 1.0))
        centre = np.angle(np.exp(2j * np.pi * phases).mean()) / (2 * np.pi) % 1.0
        return np.asarray(phases - np.round(phases - centre))


@cache
def unit_process_cov(order: int) -> Float[np.ndarray, "K K"]:
    """(K, K) the noise of a process of that order, a second later, at a spectral density of 1."""
    left = range(order, -1, -1)
    return frozen([[1 / (factorial(i) * factorial(j) * (i + j + 1)) for j in left] for i in left])


@cache
def _half_powers(order: int) -> Float[np.ndarray, " K"]:
    return frozen(np.arange(order, -1, -1) + 0.5)


@cache
def _taylor(size: int) -> tuple[Float[np.ndarray, "K K"], Float[np.ndarray, "K K"]]:
    """(K, K) powers and factorials of a Taylor step; infinite factorials where nothing is carried over."""
    ahead = np.arange(size) - np.arange(size)[:, None]
    factorials = [[factorial(j) if j >= 0 else np.inf for j in row] for row in ahead.tolist()]
    return frozen(np.maximum(ahead, 0)), frozen(factorials)
