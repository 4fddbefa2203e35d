"""The scores of replays, beside those of the mean demonstration played by the clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Console

from inphase.evaluation.replay import Replay
from inphase.metrics import MARKS
from inphase.model import Model
from inphase.training.rehearsal import by_the_clock
from inphase.trajectory import Demonstration

Figures = Mapping[str, Any]  # float or None, and what else is told of a replay

FINAL = tuple(f"final_pose_{100 * mark:.0f}" for mark in MARKS)
LONGEST = 19  # characters of a name: the table fits 80 columns
LEGEND = """\
error: mean squared; 1 is what always answering the mean reading would score
inside: the share that lies inside the 90 % band; nll: negative log-likelihood
by the clock: the mean demonstration, played whatever the partner does"""


def figures(model: Model, demonstration: Demonstration, played: Replay) -> dict[str, float | None]:
    """The scores of a replay and of the clock; None where nothing can be scored."""
    now, clock = played.now, by_the_clock(model, demonstration)
    found = {
        "nmse": now.nmse,
        "coverage": now.coverage,
        "nll": now.nll,
        **{name: played.final_pose(mark) for name, mark in zip(FINAL, MARKS, strict=True)},
        "log_likelihood": played.log_likelihood,
        "clock_nmse": clock.nmse,
        "clock_coverage": clock.coverage,
        "clock_nll": clock.nll,
    }
    return {key: value if np.isfinite(value) else None for key, value in found.items()}


class ScoreTable:
    """A table of figures that can be printed row by row, while they are made."""

    def __init__(self, console: Console, names: Sequence[str]) -> None:
        self._console = console
        self._width = min(max(map(len, [*names, "episode"])), LONGEST)

    def print_head(self) -> None:
        """The titles."""
        marks = " ".join(f"{100 * mark:4.0f} %" for mark in MARKS)
        self._console.print(
            f"{'':{self._width}}  {'response now':^20}   {'final pose, foreseen':^20}   {'by the clock':>13}\n"
            f"{'episode':{self._width}}   error inside    nll   {marks}    error inside",
            style="bold",
        )

    def print_row(self, name: str, found: Figures) -> None:
        """The figures of one replay."""
        name = name if len(name) <= LONGEST else "…" + name[1 - LONGEST :]
        now = figure(found["nmse"]), percent(found["coverage"]), figure(found["nll"])
        final = tuple(figure(found[key]) for key in FINAL)
        clock = figure(found["clock_nmse"]), percent(found["clock_coverage"])
        blocks = (" ".join(f"{text:>6}" for text in block) for block in (now, final, clock))
        self._console.print(f"{name:{self._width}}  {'   '.join(blocks)}")

    def print_mean(self, results: Sequence[Figures]) -> None:
        """The mean figures of several replays."""
        keys = ("nmse", "coverage", "nll", *FINAL, "clock_nmse", "clock_coverage")
        known = {key: [value for found in results if (value := found[key]) is not None] for key in keys}
        self.print_row("mean", {key: float(np.mean(values)) if values else None for key, values in known.items()})


def figure(value: float | None) -> str:
    """A score in at most six characters."""
    if value is None or not np.isfinite(value):
        return "–"
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}" if abs(value) < 1000 else f"{value:.0e}"


def percent(value: float | None) -> str:
    """A share in percent."""
    return f"{100 * value:.0f} %" if value is not None and np.isfinite(value) else "–"
