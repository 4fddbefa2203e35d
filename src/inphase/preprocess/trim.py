"""Cutting off the idle start and end of recordings, where the partners stand still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from inphase.channels import match
from inphase.errors import OptionError
from inphase.preprocess.coordinates import Coordinates
from inphase.trajectory import SHORTEST, Dataset, Demonstration

SIDE = 0.1  # [s] speed is told from the mean of this much before and that of as much after
FIDGET = 0.05  # of the way of the longest movement: what goes less far is no movement
LEAST = 0.2  # of an episode: one of which less would be left is left whole


def trim(
    dataset: Dataset, threshold: float = 0.05, channels: Sequence[str] | None = None, margin: float = 0.1
) -> Dataset:
    """The data set less the idle starts and ends of its demonstrations; times stay as they were recorded.

    An episode moves while its speed is above `threshold` of its 95th percentile, less the stretches that go hardly
    anywhere: people who wait do not stand quite still. `margin` [s] is kept before the first movement and after the
    last. The speed is that of all channels together, or of those that fit `channels` (names or patterns), each in
    units of the span of its group over the data set. An episode that would lose more than 80 % is left whole, and so
    is one noisier than the threshold. Raises OptionError, and ChannelError for a pattern that fits nothing.
    """
    if not 0 < threshold < 1:
        raise OptionError(f"expected a threshold between 0 and 1, got {threshold:g}")
    if not margin >= 0:
        raise OptionError(f"expected a margin of at least 0 s, got {margin:g} s")
    coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
    columns = range(len(dataset.names)) if channels is None else match(channels, dataset.names)
    chosen = coordinates.features_of(columns)
    features = [coordinates.from_channels(d.values)[:, chosen] for d in dataset]
    spans = _spans([coordinates.groups[f] for f in chosen], features)
    moving = [_cut(d, _speed(d.times, f / spans), threshold, margin) for d, f in zip(dataset, features, strict=True)]
    return Dataset(dataset.channels, tuple(moving), dataset.provenance)


def _spans(groups: Sequence[str], features: Sequence[Float[np.ndarray, "_ F"]]) -> Float[np.ndarray, " F"]:
    """The largest span of any feature in the group of each: the noise of an axis that stands still stays small."""
    everything = np.concatenate([np.zeros((0, len(groups))), *features])
    low, high = (f.reduce(everything, axis=0) for f in (np.fmin, np.fmax))
    own = np.nan_to_num(high - low)
    spans = np.array([max(s for s, other in zip(own, groups, strict=True) if other == group) for group in groups])
    return np.where(spans > 0, spans, 1.0)


def _speed(times: Float[np.ndarray, " T"], features: Float[np.ndarray, "T F"]) -> Float[np.ndarray, " T"]:
    """The root mean square speed of the features at every time [1/s], 0 where none was ever seen."""
    here = np.arange(len(times))
    # A neighbour belongs to it however long ago it was.
    first = np.minimum(np.searchsorted(times, times - SIDE), np.maximum(here - 1, 0))
    last = np.maximum(np.searchsorted(times, times + SIDE, side="right"), np.minimum(here + 2, len(times)))
    slopes = np.full(features.shape, np.nan)
    for f, feature in enumerate(features.T):
        seen = ~np.isnan(feature)
        if seen.any():
            bridged = np.interp(times, times[seen], feature[seen], left=np.nan, right=np.nan)
            slopes[:, f] = _slope(times, bridged, first, last)
    known = ~np.isnan(slopes)
    return np.asarray(np.sqrt(np.nansum(slopes**2, axis=1) / np.maximum(known.sum(axis=1), 1)))


def _slope(
    times: Float[np.ndarray, " T"],
    values: Float[np.ndarray, " T"],
    first: Int[np.ndarray, " T"],
    last: Int[np.ndarray, " T"],
) -> Float[np.ndarray, " T"]:
    """From the mean of the samples first … i to that of i … last - 1, at every i; NaN stays."""
    seen = ~np.isnan(values)
    here = np.arange(len(times))
    terms = np.stack([seen, (times - times[0]) * seen, np.where(seen, values - np.nanmean(values), 0.0)])
    sums = np.concatenate([np.zeros((3, 1)), np.cumsum(terms, axis=1)], axis=1)
    before, after = sums[:, here + 1] - sums[:, first], sums[:, last] - sums[:, here]
    with np.errstate(invalid="ignore", divide="ignore"):
        steps = after[1:] / after[0] - before[1:] / before[0]
        return np.asarray(steps[1] / steps[0])


def _movement(
    times: Float[np.ndarray, " T"], speed: Float[np.ndarray, " T"], threshold: float
) -> tuple[float, float] | None:
    """When the first movement begins and the last one ends [s]; None where there is none."""
    above = speed > threshold * np.percentile(speed, 95)
    changes = np.flatnonzero(np.diff(above, prepend=False, append=False))
    way = np.concatenate([[0.0], np.cumsum(speed * np.gradient(times))])
    ways = way[changes[1::2]] - way[changes[::2]]
    if not len(ways):
        return None
    moves = np.flatnonzero(ways >= FIDGET * ways.max())
    return float(times[changes[2 * moves[0]]]), float(times[changes[2 * moves[-1] + 1] - 1])


def _cut(
    demonstration: Demonstration, speed: Float[np.ndarray, " T"], threshold: float, margin: float
) -> Demonstration:
    """The demonstration from `margin` before its movement to `margin` after it."""
    times = demonstration.times
    movement = _movement(times, speed, threshold)
    if movement is None:
        return demonstration
    keep = (times >= movement[0] - margin) & (times <= movement[1] + margin)
    if keep.all() or keep.sum() < max(SHORTEST, LEAST * len(times)):
        return demonstration
    return Demonstration(times[keep], demonstration.values[keep], demonstration.name)
