"""Unit quaternions (x, y, z, w) and the rotation vectors [rad] that stand for them in a model."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from inphase.trajectory import QUATERNION_NORM

TAU = 2 * np.pi
IDENTITY = (0.0, 0.0, 0.0, 1.0)
DEFINED = 0.1  # by how much the largest eigenvalue of an average must stand out, of 1
SMALL = 1e-3  # [rad] below it the Jacobian takes its Taylor series


def normalised(values: Float[np.ndarray, "T 4"]) -> Float[np.ndarray, "T 4"]:
    """Unit quaternions whose first non-zero component is positive, so that q and -q are the same numbers.

    All four are NaN where one is missing or the norm is far from 1.
    """
    norms = np.sqrt((values * values).sum(axis=1))
    low, high = QUATERNION_NORM
    with np.errstate(invalid="ignore"):
        norms[~((norms > low) & (norms < high))] = np.nan
    leading = values[np.arange(len(values)), (values != 0).argmax(axis=1)]
    return np.asarray(values / np.copysign(norms, leading)[:, None])


def average(units: Float[np.ndarray, "N 4"]) -> Float[np.ndarray, " 4"] | None:
    """The orientation nearest to all: the first eigenvector of Σ q qᵀ, w >= 0; None where it is undefined.

    Source: Markley et al., Averaging Quaternions, J. Guidance, Control, and Dynamics 30(4), 2007.
    """
    eigenvalues, eigenvectors = np.linalg.eigh(units.T @ units / len(units))
    if eigenvalues[-1] - eigenvalues[-2] < DEFINED:
        return None
    mean = eigenvectors[:, -1]
    return np.asarray(mean * np.copysign(1.0, mean[3]))


def angle_between(units: Float[np.ndarray, "N 4"], other: Float[np.ndarray, " 4"]) -> Float[np.ndarray, " N"]:
    """The angle of the rotation from each to the other, 0 … π [rad]."""
    return np.asarray(2 * np.arccos(np.minimum(np.abs(units @ other), 1.0)))


def rotation_vectors(units: Float[np.ndarray, "T 4"], references: Float[np.ndarray, "R 4"]) -> Float[np.ndarray, "T 3"]:
    """The shortest rotation vectors [rad] that turn the reference (R = 1, or one for each) into each; NaN stays."""
    from scipy.spatial.transform import Rotation

    missing = np.isnan(units[:, 0])
    seen = np.where(missing[:, None], IDENTITY, units)
    # In the frame of the reference, so that turning the world turns nothing here.
    vectors = (Rotation.from_quat(references).inv() * Rotation.from_quat(seen)).as_rotvec()
    vectors[missing] = np.nan
    return np.asarray(vectors)


def nearest(vectors: Float[np.ndarray, "T 3"], near: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    """Of all rotation vectors of the same rotations, r (1 + 2πk / |r|), the ones nearest to `near`."""
    angles = np.sqrt((vectors * vectors).sum(axis=1, keepdims=True))
    # No rotation at all has no axis: the full turns nearest to `near` are about its own.
    axes = np.where(angles > 1e-12, vectors, near)
    axes = axes / np.maximum(np.sqrt((axes * axes).sum(axis=1, keepdims=True)), 1e-300)
    turns = np.round(((near * axes).sum(axis=1, keepdims=True) - angles) / TAU)
    return np.asarray(vectors + TAU * turns * axes)


def continuous(vectors: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    """The same rotations, each by the vector nearest to the one seen before it; NaN is passed over."""
    seen = np.flatnonzero(~np.isnan(vectors[:, 0]))
    steady = vectors.copy()
    path = steady[seen]
    # Where no neighbours ask for another branch none is ever left, and the slow path is not needed.
    if not np.array_equal(nearest(path[1:], path[:-1]), path[1:]):
        for i in range(1, len(path)):
            path[i] = nearest(path[i : i + 1], path[i - 1 : i])[0]
        steady[seen] = path
    return steady


def turned(vectors: Float[np.ndarray, "S 3"], reference: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "S 4"]:
    """The unit quaternions of the reference turned by each rotation vector, with one sign along S; NaN stays.

    The sign is the reference's at the first row seen.
    """
    from scipy.spatial.transform import Rotation

    units = np.full((len(vectors), 4), np.nan)
    seen = np.flatnonzero(~np.isnan(vectors).any(axis=1))
    path = (Rotation.from_quat(reference) * Rotation.from_rotvec(vectors[seen])).as_quat()
    before = np.concatenate([reference[None], path[:-1]])
    signs = np.where((path * before).sum(axis=1) < 0, -1.0, 1.0)
    units[seen] = path * np.cumprod(signs)[:, None]
    return units


def jacobian(vectors: Float[np.ndarray, "S 3"], reference: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "S 4 3"]:
    """The derivative of `turned`, up to its sign: of each quaternion by each rotation vector [1/rad]."""
    angle = np.sqrt((vectors * vectors).sum(axis=1))
    sine = 0.5 * np.sinc(angle / TAU)  # sin(|r|/2) / |r|
    with np.errstate(invalid="ignore", divide="ignore"):
        bend = np.where(angle < SMALL, -1 / 24, (0.5 * np.cos(angle / 2) - sine) / angle**2)
    vector_part = sine[:, None, None] * np.eye(3) + bend[:, None, None] * vectors[:, :, None] * vectors[:, None, :]
    scalar_part = -0.5 * sine[:, None, None] * vectors[:, None, :]
    return np.asarray(_times(reference) @ np.concatenate([vector_part, scalar_part], axis=1))


def _times(q: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "4 4"]:
    """The matrix that multiplies a quaternion by `q` from the left."""
    x, y, z, w = q
    return np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]])
