"""The channels of an episode as continuous tracks: angles unwrapped, the four numbers of a quaternion together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from inphase.channels import Channel, Kind
from inphase.preprocess.checks.rotation import quaternion_columns, sign_continuous
from inphase.preprocess.checks.stillness import spread_of


@dataclass(frozen=True)
class Track:
    """What was seen of one channel, or of one quaternion.

    name: the channel, or the group of the quaternion. group: what it is scaled with. columns: where its C numbers
    stand. samples: (N,) where it was seen. path: (N, C) without wraps and sign flips.
    """

    name: str
    group: str
    columns: tuple[int, ...]
    samples: Int[np.ndarray, " N"]
    path: Float[np.ndarray, "N C"]

    @property
    def spread(self) -> float:
        """How far it moves, single outliers apart."""
        return float(np.linalg.norm([spread_of(component) for component in self.path.T]))


def tracks(values: Float[np.ndarray, "T D"], channels: Sequence[Channel]) -> list[Track]:
    """The tracks of an episode, values (T, D), in the order of the channels."""
    quaternions = quaternion_columns(values, channels)
    group_at = {columns[0]: group for group, columns in quaternions.items()}
    inside = {i for columns in quaternions.values() for i in columns}
    found = []
    for i, channel in enumerate(channels):
        if i in group_at:
            columns = quaternions[group_at[i]]
            norms = np.linalg.norm(values[:, columns], axis=1)
            seen = np.flatnonzero(np.isfinite(norms) & (norms > 0))  # a wrong norm is no jump
            path = sign_continuous(values[seen][:, columns] / norms[seen, None])
            found.append(Track(group_at[i], group_at[i], tuple(columns), seen, path))
        elif i not in inside:
            seen = np.flatnonzero(np.isfinite(values[:, i]))
            path = values[seen, i]
            path = np.unwrap(path) if channel.kind is Kind.ANGLE else path
            found.append(Track(channel.name, channel.group, (i,), seen, path[:, None]))
    return found


def group_spreads(found: Sequence[Track]) -> dict[str, float]:
    """How far each group moves: as far as the track of it that moves most."""
    spreads: dict[str, float] = {}
    for track in found:
        spreads[track.group] = max(spreads.get(track.group, 0.0), track.spread)
    return spreads


def usual_spreads(values: Sequence[Float[np.ndarray, "_ D"]], channels: Sequence[Channel]) -> dict[str, float]:
    """How far each group moves in half of these episodes or more: the median."""
    each = [group_spreads(tracks(episode, channels)) for episode in values]
    groups = {group for spreads in each for group in spreads}
    return {group: float(np.median([spreads[group] for spreads in each if group in spreads])) for group in groups}
