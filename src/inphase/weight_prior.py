"""What is believed of the basis weights before a partner is seen (Eq. 2.11, 2.14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError, listing


@dataclass(frozen=True, eq=False)
class WeightPrior:
    """The demonstrations' weights, and the Gaussian made of them.

    samples: (N, B) one row a demonstration. shrinkage: 0 … 1, how much of the covariance between features is taken for
    chance; that of the weights of one feature, whose movement is smooth, stays whole. blocks: how many weights each
    feature has, in their order; empty where that is not known: then each weight stands for itself, and all but the
    variances shrinks. trust: 0 … 1, by how much the correlation between the observed partner, whose are the first
    `partner` weights, and the controlled one is believed; at 0 the response is the mean movement. Raises OptionError
    for fewer than two demonstrations, blocks that are not B weights together, or numbers outside their range.
    """

    samples: Float[np.ndarray, "N B"]
    shrinkage: float = 0.0
    trust: float = 1.0
    partner: int = 0
    blocks: tuple[int, ...] = ()

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
        check_blocks(self.blocks, self.samples.shape[1])
        object.__setattr__(self, "blocks", tuple(int(count) for count in self.blocks))

    @classmethod
    def from_moments(cls, mean: Float[np.ndarray, " B"], cov: Float[np.ndarray, "B B"]) -> WeightPrior:
        """The prior of a Gaussian with mean (B,) and covariance (B, B): 2 B samples that have just these moments.

        Raises OptionError where the covariance is none.
        """
        value, vector = np.linalg.eigh((cov + cov.T) / 2)
        if np.abs(cov - cov.T).max() > 1e-8 * np.abs(cov).max() or value[0] < -1e-8 * max(value[-1], 0.0):
            raise OptionError("expected a covariance of the weights, symmetric with no negative variance")
        value[value < 1e-12 * value[-1]] = 0.0  # rounding, whose root would count as a direction
        rows = np.sqrt(value * (len(value) - 0.5))[:, None] * vector.T
        return cls(np.concatenate([mean + rows, mean - rows]))

    @cached_property
    def mean(self) -> Float[np.ndarray, " B"]:
        """(B,) w₀, the mean of the demonstrations (Eq. 2.11)."""
        return frozen(self.samples.mean(0))

    @cached_property
    def factor(self) -> Float[np.ndarray, "R B"]:
        """(R, B) directions with Σ_ww = factorᵀ factor (Eq. 2.14): a weight vector is mean + c @ factor, c ~ N(0, I).

        Without shrinkage R < N, twice that where trust is lacking: the exact filters work in as few dimensions. With it
        every feature has as many of its own.
        """
        rows = self._spread
        if self.shrinkage > 0:
            rows = np.concatenate([np.sqrt(1 - self.shrinkage) * rows, np.sqrt(self.shrinkage) * self._apart])
        if self.trust < 1:
            both = rows[:, : self.partner].any(1) & rows[:, self.partner :].any(1)
            shared, alone = rows[both], rows[both]
            shared[:, self.partner :] *= self.trust
            alone[:, : self.partner] = 0.0
            rows = np.concatenate([rows[~both], shared, np.sqrt(1 - self.trust**2) * alone])
        return frozen(_reduced(rows))

    @property
    def alone(self) -> Float[np.ndarray, "R B"]:
        """(R, B) rows whose square is Σ_ww within each block, though not between blocks.

        Few of them whatever shrinks: `factor` has some for every feature then, and takes a minute for 500 of them.
        """
        ends = np.cumsum(self.blocks)
        # Neither shrinkage nor a lack of trust changes what is within a block, if the partner ends with one.
        return self._spread if self.partner in (0, *ends) and len(ends) else self.factor

    @cached_property
    def _spread(self) -> Float[np.ndarray, "N B"]:
        """(N, B) the demonstrations around their mean: rows whose square is the sample covariance."""
        return frozen((self.samples - self.mean) / np.sqrt(len(self.samples) - 1))

    @cached_property
    def _apart(self) -> Float[np.ndarray, "R B"]:
        """(R, B) rows of one feature each, whose square is the sample covariance without what is between features."""
        from scipy.linalg import block_diag

        ends = np.cumsum(self.blocks or (1,) * self.samples.shape[1])[:-1]
        return frozen(block_diag(*(_reduced(part) for part in np.split(self._spread, ends, axis=1))))

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
        return self._as_trusted(self.samples[order], rng)

    def as_believed(self, drawn: Float[np.ndarray, "E B"], rng: np.random.Generator) -> Float[np.ndarray, "E B"]:
        """Draws from another density with the demonstrations' covariance, as correlated as is believed: like `cov`."""
        if self.shrinkage > 0:
            chance = rng.standard_normal((len(drawn), len(self._apart))) @ self._apart
            off = np.sqrt(1 - self.shrinkage) * (drawn - self.mean) + np.sqrt(self.shrinkage) * chance
            drawn = self.mean + off
        return self._as_trusted(drawn, rng)

    def _as_trusted(self, drawn: Float[np.ndarray, "E B"], rng: np.random.Generator) -> Float[np.ndarray, "E B"]:
        if self.trust == 1:
            return drawn
        off, other = drawn - self.mean, drawn[rng.permutation(len(drawn))] - self.mean
        mixed = self.mean + self.trust * off + np.sqrt(1 - self.trust**2) * other
        return np.concatenate([drawn[:, : self.partner], mixed[:, self.partner :]], axis=1)


def check_blocks(blocks: Sequence[int], size: int) -> None:
    """Raise OptionError unless the blocks are counts of weights, `size` together, or none at all."""
    counts = all(isinstance(count, (int, np.integer)) and count > 0 for count in blocks)
    if blocks and not (counts and sum(blocks) == size):
        raise OptionError(f"expected blocks of {size} weights together, got {listing(blocks)}")


def _reduced(rows: Float[np.ndarray, "N B"]) -> Float[np.ndarray, "R B"]:
    """As few rows as have the same square: orthogonal ones, the longest first."""
    # The directions of the sample covariance sum to zero and are one too many: rotate that one away.
    _, size, directions = np.linalg.svd(rows, full_matrices=False)
    kept = size > 1e-10 * max(size[0], np.finfo(float).tiny)
    kept[0] = True  # demonstrations that are all the same leave one direction of no length
    return np.asarray(size[kept, None] * directions[kept])
