"""What an evaluation found, a row for every held-out episode, and its means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inphase.errors import OptionError, listing
from inphase.metrics import MARKS, Errors

METRICS = ("now", "end25", "end50", "end75", "cover", "nll")


@dataclass(frozen=True)
class Row:
    """How one predictor fared with one held-out episode; NaN where there was nothing to compare with.

    now: squared error of the controlled channels, over their training variance. end25 … end75: that of the final
    pose, as foreseen after so many % of the episode. cover: the share of readings inside the predictor's own 90 %
    interval. nll: negative log predictive density a reading, in units of the training standard deviation.
    """

    task: str
    predictor: str
    condition: str
    fold: int
    episode: str
    now: float
    end25: float
    end50: float
    end75: float
    cover: float
    nll: float

    @classmethod
    def of(cls, task: str, predictor: str, condition: str, fold: int, episode: str, errors: Errors) -> Row:
        """The row of these errors."""
        scores, (end25, end50, end75) = errors.scores, map(errors.final_pose, MARKS)
        return cls(
            task,
            predictor,
            condition,
            fold,
            episode,
            now=scores.nmse,
            end25=end25,
            end50=end50,
            end75=end75,
            cover=scores.coverage,
            nll=scores.nll,
        )


@dataclass(frozen=True)
class Figure:
    """A mean and its standard error; NaN where too few episodes tell."""

    mean: float
    error: float


@dataclass(frozen=True)
class Evaluation:
    """The rows of an evaluation, and the names in them in the order in which they came."""

    rows: tuple[Row, ...]

    @property
    def tasks(self) -> tuple[str, ...]:
        """The names of the tasks."""
        return tuple(dict.fromkeys(row.task for row in self.rows))

    @property
    def predictors(self) -> tuple[str, ...]:
        """The names of the filters and baselines."""
        return tuple(dict.fromkeys(row.predictor for row in self.rows))

    @property
    def conditions(self) -> tuple[str, ...]:
        """The names of the conditions."""
        return tuple(dict.fromkeys(row.condition for row in self.rows))

    def figure(self, metric: str, predictor: str, condition: str, tasks: Sequence[str] | None = None) -> Figure:
        """The mean of a metric over the held-out episodes of a task, and then over tasks (all, if none is named).

        So every task counts alike, however many episodes it has. The standard error is that of this mean, episodes
        taken for independent. Raises OptionError for an unknown name.
        """
        wanted = self.tasks if tasks is None else tuple(tasks)
        for what, name, valid in (
            ("metric", metric, METRICS),
            ("predictor", predictor, self.predictors),
            ("condition", condition, self.conditions),
            *(("task", task, self.tasks) for task in wanted),
        ):
            if name not in valid:
                raise OptionError(f"unknown {what} {name!r}; one of {listing(map(repr, valid))}")
        means, variances = [], []
        for task in wanted:
            values = np.array([getattr(row, metric) for row in self._sorted.get((task, predictor, condition), [])])
            known = values[np.isfinite(values)]
            means.append(known.mean() if len(known) else np.nan)
            variances.append(known.var(ddof=1) / len(known) if len(known) > 1 else np.nan)
        return Figure(float(np.mean(means)), float(np.sqrt(np.sum(variances)) / len(wanted)))

    @cached_property
    def _sorted(self) -> dict[tuple[str, str, str], list[Row]]:
        found: dict[tuple[str, str, str], list[Row]] = {}
        for row in self.rows:
            found.setdefault((row.task, row.predictor, row.condition), []).append(row)
        return found
