"""The export tab: what is in the model, a copy of it where it is wanted, and the lines that use it."""

from __future__ import annotations

import os
import shlex
import shutil
from html import escape
from pathlib import Path

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Button, CheckboxGroup, Div, Select, TextInput

from inphase.errors import InphaseError, OptionError
from inphase.io import whole_file
from inphase.model import Model
from inphase.studio.action import Action
from inphase.studio.command import Command
from inphase.studio.desk import Desk
from inphase.studio.text import as_html, heading, text, typed


def make_tab(desk: Desk) -> LayoutDOM:
    """The tab, of this desk."""
    return ExportTab(desk).layout


class ExportTab:
    """What the tab is made of."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._model = Select(title="Model", sizing_mode="stretch_width")
        self._target = TextInput(
            title="Save as (from the folder, or a whole path)", value="export.inphase", sizing_mode="stretch_width"
        )
        self._over = CheckboxGroup(labels=["in the place of a file that is there"], active=[])
        self._line = Div(disable_math=True, css_classes=["command"], sizing_mode="stretch_width")
        self._save = Button(label="Save", button_type="primary")
        self._said = text()
        self._card = Action(desk, "Show its card", self._inspected)
        self._use = Div(disable_math=True, css_classes=["said"], sizing_mode="stretch_width")
        self._model.on_change("value", lambda name, before, value: desk.choose(model=value))
        self._target.on_change("value_input", lambda name, before, value: self._refresh())
        self._over.on_change("active", lambda name, before, value: self._refresh())
        self._save.on_click(self._copy)
        desk.listen("models model", self._list)
        self.layout = column(
            self._model,
            row(
                column(
                    heading("Save a copy"),
                    self._target,
                    self._over,
                    self._line,
                    self._save,
                    self._said,
                    css_classes=["half"],
                ),
                column(heading("Use it"), self._use, css_classes=["half"]),
                css_classes=["wrap"],
                sizing_mode="stretch_width",
            ),
            heading("What is in it"),
            self._card.layout,
            sizing_mode="stretch_width",
        )
        self._list()

    def _list(self) -> None:
        self._model.options = list(self._desk.contents.models)  # type: ignore[assignment]
        self._model.value = self._desk.choice.model
        self._said.text = ""
        self._card.refresh()
        self._refresh()

    def _inspected(self) -> Command:
        if not self._desk.choice.model:
            raise OptionError("there is no model yet: the Train tab makes one")
        return Command.of("inspect", self._desk.choice.model)

    def _refresh(self) -> None:
        """The command line that copies as `Save` does, and the lines that use the copy."""
        model, target = self._desk.choice.model, self._target.value_input.strip()
        self._save.disabled = not (model and target)
        copying = ["cp", *([] if self._over.active else ["-n"]), "--", model, target]
        self._line.text = typed(shlex.join(copying)) if model and target else ""
        self._use.text = uses(target or model)

    def _copy(self) -> None:
        try:
            target = save_copy(
                self._desk.folder, self._desk.choice.model, self._target.value_input.strip(), bool(self._over.active)
            )
        except (InphaseError, OSError) as error:
            self._said.text, self._said.css_classes = as_html(error), ["said", "error"]
            return
        self._desk.look()
        self._said.text = as_html(f"wrote {target} ({target.stat().st_size / 1e3:.0f} kB)")
        self._said.css_classes = ["said", "fine"]


def save_copy(folder: Path, model: str, target: str, over: bool) -> Path:
    """Copy a model file, whole or not at all; names are from the folder, and `~` is home.

    over: in the place of a file that is there; otherwise FileExistsError is raised. Raises ModelFileError for what is
    no model, OptionError for a target that cannot be written or does not end in .inphase.
    """
    source, path = folder / model, folder / Path(target).expanduser()
    if path.suffix != ".inphase":
        raise OptionError(f"expected a name that ends in .inphase, got {target}")
    if not over and os.path.lexists(path):
        raise FileExistsError(f"{target} is there already; say so if it is to be written over")
    Model.load(source)  # what is copied is one
    with whole_file(path, new=not over) as temporary:
        shutil.copyfile(source, temporary)
    return path


def uses(model: str) -> str:
    """The lines that use a model, as HTML."""
    name = model or "model.inphase"
    python = (
        f"import inphase\n\nmodel = inphase.Model.load({name!r})\nsession = model.session()\n"
        "estimate = session.observe(t, y)  # t in seconds, y: the observed channels"
    )
    shell = (
        "inphase demo --live            # leaves inphase-demo/live.toml: copy it,\n"
        f"                               # and set its model to {shlex.quote(name)}\n"
        "inphase live live.toml --check\ninphase live live.toml"
    )
    return "".join(
        f"<p>{escape(title)}</p><pre>{escape(lines)}</pre>"
        for title, lines in (("In Python:", python), ("Live, at a terminal, beside the robot:", shell))
    )
