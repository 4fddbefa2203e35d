"""Regression: the weights of every demonstration, and of all of them together (2.3.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from inphase.basis.basis import Basis
from inphase.basis.gap import GRID, unseen
from inphase.basis.layout import Layout
from inphase.errors import DataError, OptionError

LEAST_RIDGE = 1e-12  # below, ΦᵀΦ of a wide basis has no inverse to a float


def fit_weights(
    layout: Layout,
    phases: Sequence[Float[np.ndarray, " _"]],
    values: Sequence[Float[np.ndarray, "_ F"]],
    ridge: float = 1e-6,
    *,
    bridge: float = 0.1,
    names: Sequence[str] | None = None,
) -> tuple[Float[np.ndarray, "N B"], Float[np.ndarray, " B"]]:
    """The weights (N, B) of every demonstration, and those of all of them together, w̄ (B,).

    phases: (T,) a demonstration; values: (T, F), NaN where a feature was not seen. Regularised least squares in two
    stages, T being the samples that were seen: w̄ solves (ΦᵀΦ + T ridge I) w̄ = Φᵀy over all demonstrations; each one's
    own weights solve (ΦᵀΦ + T ridge I)(w - w̄) = Φᵀ(y - Φw̄). Weights are linear in the values. A stretch of phase that
    was not seen is bridged: there, with `bridge` of a sample's weight, a demonstration is taken to read what the
    others read (w̄), and w̄ the mean of the feature. Without that, the ridge leaves the weights of the stretch to the
    noise around it. A feature not seen at all in a demonstration gets w̄.
    names: of the features, for errors. Raises DataError for a feature that is never seen or arrays that do not fit,
    OptionError for a ridge below 1e-12 or a negative bridge.
    """
    _check(layout, phases, values)
    if not LEAST_RIDGE <= ridge < np.inf or not 0 <= bridge < np.inf:
        raise OptionError(f"expected ridge >= {LEAST_RIDGE:g} and bridge >= 0, got {ridge} and {bridge}")
    own, pooled = np.empty((len(values), layout.size)), np.empty(layout.size)
    for basis, features, seen in _alike(layout, values):
        if not any(mask.any() for mask in seen):
            name = repr(names[features[0]]) if names is not None else str(features[0])
            raise DataError(f"feature {name}: expected readings, got none in any of {len(values)} demonstrations")
        at = [p[mask] for p, mask in zip(phases, seen, strict=True)]
        readings = [v[mask][:, features] for v, mask in zip(values, seen, strict=True)]
        each, mean = _solve(basis, at, readings, ridge, bridge)
        places = np.concatenate([np.arange(layout.size)[layout.slices[f]] for f in features])
        own[:, places] = each.swapaxes(1, 2).reshape(len(own), -1)
        pooled[places] = mean.T.reshape(-1)
    return own, pooled


def residuals(
    layout: Layout,
    phases: Sequence[Float[np.ndarray, " _"]],
    values: Sequence[Float[np.ndarray, "_ F"]],
    weights: Float[np.ndarray, "N B"],
) -> list[Float[np.ndarray, "_ F"]]:
    """(T, F) y - h(φ, w) of every demonstration under its own weights, NaN where a feature was not seen (Eq. 2.15)."""
    _check(layout, phases, values)
    if len(weights) != len(values):
        raise DataError(f"expected weights of {len(values)} demonstrations, got {len(weights)}")
    return [v - layout.predict(p, w) for p, v, w in zip(phases, values, weights, strict=True)]


def _check(
    layout: Layout, phases: Sequence[Float[np.ndarray, " _"]], values: Sequence[Float[np.ndarray, "_ F"]]
) -> None:
    if len(phases) != len(values) or not values:
        raise DataError(f"expected phases and values of the same demonstrations, got {len(phases)} and {len(values)}")
    for i, (p, v) in enumerate(zip(phases, values, strict=True)):
        if v.shape != (len(p), layout.count):
            raise DataError(f"demonstration {i}: expected values ({len(p)}, {layout.count}), got {v.shape}")
        if not np.isfinite(p).all() or np.isinf(v).any():
            raise DataError(f"demonstration {i}: expected finite phases, and values that are finite or NaN")


def _alike(
    layout: Layout, values: Sequence[Float[np.ndarray, "_ F"]]
) -> Iterator[tuple[Basis, Int[np.ndarray, " M"], list[Bool[np.ndarray, " _"]]]]:
    """Features that share a basis and were seen in the same samples: the basis, the features, the samples."""
    seen = [~np.isnan(v) for v in values]
    stacked = np.concatenate(seen)
    groups: dict[tuple[Basis, bytes], list[int]] = {}
    for feature, basis in enumerate(layout.bases):
        groups.setdefault((basis, stacked[:, feature].tobytes()), []).append(feature)
    for (basis, _), features in groups.items():
        yield basis, np.array(features), [mask[:, features[0]] for mask in seen]


def _solve(
    basis: Basis,
    phases: Sequence[Float[np.ndarray, " _"]],
    readings: Sequence[Float[np.ndarray, "_ M"]],
    ridge: float,
    bridge: float,
) -> tuple[Float[np.ndarray, "N Bd M"], Float[np.ndarray, "Bd M"]]:
    """The weights of every demonstration and of all, of features that share a basis and were seen together."""
    functions = [basis(p) for p in phases]
    grams = np.stack([f.T @ f for f in functions])
    moments = np.stack([f.T @ y for f, y in zip(functions, readings, strict=True)])
    counts = np.array([len(p) for p in phases], dtype=np.float64)
    total, identity = counts.sum(), np.eye(basis.size)

    gap = basis(unseen(np.concatenate(phases), basis.periodic))
    level = np.concatenate(readings).mean(0)
    shrinkage = ridge * identity + bridge / GRID * gap.T @ gap
    goal = bridge / GRID * gap.sum(0)[:, None] * level
    mean = np.linalg.solve(grams.sum(0) + total * shrinkage, moments.sum(0) + total * goal)

    gaps = [basis(unseen(p, basis.periodic)) for p in phases]
    shrinkages = np.stack([ridge * identity + bridge / GRID * g.T @ g for g in gaps])
    # One that was not seen at all has no samples to weigh against: any weight but zero leaves it at w̄.
    penalties = np.maximum(counts, 1.0)[:, None, None] * shrinkages
    return mean + np.linalg.solve(grams + penalties, moments - grams @ mean), mean
