"""The studio's train tab: from recordings to a model, and what the model believes."""

from __future__ import annotations

from typing import Any

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Select, TextInput

from inphase.errors import OptionError
from inphase.studio.action import Action
from inphase.studio.basis_chooser import BasisChooser
from inphase.studio.command import Command, Value, as_path
from inphase.studio.desk import Choice, Desk
from inphase.studio.model_view import ModelView
from inphase.studio.text import as_html, heading, text
from inphase.studio.train_roles import Roles, check_ready
from inphase.studio.worker import Outcome

QUICK, FULL = "quick", "full"
WAYS: list[str | tuple[Any, str]] = [
    (QUICK, "quick: seconds, not calibrated"),
    (FULL, "full: calibrated, up to minutes"),
]


def fit_command(choice: Choice, output: str, basis: dict[str, Value], quick: bool) -> Command:
    """`inphase fit` of what is chosen; raises OptionError where something is missing.

    output: the model file. basis: as the chooser gives it. quick: hold nothing out.
    """
    check_ready(choice)
    if not output.endswith(".inphase"):
        raise OptionError(f"the model file: expected a name that ends in .inphase, got {output!r}")
    options = {**choice.columns, **basis, "quick": quick, "output": as_path(output)}
    return Command.of("fit", *choice.recordings, options=options)


def make_tab(desk: Desk) -> LayoutDOM:
    """The tab, of this desk."""
    return _Tab(desk).layout


class _Tab:
    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._output = TextInput(title="Model file", value="model.inphase", width=260)
        self._replaced = text(kind="quiet")
        self._way = Select(title="Fit", value=QUICK, options=WAYS, width=260)
        self._view = ModelView(desk)
        self._basis = BasisChooser(desk, self._refresh)
        self._train = Action(desk, "Train", self._command, self._trained)
        self._output.on_change("value", lambda attr, old, new: self._refresh())
        self._way.on_change("value", lambda attr, old, new: self._refresh())
        desk.listen("recordings observed controlled angle quaternion linear models", self._refresh)
        desk.listen("model", lambda: self._view.show(desk.choice.model))
        self._refresh()
        self.layout = column(
            heading("Train"),
            Roles(desk).layout,
            self._basis.layout,
            row(self._way, self._output, css_classes=["wrap"]),
            self._replaced,
            self._train.layout,
            heading("What the model believes"),
            self._view.layout,
            sizing_mode="stretch_width",
        )

    def _command(self) -> Command:
        quick = self._way.value == QUICK
        return fit_command(self._desk.choice, self._output.value.strip(), self._basis.options, quick)

    def _refresh(self) -> None:
        name = self._output.value.strip()
        there = name in self._desk.contents.models
        self._replaced.text = as_html(f"{name} is there already, and will be replaced") if there else ""
        self._replaced.visible = there
        self._train.refresh()

    def _trained(self, outcome: Outcome) -> None:
        if not outcome.fine:
            return
        name = outcome.command.arguments[outcome.command.arguments.index("--output") + 1]
        if name == self._desk.choice.model:
            self._view.show(name)  # another one of the same name
        else:
            self._desk.choose(model=name)
