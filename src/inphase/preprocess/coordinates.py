"""Between channels, which files and users speak, and features, the model's coordinates on a flat space.

A linear channel is one feature, itself. An angle is one: how far it is from a reference, unwrapped in time. The
four channels of a quaternion are three: the rotation vector [rad] that turns a reference orientation into it.
Rotation vectors are singular one full turn away from the reference; orientations that go that far are not for them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import IntArray, freeze
from inphase.channels import Channel, Kind, quaternions
from inphase.errors import OptionError, listing
from inphase.preprocess import quaternion
from inphase.preprocess.reference import reference_angle, reference_orientation

TAU = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Coordinates:
    """How the D channels of a recording are written as F features, and back.

    references: (D,) 0 for a linear channel, the reference angle [rad] for an angle, the components of the unit
    reference quaternion for the channels of a quaternion. Raises OptionError where they are not that.
    """

    channels: tuple[Channel, ...]
    references: Float[np.ndarray, " D"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", tuple(self.channels))
        freeze(self, references=self.references)
        if self.references.shape != (len(self.channels),):
            raise OptionError(f"expected {len(self.channels)} references, got an array of {self.references.shape}")
        for channel, reference in zip(self.channels, self.references, strict=True):
            if channel.kind is Kind.LINEAR and reference != 0:
                raise OptionError(f"expected the reference 0 of the linear channel {channel.name}, got {reference:g}")
            if not np.isfinite(reference):
                raise OptionError(f"expected a finite reference of {channel.name}, got {reference:g}")
        if len(self._quaternions):
            units = self.references[self._quaternions]
            for xyzw, norm in zip(self._quaternions, np.linalg.norm(units, axis=1), strict=True):
                if abs(norm - 1) > 1e-6:
                    names = listing(self.channels[i].name for i in xyzw)
                    raise OptionError(f"expected a reference of {names} with norm 1, got {norm:g}")
            # Loads scipy, which takes too long for the first sample of a live interaction.
            quaternion.rotation_vectors(units, units)

    @classmethod
    def learn(cls, channels: Sequence[Channel], values: Sequence[Float[np.ndarray, "_ D"]]) -> Coordinates:
        """Coordinates whose references are the mean angle and orientation of these trajectories, each (T, D).

        NaN is passed over; what was never seen gets the reference 0, or no rotation.
        """
        references = np.zeros(len(channels))
        for i, channel in enumerate(channels):
            if channel.kind is Kind.ANGLE:
                references[i] = reference_angle([v[:, i] for v in values])
        for xyzw in quaternions(channels):
            references[list(xyzw)] = reference_orientation([v[:, xyzw] for v in values])
        return cls(tuple(channels), references)

    @cached_property
    def flat(self) -> bool:
        """Whether every channel is linear, and so is its own feature."""
        return all(channel.kind is Kind.LINEAR for channel in self.channels)

    @property
    def count(self) -> int:
        """F, the number of features."""
        return len(self.channel_of)

    @cached_property
    def channel_of(self) -> tuple[tuple[int, ...], ...]:
        """For every feature the positions of its channels: one, or the x, y, z and w of a quaternion."""
        return tuple(part for part in self._parts for _ in range(_width(part)))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """A name for every feature: the channel's, or `head_q rot x` and so on for `head_qx` … `head_qw`."""
        found: list[str] = []
        for part in self._parts:
            first = self.channels[part[0]]
            stem = first.name[:-1].rstrip("_") or first.group
            found += [first.name] if len(part) == 1 else [f"{stem} rot {axis}" for axis in "xyz"]
        return tuple(found)

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """The group of every feature's channels."""
        return tuple(self.channels[part[0]].group for part in self.channel_of)

    def features_of(self, channel_positions: Iterable[int] | Int[np.ndarray, " C"]) -> Int[np.ndarray, " M"]:
        """The features that any of these channels is part of, increasing."""
        wanted = {int(i) for i in channel_positions}
        return np.array([f for f, part in enumerate(self.channel_of) if wanted.intersection(part)], dtype=np.int64)

    def from_channels(self, values: Float[np.ndarray, "T D"]) -> Float[np.ndarray, "T F"]:
        """The features of one trajectory in the order of time, continuous, the first seen nearest the references.

        A quaternion of which a component is missing, or whose norm is far from 1, is missing whole.
        """
        if self.flat:
            return values
        features = np.empty((len(values), self.count))
        features[:, self._single_features] = values[:, self._single_channels] - self.references[self._single_channels]
        for f in self._angles:
            features[:, f] = _unwrapped(features[:, f])
        for xyzw, rotation in zip(self._quaternions, self._rotations, strict=True):
            units = quaternion.normalised(values[:, xyzw])
            vectors = quaternion.rotation_vectors(units, self.references[xyzw][None])
            features[:, rotation] = quaternion.continuous(vectors)
        return features

    def sample(self, values: Float[np.ndarray, " D"], near: Float[np.ndarray, " F"]) -> Float[np.ndarray, " F"]:
        """The features of one live sample, each on the branch nearest to `near`, a prediction; NaN where not seen."""
        if self.flat:
            return values
        features = np.empty(self.count)
        features[self._single_features] = values[self._single_channels] - self.references[self._single_channels]
        if len(self._angles):
            features[self._angles] -= TAU * np.round((features[self._angles] - near[self._angles]) / TAU)
        if len(self._rotations):
            units = quaternion.normalised(values[self._quaternions])
            vectors = quaternion.rotation_vectors(units, self.references[self._quaternions])
            features[self._rotations] = quaternion.nearest(vectors, near[self._rotations])
        return features

    def to_channels(
        self, mean: Float[np.ndarray, "S F"], var: Float[np.ndarray, "S F"]
    ) -> tuple[Float[np.ndarray, "S D"], Float[np.ndarray, "S D"]]:
        """Mean and variance of every channel along S states, from those of independent features.

        Angles are continuous, not wrapped. Quaternions have norm 1 and one sign along S, the reference's at the
        first; their variance is that of the rotation vector through the Jacobian, to first order.
        """
        if self.flat:
            return mean, var
        values, variances = np.empty((2, len(mean), len(self.channels)))
        values[:, self._single_channels] = mean[:, self._single_features] + self.references[self._single_channels]
        variances[:, self._single_channels] = var[:, self._single_features]
        for xyzw, rotation in zip(self._quaternions, self._rotations, strict=True):
            vectors, reference = mean[:, rotation], self.references[xyzw]
            values[:, xyzw] = quaternion.turned(vectors, reference)
            slopes = quaternion.jacobian(vectors, reference)
            variances[:, xyzw] = np.einsum("scf,sf->sc", slopes * slopes, var[:, rotation])
        return values, variances

    def jacobian(self, state: Float[np.ndarray, " F"]) -> Float[np.ndarray, "D F"] | None:
        """(D, F) the derivative of the channels by the features, around a state (F,); None where each is its own.

        The sign of a quaternion is the one that `turned` begins with: nearest to the reference.
        """
        if self.flat:
            return None
        slopes = np.zeros((len(self.channels), self.count))
        slopes[self._single_channels, self._single_features] = 1.0
        for xyzw, rotation in zip(self._quaternions, self._rotations, strict=True):
            vector = state[None, rotation]
            slope = quaternion.jacobian(vector, self.references[xyzw])[0]
            # The derivative is that of the product reference · exp(r / 2), which may be the other sign of the same.
            angle = np.sqrt((vector * vector).sum())
            slopes[np.ix_(xyzw, rotation)] = slope if np.cos(angle / 2) >= 0 else -slope
        return slopes

    @cached_property
    def _parts(self) -> tuple[tuple[int, ...], ...]:
        """The channels that make one or three features together, in the order of the first of them."""
        singles = [(i,) for i, channel in enumerate(self.channels) if channel.kind is not Kind.QUATERNION]
        return tuple(sorted([*singles, *quaternions(self.channels)], key=min))

    @cached_property
    def _quaternions(self) -> IntArray:
        return np.array(quaternions(self.channels), dtype=np.int64).reshape(-1, 4)

    @cached_property
    def _rotations(self) -> IntArray:
        found = [f for f, part in enumerate(self.channel_of) if len(part) == 4]
        return np.array(found, dtype=np.int64).reshape(-1, 3)

    @cached_property
    def _single_features(self) -> IntArray:
        return np.array([f for f, part in enumerate(self.channel_of) if len(part) == 1], dtype=np.int64)

    @cached_property
    def _single_channels(self) -> IntArray:
        return np.array([part[0] for part in self.channel_of if len(part) == 1], dtype=np.int64)

    @cached_property
    def _angles(self) -> IntArray:
        found = [f for f, part in enumerate(self.channel_of) if self.channels[part[0]].kind is Kind.ANGLE]
        return np.array(found, dtype=np.int64)


def _width(part: tuple[int, ...]) -> int:
    """How many features these channels make."""
    return 3 if len(part) == 4 else 1


def _unwrapped(angles: Float[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """The angles without jumps [rad], the first seen between -π and π; NaN is passed over."""
    steady = angles.copy()
    seen = np.flatnonzero(~np.isnan(angles))
    # Whole turns are counted, not added up: no rounding error grows along the trajectory.
    turns = np.round(np.diff(angles[seen], prepend=0.0) / TAU)
    steady[seen] -= TAU * np.cumsum(turns)
    return steady
