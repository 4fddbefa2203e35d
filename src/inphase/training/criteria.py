"""What a basis makes of demonstrations at common phases: fit, information criteria, and demonstrations held out."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from inphase.errors import DataError
from inphase.preprocess.coordinates import Coordinates
from inphase.trajectory import Dataset

FEWEST, MOST = 50, 200  # phases at which demonstrations are compared
SHORTER = 0.1  # of the demonstrations have fewer readings than that
ROUNDING = 1e-12  # of a feature's variance: an error below is none
STILL, LEAST = 1e-7, 1e-100  # of the size of a feature, and of nothing: what counts as movement


def criteria(functions: Float[np.ndarray, "C G B"], curves: Float[np.ndarray, "F N G"]) -> Float[np.ndarray, "_ F C"]:
    """AIC, BIC, the mean squared error over the variance, and -2 log likelihood of each demonstration held out."""
    (features, count, length), (some, _, size) = curves.shape, functions.shape
    basis = np.linalg.qr(functions)[0]  # orthonormal: what it leaves over is noise, whatever the condition number
    weights = (curves.reshape(-1, length) @ basis).reshape(some, features, count, size)
    size_of = np.abs(curves).max(axis=(1, 2)) ** 2 + LEAST
    variance = np.maximum(curves.var(axis=(1, 2)), STILL**2 * size_of)
    left = np.einsum("fng,fng->fn", curves, curves) - np.einsum("cfnb,cfnb->cfn", weights, weights)
    left = np.maximum(left, length * ROUNDING * variance[:, None])
    error = left.mean(-1) / length
    likelihood = length * (np.log(2 * np.pi * error) + 1)  # -2 log, at the variance that makes it likeliest
    aic, bic = likelihood + 2 * size, likelihood + np.log(length) * size

    # A demonstration under the Gaussian of the others (Eq. 2.11, 2.14): in orthonormal weights, what the basis cannot
    # say is noise, and the covariance that lacks one of them is that of all but for a term of rank 1.
    noise = left.mean(-1) / (length - size)
    off = weights - weights.mean(2, keepdims=True)
    cov = off.swapaxes(-1, -2) @ off / (count - 2) + noise[..., None, None] * np.eye(size)
    factor = np.linalg.cholesky(cov)
    white = off @ np.linalg.inv(factor).swapaxes(-1, -2)
    alpha = count / ((count - 1) * (count - 2))
    within = np.einsum("cfnb,cfnb->cfn", white, white)
    kept = np.maximum(1 - alpha * within, np.finfo(float).eps)
    ratio = (count / (count - 1)) ** 2
    log_det = 2 * np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(-1)
    said = log_det[..., None] + np.log(kept) + ratio * within / kept
    unsaid = (length - size) * np.log(noise)[..., None] + left / noise[..., None]
    scores = said + unsaid + length * np.log(2 * np.pi)
    figures = np.stack([aic / length, bic / length, error / np.where(variance > STILL**2 * size_of, variance, size_of)])
    return np.concatenate([figures, np.moveaxis(scores, -1, 0) / length]).swapaxes(1, 2)


def common_curves(dataset: Dataset, coordinates: Coordinates, periodic: bool) -> Float[np.ndarray, "F N G"]:
    """Every feature of every demonstration at the same phases; gaps are bridged, and what was not seen is the mean."""
    # No more than the shorter ones have readings: between two of them there is no news, and noise would look smooth.
    readings = int(np.quantile([len(demonstration) for demonstration in dataset], SHORTER))
    phases = common_phases(min(max(readings, FEWEST), MOST), periodic)
    curves = np.full((coordinates.count, len(dataset), len(phases)), np.nan)
    for i, demonstration in enumerate(dataset):
        features, at = coordinates.from_channels(demonstration.values), demonstration.phases
        seen = ~np.isnan(features)
        for own, feature, there in zip(curves, features.T, seen.T, strict=True):
            if there.any():
                own[i] = np.interp(phases, at[there], feature[there])
    never = np.isnan(curves).all(axis=(1, 2))
    if never.any():
        name = dataset.names[coordinates.channel_of[int(np.argmax(never))][0]]
        raise DataError(f"channel {name!r}: expected readings, got none in any of {len(dataset)} demonstrations")
    return np.where(np.isnan(curves), np.nanmean(curves, axis=1, keepdims=True), curves)


def common_phases(count: int, periodic: bool) -> Float[np.ndarray, " G"]:
    """(G,) phases, evenly spaced from 0 to 1, or round the circle."""
    return np.linspace(0.0, 1.0, count, endpoint=not periodic)
