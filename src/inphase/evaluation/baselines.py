"""What to beat: predictors without a model of the interaction, or of its tempo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from inphase.arrays import FloatArray, freeze
from inphase.evaluation.conditions import ticks
from inphase.evaluation.partners import Partners
from inphase.evaluation.predictor import Learner, Step
from inphase.trajectory import Dataset

GRID = 200  # moments of the mean trajectory
LAGS = (0, 5, 10, 20)  # samples: the partner's last moments
STRENGTH = 0.01  # of the ridge, in units of the features' variance


@dataclass(frozen=True, eq=False)
class MeanTrajectory:
    """The average demonstration, played by the clock whatever the partner does.

    mean, std: (GRID, Dc) of the controlled channels. duration: of the average demonstration [s].
    """

    mean: Float[np.ndarray, "G Dc"]
    std: Float[np.ndarray, "G Dc"]
    duration: float

    def __post_init__(self) -> None:
        freeze(self, mean=self.mean, std=self.std)

    @classmethod
    def learn(cls, dataset: Dataset) -> MeanTrajectory:
        """The mean over demonstrations at equal shares of their time; gaps are bridged."""
        partners, grid = Partners.learn(dataset), np.linspace(0, 1, GRID)
        curves = np.full((len(dataset), GRID, len(partners.controlled)), np.nan)
        for curve, demonstration in zip(curves, dataset, strict=True):
            places, _ = ticks(demonstration.times)
            _, controlled = partners.features(demonstration)
            for f, feature in enumerate(controlled.T):
                seen = ~np.isnan(feature)
                if seen.any():
                    curve[:, f] = np.interp(grid, places[seen] / places[-1], feature[seen])
        mean, std = partners.answer(np.nanmean(curves, axis=0), np.nanvar(curves, axis=0))
        return cls(mean, std, float(np.mean([demonstration.duration for demonstration in dataset])))

    def begin(self) -> Step:
        """The clock starts with the first sample."""
        started: list[float] = []

        def step(time: float, values: FloatArray) -> tuple[FloatArray, FloatArray]:
            if not started:
                started.append(time)
            share = min((time - started[0]) / self.duration, 1.0)
            at = [round(share * (GRID - 1)), GRID - 1]
            return self.mean[at], self.std[at]

        return step


@dataclass(frozen=True, eq=False)
class Ridge:
    """A regression of the controlled channels now on the partner's last moments, without any model of time.

    The final pose is the mean of all. first: (Fo,) what an observed feature is taken for until it is seen. centre,
    scale: (L Fo,) of the lagged features, L = len(LAGS). slopes: (L Fo, Fc). offset, var: (Fc,). end, end_var: (Fc,).
    """

    partners: Partners
    first: Float[np.ndarray, " Fo"]
    centre: Float[np.ndarray, " X"]
    scale: Float[np.ndarray, " X"]
    slopes: Float[np.ndarray, "X Fc"]
    offset: Float[np.ndarray, " Fc"]
    var: Float[np.ndarray, " Fc"]
    end: Float[np.ndarray, " Fc"]
    end_var: Float[np.ndarray, " Fc"]

    @classmethod
    def learn(cls, dataset: Dataset) -> Ridge:
        """Least squares with a ridge, every controlled feature on the samples in which it was seen."""
        partners = Partners.learn(dataset)
        observed, controlled = zip(*(partners.features(demonstration) for demonstration in dataset), strict=True)
        first = _known_mean(np.concatenate(observed))
        inputs = np.concatenate([_lagged(_held(features, first)) for features in observed])
        targets = np.concatenate(controlled)
        centre, scale, offset = inputs.mean(0), inputs.std(0) + 1e-9, np.nanmean(targets, 0)
        scaled = (inputs - centre) / scale
        slopes = np.empty((scaled.shape[1], targets.shape[1]))
        for f, target in enumerate(targets.T):
            seen = ~np.isnan(target)
            known = scaled[seen]
            ridge = STRENGTH * len(known) * np.eye(known.shape[1])
            slopes[:, f] = np.linalg.solve(known.T @ known + ridge, known.T @ (target[seen] - offset[f]))
        last = np.array([_held(features, np.full(features.shape[1], np.nan))[-1] for features in controlled])
        return cls(
            partners,
            first=first,
            centre=centre,
            scale=scale,
            slopes=slopes,
            offset=offset,
            var=np.nanmean((scaled @ slopes + offset - targets) ** 2, 0),
            end=np.nanmean(last, 0),
            end_var=np.nanvar(last, 0),
        )

    def begin(self) -> Step:
        """What is not seen is taken to stay as it was."""
        past: list[FloatArray] = []
        near = np.zeros(len(self.first))  # where features begin, as in the demonstrations

        def step(time: float, values: FloatArray) -> tuple[FloatArray, FloatArray]:
            read = self.partners.read(values, near)
            seen = ~np.isnan(read)
            near[seen] = read[seen]
            past.append(np.where(seen, read, past[-1] if past else self.first))
            inputs = np.concatenate([past[max(len(past) - 1 - lag, 0)] for lag in LAGS])
            now = (inputs - self.centre) / self.scale @ self.slopes + self.offset
            return self.partners.answer(np.stack([now, self.end]), np.stack([self.var, self.end_var]))

        return step


def _lagged(features: Float[np.ndarray, "T Fo"]) -> Float[np.ndarray, "T X"]:
    here = np.arange(len(features))
    return np.hstack([features[np.maximum(here - lag, 0)] for lag in LAGS])


def _held(features: Float[np.ndarray, "T F"], first: Float[np.ndarray, " F"]) -> Float[np.ndarray, "T F"]:
    """Every feature as it was last seen, and `first` before that."""
    whole = np.concatenate([first[None], features])
    seen: Bool[np.ndarray, "T F"] = ~np.isnan(whole)
    seen[0] = True
    last = np.maximum.accumulate(np.where(seen, np.arange(len(whole))[:, None], 0), axis=0)
    return np.take_along_axis(whole, last, axis=0)[1:]


def _known_mean(features: Float[np.ndarray, "T F"]) -> Float[np.ndarray, " F"]:
    """The mean of what was seen, 0 where nothing was."""
    count = (~np.isnan(features)).sum(0)
    return np.asarray(np.nansum(features, axis=0) / np.maximum(count, 1))


BASELINES: dict[str, Learner] = {"mean trajectory": MeanTrajectory.learn, "ridge": Ridge.learn}
