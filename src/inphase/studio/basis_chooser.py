"""Which basis functions a model gets: chosen by training, by family and size, or from a comparison on recordings."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Button, Select, Spinner

from inphase.basis import make
from inphase.studio.action import Action
from inphase.studio.command import Command, Value
from inphase.studio.desk import Desk
from inphase.studio.details import details
from inphase.studio.figures.basis import draw_basis
from inphase.studio.figures.criterion import TITLES, draw_criterion, size_of
from inphase.studio.grid import grid
from inphase.studio.text import text
from inphase.studio.train_roles import check_ready
from inphase.studio.worker import Outcome

CHOICES: dict[str, str] = {
    "": "automatic",
    "gaussian": "gaussian",
    "sigmoid": "sigmoid",
    "polynomial": "polynomial",
    "periodic": "periodic: an episode is one cycle",
}
CRITERION = "held-out"


class BasisChooser:
    """Family and size, a comparison to be run, and its picture; changed: told when the choice is another."""

    def __init__(self, desk: Desk, changed: Callable[[], None]) -> None:
        self._desk, self._changed = desk, changed
        self._family = Select(title="Basis functions", options=_listed(CHOICES), value="", width=260)
        self._size = Spinner(title="How many", value=15, low=2, high=200, step=1, width=90, visible=False)
        self._shape = column(sizing_mode="stretch_width")
        self._found = column(sizing_mode="stretch_width")
        self._compare = Action(desk, "Compare basis functions", self._command, self._compared, with_output=False)
        self._family.on_change("value", lambda attr, old, new: self._choose())
        self._size.on_change("value", lambda attr, old, new: self._choose())
        desk.listen("recordings observed controlled angle quaternion linear", self._compare.refresh)
        self.layout: LayoutDOM = column(
            row(self._family, self._size), self._shape, self._compare.layout, self._found, sizing_mode="stretch_width"
        )

    @property
    def options(self) -> dict[str, Value]:
        """As options of `inphase fit`."""
        family, size = self._family.value, int(self._size.value or 2)
        if family not in CHOICES or not family:  # a text that was taken over, or nothing
            return {"basis": family or None, "periodic": family.startswith("periodic")}
        return {"basis": f"{family}:{_number(family, size)}", "periodic": family == "periodic"}

    def take(self, basis: str) -> None:
        """Choose a basis by such a text as `inphase select` prints, `gaussian:12`."""
        if basis not in CHOICES:
            self._family.options = _listed(CHOICES | {basis: basis})
        self._family.value = basis

    def _choose(self) -> None:
        family, size = self._family.value, int(self._size.value or 2)
        self._size.visible = bool(family) and family in CHOICES
        self._shape.children = []
        if self._size.visible:
            first = "degree" if family == "polynomial" else "size"
            basis = make(family, **{first: _number(family, size)})
            self._shape.children = [draw_basis(f"{size} functions", basis)]
        self._compare.refresh()
        self._changed()

    def _command(self) -> Command:
        choice = self._desk.choice
        check_ready(choice)
        periodic = self._family.value.startswith("periodic")
        return Command.of("select", *choice.recordings, options={**choice.columns, "periodic": periodic, "json": True})

    def _compared(self, outcome: Outcome) -> None:
        self._found.children = []
        if outcome.fine:
            self._found.children = list(show_selection(json.loads(outcome.output), self.take))


def show_selection(selection: Mapping[str, Any], take: Callable[[str], None]) -> list[LayoutDOM]:
    """The criteria by size and family, all candidates in a table, and a button that takes the best."""
    candidates, best = selection["candidates"], next(iter(selection["best"][CRITERION].values()))
    figures = []
    for criterion in (CRITERION, *(name for name in TITLES if name != CRITERION)):
        chosen = next(iter(selection["best"][criterion].values()))
        figures.append(draw_criterion(candidates, criterion, _family_and_size(chosen)))
    button = Button(label=f"Take {best}", button_type="primary")
    button.on_click(lambda: take(best))
    order = sorted(candidates, key=lambda candidate: _or_last(candidate[CRITERION][0]))
    rows = [
        [candidate["family"], size_of(candidate), _parameters(candidate)]
        + [_or_dash(candidate[name][0]) for name in (CRITERION, "aic", "bic")]
        + [_percent(candidate["error"][0])]
        for candidate in order
    ]
    titles = ["family", "functions", "width", *(TITLES[name] for name in (CRITERION, "aic", "bic")), "error of the fit"]
    return [
        text(
            "How well each family and size suits the recordings, at its best width; the ring is what a criterion "
            "chooses. Held out: how likely a recording is, given the others; the fewest functions that are no worse "
            "than the best within a standard error.",
            kind="quiet",
        ),
        grid(figures),
        details(f"all {len(candidates)} candidates in a table, the best first", titles, rows),
        button,
    ]


def _listed(choices: Mapping[str, str]) -> list[str | tuple[Any, str]]:
    return list(choices.items())


def _number(family: str, size: int) -> int:
    """What stands behind the family's name: a polynomial's is its degree."""
    return size - 1 if family == "polynomial" else size


def _family_and_size(basis: str) -> tuple[str, int]:
    family, number, *_ = basis.split(":")
    return family, int(number) + (family == "polynomial")


def _parameters(candidate: Mapping[str, Any]) -> str:
    width = candidate.get("width")
    return "" if width is None else f"{width:.3g}" + (" (ends at 0 and 1)" if candidate.get("margin") == 0 else "")


def _or_last(value: float | None) -> float:
    return float("inf") if value is None else value


def _or_dash(value: float | None) -> float | str:
    return "–" if value is None else value


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.2f} %"
