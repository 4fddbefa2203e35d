"""What features read, and the rows of H, a feature at a time."""

from __future__ import annotations

import numpy as np

from inphase.basis import Layout


class Curves:
    """h(φ, w), a feature at a time; a basis that features share is evaluated once."""

    def __init__(self, layout: Layout) -> None:
        self.size, self.places, self.bases = layout.size, layout.slices, tuple(dict.fromkeys(layout.bases))
        self.basis_of = [self.bases.index(basis) for basis in layout.bases]

    def values(self, phase: float, features: np.ndarray) -> list[np.ndarray]:
        """Φ(φ) of every feature."""
        shared = [basis(np.array(phase)) for basis in self.bases]
        return [shared[self.basis_of[feature]] for feature in features]

    def readings(self, phase: float, weights: np.ndarray, features: np.ndarray) -> np.ndarray:
        """(M,) what the features read."""
        values = self.values(phase, features)
        return np.array([v @ weights[self.places[f]] for f, v in zip(features, values, strict=True)])

    def slopes(self, phase: float, weights: np.ndarray, features: np.ndarray) -> np.ndarray:
        """(M,) ∂h/∂φ, the first column of H in Eq. 2.6."""
        shared = [basis.with_derivative(np.array(phase))[1] for basis in self.bases]
        return np.array([shared[self.basis_of[f]] @ weights[self.places[f]] for f in features])

    def dense(self, phase: float, features: np.ndarray) -> np.ndarray:
        """(M, B) the other columns of H."""
        rows = np.zeros((len(features), self.size))
        for row, feature, values in zip(rows, features, self.values(phase, features), strict=True):
            row[self.places[feature]] = values
        return rows


def within(phase: float) -> float:
    """The phase, brought back into the interaction."""
    return float(min(max(phase, 0.0), 1.0))
