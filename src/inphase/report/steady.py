"""Angles and quaternions as they can be drawn: on one branch, without jumps that no joint made."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, Kind, quaternions
from inphase.metrics import difference
from inphase.preprocess.checks.rotation import sign_continuous
from inphase.preprocess.coordinates import Coordinates


def steady(channels: Sequence[Channel], values: Float[np.ndarray, "T D"]) -> Float[np.ndarray, "T D"]:
    """Angles unwrapped and quaternions with the sign of the one before; NaN stays."""
    drawn = np.array(values)
    for column, channel in enumerate(channels):
        seen = np.isfinite(drawn[:, column])
        if channel.kind is Kind.ANGLE:
            drawn[seen, column] = np.unwrap(drawn[seen, column])
    for parts in quaternions(channels):
        columns = list(parts)
        seen = np.isfinite(drawn[:, columns]).all(1)
        if seen.any():
            drawn[np.ix_(seen, columns)] = sign_continuous(drawn[seen][:, columns])
    return drawn


def steady_together(
    channels: Sequence[Channel], values: Sequence[Float[np.ndarray, "_ D"]]
) -> list[Float[np.ndarray, "_ D"]]:
    """Several trajectories (T, D), each steady and all on the branch near their mean; quaternions have norm 1."""
    coordinates = Coordinates.learn(channels, values)
    if coordinates.flat:
        return [*values]
    features = [coordinates.from_channels(one) for one in values]
    return [coordinates.to_channels(one, np.zeros_like(one))[0] for one in features]


def beside(
    channels: Sequence[Channel], values: Float[np.ndarray, "T D"], answers: Float[np.ndarray, "T D"]
) -> Float[np.ndarray, "T D"]:
    """The values on the branch of the answers to them: what is drawn apart is wrong. Unanswered ones are steady."""
    near = answers - difference(channels, answers, values)
    return np.where(np.isfinite(answers), near, steady(channels, values))
