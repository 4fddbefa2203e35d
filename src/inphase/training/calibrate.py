"""Calibration: basis, noise, trust, tempo, shrinkage, reflex and band, chosen by held-out demonstrations.

Every choice starts from what was learned without playing anything, and changes only for a candidate that is better by
more than its standard error: a handful of demonstrations is easily flattered. What counts is the relative gain, so that
a condition in which all goes well weighs as much as one in which nothing does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from inphase.evidence import Evidence, Trial
from inphase.metrics import NINETY, Errors
from inphase.model import Model
from inphase.noise import Noise
from inphase.training.rehearsal import CONDITIONS, Rehearsal, by_the_clock, play, rehearsals, relative, scores
from inphase.training.shrinkage import intensity
from inphase.trajectory import Dataset
from inphase.workers import Run, workers

FEWEST = 4  # demonstrations: without one of three, too little is left to judge by
INSIDE = 0.9  # of the readings, inside the band of 90 %
BANDS = (0.3, 3.0)  # nothing that so few demonstrations tell makes a band narrower or wider than that

Change = Callable[[Model], Model]


@dataclass(frozen=True)
class Candidate:
    """One way to have a model: `value` in words, and the change that makes a model so."""

    value: str
    change: Change


def _lasting(factor: float) -> Change:
    def change(model: Model) -> Model:
        return replace(model, noise=Noise(model.noise.var, factor * model.noise.correlation_time))

    return change


def _trust(trust: float) -> Change:
    return lambda model: replace(model, prior=replace(model.prior, trust=trust))


def _usual(usual: float) -> Change:
    return lambda model: replace(model, tempo=replace(model.tempo, usual=usual))


def _shrunk(shrinkage: str | float) -> Change:
    def change(model: Model) -> Model:
        prior = model.prior
        return replace(model, prior=replace(prior, shrinkage=intensity(shrinkage, prior.samples, prior.blocks)))

    return change


def _reflex(weight: float) -> Change:
    return lambda model: replace(model, reflex=replace(model.reflex, weight=weight) if model.reflex else None)


def _banded(band: float) -> Change:
    return lambda model: replace(model, band=band)


CHOICES: dict[str, tuple[Candidate, ...]] = {
    "reflex": tuple(Candidate(f"{x:g} times its precision", _reflex(x)) for x in (0.0, 0.3)),
    "noise lasts": tuple(Candidate(f"{x:g} times as long", _lasting(x)) for x in (2.0,)),
    "trust": tuple(Candidate(f"{x:g}", _trust(x)) for x in (0.0, 0.5)),
    "usual tempo": tuple(Candidate(f"{x:.0%} of interactions", _usual(x)) for x in (0.5, 0.95)),
    "shrinkage": (Candidate("0.3 between features", _shrunk(0.3)),),
}


@dataclass(frozen=True)
class Alternative:
    """Another model of the same data set, `value` in words, and how one of a part of it is learned."""

    value: str
    model: Model
    learn: Callable[[Dataset], Model]


class Calibration:
    """The choices so far, and their evidence."""

    def __init__(self, held_out: Sequence[Rehearsal], run: Run, tell: Callable[[], None]):
        self._held_out, self._run, self._tell = held_out, run, tell
        self._changes: list[Change] = []
        self.trials: list[Trial] = []
        self.errors = self._play(None)
        self._note("before", "as learned", self.errors, chosen=True)

    def consider(self, choice: str, value: str, held_out: Sequence[Rehearsal]) -> bool:
        """Play models that were learned otherwise and, if they are better by more than chance, go on with them."""
        there = self._held_out
        self._held_out = held_out
        errors = self._play(None)
        gain, doubt = self._gain(errors)
        better = gain > doubt
        self._note(choice, "as it is", self.errors, chosen=not better)
        self._note(choice, value, errors, chosen=better)
        if better:
            self.errors = errors
        else:
            self._held_out = there
        return better

    def choose(self, choice: str, candidates: Sequence[Candidate]) -> None:
        """Play every candidate and keep the best, if it is better than what is there by more than chance."""
        played = [self._play(candidate.change) for candidate in candidates]
        gains = [self._gain(errors) for errors in played]
        best = int(np.argmax([mean for mean, _ in gains]))
        better = gains[best][0] > gains[best][1]
        self._note(choice, "as it is", self.errors, chosen=not better)
        for i, (candidate, errors) in enumerate(zip(candidates, played, strict=True)):
            self._note(choice, candidate.value, errors, chosen=better and i == best)
        if better:
            self._changes.append(candidates[best].change)
            self.errors = played[best]

    def choose_band(self) -> None:
        """As wide as it takes for nine of ten readings to lie inside."""
        off = np.abs(relative(self.errors))
        band = float(np.clip(np.quantile(off, INSIDE) / NINETY, *BANDS)) if len(off) else 1.0
        self._changes.append(_banded(band))
        self._note("band", f"{band:.2f} times as wide", self.errors, chosen=True, band=band)

    def applied(self, model: Model) -> Model:
        """A model with all that was chosen."""
        for change in self._changes:
            model = change(model)
        return model

    def _play(self, change: Change | None) -> list[Errors]:
        tasks = []
        for rehearsal in self._held_out:
            model = self.applied(rehearsal.model)
            model = change(model) if change else model
            tasks += [(model, variation) for variation in rehearsal.variations]
        found = self._run(play, tasks)
        self._tell()
        return found

    def _gain(self, errors: Sequence[Errors]) -> tuple[float, float]:
        """The share by which the error is smaller than what is there, and its standard error over demonstrations."""
        there = self._by_condition(self.errors)
        gain = ((there - self._by_condition(errors)) / np.maximum(there.mean(0), 1e-12)).mean(1)
        return float(gain.mean()), float(gain.std(ddof=1) / np.sqrt(len(gain)))

    def _by_condition(self, errors: Sequence[Errors]) -> Float[np.ndarray, "n C"]:
        return np.array([e.scores.nmse for e in errors]).reshape(len(self._held_out), -1)

    def _note(self, choice: str, value: str, errors: Sequence[Errors], chosen: bool, band: float = 1.0) -> None:
        found, each = scores(errors, band), self._by_condition(errors).mean(1)
        doubt = float(each.std(ddof=1) / np.sqrt(len(each)))
        self.trials.append(Trial(choice, value, found.nmse, doubt, found.coverage, found.nll, chosen))


def calibrate(
    dataset: Dataset,
    model: Model,
    learn: Callable[[Dataset], Model],
    *,
    alternative: Alternative | None = None,
    fixed: Sequence[str] = (),
    jobs: int = 1,
    cluster: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Model:
    """The model with everything chosen that is not in `fixed`, and the evidence.

    learn: makes a model of a part of the data set. alternative: one with another basis, taken where it follows better.
    jobs, cluster: who plays (see `inphase.workers`). progress: is told the share that is done.
    """
    choices = {name: candidates for name, candidates in CHOICES.items() if name not in fixed}
    steps = 2 + sum(len(candidates) for candidates in choices.values()) + (alternative is not None)
    done = 0

    def tell() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / steps)

    held_out = rehearsals(dataset, learn)
    if len(held_out) < FEWEST - 1:
        return model
    tell()
    with workers(jobs, cluster) as team:
        calibration = Calibration(held_out, team.run, tell)
        if alternative is not None:
            otherwise = rehearsals(dataset, alternative.learn)
            if len(otherwise) == len(held_out) and calibration.consider("basis", alternative.value, otherwise):
                model, held_out = alternative.model, otherwise
        for name, candidates in choices.items():
            calibration.choose(name, candidates)
        calibration.choose_band()
    clock = [by_the_clock(r.model, v).nmse for r in held_out for v in r.variations]
    evidence = Evidence(len(held_out), tuple(CONDITIONS), tuple(calibration.trials), float(np.mean(clock)))
    return replace(calibration.applied(model), evidence=evidence)
