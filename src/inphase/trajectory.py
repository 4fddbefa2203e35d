"""Recorded interactions: one `Demonstration`, and the `Dataset` of them that a model learns from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase.arrays import freeze, frozen
from inphase.channels import Channel, Kind, Role, check_channels, group_of, make_channels, match
from inphase.errors import DataError, OptionError, listing

SHORTEST = 3  # samples: two span a line and say nothing about a movement
QUATERNION_NORM = (0.9, 1.1)  # what four channels named like a quaternion must measure to be taken for one …
QUATERNION_SHARE = 0.9  # … in this share of samples: a tracker that lost its target may write zeros


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One recorded interaction of both partners.

    times: (T,) [s], increasing, any rate. values: (T, D), NaN where a channel was not seen. Both are read-only.
    Raises DataError for fewer than three samples, times that do not increase, or infinite values.
    """

    times: Float[np.ndarray, " T"]
    values: Float[np.ndarray, "T D"]
    name: str = "demonstration"

    def __post_init__(self) -> None:
        freeze(self, times=self.times, values=self.values)
        if self.times.ndim != 1 or self.values.ndim != 2 or len(self.times) != len(self.values):
            raise DataError(
                f"{self.name}: expected times (T,) and values (T, D), got {self.times.shape} and {self.values.shape}"
            )
        if len(self.times) < SHORTEST:
            raise DataError(f"{self.name}: expected at least {SHORTEST} samples, got {len(self.times)}")
        if not np.isfinite(self.times).all():
            at = int(np.argmin(np.isfinite(self.times)))
            raise DataError(f"{self.name}: expected finite times, got {self.times[at]} at sample {at}")
        steps = np.diff(self.times)
        if (steps <= 0).any():
            at = int(np.argmax(steps <= 0))
            raise DataError(
                f"{self.name}: expected times that increase, got {self.times[at + 1]:g} s "
                f"after {self.times[at]:g} s at sample {at + 1}"
            )
        if np.isinf(self.values).any():
            sample, column = np.argwhere(np.isinf(self.values))[0]
            raise DataError(
                f"{self.name}: expected finite values or NaN, got {self.values[sample, column]} "
                f"in column {column} at {self.times[sample]:g} s"
            )

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        samples, channels = self.values.shape
        return f"Demonstration({self.name!r}, {samples} samples of {channels} channels, {self.duration:.2f} s)"

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def phases(self) -> Float[np.ndarray, " T"]:
        """(T,) the share of the interaction that is over at every sample: 0 at the first, 1 at the last (2.3.1)."""
        return frozen((self.times - self.times[0]) / self.duration)


@dataclass(frozen=True, eq=False)
class Dataset:
    """Demonstrations of one interaction over the same channels, the observed ones first.

    Raises DataError where there is no demonstration or one has another number of columns.
    """

    channels: tuple[Channel, ...]
    demonstrations: tuple[Demonstration, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", tuple(self.channels))
        object.__setattr__(self, "demonstrations", tuple(self.demonstrations))
        object.__setattr__(self, "provenance", dict(self.provenance))
        if not self.demonstrations:
            raise DataError("expected at least one demonstration, got none")
        check_channels(self.channels)
        for demonstration in self.demonstrations:
            if demonstration.values.shape[1] != len(self.channels):
                raise DataError(
                    f"{demonstration.name}: expected {len(self.channels)} channels "
                    f"({listing(c.name for c in self.channels)}), got {demonstration.values.shape[1]} columns"
                )

    @classmethod
    def from_arrays(
        cls,
        times: Sequence[ArrayLike],
        values: Sequence[ArrayLike],
        observed: Sequence[str],
        controlled: Sequence[str],
        *,
        units: Mapping[str, str] | None = None,
        kinds: Mapping[str, str] | None = None,
        groups: Mapping[str, str] | None = None,
        names: Sequence[str] | None = None,
        provenance: Mapping[str, str] | None = None,
    ) -> Dataset:
        """A data set from one array of times (T,) [s] and one of values (T, D) a demonstration.

        The columns are the observed channels, then the controlled ones. `units`, `kinds` and `groups` go from a
        channel name or pattern to the value. Four channels named …qx, …qy, …qz, …qw that measure 1 together are
        taken for a quaternion unless `kinds` says otherwise. Raises DataError and ChannelError.
        """
        if len(times) != len(values):
            raise DataError(f"expected one array of values for each of {len(times)} arrays of times, got {len(values)}")
        names = names if names is not None else [f"demonstration {i}" for i in range(len(times))]
        if len(names) != len(times):
            raise DataError(f"expected {len(times)} names, got {len(names)}")
        demonstrations = [Demonstration(t, v, n) for t, v, n in zip(times, values, names, strict=True)]  # type: ignore[arg-type]
        columns = len(observed) + len(controlled)
        same = [d.values for d in demonstrations if d.values.shape[1] == columns]
        guessed = guess_quaternions([*observed, *controlled], same) | dict(kinds or {})
        channels = make_channels(observed, controlled, units, guessed, groups)
        return cls(channels, tuple(demonstrations), provenance or {})

    def __len__(self) -> int:
        return len(self.demonstrations)

    def __repr__(self) -> str:
        roles = f"observed: {listing(self.observed)}; controlled: {listing(self.controlled)}"
        return f"Dataset({len(self)} demonstrations, {roles})"

    def _repr_html_(self) -> str:
        from inphase.report.notebook import dataset_html  # a door upward: docs/decisions/0014-pictures.md

        return dataset_html(self)

    def __iter__(self) -> Iterator[Demonstration]:
        return iter(self.demonstrations)

    def __getitem__(self, index: int) -> Demonstration:
        return self.demonstrations[index]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all channels, in the order of the columns."""
        return tuple(channel.name for channel in self.channels)

    @property
    def observed(self) -> tuple[str, ...]:
        """The names of the observed channels."""
        return tuple(channel.name for channel in self.channels if channel.role is Role.OBSERVED)

    @property
    def controlled(self) -> tuple[str, ...]:
        """The names of the controlled channels."""
        return tuple(channel.name for channel in self.channels if channel.role is Role.CONTROLLED)

    def subset(self, indices: Sequence[int]) -> Dataset:
        """The data set of these demonstrations alone."""
        return Dataset(self.channels, tuple(self.demonstrations[i] for i in indices), self.provenance)

    def select(self, channels: Sequence[str] | str) -> Dataset:
        """The data set of the observed channels that fit these names or patterns, and of all controlled ones.

        Raises ChannelError for a pattern that fits no channel, or a quaternion that would be torn apart.
        """
        fitting = set(match(channels, self.names))
        columns = [i for i, c in enumerate(self.channels) if i in fitting or c.role is Role.CONTROLLED]
        parts = tuple(Demonstration(d.times, d.values[:, columns], d.name) for d in self)
        return Dataset(tuple(self.channels[i] for i in columns), parts, self.provenance)

    def without(self, index: int) -> Dataset:
        """The data set less one demonstration, as leave-one-out needs it; raises OptionError where there is none."""
        if not -len(self) <= index < len(self):
            raise OptionError(f"expected a demonstration from {-len(self)} to {len(self) - 1}, got {index}")
        return self.subset([i for i in range(len(self)) if i != index % len(self)])


def guess_quaternions(names: Sequence[str], values: Sequence[Float[np.ndarray, "_ D"]]) -> dict[str, str]:
    """The kind of all channels that are named like a quaternion (…qx, …qy, …qz, …qw) and measure like one."""
    found: dict[str, str] = {}
    for stem in {group_of(name) for name in names if name.endswith("qw")}:
        parts = [names.index(stem + axis) for axis in "xyzw" if stem + axis in names]
        if len(parts) != 4:
            continue
        norms = np.concatenate([np.linalg.norm(v[:, parts], axis=1) for v in values]) if values else np.empty(0)
        norms = norms[np.isfinite(norms)]
        low, high = QUATERNION_NORM
        if len(norms) and ((norms > low) & (norms < high)).mean() >= QUATERNION_SHARE:
            found |= {names[i]: Kind.QUATERNION.value for i in parts}
    return found
