"""The two partners of a data set in flat coordinates: what a prediction without a model is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.arrays import IntArray
from inphase.channels import Role, quaternions
from inphase.errors import DataError
from inphase.preprocess.coordinates import Coordinates
from inphase.trajectory import Dataset, Demonstration

SMALLEST = 1e-6  # spread of a controlled channel: one that stands still is no reason to divide by nothing


@dataclass(frozen=True, eq=False)
class Partners:
    """Which features (F) are the observed partner's (Fo), and which the controlled one's (Fc)."""

    coordinates: Coordinates
    observed: IntArray
    controlled: IntArray

    @classmethod
    def learn(cls, dataset: Dataset) -> Partners:
        """Those of a data set; raises DataError for a controlled channel that was never seen."""
        seen = np.any([np.isfinite(d.values).any(axis=0) for d in dataset], axis=0)
        for channel, found in zip(dataset.channels, seen, strict=True):
            if channel.role is Role.CONTROLLED and not found:
                raise DataError(
                    f"channel {channel.name!r}: expected readings, got none in any of {len(dataset)} demonstrations"
                )
        coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
        count = len(dataset.observed)
        return cls(
            coordinates,
            observed=coordinates.features_of(range(count)),
            controlled=coordinates.features_of(range(count, len(dataset.channels))),
        )

    def features(self, demonstration: Demonstration) -> tuple[Float[np.ndarray, "T Fo"], Float[np.ndarray, "T Fc"]]:
        """The observed features of a demonstration, and the controlled ones."""
        features = self.coordinates.from_channels(demonstration.values)
        return features[:, self.observed], features[:, self.controlled]

    def read(self, values: Float[np.ndarray, " Do"], near: Float[np.ndarray, " Fo"]) -> Float[np.ndarray, " Fo"]:
        """The observed features of one sample, on the branch nearest to `near`; NaN where not seen."""
        if self.coordinates.flat:
            return values
        sample = np.full(len(self.coordinates.channels), np.nan)
        sample[: len(values)] = values
        branch = np.zeros(self.coordinates.count)
        branch[self.observed] = near
        return self.coordinates.sample(sample, branch)[self.observed]

    def answer(
        self, mean: Float[np.ndarray, "S Fc"], var: Float[np.ndarray, "S Fc"]
    ) -> tuple[Float[np.ndarray, "S Dc"], Float[np.ndarray, "S Dc"]]:
        """Mean and standard deviation of the controlled channels, from mean and variance of their features."""
        if self.coordinates.flat:
            return mean, np.sqrt(var)
        means, variances = np.zeros((2, len(mean), self.coordinates.count))
        means[:, self.controlled], variances[:, self.controlled] = mean, var
        means, variances = self.coordinates.to_channels(means, variances)
        columns = [i for i, c in enumerate(self.coordinates.channels) if c.role is Role.CONTROLLED]
        return means[:, columns], np.sqrt(variances[:, columns])

    def spread(self, dataset: Dataset) -> Float[np.ndarray, " Dc"]:
        """The standard deviation of every controlled channel, on one branch of its circle; a quaternion's share one."""
        features = [self.coordinates.from_channels(d.values) for d in dataset]
        values = np.concatenate([self.coordinates.to_channels(f, np.zeros_like(f))[0] for f in features])
        controlled = [i for i, c in enumerate(dataset.channels) if c.role is Role.CONTROLLED]
        spread = np.zeros(len(dataset.channels))
        spread[controlled] = np.nanstd(values[:, controlled], axis=0)
        for part in quaternions(dataset.channels):
            spread[list(part)] = np.sqrt(np.mean(spread[list(part)] ** 2))
        return np.maximum(spread[controlled], SMALLEST)
