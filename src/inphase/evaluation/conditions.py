"""The same interaction at another speed, with a pause, or with the partner out of sight for a while."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, Role
from inphase.errors import OptionError, listing
from inphase.preprocess.coordinates import Coordinates
from inphase.trajectory import Demonstration

Condition: TypeAlias = Callable[[Demonstration, Sequence[Channel]], Demonstration]

REGULAR = 0.01  # of a step: a clock that is read with so many digits ticks evenly
FEWEST = 8  # samples of a movement at double speed
BEGINS = 3  # pause and loss begin after a third of the episode
PAUSE = 2.0  # [s]
TREMOR = 1e-3  # of a channel's standard deviation: nobody stands quite still
LOST = 0.3  # of the episode


def warp(demonstration: Demonstration, channels: Sequence[Channel], condition: str) -> Demonstration:
    """A demonstration under the condition of that name, sampled as often as before; raises OptionError for another."""
    if condition not in CONDITIONS:
        raise OptionError(f"unknown condition {condition!r}; one of {listing(map(repr, CONDITIONS))}")
    return CONDITIONS[condition](demonstration, channels)


def ticks(times: Float[np.ndarray, " T"]) -> tuple[Float[np.ndarray, " T"], float]:
    """Every sample's place, in steps of the clock from the first, and the step [s], the median of all.

    Where all are whole numbers of steps but for rounding they count as that: a regular recording ticks 0, 1, 2 …
    """
    step = float(np.median(np.diff(times)))
    steps = np.diff(times) / step
    whole = np.round(steps)
    regular = bool((np.abs(steps - whole) < REGULAR).all())
    return np.concatenate([[0.0], np.cumsum(whole if regular else steps)]), step


def _as_recorded(demonstration: Demonstration, channels: Sequence[Channel]) -> Demonstration:
    return demonstration


def _slow(demonstration: Demonstration, channels: Sequence[Channel]) -> Demonstration:
    places, _ = ticks(demonstration.times)
    return _resampled(demonstration, channels, 2 * (round(places[-1]) + 1))


def _fast(demonstration: Demonstration, channels: Sequence[Channel]) -> Demonstration:
    places, _ = ticks(demonstration.times)
    return _resampled(demonstration, channels, max((round(places[-1]) + 1) // 2, FEWEST))


def _resampled(demonstration: Demonstration, channels: Sequence[Channel], count: int) -> Demonstration:
    """The movement in `count` samples, each a step of the clock after the one before; gaps stay gaps."""
    coordinates = Coordinates.learn(channels, [demonstration.values])
    places, step = ticks(demonstration.times)
    at = np.linspace(0, places[-1], count)
    features = coordinates.from_channels(demonstration.values)
    moved = np.stack([np.interp(at, places, feature) for feature in features.T], axis=1)
    times = demonstration.times[0] + np.arange(count) * step
    return Demonstration(times, _channels(coordinates, moved), demonstration.name)


def _pause(demonstration: Demonstration, channels: Sequence[Channel]) -> Demonstration:
    """Both stand still; the partner with a tremor, which is there all the time."""
    coordinates = Coordinates.learn(channels, [demonstration.values])
    features = coordinates.from_channels(demonstration.values)
    places, step = ticks(demonstration.times)
    begins, still = len(places) // BEGINS, int(PAUSE / step + 1e-6)
    at = np.r_[np.arange(begins), np.full(still, begins), np.arange(begins, len(places))]
    moments = np.r_[places[:begins], places[begins] + np.arange(still), places[begins:] + still]
    paused = features[at]
    observed = coordinates.features_of([i for i, c in enumerate(channels) if c.role is Role.OBSERVED])
    size = _std(features[:, observed])
    paused[:, observed] += np.random.default_rng(0).normal(size=(len(at), len(observed))) * TREMOR * size
    return Demonstration(demonstration.times[0] + moments * step, _channels(coordinates, paused), demonstration.name)


def _lost(demonstration: Demonstration, channels: Sequence[Channel]) -> Demonstration:
    begins, count = len(demonstration) // BEGINS, int(LOST * len(demonstration))
    values = demonstration.values.copy()
    observed = [i for i, channel in enumerate(channels) if channel.role is Role.OBSERVED]
    values[begins : begins + count, observed] = np.nan
    return Demonstration(demonstration.times, values, demonstration.name)


def _channels(coordinates: Coordinates, features: Float[np.ndarray, "T F"]) -> Float[np.ndarray, "T D"]:
    return coordinates.to_channels(features, np.zeros_like(features))[0]


def _std(values: Float[np.ndarray, "T F"]) -> Float[np.ndarray, " F"]:
    """The standard deviation of what was seen, 0 where nothing was."""
    std = np.zeros(values.shape[1])
    seen = ~np.isnan(values).all(axis=0)
    std[seen] = np.nanstd(values[:, seen], axis=0)
    return std


CONDITIONS: dict[str, Condition] = {
    "as recorded": _as_recorded,
    "slow x2": _slow,
    "fast x2": _fast,
    "pause 2 s": _pause,
    "lost 30 %": _lost,
}
