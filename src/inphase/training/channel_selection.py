"""Which observed channels are worth having: those that say most of the controlled ones, one after the other (3.2.2).

What is compared are demonstrations, by the coefficients of their curves, as in 3.2.2, and not samples. Samples of one
demonstration say nearly the same again, so that no number of them is independent; and two channels that change at the
same phase of every interaction seem to tell of each other, although the phase alone tells it. Of a channel's
coefficients the one counts in which demonstrations differ most, because no histogram of many is ever filled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.basis import Gaussian, Layout
from inphase.basis.fit import fit_weights
from inphase.channels import Role, match, quaternions
from inphase.errors import DataError, OptionError, listing
from inphase.preprocess.coordinates import Coordinates
from inphase.training.information import ESTIMATORS, Estimator
from inphase.trajectory import Dataset

FEWEST = 8  # demonstrations: fewer fill no two bins
SIZE = 20  # basis functions of every channel
PHASES = np.linspace(0.0, 1.0, 60)
STILL = 1e-9  # of a channel's size: differences of rounding
SHUFFLED = 50  # channels of other demonstrations, at least, that tell what chance gives
FALSE = 0.05  # probability that any channel is chosen where none says anything


@dataclass(frozen=True)
class Candidate:
    """One observed channel. information: [nat] given those chosen before it; alone: [nat] given none."""

    channel: str
    information: float
    alone: float
    chosen: bool


@dataclass(frozen=True)
class ChannelSelection:
    """What came of a selection: those chosen in their order, then the others, by what they would still have added.

    chosen: their names. names: all channels to keep, `dataset.select(selection.names)`. chance: [nat] the information
    that a channel which has none must exceed to be taken for one that has, before any was chosen.
    """

    table: tuple[Candidate, ...]
    kept: tuple[str, ...]
    threshold: float
    chance: float
    estimator: str

    @property
    def chosen(self) -> tuple[str, ...]:
        """The names of the channels that were chosen, the best first."""
        return tuple(row.channel for row in self.table if row.chosen)

    @property
    def names(self) -> tuple[str, ...]:
        """The chosen channels, and those that were not up for selection."""
        return (*self.kept, *self.chosen)

    def __str__(self) -> str:
        width = max(len(row.channel) for row in self.table)
        lines = [f"{'channel':{width}}  information  alone  chosen"]
        for row in self.table:
            chosen = "yes" if row.chosen else "no"
            lines.append(f"{row.channel:{width}}  {row.information:11.3f}  {row.alone:5.2f}  {chosen}")
        return "\n".join(lines)


def select_channels(
    dataset: Dataset,
    threshold: float = 0.07,
    estimator: str = "binned",
    *,
    channels: Sequence[str] | str | None = None,
    about: Sequence[str] | str | None = None,
) -> ChannelSelection:
    """The observed channels that say something of the controlled ones, chosen one after the other (3.2.2).

    threshold: [nat] each has to add more than that, and more than chance would: than channels whose demonstrations were
    shuffled have. estimator: "binned" or "neighbours". channels: those to choose from, names or patterns, all observed
    ones by default; the others are kept whatever they say. about: the controlled channels of interest, all by default.
    What a channel adds is what it says of the controlled channel of which it says most, given that one of the channels
    chosen before which leaves least to say (Fleuret 2004). The four channels of a quaternion count as one. A channel
    that was never seen, or is the same in all demonstrations, says nothing.
    Raises DataError for fewer than eight demonstrations, or controlled channels that never differ; ChannelError,
    OptionError.
    """
    if estimator not in ESTIMATORS:
        raise OptionError(f"unknown estimator {estimator!r}; one of {listing(ESTIMATORS)}")
    if not 0 <= threshold < np.inf:
        raise OptionError(f"threshold: expected a finite number of nats >= 0, got {threshold!r}")
    if len(dataset) < FEWEST:
        raise DataError(f"expected at least {FEWEST} demonstrations to select channels by, got {len(dataset)}")
    names, observed = dataset.names, len(dataset.observed)
    columns = match(channels if channels is not None else dataset.observed, names)
    wanted = match(about if about is not None else dataset.controlled, names)
    for what, positions, role in (("channels", columns, Role.OBSERVED), ("about", wanted, Role.CONTROLLED)):
        wrong = [names[i] for i in positions if dataset.channels[i].role is not role]
        if wrong or not positions:
            raise OptionError(f"{what}: expected {role.value} channels, got {listing(wrong)}")
    curves = _curves(dataset)
    together = _units(dataset)
    targets = np.stack([_leading(curves[unit[0]]) for unit in dict.fromkeys(together[i] for i in wanted)])
    if not targets.any():
        got = listing(names[i] for i in wanted)
        raise DataError(f"expected controlled channels that differ between demonstrations, got {got}")
    units = list(dict.fromkeys(together[i] for i in columns))
    scores = np.stack([_leading(curves[unit[0]]) for unit in units])
    order, gains, alone, chance = _greedy(scores, targets, threshold, ESTIMATORS[estimator])
    rest = sorted((u for u in range(len(units)) if u not in order), key=lambda u: -gains[u])
    table = [
        Candidate(names[i], float(gains[u]), float(alone[u]), u in order) for u in [*order, *rest] for i in units[u]
    ]
    chosen_from = {i for unit in units for i in unit}
    kept = tuple(name for i, name in enumerate(names[:observed]) if i not in chosen_from)
    return ChannelSelection(tuple(table), kept, float(threshold), chance, estimator)


def _greedy(
    scores: Float[np.ndarray, "C N"], targets: Float[np.ndarray, "K N"], threshold: float, information: Estimator
) -> tuple[list[int], Float[np.ndarray, " C"], Float[np.ndarray, " C"], float]:
    """Which were chosen, in their order; what each added or would add; what it says alone; and what chance would."""
    from scipy.special import ndtri

    count, rng = len(scores), np.random.default_rng(0)
    copies = -(-SHUFFLED // count)
    shuffled = [scores[:, rng.permutation(scores.shape[1])] for _ in range(copies)]
    everything = np.concatenate([scores, *shuffled])
    moving = np.ptp(everything[count:], axis=1) > 0
    rare = float(ndtri(1 - FALSE / count))

    def by_chance(says: Float[np.ndarray, " A"]) -> float:
        none = says[count:][moving]
        return float(none.mean() + rare * none.std()) if len(none) else 0.0

    of_each = information(everything, targets, None)
    left = of_each.max(1)
    alone, chance = left[:count].copy(), by_chance(left)
    gains, order = alone.copy(), list[int]()
    while len(order) < count:
        open_still = [u for u in range(count) if u not in order]
        best = max(open_still, key=lambda u: left[u])
        if not left[best] > max(threshold, by_chance(left)):
            break
        order.append(best)
        of_each = np.minimum(of_each, information(everything, targets, scores[best]))
        left = of_each.max(1)
        waiting = [u for u in open_still if u != best]
        gains[waiting] = left[waiting]
    return order, gains, alone, chance


def _units(dataset: Dataset) -> dict[int, tuple[int, ...]]:
    """For every channel those that it is chosen with: itself, or the four of its quaternion."""
    together = {i: tuple(sorted(xyzw)) for xyzw in quaternions(dataset.channels) for i in xyzw}
    return {i: together.get(i, (i,)) for i in range(len(dataset.channels))}


def _curves(dataset: Dataset) -> list[Float[np.ndarray, "N _"]]:
    """For every channel the curves of its features, fitted by basis functions; none that is unseen or stands still."""
    coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
    features = [coordinates.from_channels(d.values) for d in dataset]
    everything = np.concatenate(features)
    low, high = (reduce(everything, axis=0) for reduce in (np.fmin.reduce, np.fmax.reduce))
    size = np.where(np.isnan(low), 0.0, np.maximum(np.abs(low), np.abs(high)))
    moving = np.flatnonzero(np.nan_to_num(high - low) > STILL * size)
    curves = np.zeros((len(dataset), len(PHASES), 0))
    if len(moving):
        level, std = np.nanmean(everything[:, moving], axis=0), np.nanstd(everything[:, moving], axis=0)
        layout = Layout((Gaussian(SIZE),) * len(moving))
        scaled = [(curve[:, moving] - level) / std for curve in features]
        weights, _ = fit_weights(layout, [d.phases for d in dataset], scaled)
        curves = np.stack([layout.predict(PHASES, own) for own in weights])
    place = {int(f): at for at, f in enumerate(moving)}
    found = []
    for i in range(len(dataset.channels)):
        own = [place[f] for f in coordinates.features_of([i]).tolist() if f in place]
        found.append(curves[:, :, own].reshape(len(dataset), -1))
    return found


def _leading(curves: Float[np.ndarray, "N M"]) -> Float[np.ndarray, " N"]:
    """(N,) where every demonstration lies in the direction in which they differ most; zeros if they do not."""
    if not curves.shape[1]:
        return np.zeros(len(curves))
    where, size, way = np.linalg.svd(curves - curves.mean(0), full_matrices=False)
    if not size[0] > STILL * np.sqrt(curves.size):
        return np.zeros(len(curves))
    sign = np.sign(way[0, np.abs(way[0]).argmax()])  # or else it hangs on rounding
    return np.asarray(sign * size[0] * where[:, 0])
