"""Cross-validation of filters and baselines on recordings, under conditions that were not demonstrated (DESIGN 5)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

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
from inphase.workers import workers

FOLDS = 4
FEWEST_SHOWN = 2  # demonstrations that a model is learned from


@dataclass(frozen=True, eq=False)
class Split:
    """One fold of one task: what is learned from, and what was held out."""

    task: str
    fold: int
    train: Dataset
    test: Dataset


@dataclass(frozen=True)
class Part:
    """What is scored at a time: one predictor on what was held out in one fold, under one condition."""

    task: str
    fold: int
    predictor: str
    condition: str


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
    cluster: str | None = None,
    known: Sequence[Row] = (),
    keep: Callable[[Sequence[Row]], object] | None = None,
    progress: Callable[[float], object] | None = None,
) -> Evaluation:
    """How well filters, and what else is named, follow interactions that they have not seen.

    data: one task, or several by name. Episode i is held out in fold i % folds; what is learned from the others by
    `fit` and by `others` (the baselines) is shown the observed channels of each held-out episode, sample by sample,
    under each of the conditions, with the same seed. jobs: so many processes; the rows are the same for any number.
    cluster: the address of a dask scheduler (tcp://host:port) whose workers do it instead. known: rows of the same
    evaluation, interrupted, or of a smaller one; what they hold is not done again. keep: is told rows as they are
    found, the known ones first, so that an interrupt loses none. progress: is told the share that is done.
    Raises OptionError for unknown names and a cluster that does not answer, DataError where there are too few episodes,
    WorkerError where workers are lost for good.
    """
    tasks = {"data": data} if isinstance(data, Dataset) else dict(data)
    conditions, filters = tuple(dict.fromkeys(conditions)), tuple(dict.fromkeys(filters))
    _check(tasks, filters, others, folds, conditions)
    names = [*filters, *others]
    splits = [split for task, dataset in tasks.items() for split in _splits(task, dataset, folds)]
    parts = {
        split: [Part(split.task, split.fold, name, condition) for name in names for condition in conditions]
        for split in splits
    }
    found = {part: rows for split in splits for part, rows in _known(known, split).items() if part in parts[split]}
    if keep is not None:
        for rows in found.values():
            keep(rows)
    to_score = {split: [part for part in parts[split] if part not in found] for split in splits}
    waiting: deque[tuple[Split | Part, Callable[[], Learned | list[Row]]]] = deque(
        (split, partial(_learn, split, {part.predictor for part in missing}, fit, others, seed))
        for split, missing in to_score.items()
        if missing
    )
    total = len(waiting) + sum(map(len, to_score.values()))
    with workers(jobs, cluster) as team:
        for done, (label, result) in enumerate(team.as_done(waiting), 1):
            if isinstance(label, Split):
                # What was learned is scored before more is learned: less waits, and an interrupt finds finished rows.
                scoring = [
                    (part, partial(_score, part, label.test, result.predictors[part.predictor], result.spread))
                    for part in to_score[label]
                ]
                waiting.extendleft(reversed(scoring))
            else:
                found[label] = result
                if keep is not None:
                    keep(result)
            if progress is not None:
                progress(done / total)
    return Evaluation(tuple(row for split in splits for part in parts[split] for row in found[part]))


def _check(
    tasks: Mapping[str, Dataset],
    filters: Sequence[str],
    others: Mapping[str, Learner],
    folds: int,
    conditions: Sequence[str],
) -> None:
    for what, names, valid in (("filter", filters, FILTERS), ("condition", conditions, CONDITIONS)):
        for name in names:
            if name not in valid:
                raise OptionError(f"unknown {what} {name!r}; one of {listing(map(repr, valid))}")
    if not (filters or others) or not conditions:
        raise OptionError("expected at least one filter or baseline and one condition, got none")
    if not (isinstance(folds, (int, np.integer)) and folds >= 2):
        raise OptionError(f"folds: expected a whole number of at least 2, got {folds!r}")
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


def _known(rows: Sequence[Row], split: Split) -> dict[Part, list[Row]]:
    """The parts of a split whose every episode is among the rows."""
    found: dict[Part, list[Row]] = {}
    for row in rows:
        if (row.task, row.fold) == (split.task, split.fold):
            found.setdefault(Part(row.task, row.fold, row.predictor, row.condition), []).append(row)
    episodes = [demonstration.name for demonstration in split.test]
    return {part: some for part, some in found.items() if [row.episode for row in some] == episodes}


def _learn(
    split: Split,
    names: Collection[str],
    fit: Callable[[Dataset], Model],
    others: Mapping[str, Learner],
    seed: int,
) -> Learned:
    try:
        spread = Partners.learn(split.train).spread(split.train)
        predictors: dict[str, Predictor] = {name: others[name](split.train) for name in names if name in others}
        if len(predictors) < len(names):
            model = fit(split.train)
            predictors |= {name: Filtered(model, name, seed) for name in names if name not in others}
    except DataError as error:
        raise DataError(f"{split.task}: {error}") from None
    return Learned(spread, predictors)


def _score(part: Part, test: Dataset, predictor: Predictor, spread: Float[np.ndarray, " Dc"]) -> list[Row]:
    rows = []
    for demonstration in test:
        errors = play(predictor, test, warp(demonstration, test.channels, part.condition), spread)
        rows.append(Row.of(part.task, part.predictor, part.condition, part.fold, demonstration.name, errors))
    return rows
