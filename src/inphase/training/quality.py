"""How good demonstrations are: how each was sampled, how it fits in with the others, and what it adds to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from inphase.arrays import FloatArray, frozen
from inphase.basis import Gaussian, Layout
from inphase.basis.fit import fit_weights, residuals
from inphase.channels import Kind
from inphase.errors import DataError
from inphase.preprocess.coordinates import Coordinates
from inphase.preprocess.sampling import Sampling, sampling
from inphase.preprocess.scaling import Scaling
from inphase.preprocess.trim import trim
from inphase.training.likelihood import FEWEST, LeftOut, left_out
from inphase.training.noise import regression_noise
from inphase.training.redundant import ChannelFinding, dead, redundant
from inphase.training.unlike import ERROR_RATE, NORMAL, Unlike, lateness, scores, threshold, where_unlike
from inphase.trajectory import Dataset

SIZE = 20  # basis functions a feature, as in a model
READINGS = 50  # phases at which the curve of a demonstration is read
STILL = 1e-12  # of a channel's size: it does not move
SHRINKAGES = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)  # of which the one is taken that makes the left-out ones likeliest


@dataclass(frozen=True)
class EpisodeQuality:
    """What there is to know of one demonstration.

    moves: when its movement begins and ends [s], as `inphase.trim` would cut it, in its own clock. The others are None
    where there are too few demonstrations to leave one out. log_likelihood: of its movement under the Gaussian of all
    others, per reading [nat]. score: how far it lies outside, in robust standard deviations of all. outlier: whether
    that is above the threshold. contribution: by how much the log-likelihood of each other demonstration, left out in
    its turn, falls on average where this one is missing, per reading [nat]; negative where it only misleads. unlike:
    of an outlier, which features are unlike the others, the furthest first. late: of an outlier that does the same
    later (earlier: negative), by how much of the phase.
    """

    name: str
    sampling: Sampling
    moves: tuple[float, float]
    log_likelihood: float | None = None
    score: float | None = None
    contribution: float | None = None
    outlier: bool = False
    unlike: tuple[Unlike, ...] = ()
    late: float | None = None

    @property
    def verdict(self) -> str:
        """What is wrong with it in a few words; empty where nothing is."""
        if not self.outlier:
            return ""
        where = ", ".join(part.feature for part in self.unlike) + f" around phase {self.unlike[0].at:.2g}"
        if self.late is None:
            return f"unlike the others: {where}"
        return (
            f"{'later' if self.late > 0 else 'earlier'} than the others by {abs(self.late):.2g} of the phase: {where}"
        )


@dataclass(frozen=True)
class Quality:
    """How good the demonstrations of a data set are.

    episodes: one a demonstration, in their order. findings: what is wrong with channels in all of them. threshold: the
    score above which a demonstration is marked; of data sets in which nothing is wrong at most the share `error_rate`
    has one that is. shrinkage: how much of the covariance of the others is taken for chance. why_not: why none was left
    out, empty where each was.
    """

    episodes: tuple[EpisodeQuality, ...]
    findings: tuple[ChannelFinding, ...]
    threshold: float | None = None
    error_rate: float = ERROR_RATE
    shrinkage: float | None = None
    why_not: str = ""

    @property
    def outliers(self) -> tuple[EpisodeQuality, ...]:
        """The demonstrations that are unlike the others, the furthest first."""
        return tuple(sorted((e for e in self.episodes if e.outlier), key=lambda e: -(e.score or 0.0)))


def assess(dataset: Dataset) -> Quality:
    """How good demonstrations are; nothing is changed and nothing refused.

    The movement of each is read at 50 phases from its basis weights (2.3.1), and held against the Gaussian of all
    others: their mean (Eq. 2.11), their covariance (Eq. 2.14) shrunk towards the variances of single readings, as much
    as makes the left-out ones likeliest, and the noise of the regression (Eq. 2.15). Marked is what lies further from
    the others than chance has it. Two bad ones that are bad in the same way speak for each other. Raises DataError for
    anything but a Dataset.
    """
    if not isinstance(dataset, Dataset):
        raise DataError(f"expected a Dataset, as inphase.load makes one, got {type(dataset).__name__}")
    coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
    features = [coordinates.from_channels(d.values) for d in dataset]
    seen, moving = _alive(dataset, coordinates, features)
    findings = dead(*_by_channel(coordinates, seen, moving))
    chosen = np.flatnonzero(moving)
    plain = [EpisodeQuality(d.name, sampling(d), moves) for d, moves in zip(dataset, _moves(dataset), strict=True)]
    if not len(chosen):
        return Quality(tuple(plain), tuple(findings), why_not="no channel moves")
    names = [coordinates.names[f] for f in chosen]
    curves, noise_var, span = _curves(dataset, coordinates, features, chosen)
    findings += redundant(names, (curves * span).reshape(-1, len(chosen)))
    if len(dataset) < FEWEST:
        few = f"expected at least {FEWEST} demonstrations to hold each against the others, got {len(dataset)}"
        return Quality(tuple(plain), tuple(findings), why_not=few)
    present = np.array([np.isfinite(curve[:, chosen]).any(axis=0) for curve in features])
    shrinkage, found = _left_out(curves, noise_var, present)
    return _judged(plain, findings, names, curves, shrinkage, found)


def _judged(
    plain: Sequence[EpisodeQuality],
    findings: Sequence[ChannelFinding],
    names: Sequence[str],
    curves: Float[np.ndarray, "N P F"],
    shrinkage: float,
    found: LeftOut,
) -> Quality:
    """The quality of demonstrations that were left out."""
    _, points, width = curves.shape
    score = scores(found.distance, points * width)
    limit = threshold(found.variances, shrinkage, points * width)
    deviations = found.deviations.reshape(curves.shape)
    episodes = []
    for i, episode in enumerate(plain):
        known = replace(
            episode,
            log_likelihood=float(found.log_likelihood[i]),
            score=float(score[i]),
            contribution=float(found.contribution[i]),
        )
        if score[i] > limit:
            unlike = where_unlike(names, PHASES, deviations[i])
            mean = np.delete(curves, i, axis=0).mean(axis=0)
            # What a deviation of 1 is; where there is none it does not matter, for there the curve is the mean.
            std = (curves[i] - mean) / np.where(deviations[i] == 0, np.inf, deviations[i])
            late = lateness(curves[i], mean, np.where(std > 0, std, np.inf))
            known = replace(known, outlier=True, unlike=unlike, late=late)
        episodes.append(known)
    return Quality(tuple(episodes), tuple(findings), limit, ERROR_RATE, shrinkage)


def _left_out(
    curves: Float[np.ndarray, "N P F"], noise_var: Float[np.ndarray, " F"], present: Bool[np.ndarray, "N F"]
) -> tuple[float, LeftOut]:
    """The shrinkage under which the median demonstration is likeliest when it is left out, and what it tells.

    Of a demonstration that lacks features, what the others say of those it has.
    """
    # No one demonstration moves a median far, so this is the same for all of them.
    usual = (NORMAL * np.median(np.abs(curves - np.median(curves, axis=0)), axis=0)) ** 2
    target = (usual + usual.mean(axis=0)) / 2  # a median of few is rough: half of it is that of the whole feature

    def over(features: Bool[np.ndarray, " F"], shrinkage: float) -> LeftOut:
        floor = (shrinkage * target + noise_var)[:, features]
        return left_out(curves[..., features].reshape(len(curves), -1), floor.ravel(), shrinkage)

    everything = np.ones(len(noise_var), dtype=bool)
    tried = [(shrinkage, over(everything, shrinkage)) for shrinkage in SHRINKAGES]
    shrinkage, found = max(tried, key=lambda trial: float(np.median(trial[1].log_likelihood)))
    log_likelihood, distance = np.array(found.log_likelihood), np.array(found.distance)
    deviations = np.array(found.deviations).reshape(curves.shape)
    for i in np.flatnonzero(~present.all(axis=1) & present.any(axis=1)):
        # What stands in for a feature that was not seen is the mean, which does not go with the others.
        part = over(present[i], shrinkage)
        log_likelihood[i], distance[i] = part.log_likelihood[i], part.distance[i]
        deviations[i] = 0.0
        deviations[i][:, present[i]] = part.deviations[i].reshape(len(PHASES), -1)
    flat = deviations.reshape(len(curves), -1)
    return shrinkage, replace(found, log_likelihood=log_likelihood, distance=distance, deviations=flat)


PHASES = frozen((np.arange(READINGS) + 0.5) / READINGS)


def _curves(
    dataset: Dataset,
    coordinates: Coordinates,
    features: Sequence[Float[np.ndarray, "_ F"]],
    chosen: np.ndarray,
) -> tuple[Float[np.ndarray, "N P M"], Float[np.ndarray, " M"], Float[np.ndarray, " M"]]:
    """What each demonstration reads along the phase, scaled; the noise around it; and the span it is scaled by."""
    scaling = Scaling.learn([coordinates.groups[f] for f in chosen], [f[:, chosen] for f in features])
    scaled = [scaling.scale(f[:, chosen]) for f in features]
    # Around their middle, so that the ridge of the regression treats a channel and its mirror image alike.
    middle = np.nanmean(np.concatenate(scaled), axis=0)
    scaled = [f - middle for f in scaled]
    layout = Layout((Gaussian(SIZE),) * len(chosen))
    times, phases = [d.times for d in dataset], [d.phases for d in dataset]
    weights, _ = fit_weights(layout, phases, scaled)
    noise = regression_noise(times, residuals(layout, phases, scaled, weights))
    return np.stack([layout.predict(PHASES, w) for w in weights]), noise.var, scaling.span


def _alive(
    dataset: Dataset, coordinates: Coordinates, features: Sequence[Float[np.ndarray, "_ F"]]
) -> tuple[Bool[np.ndarray, " F"], Bool[np.ndarray, " F"]]:
    """Which features were ever seen, and which ever move."""
    everything = np.concatenate(features)
    low, high = (f.reduce(everything, axis=0) for f in (np.fmin, np.fmax))
    linear = np.array([dataset.channels[part[0]].kind is Kind.LINEAR for part in coordinates.channel_of])
    size = np.where(linear, np.maximum(np.abs(low), np.abs(high)), 1.0)
    with np.errstate(invalid="ignore"):
        return np.isfinite(low), np.asarray(high - low > STILL * size)


def _by_channel(
    coordinates: Coordinates, seen: Bool[np.ndarray, " F"], moving: Bool[np.ndarray, " F"]
) -> tuple[list[str], Bool[np.ndarray, " C"], Bool[np.ndarray, " C"]]:
    """A name for every channel or whole quaternion, whether it was ever seen, and whether any of it moves."""
    parts = list(dict.fromkeys(coordinates.channel_of))
    members = [[f for f, of in enumerate(coordinates.channel_of) if of == part] for part in parts]
    first = [coordinates.channels[part[0]] for part in parts]
    names = [c.name if len(part) == 1 else c.group for c, part in zip(first, parts, strict=True)]
    return names, np.array([seen[f].any() for f in members]), np.array([moving[f].any() for f in members])


def _moves(dataset: Dataset) -> list[tuple[float, float]]:
    """From when to when each would be left by `trim` [s]."""
    cut: list[FloatArray] = [demonstration.times for demonstration in trim(dataset)]
    return [(float(times[0]), float(times[-1])) for times in cut]
