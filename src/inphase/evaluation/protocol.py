"""Cross-validation of filters and baselines on recordings, under conditions that were not demonstrated (DESIGN 5)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from inphase.errors import DataError, OptionError, listing
from inphase.evaluation.baselines import BASELINES
from inphase.evaluation.conditions import CONDITIONS, warp
from inphase.evaluation.partners import Partners
from inphase.evaluation.predictor import Filtered, Learner, Predictor, play
from inphase.evaluation.results import Evaluation, Row
from inphase.filters import FILTERS, RECOMMENDED
from inphase.model import Model
from inphase.training import fit as learn_model
from inphase.trajectory import Dataset

Part = TypeVar("Part")

FOLDS = 4
FEWEST_SHOWN = 2  # demonstrations that a model is learned from


@dataclass(frozen=True)
class Split:
    """One fold of one task: what is learned from, and what was held out."""

    task: str
    fold: int
    train: Dataset
    test: Dataset


@dataclass(frozen=True, eq=False)
class Learned:
    """What came of the demonstrations of a split. spread: (Dc,) the unit of errors."""

    spread: Float[np.ndarray, " Dc"]
    predictors: Mapping[str, Predictor]


def evaluate(
    data: Dataset | Mapping[str, Dataset],
    filters: Sequence[str] = (RECOMMENDED,),
    *,
    folds: int = FOLDS,
    conditions: Sequence[str] = tuple(CONDITIONS),
    seed: int = 0,
    fit: Callable[[Dataset], Model] = learn_model,
    others: Mapping[str, Learner] = BASELINES,
    jobs: int = 1,
    progress: Callable[[float], object] | None = None,
) -> Evaluation:
    """How well filters, and what else is named, follow interactions that they have not seen.

    data: one task, or several by name. Episode i is held out in fold i % folds; what is learned from the others by
    `fit` and by `others` (the baselines) is shown the observed channels of each held-out episode, sample by sample,
    under each of the conditions, with the same seed. jobs: so many processes; the rows are the same for any number.
    progress: is told the share that is done. Raises OptionError for unknown names, and DataError where there are too
    few episodes.
    """
    tasks = {"data": data} if isinstance(data, Dataset) else dict(data)
    conditions, filters = tuple(dict.fromkeys(conditions)), tuple(dict.fromkeys(filters))
    _check(tasks, filters, others, folds, conditions, jobs)
    splits = [split for task, dataset in tasks.items() for split in _splits(task, dataset, folds)]
    names = [*filters, *others]
    total = len(splits) * (1 + len(names) * len(conditions))

    from joblib import Parallel, delayed  # type: ignore[import-untyped]

    # Arrays go to the processes as they are: no files are left anywhere.
    with Parallel(n_jobs=jobs, return_as="generator", max_nbytes=None) as work:
        learning = work(delayed(_learn)(split, filters, fit, others, seed) for split in splits)
        learned = list(_told(learning, 0, total, progress))
        playing = work(
            delayed(_score)(split.task, split.fold, split.test, condition, name, found.predictors[name], found.spread)
            for split, found in zip(splits, learned, strict=True)
            for name in names
            for condition in conditions
        )
        rows = [row for some in _told(playing, len(splits), total, progress) for row in some]
    return Evaluation(tuple(rows))


def _check(
    tasks: Mapping[str, Dataset],
    filters: Sequence[str],
    others: Mapping[str, Learner],
    folds: int,
    conditions: Sequence[str],
    jobs: int,
) -> None:
    for what, names, valid in (("filter", filters, FILTERS), ("condition", conditions, CONDITIONS)):
        for name in names:
            if name not in valid:
                raise OptionError(f"unknown {what} {name!r}; one of {listing(map(repr, valid))}")
    if not (filters or others) or not conditions:
        raise OptionError("expected at least one filter or baseline and one condition, got none")
    for what, number, least in (("folds", folds, 2), ("jobs", jobs, 1)):
        if not (isinstance(number, (int, np.integer)) and number >= least):
            raise OptionError(f"{what}: expected a whole number of at least {least}, got {number!r}")
    if not tasks:
        raise DataError("expected at least one data set, got none")
    for task, dataset in tasks.items():
        if len(dataset) < folds:
            raise DataError(
                f"{task}: expected at least {folds} episodes, one for each of {folds} folds, got {len(dataset)}"
            )
        if len(dataset) - -(-len(dataset) // folds) < FEWEST_SHOWN:
            raise DataError(
                f"{task}: expected at least {FEWEST_SHOWN} episodes to learn from in each of {folds} folds, "
                f"got {len(dataset)} episodes in all"
            )
        if not dataset.observed or not dataset.controlled:
            raise DataError(
                f"{task}: expected observed and controlled channels, got {listing(dataset.observed)} and "
                f"{listing(dataset.controlled)}"
            )


def _splits(task: str, dataset: Dataset, folds: int) -> Iterator[Split]:
    everything = range(len(dataset))
    for fold in range(folds):
        train = dataset.subset([i for i in everything if i % folds != fold])
        yield Split(task, fold, train, dataset.subset(everything[fold::folds]))


def _learn(
    split: Split,
    filters: Sequence[str],
    fit: Callable[[Dataset], Model],
    others: Mapping[str, Learner],
    seed: int,
) -> Learned:
    with _one_thread():
        try:
            spread = Partners.learn(split.train).spread(split.train)
            predictors: dict[str, Predictor] = {}
            if filters:
                model = fit(split.train)
                predictors |= {name: Filtered(model, name, seed) for name in filters}
            predictors |= {name: learn(split.train) for name, learn in others.items()}
        except DataError as error:
            raise DataError(f"{split.task}: {error}") from None
    return Learned(spread, predictors)


def _score(
    task: str,
    fold: int,
    test: Dataset,
    condition: str,
    name: str,
    predictor: Predictor,
    spread: Float[np.ndarray, " Dc"],
) -> list[Row]:
    rows = []
    with _one_thread():
        for demonstration in test:
            errors = play(predictor, test, warp(demonstration, test.channels, condition), spread)
            rows.append(Row.of(task, name, condition, fold, demonstration.name, errors))
    return rows


@contextmanager
def _one_thread() -> Iterator[None]:
    """BLAS with one thread: more would be in each other's way, and might add up in another order."""
    import scipy.linalg  # noqa: F401 - it brings a BLAS of its own, which can be limited once it is there
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield


def _told(parts: Iterable[Part], before: int, total: int, progress: Callable[[float], object] | None) -> Iterator[Part]:
    """The parts as they come, each told of."""
    for done, part in enumerate(parts, before + 1):
        if progress is not None:
            progress(done / total)
        yield part
