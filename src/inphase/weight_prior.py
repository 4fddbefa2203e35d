"""What is believed of the basis weights before a partner is seen (Eq. 2.11, 2.14)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError


@dataclass(frozen=True, eq=False)
class WeightPrior:
    """The demonstrations' weights, and the Gaussian made of them.

    samples: (N, B) one row a demonstration. shrinkage: 0 … 1, how much of the covariance between weights is taken for
    chance; the variances stay. trust: 0 … 1, by how much the correlation between the observed partner, whose are the
    first `partner` weights, and the controlled one is believed; at 0 the response is the mean movement. Raises
    OptionError for fewer than two demonstrations, or numbers outside their range.
    """

    samples: Float[np.ndarray, "N B"]
    shrinkage: float = 0.0
    trust: float = 1.0
    partner: int = 0

    def __post_init__(self) -> None:
        freeze(self, samples=self.samples)
        if self.samples.ndim != 2 or len(self.samples) < 2 or not np.isfinite(self.samples).all():
            raise OptionError(f"expected finite weights (N, B) of at least 2 demonstrations, got {self.samples.shape}")
        if not 0 <= self.shrinkage <= 1:
            raise OptionError(f"expected a shrinkage between 0 and 1, got {self.shrinkage}")
        if not 0 <= self.trust <= 1:
            raise OptionError(f"expected a trust between 0 and 1, got {self.trust}")
        if not 0 <= self.partner <= self.samples.shape[1]:
            raise OptionError(f"expected partner from 0 to {self.samples.shape[1]} weights, got {self.partner}")

    @cached_property
    def mean(self) -> Float[np.ndarray, " B"]:
        """(B,) w₀, the mean of the demonstrations (Eq. 2.11)."""
        return frozen(self.samples.mean(0))

    @cached_property
    def factor(self) -> Float[np.ndarray, "R B"]:
        """(R, B) directions with Σ_ww = factorᵀ factor (Eq. 2.14): a weight vector is mean + c @ factor, c ~ N(0, I).

        Without shrinkage R < N, twice that where trust is lacking: the exact filters work in as few dimensions.
        """
        spread = (self.samples - self.mean) / np.sqrt(len(self.samples) - 1)
        rows = [np.sqrt(1 - self.shrinkage) * spread] if self.shrinkage < 1 else []
        if self.shrinkage > 0:
            rows.append(np.diag(np.sqrt(self.shrinkage * (spread**2).sum(0))))
        if self.trust < 1:
            shared, alone = np.concatenate(rows), np.concatenate(rows)
            shared[:, self.partner :] *= self.trust
            alone[:, : self.partner] = 0.0
            rows = [shared, np.sqrt(1 - self.trust**2) * alone]
        # The directions of the sample covariance sum to zero and are one too many: rotate that one away.
        _, size, directions = np.linalg.svd(np.concatenate(rows), full_matrices=False)
        kept = size > 1e-10 * max(size[0], np.finfo(float).tiny)
        kept[0] = True  # demonstrations that are all the same leave one direction of no length
        return frozen(size[kept, None] * directions[kept])

    @property
    def cov(self) -> Float[np.ndarray, "B B"]:
        """(B, B) Σ_ww of Eq. 2.14, made anew at each call."""
        return np.asarray(self.factor.T @ self.factor)

    def draw(self, count: int, rng: np.random.Generator) -> Float[np.ndarray, "E B"]:
        """`count` weight vectors from the Gaussian."""
        return np.asarray(self.mean + rng.standard_normal((count, len(self.factor))) @ self.factor)

    def resample(self, count: int, rng: np.random.Generator) -> Float[np.ndarray, "E B"]:
        """`count` of the demonstrations' own weights, each as often as any other, give or take one (Fig. 23).

        As far as trust is lacking, the controlled part is that of another demonstration.
        """
        number = len(self.samples)
        order = np.concatenate([np.tile(np.arange(number), count // number), rng.permutation(number)[: count % number]])
        drawn = self.samples[order]
        if self.trust < 1:
            off, other = drawn - self.mean, drawn[rng.permutation(count)] - self.mean
            mixed = self.mean + self.trust * off + np.sqrt(1 - self.trust**2) * other
            drawn[:, self.partner :] = mixed[:, self.partner :]
        return np.asarray(drawn)
