"""A Gaussian mixture over the demonstrations' weights: what eBIP⁻ draws its ensemble from (3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze, frozen
from inphase.errors import OptionError

MOST_COMPONENTS = 5
MOST_DIRECTIONS = 4  # in which components differ: few demonstrations tell no more of their shapes
EVIDENCE = 6.0  # by which the information criterion has to prefer a mixture: strong, to Kass and Raftery (1995)
VOLUME = 1 / 3  # of a component, imagined before any demonstration is seen; all of them together have 1
ROUNDS = 100  # at most, of expectation and maximisation …
SETTLED = 1e-4  # … until no demonstration changes its component by more than this share


@dataclass(frozen=True, eq=False)
class Components:
    """Gaussians in a few directions. shares: (K,) sum to 1. centres: (K, L). covs: (K, L, L)."""

    shares: Float[np.ndarray, " K"]
    centres: Float[np.ndarray, "K L"]
    covs: Float[np.ndarray, "K L L"]

    def __post_init__(self) -> None:
        freeze(self, shares=self.shares, centres=self.centres, covs=self.covs)

    @cached_property
    def roots(self) -> Float[np.ndarray, "K L L"]:
        """(K, L, L) the covariances' Cholesky factors."""
        return frozen(np.linalg.cholesky(self.covs))

    def log_densities(self, points: Float[np.ndarray, "N L"]) -> Float[np.ndarray, "N K"]:
        """(N, K) the logarithm of each component's share times its density, at every point."""
        off = (points - self.centres[:, None]).transpose(0, 2, 1)
        white = np.linalg.solve(self.roots, off)
        log_det = np.log(np.diagonal(self.roots, axis1=1, axis2=2)).sum(1)
        constant = np.log(self.shares) - log_det - 0.5 * points.shape[1] * np.log(2 * np.pi)
        return np.asarray((constant[:, None] - 0.5 * (white**2).sum(1)).T)

    def standardised(self) -> Components:
        """The same components, moved and stretched together until mean and covariance of all are 0 and I."""
        centres = self.centres - self.shares @ self.centres
        within = np.tensordot(self.shares, self.covs, 1)
        stretch = np.linalg.inv(np.linalg.cholesky(within + (centres.T * self.shares) @ centres))
        return Components(self.shares, centres @ stretch.T, stretch @ self.covs @ stretch.T)


@dataclass(frozen=True, eq=False)
class Mixture:
    """Gaussians that differ in the widest directions of the demonstrations and share all others.

    A weight vector is mean + c @ factor, mean: (B,), factor: (R, B); the first L of c are drawn from the components,
    the others from N(0, I). Mean and covariance are those of the demonstrations, whatever the components.
    """

    mean: Float[np.ndarray, " B"]
    factor: Float[np.ndarray, "R B"]
    components: Components

    def __post_init__(self) -> None:
        freeze(self, mean=self.mean, factor=self.factor)

    @classmethod
    def learn(cls, samples: Float[np.ndarray, "N B"]) -> Mixture:
        """The mixture of the demonstrations' weights, a row each; always the same for the same ones.

        In all directions that N demonstrations span, any split of them is perfect, and covariances are singular. So
        components differ in a few principal directions only: how many, and how many components, is chosen together by
        the Bayesian information criterion. Each start is a cut of Ward's tree (Fraley and Raftery 2002).
        Raises OptionError for fewer than two demonstrations, or weights that are not finite.
        """
        if samples.ndim != 2 or len(samples) < 2 or not np.isfinite(samples).all():
            raise OptionError(f"expected finite weights (N, B) of at least 2 demonstrations, got {samples.shape}")
        count, mean = len(samples), samples.mean(0)
        turned, size, directions = np.linalg.svd((samples - mean) / np.sqrt(count - 1), full_matrices=False)
        rank = int((size > 1e-10 * max(size[0], np.finfo(float).tiny)).sum())
        points = np.sqrt(count - 1) * turned[:, :rank]  # c, whose covariance is I
        factor = size[: max(rank, 1), None] * directions[: max(rank, 1)]
        return cls(mean, factor, _chosen(points))

    def draw(self, count: int, rng: np.random.Generator) -> Float[np.ndarray, "E B"]:
        """`count` weight vectors; each component gives as many as its share says, give or take one."""
        drawn, parts = rng.standard_normal((count, len(self.factor))), self.components
        combed = (np.arange(count) + rng.random()) / count
        of = np.searchsorted(np.cumsum(parts.shares)[:-1], combed, side="right")
        leading = parts.centres.shape[1]
        drawn[:, :leading] = parts.centres[of] + np.einsum("eij,ej->ei", parts.roots[of], drawn[:, :leading])
        return np.asarray(self.mean + drawn @ self.factor)


def expectation_maximisation(
    points: Float[np.ndarray, "N L"], belonging: Float[np.ndarray, "N K"], rounds: int = ROUNDS
) -> Components:
    """The components that maximise the penalised likelihood, climbing from who belongs where (rows sum to 1).

    To be run on points of covariance I. The penalty is that of one more demonstration in every component, imagined
    around its centre with a covariance Λ of a third of the volume: Σ_k log π_k - (log|Σ_k| + tr(Λ Σ_k⁻¹)) / 2
    (Fraley and Raftery 2007, Chen and Tan 2009). So no component can close in on a single demonstration.
    """
    for _ in range(rounds):
        parts = _maximised(points, belonging)
        before, joint = belonging, parts.log_densities(points)
        belonging = np.exp(joint - np.logaddexp.reduce(joint, axis=1, keepdims=True))
        if np.abs(belonging - before).max() < SETTLED:
            break
    return parts


def _maximised(points: Float[np.ndarray, "N L"], belonging: Float[np.ndarray, "N K"]) -> Components:
    count, size = belonging.shape[1], points.shape[1]
    members = belonging.sum(0)
    centres = belonging.T @ points / np.maximum(members, np.finfo(float).tiny)[:, None]
    off = points - centres[:, None]
    scatter = np.einsum("nk,kni,knj->kij", belonging, off, off) + np.eye(size) * VOLUME ** (2 / size)
    return Components((members + 1) / (len(points) + count), centres, scatter / (members + 1)[:, None, None])


def _chosen(points: Float[np.ndarray, "N R"]) -> Components:
    """The components, in the first directions, that the information criterion likes best; one without strong reason."""
    from scipy.cluster.hierarchy import cut_tree, ward

    number, rank = points.shape
    counts = range(2, min(MOST_COMPONENTS, number // 2) + 1)
    best, most = Components(np.ones(1), np.zeros((1, 1)), np.ones((1, 1, 1))), EVIDENCE
    for size in range(1, min(MOST_DIRECTIONS, rank) + 1):
        leading = points[:, :size]
        alone = Components(np.ones(1), np.zeros((1, size)), np.eye(size)[None]).log_densities(leading).sum()
        for count, cut in zip(counts, cut_tree(ward(leading), counts).T, strict=True):
            parts = expectation_maximisation(leading, np.eye(count)[cut]).standardised()
            gain = np.logaddexp.reduce(parts.log_densities(leading), axis=1).sum() - alone
            parameters = (count - 1) * (1 + size + size * (size + 1) / 2)  # beyond those of the single one
            preferred = 2 * gain - parameters * np.log(number)
            if preferred > most:
                best, most = parts, preferred
    return best
