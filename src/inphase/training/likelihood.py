"""How likely every demonstration is under the Gaussian of all others, without learning one anew for each.

The Gaussian of a set S of n curves x, each K readings long, has their mean (Eq. 2.11) and the covariance

    Σ = (1 - λ) / (n - 1) Σ_S (x - mean)(x - mean)ᵀ + A,

the sample covariance (Eq. 2.14) shrunk by λ and filled up by a diagonal A, which makes it whole however few curves
there are. Leaving one curve or two out takes as many directions from the scatter of all. So, by the matrix determinant
lemma and Woodbury's identity, all that is needed are the products eᵢᵀ K⁻¹ eⱼ of the deviations from the mean of all N
curves, where K is Σ with all curves in its sum.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.errors import DataError

FEWEST = 4  # curves: with two left out, two are needed for a covariance


@dataclass(frozen=True, eq=False)
class LeftOut:
    """What the curves say of each other.

    log_likelihood: (N,) of every curve under the Gaussian of all others, per reading [nat]. distance: (N,) how far it
    lies from their mean, the root mean square over its readings in standard deviations of that Gaussian. contribution:
    (N,) by how much the log-likelihood of each other curve, per reading [nat], is less on average where this one is
    left out as well. deviations: (N, K) every reading less the mean of the others, in standard deviations of it alone.
    variances: (N,) along the principal directions of all curves, in units of A, the largest first.
    """

    log_likelihood: Float[np.ndarray, " N"]
    distance: Float[np.ndarray, " N"]
    contribution: Float[np.ndarray, " N"]
    deviations: Float[np.ndarray, "N K"]
    variances: Float[np.ndarray, " N"]

    def __post_init__(self) -> None:
        freeze(self, **{field.name: getattr(self, field.name) for field in fields(self)})


def left_out(curves: Float[np.ndarray, "N K"], floor: Float[np.ndarray, " K"], shrinkage: float) -> LeftOut:
    """What curves (N, K) say of each other; floor: (K,) the diagonal A. Raises DataError for fewer than four curves."""
    count, readings = curves.shape
    if count < FEWEST:
        raise DataError(f"expected at least {FEWEST} demonstrations to leave any out, got {count}")
    deviations = curves - curves.mean(axis=0)
    scaled = deviations / np.sqrt(floor)
    gram = scaled @ scaled.T
    constant = readings * np.log(2 * np.pi) + np.log(floor).sum()

    weight = (1 - shrinkage) / (count - 2)
    squares, log_det = one_left_out(gram, weight)
    log_likelihood = -0.5 * (squares + log_det + constant) / readings
    without = -0.5 * (_two_left_out(gram, (1 - shrinkage) / (count - 3)) + constant) / readings
    losses = log_likelihood - without  # (i, j): of j, where i is left out as well
    np.fill_diagonal(losses, 0.0)

    # The variance of each reading by itself, among the others.
    var = weight * ((deviations**2).sum(axis=0) - count / (count - 1) * deviations**2) + floor
    return LeftOut(
        log_likelihood=log_likelihood,
        distance=np.sqrt(squares / readings),
        contribution=losses.sum(axis=1) / (count - 1),
        deviations=count / (count - 1) * deviations / np.sqrt(var),
        variances=np.maximum(np.linalg.eigvalsh(gram)[::-1], 0.0) / (count - 1),
    )


def one_left_out(
    gram: Float[np.ndarray, "*S N N"], weight: float
) -> tuple[Float[np.ndarray, "*S N"], Float[np.ndarray, "*S N"]]:
    """The squared distance of every curve from the others, and the log-determinant of their covariance over that of A.

    gram: eᵢᵀ A⁻¹ eⱼ of the deviations from the mean of all. weight: of the scatter of the others, (1 - λ) / (N - 2).
    """
    count = gram.shape[-1]
    whole = np.eye(count) + weight * gram
    own = np.diagonal(np.linalg.solve(whole, gram), axis1=-2, axis2=-1)  # eᵢᵀ K⁻¹ eᵢ
    kept = 1 - weight * count / (count - 1) * own
    return (count / (count - 1)) ** 2 * own / kept, np.linalg.slogdet(whole)[1][..., None] + np.log(kept)


def _two_left_out(gram: Float[np.ndarray, "N N"], weight: float) -> Float[np.ndarray, "N N"]:
    """(i, j) the squared distance of j from the curves without i and j, plus the log-determinant as above."""
    count = len(gram)
    whole = np.eye(count) + weight * gram
    inner = np.linalg.solve(whole, gram)
    own = np.diag(inner)
    pairs = np.empty((count, count, 2, 2))  # the products of eᵢ and eⱼ
    pairs[..., 0, 0], pairs[..., 1, 1] = own[:, None], own[None, :]
    pairs[..., 0, 1] = pairs[..., 1, 0] = inner
    share = 1 / (count - 2)
    taken = np.eye(2) + share  # scatter of all - [eᵢ eⱼ] taken [eᵢ eⱼ]ᵀ = scatter without the two
    offset = np.array([share, 1 + share])  # [eᵢ eⱼ] offset = xⱼ less the mean without the two
    left = np.eye(2) - weight * pairs @ taken
    left[np.arange(count), np.arange(count)] = np.eye(2)  # no pair
    squares = np.einsum("k,ijk->ij", offset, np.linalg.solve(left, (pairs @ offset)[..., None])[..., 0])
    return np.asarray(squares + np.linalg.slogdet(whole)[1] + np.linalg.slogdet(left)[1])
