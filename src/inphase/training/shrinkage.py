"""How much of the correlation between weights is chance: shrinkage intensities from the demonstrations alone.

All of them standardise the weights: it is correlations that shrink, while variances stay. `between` is made for what
`WeightPrior` does, which shrinks the correlations between features and keeps those within one: neighbouring basis
functions have weights that are alike because movements are smooth, which is not chance. The formulas of Ledoit and
Wolf and of OAS are as published: they look at all correlations, as if each would shrink, those within features too. On
recordings of five to eight demonstrations the first finds a fifth less than `between` (0.4 … 0.6 for 0.5 … 0.8), OAS
up to a third more. All three are made for the error of the covariance; what helps a filter is for `fit` to find out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from jaxtyping import Bool, Float

from inphase.errors import OptionError, listing
from inphase.weight_prior import check_blocks

STILL = 1e-12  # of a weight's size: it does not vary


def ledoit_wolf(samples: Float[np.ndarray, "N B"]) -> float:
    """The intensity of Ledoit and Wolf (2004, Lemma 3.2 to 3.4), 0 … 1, for weights (N, B), a demonstration a row.

    It is how far single demonstrations scatter around the correlations, over how far these are from none. Two
    demonstrations both lie on the line between them and prove nothing: 1. Raises OptionError for fewer.
    """
    white, _ = _standardised(samples)
    count, size = white.shape
    if size < 2 or count == 2:
        return float(size >= 2)
    squared, scatter = _moments(white)
    return _share(scatter / count, squared - size)


def oas(samples: Float[np.ndarray, "N B"]) -> float:
    """The oracle approximating intensity of Chen, Wiesel, Eldar and Hero (2010, Eq. 23), 0 … 1, for weights (N, B).

    It takes weights to be Gaussian, and a demonstration to be spent on their mean. Raises OptionError for fewer than
    two demonstrations.
    """
    white, _ = _standardised(samples)
    count, size = white.shape
    if size < 2:
        return 0.0
    squared, _ = _moments(white)  # tr S²; tr S is the number of weights
    above = (1 - 2 / size) * squared + size**2
    return _share(above, (count - 2 / size) * (squared - size))


def between(samples: Float[np.ndarray, "N B"], blocks: Sequence[int]) -> float:
    """The intensity for what is between features, 0 … 1, for weights (N, B) and how many of them each feature has.

    That of Schäfer and Strimmer (2005) for correlations, Σ Var(r) / Σ r², summed over those between features only, as
    the others do not move. Without blocks each weight is a feature, and the formula theirs. Two demonstrations prove
    nothing: 1. Raises OptionError for fewer, or blocks that are not B weights together.
    """
    white, varies = _standardised(samples)
    check_blocks(blocks, len(varies))
    sizes = tuple(blocks) or (1,) * len(varies)
    feature = np.repeat(np.arange(len(sizes)), sizes)[varies]
    parts = [white[:, feature == one] for one in np.unique(feature)]
    count = len(white)
    if len(parts) < 2 or count == 2:
        return float(len(parts) >= 2)
    # What is between features is what there is, less what is within them.
    squared, scatter = np.array(_moments(white)) - np.sum([_moments(part) for part in parts], axis=0)
    return _share(float(scatter) / (count - 1), float(squared))


SHRINKAGES: Mapping[str, Callable[[Float[np.ndarray, "N B"], Sequence[int]], float]] = MappingProxyType(
    {
        "none": lambda samples, blocks: 0.0,
        "ledoit-wolf": lambda samples, blocks: ledoit_wolf(samples),
        "oas": lambda samples, blocks: oas(samples),
        "between": between,
    }
)


def intensity(shrinkage: str | float, samples: Float[np.ndarray, "N B"], blocks: Sequence[int] = ()) -> float:
    """The shrinkage of that name for weights (N, B), of which each feature has `blocks`, or the number itself.

    Raises OptionError for an unknown name, or a number that is not in 0 … 1.
    """
    if isinstance(shrinkage, str):
        if shrinkage not in SHRINKAGES:
            raise OptionError(f"unknown shrinkage {shrinkage!r}; one of {listing(SHRINKAGES)}, or a number 0 … 1")
        return SHRINKAGES[shrinkage](samples, blocks)
    if not 0 <= shrinkage <= 1:
        raise OptionError(f"expected a shrinkage between 0 and 1, got {shrinkage}")
    return float(shrinkage)


def _share(part: float, whole: float) -> float:
    """Their ratio, within 0 … 1; 1 where there is no correlation that could be kept."""
    return min(max(part / whole, 0.0), 1.0) if whole > 0 else 1.0


def _moments(white: Float[np.ndarray, "N V"]) -> tuple[float, float]:
    """‖S‖² of the correlations S = mean z zᵀ, and mean ‖z zᵀ - S‖², how far single demonstrations scatter around it."""
    count, size = white.shape
    products = white @ white.T if count < size else white.T @ white  # whichever is smaller: the same in squares
    squared = float((products**2).sum()) / count**2
    return squared, float(((white**2).sum(1) ** 2).sum()) / count - squared


def _standardised(samples: Float[np.ndarray, "N B"]) -> tuple[Float[np.ndarray, "N V"], Bool[np.ndarray, " B"]]:
    """z of the weights that vary, and which those are."""
    if samples.ndim != 2 or len(samples) < 2 or not np.isfinite(samples).all():
        raise OptionError(f"expected finite weights (N, B) of at least 2 demonstrations, got {samples.shape}")
    off, std = samples - samples.mean(0), samples.std(0)
    varies = std > STILL * np.abs(samples).max(0)
    return off[:, varies] / std[varies], varies
