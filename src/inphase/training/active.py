"""Windows of the phase in which channels are informative: as named, or where channels leave their rest (3.2.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float

from inphase.channels import match, spread
from inphase.errors import DataError, OptionError
from inphase.preprocess.coordinates import Coordinates
from inphase.training.rest import rest
from inphase.trajectory import Dataset

BINS = 50  # of the phase
ABOVE = 4.0  # standard deviations of the noise: what is further from rest, on average, is no chance
NEVER = (0.0, 0.0)


def learn_active(
    dataset: Dataset, channels: Sequence[str] | str, *, periodic: bool = False
) -> dict[str, tuple[float, float]]:
    """The window of the phase in which each of some channels tells anything, as `inphase.fit(..., active=)` takes it.

    channels: names or patterns. A channel is active where its readings, over all demonstrations, differ from its rest
    by more than the noise there; the window goes from the first such phase to the last, a fiftieth wider on both
    sides. Periodic: the shortest window round the circle, which may begin late and end early. One that never leaves its
    rest has a window that never opens. Raises ChannelError for a pattern that fits nothing, DataError for a channel
    that is never seen.
    """
    coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
    curves = np.concatenate([coordinates.from_channels(d.values) for d in dataset])
    bins = np.minimum((np.concatenate([d.phases for d in dataset]) * BINS).astype(np.int64), BINS - 1)
    found: dict[str, tuple[float, float]] = {}
    for position in match(channels, dataset.names):
        name, busy = dataset.names[position], np.zeros(BINS, dtype=bool)
        for f in coordinates.features_of([position]):
            seen = ~np.isnan(curves[:, f])
            if not seen.any():
                raise DataError(
                    f"channel {name!r}: expected readings, got none in any of {len(dataset)} demonstrations"
                )
            level, noise = rest(curves[:, f])
            power = np.bincount(bins[seen], (curves[seen, f] - level) ** 2, BINS)
            count = np.maximum(np.bincount(bins[seen], minlength=BINS), 1)
            busy |= np.sqrt(power / count) > ABOVE * noise + 1e-12 * abs(level)
        found[name] = _window(busy, periodic)
    return found


def _window(busy: Bool[np.ndarray, " G"], periodic: bool) -> tuple[float, float]:
    """From the first busy bin to the last, a bin wider on both sides; round a circle less the longest quiet stretch."""
    where = np.flatnonzero(busy)
    if not len(where):
        return NEVER
    if not periodic:
        return max(int(where[0]) - 1, 0) / BINS, min(int(where[-1]) + 2, BINS) / BINS
    quiet = np.diff(where, append=where[0] + BINS) - 1  # bins after each
    last = int(quiet.argmax())
    if quiet[last] <= 2:
        return 0.0, 1.0
    start, end = (int(where[(last + 1) % len(where)]) - 1) % BINS, (int(where[last]) + 2) % BINS
    return start / BINS, (end or BINS) / BINS


def windows(
    active: Mapping[str, tuple[float, float]] | None, dataset: Dataset, coordinates: Coordinates
) -> Float[np.ndarray, "F 2"]:
    """(F, 2) a window for every feature, from windows by channel name or pattern; the whole phase for the others.

    That of a quaternion is the one of its first channel. Raises ChannelError, OptionError.
    """
    for name, window in (active or {}).items():
        pair = isinstance(window, (tuple, list, np.ndarray)) and len(window) == 2
        if not pair or not all(isinstance(end, (int, float)) for end in window):
            raise OptionError(f"active: expected (from, until) for {name!r}, got {window!r}")
    by_channel = spread(active or {}, dataset.names)
    rows = [by_channel.get(dataset.names[positions[0]], (0.0, 1.0)) for positions in coordinates.channel_of]
    return np.array(rows, dtype=np.float64)
