"""Blocks of features that share a basis: how a layout computes without the zeros of its Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import IntArray
from inphase.basis.basis import Basis
from inphase.errors import OptionError, listing


@dataclass(frozen=True, eq=False)
class Block:
    """Features of one basis. columns: (m,) their places among those asked for. places: (m · size,) of their weights.

    Both are slices where the features stand side by side, so that taking them copies nothing.
    """

    basis: Basis
    count: int
    columns: slice | IntArray
    places: slice | IntArray

    def weights(self, weights: Float[np.ndarray, "*E B"]) -> Float[np.ndarray, "*E m Bd"]:
        """(*E, m, size) the weights of the features."""
        return weights[..., self.places].reshape(*weights.shape[:-1], self.count, self.basis.size)


@dataclass(frozen=True, eq=False)
class Plan:
    """The blocks that the features asked for fall into, and how many features those are."""

    blocks: tuple[Block, ...]
    count: int

    def join(self, parts: Sequence[Float[np.ndarray, "*E _"]], shape: tuple[int, ...]) -> Float[np.ndarray, "*E M"]:
        """(*shape, M) what the blocks gave, every feature in its place."""
        if len(parts) == 1:
            return parts[0]
        joined = np.empty((*shape, self.count))
        for block, part in zip(self.blocks, parts, strict=True):
            joined[..., block.columns] = part
        return joined


def make_plan(bases: Sequence[Basis], slices: Sequence[slice], features: Int[np.ndarray, " M"] | None) -> Plan:
    """The plan for some features, None for all; raises OptionError where they do not exist or do not increase."""
    wanted = np.arange(len(bases)) if features is None else np.asarray(features, dtype=np.int64)
    if len(wanted) and (wanted[0] < 0 or wanted[-1] >= len(bases) or (np.diff(wanted) <= 0).any()):
        raise OptionError(f"expected increasing features from 0 to {len(bases) - 1}, got {listing(wanted)}")
    columns_of: dict[Basis, list[int]] = {}
    for column, feature in enumerate(wanted):
        columns_of.setdefault(bases[feature], []).append(column)
    blocks = []
    for basis, columns in columns_of.items():
        places = np.concatenate([np.arange(slices[i].start, slices[i].stop) for i in wanted[columns]])
        blocks.append(Block(basis, len(columns), _side_by_side(np.array(columns)), _side_by_side(places)))
    return Plan(tuple(blocks), len(wanted))


def _side_by_side(indices: IntArray) -> slice | IntArray:
    """The indices as a slice where they have no gap."""
    first, last = int(indices[0]), int(indices[-1])
    return slice(first, last + 1) if last - first + 1 == len(indices) else indices
