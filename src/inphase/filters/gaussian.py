"""The arithmetic of one Gaussian innovation, shared by all filters."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, log, tau

import numpy as np
from jaxtyping import Float

LOG_TAU = log(tau)
ABSURD = 1e8  # standard deviations: numbers that would only blow the belief up


@dataclass(frozen=True)
class InnovationScore:
    """How well a sample fitted its prediction, and the means to divide by its covariance."""

    root: Float[np.ndarray, "M M"]
    log_likelihood: float
    surprise: float

    def solve(self, columns: Float[np.ndarray, "M ..."]) -> Float[np.ndarray, "M ..."]:
        """S⁻¹ @ columns."""
        from scipy.linalg.lapack import dpotrs

        return np.asarray(dpotrs(self.root, columns, lower=1)[0])


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


def innovation_score(innovation: Float[np.ndarray, " M"], cov: Float[np.ndarray, "M M"]) -> InnovationScore | None:
    """The Gaussian log-density of an innovation under its covariance S (Eq. 2.7).

    None where S is no covariance, or the innovation so many standard deviations off that it is no reading.
    """
    # LAPACK itself: what numpy and scipy put around it takes longer than a small sample does.
    from scipy.linalg.lapack import dpotrf, dtrtrs

    root, refused = dpotrf(cov, lower=1)
    if refused:
        return None
    white = dtrtrs(root, innovation, lower=1)[0]
    with np.errstate(over="ignore", invalid="ignore"):  # an absurd reading is caught below
        surprise = float(white @ white)
    log_det = 2 * float(np.log(root.diagonal()).sum())
    if not (surprise <= ABSURD**2 * len(innovation) and isfinite(log_det)):
        return None
    return InnovationScore(root, -0.5 * (surprise + log_det + len(innovation) * LOG_TAU), surprise)
