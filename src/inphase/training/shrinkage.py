"""How much of the correlation between weights is chance: shrinkage intensities from the demonstrations alone.

The target is that of `WeightPrior`: variances stay, covariances shrink towards 0. So weights are standardised, and the
identity is what their correlations are shrunk to. Weights of neighbouring basis functions are correlated because
movements are smooth, and shrinking takes that for chance like all the rest: what is drawn from a shrunk prior is
rougher than any demonstration, and where these are few and smooth, a held-out one is often less likely under it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from inphase.errors import OptionError, listing

STILL = 1e-12  # of a weight's size: it does not vary


def none(samples: Float[np.ndarray, "N B"]) -> float:
    """0: the covariance of the demonstrations as it is."""
    return 0.0


def ledoit_wolf(samples: Float[np.ndarray, "N B"]) -> float:
    """The intensity of Ledoit and Wolf (2004, Lemma 3.2 to 3.4), 0 … 1, for weights (N, B), a demonstration a row.

    It is how far single demonstrations scatter around the correlations, over how far these are from none. Two
    demonstrations both lie on the line between them and prove nothing: 1. Raises OptionError for fewer.
    """
    gram, size = _gram(samples)
    count = len(gram)
    if size < 2 or count == 2:
        return float(size >= 2)
    squared = float((gram**2).sum()) / count**2  # ‖S‖²
    scatter = float((np.diag(gram) ** 2).sum()) / count - squared  # mean ‖z zᵀ - S‖²
    return _share(scatter / count, squared - size)


def oas(samples: Float[np.ndarray, "N B"]) -> float:
    """The oracle approximating intensity of Chen, Wiesel, Eldar and Hero (2010, Eq. 23), 0 … 1, for weights (N, B).

    It takes weights to be Gaussian, and a demonstration to be spent on their mean. Raises OptionError for fewer than
    two demonstrations.
    """
    gram, size = _gram(samples)
    if size < 2:
        return 0.0
    squared = float((gram**2).sum()) / len(gram) ** 2  # tr S²; tr S is the number of weights
    above = (1 - 2 / size) * squared + size**2
    return _share(above, (len(gram) - 2 / size) * (squared - size))


SHRINKAGES: Mapping[str, Callable[[Float[np.ndarray, "N B"]], float]] = MappingProxyType(
    {"none": none, "ledoit-wolf": ledoit_wolf, "oas": oas}
)


def intensity(shrinkage: str | float, samples: Float[np.ndarray, "N B"]) -> float:
    """The shrinkage of that name for weights (N, B), or the number itself.

    Raises OptionError for an unknown name, or a number that is not in 0 … 1.
    """
    if isinstance(shrinkage, str):
        if shrinkage not in SHRINKAGES:
            raise OptionError(f"unknown shrinkage {shrinkage!r}; one of {listing(SHRINKAGES)}, or a number 0 … 1")
        return SHRINKAGES[shrinkage](samples)
    if not 0 <= shrinkage <= 1:
        raise OptionError(f"expected a shrinkage between 0 and 1, got {shrinkage}")
    return float(shrinkage)


def _share(part: float, whole: float) -> float:
    """Their ratio, within 0 … 1; 1 where there is no correlation that could be kept."""
    return min(max(part / whole, 0.0), 1.0) if whole > 0 else 1.0


def _gram(samples: Float[np.ndarray, "N B"]) -> tuple[Float[np.ndarray, "N N"], int]:
    """Z Zᵀ of the standardised weights Z, whose ZᵀZ / N are the correlations S; and how many of the weights vary."""
    if samples.ndim != 2 or len(samples) < 2 or not np.isfinite(samples).all():
        raise OptionError(f"expected finite weights (N, B) of at least 2 demonstrations, got {samples.shape}")
    off, std = samples - samples.mean(0), samples.std(0)
    varies = std > STILL * np.abs(samples).max(0)
    white = off[:, varies] / std[varies]
    return white @ white.T, int(varies.sum())
