"""What a model's choices were made by: a table for people, values for machines, and two lines for the card."""

from __future__ import annotations

from dataclasses import asdict
from itertools import groupby
from textwrap import fill
from typing import Any

import numpy as np
from rich.console import Console

from inphase.cli.console import counted
from inphase.cli.scores import LEGEND, figure, percent
from inphase.evidence import Evidence, Trial
from inphase.model import Model
from inphase.training.calibrate import FEWEST

WIDTH = 79  # of text [characters]
NAME, ERROR, INSIDE, NLL = 38, 17, 9, 9  # of the table
TOGETHER = "\xa0"  # a blank at which no line ends
UNCHANGED = "as it is"  # of a trial: with what was there before
MEANING = {
    "basis": "how many basis functions a channel has; as many as held-out ones ask for",
    "noise lasts": "how long a deviation persists; if longer, each sample counts less",
    "trust": "in what the partner's movement tells beyond its timing; 0: timing alone",
    "usual tempo": "how many interactions go at the tempo of the demonstrations",
    "shrinkage": "how much of the covariance between channels is taken for chance",
    "reflex": "how much counts what the partner's last moments say by themselves",
    "band": "set so that nine of ten held-out readings lie in the 90 % band",
}
HOW = """\
±: standard error over the demonstrations; *: what the model has, changed only
where the error falls by more than the standard error of its fall. The same
demonstrations chose and judge: expect a little more error with new ones"""


def describe_evidence(evidence: Evidence | None) -> dict[str, Any] | None:
    """The evidence as plain values; None where there is none, or nothing could be scored."""
    if evidence is None:
        return None
    described = asdict(evidence)
    for trial in described["trials"]:
        trial.update({key: _plain(value) for key, value in trial.items()})
    return described | {"by_the_clock": _plain(evidence.by_the_clock)}


def summary(model: Model) -> str:
    """What was chosen, and what that changed, in a line each; or why nothing was."""
    evidence = model.evidence
    if evidence is None:
        few = f", since there are fewer than {FEWEST}" if len(model.prior.samples) < FEWEST else ""
        return f"not calibrated: no demonstrations were held out{few}"
    before, after = evidence.before, evidence.after
    changes = ", ".join(change.replace(" ", TOGETHER) for change in _changes(evidence))
    chosen = fill(f"calibrated: {changes or 'nothing had to change'}", WIDTH).replace(TOGETHER, " ")
    return (
        f"{chosen}\n{counted(evidence.held_out, 'demonstration')} held out: error {figure(before.error)} → "
        f"{figure(after.error)}, inside the 90 % band {percent(before.coverage)} → {percent(after.coverage)}"
    )


def print_evidence(console: Console, model: Model) -> None:
    """Every choice with all that was tried, and what the choices changed; nothing where there is no evidence."""
    evidence = model.evidence
    if evidence is None:
        return
    played = (
        f"{counted(evidence.held_out, 'demonstration')} held out, each played to a model that had not seen it, in "
        f"{counted(len(evidence.conditions), 'way')}: {', '.join(evidence.conditions)}."
    )
    console.print(f"\n{fill(played, WIDTH)}\n")
    console.print(f"{'':{NAME}}{'error':>{ERROR}}{'inside':>{INSIDE}}{'nll':>{NLL}}", style="bold")
    for choice, trials in groupby(evidence.trials[1:], key=lambda trial: trial.choice):
        meaning = f": {MEANING[choice]}" if choice in MEANING else ""
        console.print(f"{choice}{meaning}", style="bold")
        for trial in trials:
            mark, style = ("*", "") if trial.chosen else (" ", "dim")
            console.print(_row(f" {mark} {_value(trial, model)}", trial), style=style)
    console.print()
    console.print(_row("before", evidence.before))
    console.print(_row("after", evidence.after), style="bold")
    # Its error stands under those of the others, and not under what these are uncertain by.
    clock = f"{figure(evidence.by_the_clock)}{'':8}"
    console.print(f"{'by the clock':{NAME}}{clock:>{ERROR}}".rstrip())
    console.print(f"\n{LEGEND}\n{HOW}", style="dim")


def _row(name: str, trial: Trial) -> str:
    error = f"{figure(trial.error)} ± {figure(trial.error_std):5}"
    return f"{name:{NAME}}{error:>{ERROR}}{percent(trial.coverage):>{INSIDE}}{figure(trial.nll):>{NLL}}"


def _value(trial: Trial, model: Model) -> str:
    """Which candidate, in words; what is unchanged with its figure, if the model has it still."""
    if trial.value != UNCHANGED:
        return _spaced(trial.value)
    known = {
        "reflex": f"{model.reflex.weight if model.reflex else 0:g} times its precision",
        "trust": f"{model.prior.trust:.2g}",
        "usual tempo": f"{percent(model.tempo.usual)} of interactions",
        "shrinkage": f"{model.prior.shrinkage:.2g}",
    }
    return f"unchanged: {known[trial.choice]}" if trial.chosen and trial.choice in known else "unchanged"


def _changes(evidence: Evidence) -> list[str]:
    """The chosen candidates that are not, as the first of several is, what was there before."""
    changes = []
    for choice, group in groupby(evidence.trials[1:], key=lambda trial: trial.choice):
        trials = list(group)
        tried = trials if len(trials) == 1 else trials[1:]
        changes += [f"{choice} {_spaced(trial.value)}" for trial in tried if trial.chosen]
    return changes


def _spaced(value: str) -> str:
    return value.replace("%", " %")


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
