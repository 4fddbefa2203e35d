"""How much arithmetic the equations of a step ask for, by extent: the theory that measured growth is held against.

Multiplications, to leading order, in the cheapest order of the products that is known to us; what moves memory only is
left out. B weights, M observed channels of b basis functions, E members or particles, R directions in which
demonstrations differ.
"""

from __future__ import annotations

from collections.abc import Callable

from chance import Extent

DIRECTIONS = 63  # that rbpf follows, at most


def ebip(extent: Extent) -> float:
    """Readings E M b; the update E B min(E, 2 M).

    The update is a combination of members (E², the O(E² n) of section 3.1), or goes through the gain (2 M) where
    there are fewer readings than members: then members cost in proportion, and channels with the square.
    """
    e, m = extent.members, extent.observed
    return e * m * extent.basis + 3 * innovation(m, e) + e * extent.weights * min(e, 2 * m)


def bip(extent: Extent) -> float:
    """Rows of H in the prior's directions R M b; Σ Hᵀ, gain and covariance R² M; the weights' mean R B."""
    r, m = min(extent.demonstrations - 1, extent.weights), extent.observed
    return r * m * extent.basis + 3 * r**2 * m + 2 * innovation(m, r) + r * extent.weights


def particle(extent: Extent) -> float:
    """Readings E M b, and their covariance, by which a sample's surprise is told."""
    e, m = extent.members, extent.observed
    return e * m * extent.basis + innovation(m, e)


def rbpf(extent: Extent) -> float:
    """For every particle rows of H R M b, what they say of the weights R² M, and its factor R³ / 3."""
    r, m = min(extent.demonstrations - 1, extent.weights, DIRECTIONS), extent.observed
    return extent.members * (r * m * extent.basis + r**2 * m + r**3 / 3)


def innovation(readings: int, samples: int) -> float:
    """S of so many readings from so many samples or directions, and its factor: in the space of whichever are fewer."""
    least = min(readings, samples)
    return readings * samples * least + least**3 / 3


WORK: dict[str, Callable[[Extent], float]] = {"ebip": ebip, "bip": bip, "particle": particle, "rbpf": rbpf}

# The exponents of section 3.1, O(E² n) for ebip and O(n³) for bip; of the others it gives none.
DISSERTATION: dict[str, dict[str, float]] = {
    "ebip": {"channels": 1.0, "basis": 1.0, "members": 2.0, "demonstrations": 0.0},
    "bip": {"channels": 3.0, "basis": 3.0, "demonstrations": 0.0},
}
