"""The angle or orientation that features are measured from, learned from trajectories.

It is the mean of all samples. Where that is undefined (an angle that goes all round) or so far from where some
trajectories start that these would fall on different branches, it is the mean of their starts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from inphase.preprocess.quaternion import DEFINED, IDENTITY, TAU, angle_between, average, normalised

SAFE = 0.75 * np.pi  # [rad] a start further than this from the reference may be taken for one on another branch


def reference_angle(trajectories: Sequence[Float[np.ndarray, " _"]]) -> float:
    """The reference of an angle [rad] over trajectories (T,), NaN where not seen; 0 where it never was."""
    seen = [angles[~np.isnan(angles)] for angles in trajectories]
    reference = float(_reference(seen, _circular_mean, _arc, np.zeros(())))
    starts = np.array([angles[0] for angles in seen if len(angles)])
    # A joint that is recorded between 3 and 5 rad is also commanded between 3 and 5 rad.
    turns = np.round(np.median(starts - reference) / TAU) if len(starts) else 0.0
    return reference + TAU * float(turns)


def reference_orientation(trajectories: Sequence[Float[np.ndarray, "_ 4"]]) -> Float[np.ndarray, " 4"]:
    """The reference quaternion over trajectories (T, 4), NaN where not seen; the identity where it never was."""
    units = [normalised(values) for values in trajectories]
    return _reference([u[~np.isnan(u[:, 0])] for u in units], average, angle_between, np.array(IDENTITY))


def _reference(
    trajectories: Sequence[Float[np.ndarray, " ..."]],
    mean: Callable[..., Float[np.ndarray, " ..."] | None],
    distance: Callable[..., Float[np.ndarray, " _"]],
    unseen: Float[np.ndarray, " ..."],
) -> Float[np.ndarray, " ..."]:
    seen = [samples for samples in trajectories if len(samples)]
    if not seen:
        return unseen
    overall = mean(np.concatenate(seen))
    starts = np.stack([samples[0] for samples in seen])
    if overall is not None and (distance(starts, overall) < SAFE).all():
        return overall
    at_start = mean(starts)
    return np.asarray(starts[0]) if at_start is None else at_start


def _circular_mean(angles: Float[np.ndarray, " N"]) -> Float[np.ndarray, ""] | None:
    """The direction of Σ exp(i a); None where they point all round."""
    mean = np.exp(1j * angles).mean()
    return np.asarray(np.angle(mean)) if abs(mean) > DEFINED else None


def _arc(angles: Float[np.ndarray, " N"], other: Float[np.ndarray, ""]) -> Float[np.ndarray, " N"]:
    """The angle from each to the other, 0 … π [rad]."""
    return np.asarray(np.abs(np.angle(np.exp(1j * (angles - other)))))
