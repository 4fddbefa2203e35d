"""Channel groups reduced to one channel: it does not matter which sensor of a group is pressed (3.2.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase.arrays import IntArray
from inphase.channels import Channel, Kind, match
from inphase.errors import ChannelError, ObservationError, OptionError, listing
from inphase.trajectory import Dataset, Demonstration


def _of_seen(
    reduce: Callable[..., Float[np.ndarray, " T"]], values: Float[np.ndarray, "T m"]
) -> Float[np.ndarray, " T"]:
    """(T,) of those that were seen; NaN where none was."""
    reduced, seen = np.full(len(values), np.nan), ~np.isnan(values).all(1)
    reduced[seen] = reduce(values[seen], axis=1)
    return reduced


def _norm(values: Float[np.ndarray, "T m"]) -> Float[np.ndarray, " T"]:
    return np.asarray(np.sqrt(_of_seen(np.nansum, values**2)))


WAYS: dict[str, Callable[[Float[np.ndarray, "T m"]], Float[np.ndarray, " T"]]] = {
    "max": lambda values: _of_seen(np.nanmax, values),
    "mean": lambda values: _of_seen(np.nanmean, values),
    "norm": _norm,
}


@dataclass(frozen=True)
class Reduction:
    """Groups of channels, each of which becomes one: {name: (names or patterns, "max", "mean" or "norm")}.

    What was not seen is left out, and a group of which nothing was seen was not seen; neither was what is infinite in a
    live sample. Raises OptionError for no group, or another way to reduce.
    """

    groups: Mapping[str, tuple[Sequence[str] | str, str]]

    def __post_init__(self) -> None:
        groups: dict[str, tuple[tuple[str, ...], str]] = {}
        for name, entry in dict(self.groups).items():
            if not (isinstance(entry, (tuple, list)) and len(entry) == 2):
                raise OptionError(f'{name}: expected (names or patterns, "max"), got {entry!r}')
            patterns, way = entry
            if way not in WAYS:
                raise OptionError(f"{name}: unknown way to reduce {way!r}; one of {listing(WAYS)}")
            groups[name] = ((patterns,) if isinstance(patterns, str) else tuple(patterns)), way
        if not groups or not all(patterns for patterns, _ in groups.values()):
            raise OptionError(f"expected groups of channels to reduce, got {self.groups!r}")
        object.__setattr__(self, "groups", groups)

    def __hash__(self) -> int:
        return hash(tuple(self.groups.items()))

    def dataset(self, dataset: Dataset) -> Dataset:
        """The data set with one channel a group, where the first of its channels was; the others stay.

        It has the unit and the group of scaling that all of its channels have, if they do. Raises ChannelError for a
        pattern that fits nothing, a channel of two groups, a group over both roles or of angles, and a name that
        another channel has.
        """
        plan = _plan(self, dataset.names)
        channels: list[Channel] = []
        for name, columns in plan.items():
            members = [dataset.channels[i] for i in columns]
            roles, units = {c.role for c in members}, {c.unit for c in members}
            if name not in self.groups:
                channels += members
                continue
            if len(roles) > 1 or any(c.kind is not Kind.LINEAR for c in members):
                got = listing(f"{c.name} ({c.role.value}, {c.kind.value})" for c in members)
                raise ChannelError(f"{name}: expected linear channels of one role, got {got}")
            unit, group = (of.pop() if len(of) == 1 else "" for of in (units, {c.group for c in members}))
            channels.append(Channel(name, members[0].role, unit, group=group))
        parts = tuple(Demonstration(d.times, self._reduced(d.values, plan), d.name) for d in dataset)
        return Dataset(tuple(channels), parts, dataset.provenance)

    def sample(
        self, values: ArrayLike | Mapping[str, float], observed: Sequence[str] | None = None
    ) -> Float[np.ndarray, " R"] | dict[str, float]:
        """One live sample, as `session.observe` takes it for a model of the reduced data set.

        values: {name: value}, of which the reduction is {name: value} again, a group of which no channel is there left
        out; or an array in the order of `observed`, the names of the channels before the reduction. Raises
        ObservationError for an array of another length or without names, ChannelError as `dataset` does.
        """
        names = tuple(values) if isinstance(values, Mapping) else tuple(observed or ())
        if not isinstance(values, Mapping) and observed is None:
            raise ObservationError("expected observed=, the names of the values of an array, got none")
        try:
            row = np.array(list(values.values()) if isinstance(values, Mapping) else values, dtype=np.float64)
        except (TypeError, ValueError):
            raise ObservationError(f"expected numbers for {listing(names)}, got {values!r}") from None
        if row.shape != (len(names),):
            raise ObservationError(
                f"expected {len(names)} values, one for each of {listing(names)}, got shape {row.shape}"
            )
        row[np.isinf(row)] = np.nan  # was not seen, as for a session
        if not isinstance(values, Mapping):
            return np.asarray(self._reduced(row[None], _plan(self, names))[0])
        plan = _present(self, names)
        return dict(zip(plan, self._reduced(row[None], plan)[0].tolist(), strict=True)) if plan else {}

    def _reduced(self, values: Float[np.ndarray, "T D"], plan: Mapping[str, IntArray]) -> Float[np.ndarray, "T R"]:
        columns = [
            WAYS[self.groups[name][1]](values[:, at]) if name in self.groups else values[:, at[0]]
            for name, at in plan.items()
        ]
        return np.asarray(np.stack(columns, axis=1))


@lru_cache(maxsize=64)
def _plan(reduction: Reduction, names: tuple[str, ...]) -> dict[str, IntArray]:
    """The channels after the reduction, in their order, and the positions of those they are made of."""
    fitting = {name: match(patterns, names) for name, (patterns, _) in reduction.groups.items()}
    return _ordered(fitting, names)


@lru_cache(maxsize=64)
def _present(reduction: Reduction, names: tuple[str, ...]) -> dict[str, IntArray]:
    """The same for names of which some, or all of a group, may be missing."""
    fitting: dict[str, list[int]] = {}
    for name, (patterns, _) in reduction.groups.items():
        found: set[int] = set()
        for pattern in patterns:
            try:
                found.update(match([pattern], names))
            except ChannelError:
                continue
        if found:
            fitting[name] = sorted(found)
    return _ordered(fitting, names)


def _ordered(fitting: Mapping[str, list[int]], names: tuple[str, ...]) -> dict[str, IntArray]:
    owner: dict[int, str] = {}
    for name, columns in fitting.items():
        twice = [names[i] for i in columns if i in owner]
        if twice:
            raise ChannelError(f"{name}: expected channels of no other group, got {listing(twice)}")
        owner |= dict.fromkeys(columns, name)
    taken = [name for name in fitting if name in names and names.index(name) not in owner]
    if taken:
        raise ChannelError(f"expected names of groups that no other channel has, got {listing(taken)}")
    order = dict.fromkeys(owner.get(i, name) for i, name in enumerate(names))
    places = {name: i for i, name in enumerate(names)}
    return {name: np.array(fitting.get(name, [places.get(name, -1)]), dtype=np.int64) for name in order}
