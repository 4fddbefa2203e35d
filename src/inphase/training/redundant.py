"""Features that say nothing, or nothing that others do not say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from inphase.errors import listing

SAME = 1e-4  # of its standard deviation: a feature that lies no further from a combination of others follows from them
PART = 1e-3  # of the standard deviation: less of a feature is no part of a combination


@dataclass(frozen=True)
class ChannelFinding:
    """What is wrong with some features in all demonstrations: 'missing', 'constant', 'duplicate' or 'collinear'."""

    kind: str
    features: tuple[str, ...]
    message: str


def dead(names: Sequence[str], seen: Bool[np.ndarray, " F"], moving: Bool[np.ndarray, " F"]) -> list[ChannelFinding]:
    """A finding for the features that were never seen, and one for those that never move."""
    missing = tuple(name for name, yes in zip(names, seen, strict=True) if not yes)
    still = tuple(name for name, yes, alive in zip(names, seen, moving, strict=True) if yes and not alive)
    found = []
    if missing:
        found.append(ChannelFinding("missing", missing, f"never seen: {listing(missing)}"))
    if still:
        found.append(ChannelFinding("constant", still, f"never moves: {listing(still)}"))
    return found


def redundant(names: Sequence[str], readings: Float[np.ndarray, "R F"]) -> list[ChannelFinding]:
    """Features that are copies of each other, or follow from others, in readings (R, F) of features that move.

    Found by a pivoted QR factorisation of the standardised readings: what is left of a feature when all before it are
    taken away is nothing.
    """
    from scipy.linalg import qr, solve_triangular

    std = readings.std(axis=0)
    standard = (readings - readings.mean(axis=0)) / std / np.sqrt(len(readings))
    triangle, order = qr(standard, mode="r", pivoting=True)
    triangle = triangle[: len(order)]
    rank = int((np.abs(np.diag(triangle)) > SAME).sum())
    independent = order[:rank]
    shares = solve_triangular(triangle[:rank, :rank], triangle[:rank, rank:])
    copies: dict[int, list[int]] = {}
    found = []
    for dependent, share in zip(order[rank:], shares.T, strict=True):
        parts = independent[np.abs(share) > PART]
        other = int(parts[0])
        if len(parts) == 1 and np.abs(readings[:, dependent] - readings[:, other]).max() <= SAME * std[other]:
            copies.setdefault(other, [other]).append(int(dependent))
        else:
            together = tuple(names[f] for f in sorted({int(dependent), *parts.tolist()}))
            kind = (
                f"a line through each other: {' and '.join(together)}"
                if len(together) == 2
                else (f"each follows from the others: {listing(together)}")
            )
            found.append(ChannelFinding("collinear", together, kind))
    for members in copies.values():
        together = tuple(names[f] for f in sorted(members))
        found.append(ChannelFinding("duplicate", together, f"copies of each other: {listing(together)}"))
    return sorted(found, key=lambda finding: (finding.kind, finding.features))
