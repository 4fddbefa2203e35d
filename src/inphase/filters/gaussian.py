"""The arithmetic of one Gaussian innovation, shared by all filters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import isfinite, log, tau
from typing import Any

import numpy as np
from jaxtyping import Float

from inphase.arrays import FloatArray

LOG_TAU = log(tau)
ABSURD = 1e8  # standard deviations: numbers that would only blow the belief up


@dataclass(frozen=True)
class InnovationScore:
    """How well a sample fitted its prediction, and `solve`, which divides columns (M, K) by its covariance S."""

    log_likelihood: float
    surprise: float
    solve: Callable[[FloatArray], FloatArray]


def forward(roots: Float[np.ndarray, "P M M"], columns: Float[np.ndarray, "P M K"]) -> Float[np.ndarray, "P M K"]:
    """(P, M, K) root⁻¹ @ columns for many lower triangular roots at once.

    Row after row for all of them: numpy solves a stack by a general factorisation of each, in twice the time.
    """
    solved = np.empty_like(columns)
    scale = 1 / np.diagonal(roots, axis1=1, axis2=2)
    for i in range(columns.shape[1]):
        rest = columns[:, i]
        if i:
            rest = rest - (roots[:, i : i + 1, :i] @ solved[:, :i])[:, 0]
        np.multiply(rest, scale[:, i : i + 1], out=solved[:, i])
    return solved


def backward(roots: Float[np.ndarray, "P M M"], columns: Float[np.ndarray, "P M"]) -> Float[np.ndarray, "P M"]:
    """(P, M) root⁻ᵀ @ column for many lower triangular roots at once."""
    rest = columns.copy()
    scale = 1 / np.diagonal(roots, axis1=1, axis2=2)
    for i in reversed(range(rest.shape[1])):
        rest[:, i] *= scale[:, i]
        rest[:, :i] -= roots[:, i, :i] * rest[:, i : i + 1]
    return rest


def innovation_score(innovation: Float[np.ndarray, " M"], cov: Float[np.ndarray, "M M"]) -> InnovationScore | None:
    """The Gaussian log-density of an innovation under its covariance S (Eq. 2.7).

    None where S is no covariance, or the innovation so many standard deviations off that it is no reading.
    """
    lapack = _lapack()
    root, refused = lapack.dpotrf(cov, lower=1)
    if refused:
        return None
    white = lapack.dtrtrs(root, innovation, lower=1)[0]
    with np.errstate(over="ignore", invalid="ignore"):  # an absurd reading is caught below
        surprise = float(white @ white)
    log_det = 2 * float(np.log(root.diagonal()).sum())
    return _score(len(innovation), surprise, log_det, lambda columns: lapack.dpotrs(root, columns, lower=1)[0])


def spread_score(
    innovation: Float[np.ndarray, " M"], spread: Float[np.ndarray, "E M"], noise_var: Float[np.ndarray, " M"]
) -> InnovationScore | None:
    """The same for S = spreadᵀ spread + diag(noise_var), as an ensemble has it.

    With fewer members than readings, by a system that is as small as the ensemble (matrix inversion lemma).
    """
    if len(innovation) <= len(spread):
        cov = spread.T @ spread
        cov.flat[:: len(innovation) + 1] += noise_var
        return innovation_score(innovation, cov)
    stds = np.sqrt(noise_var)
    rows = spread / stds  # Z, S = √R (I + Zᵀ Z) √R
    inner = rows @ rows.T
    inner.flat[:: len(rows) + 1] += 1.0
    lapack = _lapack()
    root, refused = lapack.dpotrf(inner, lower=1)
    if refused:
        return None
    white = innovation / stds
    with np.errstate(over="ignore", invalid="ignore"):  # an absurd reading is caught below
        explained = lapack.dtrtrs(root, rows @ white, lower=1)[0]
        surprise = max(float(white @ white - explained @ explained), 0.0)
    log_det = 2 * float(np.log(root.diagonal()).sum() + np.log(stds).sum())

    def solve(columns: FloatArray) -> FloatArray:
        scaled = (columns.T / stds).T
        return np.asarray(((scaled - rows.T @ lapack.dpotrs(root, rows @ scaled, lower=1)[0]).T / stds).T)

    return _score(len(innovation), surprise, log_det, solve)


@cache
def _lapack() -> Any:
    """LAPACK itself: what numpy and scipy put around it takes longer than a small sample does."""
    import scipy.linalg.lapack

    return scipy.linalg.lapack


def _score(
    size: int, surprise: float, log_det: float, solve: Callable[[FloatArray], FloatArray]
) -> InnovationScore | None:
    if not (surprise <= ABSURD**2 * size and isfinite(log_det)):
        return None
    return InnovationScore(-0.5 * (surprise + log_det + size * LOG_TAU), surprise, solve)
