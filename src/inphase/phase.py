"""How the interaction's progress is believed to evolve: the temporal block of the state (Eq. 2.4, 2.5)."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.errors import OptionError

ORDERS = (0, 1, 2)


@dataclass(frozen=True, eq=False)
class PhaseModel:
    """A prior over phase and its derivatives, and the white noise that drives the highest one.

    mean: (K,) at the start, [1, 1/s, 1/s²][:K]; cov: (K, K). K = order + 1: phase alone, with velocity, with
    acceleration (4.2.7.1). diffusion: spectral density of the noise [1/s^(2 K - 1)]. nominal_velocity: of the
    demonstrations [1/s]. periodic: the phase rolls over from 1 to 0 (4.2.7.3).
    Raises OptionError for shapes or values that make no prior.
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

    @property
    def order(self) -> int:
        """0: phase alone; 1: with velocity; 2: with acceleration."""
        return len(self.mean) - 1

    def transition(self, dt: float) -> Float[np.ndarray, "K K"]:
        """The phase block of G in Eq. 2.4, dt [s] later: a Taylor step."""
        size = len(self.mean)
        return np.array(
            [[dt ** (j - i) / factorial(j - i) if j >= i else 0.0 for j in range(size)] for i in range(size)]
        )

    def process_cov(self, dt: float) -> Float[np.ndarray, "K K"]:
        """The phase block of Q in Eq. 2.5, dt [s] later.

        Continuous white noise of spectral density q on the highest derivative n, integrated over the step:
        Q_ij = q ∫₀^dt s^(n-i)/(n-i)! · s^(n-j)/(n-j)! ds. For order 1 that is q [[dt³/3, dt²/2], [dt²/2, dt]]. Of the
        two models Eq. 2.5 names, this one does not depend on how a stretch of time is cut into samples:
        Q(a + b) = F(b) Q(a) F(b)ᵀ + Q(b). (The matrix printed there mixes the entries of both.)
        """
        n = self.order
        return np.array(
            [
                [
                    self.diffusion
                    * dt ** (2 * n - i - j + 1)
                    / (factorial(n - i) * factorial(n - j) * (2 * n - i - j + 1))
                    for j in range(n + 1)
                ]
                for i in range(n + 1)
            ]
        )

    def confine(self, phases: Float[np.ndarray, "*E"]) -> Float[np.ndarray, "*E"]:
        """Phases brought back to where they make sense: into [0, 1], or when periodic within half a turn of their mean.

        That mean is one on the circle, in [0, 1): an ensemble that straddles 1 keeps its spread, and members that are
        whole cycles apart are at the same place.
        """
        if not self.periodic:
            return np.asarray(np.clip(phases, 0.0, 1.0))
        centre = np.angle(np.exp(2j * np.pi * phases).mean()) / (2 * np.pi) % 1.0
        return np.asarray(phases - np.round(phases - centre))
