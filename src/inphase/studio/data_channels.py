"""Whose channels the columns of recordings are, and of which kind: chosen in a table, or typed as patterns."""

from __future__ import annotations

import shlex
from contextlib import suppress
from typing import Any

from bokeh.layouts import column, row
from bokeh.models.widgets import Button, Select, TextInput

from inphase.channels import Kind
from inphase.errors import InphaseError
from inphase.studio.desk import Choice, Desk
from inphase.studio.quality import Quality
from inphase.studio.roles import check, fitting, guess, patterns, words
from inphase.studio.table import fill, make_table
from inphase.studio.text import as_html, text

ROLES = ("observed", "controlled")
AS_FOUND = "as found"


class Channels:
    """A table of channels, buttons that say what those marked in it are, and the patterns that say the same."""

    def __init__(self, desk: Desk, quality: Quality) -> None:
        self._desk, self._quality = desk, quality
        self._table = make_table(
            {
                "name": ("channel", 150, None),
                "role": ("partner", 80, None),
                "kind": ("kind", 80, None),
                "low": ("from", 60, 3),
                "high": ("to", 60, 3),
                "missing": ("missing %", 70, 1),
            },
            height=250,
            selectable="checkbox",
        )
        self._rows: Any = self._table.source
        buttons = []
        for label, role in (("Observed", "observed"), ("Controlled", "controlled"), ("Not used", "")):
            button = Button(label=label, width=100)
            button.on_click(lambda role=role: self._assign(role))
            buttons.append(button)
        self._kind = Select(value=AS_FOUND, title="Kind of those marked", width=150)
        self._kind.options = [AS_FOUND, *(kind.value for kind in Kind)]  # type: ignore[assignment]
        self._kind.on_change("value", lambda name, before, value: self._set_kind(value))
        self._typed = {
            role: TextInput(title=f"{role.capitalize()}: names or patterns", sizing_mode="stretch_width")
            for role in ROLES
        }
        for box in self._typed.values():
            box.on_change("value", lambda name, before, value: self._take_typed())
        self._wrong = text(kind="error")
        self._wrong.visible = False
        self._filling = False
        self.layout = column(
            text("Mark channels and say whose they are; with none said, all are observed.", kind="quiet"),
            column(self._table, css_classes=["scroll"], sizing_mode="stretch_width"),
            row(*buttons, css_classes=["wrap"]),
            self._kind,
            *self._typed.values(),
            self._wrong,
            sizing_mode="stretch_width",
        )
        desk.listen("observed controlled angle quaternion linear", self.show)

    def settle(self) -> None:
        """Where the roles do not fit the chosen recordings, or none are said, guess them."""
        choice, names = self._desk.choice, self._desk.names()
        try:
            check(choice, names)
            if choice.observed or choice.controlled:
                return
        except InphaseError:
            pass
        self._desk.choose(**guess(self._desk))

    def show(self) -> None:
        """Fill in what is chosen and what is known."""
        choice, names = self._desk.choice, self._desk.names()
        role = {name: label for label in ROLES for name in _fitting(getattr(choice, label), names)}
        kinds = {name: kind.value for kind in Kind for name in _fitting(getattr(choice, kind.value), names)}
        told = {channel["name"]: channel for channel in self._quality.channels}
        nothing_said = not (choice.observed or choice.controlled)
        fill(
            self._table,
            {
                "name": list(names),
                "role": [role.get(name, "observed" if nothing_said else "") for name in names],
                "kind": [kinds.get(name) or told.get(name, {}).get("kind", "") for name in names],
                "low": [_number(told.get(name, {}).get("low")) for name in names],
                "high": [_number(told.get(name, {}).get("high")) for name in names],
                "missing": [100 * told.get(name, {}).get("missing", 0.0) or float("nan") for name in names],
            },
        )
        self._filling = True
        for label, box in self._typed.items():
            box.value = shlex.join(getattr(choice, label))
        self._filling = False

    def _marked(self) -> list[str]:
        names = self._rows.data["name"]
        return [names[i] for i in self._rows.selected.indices if i < len(names)]

    def _assign(self, to: str) -> None:
        choice, names, marked = self._desk.choice, self._desk.names(), set(self._marked())
        if not marked:
            self._complain("mark one channel or more in the table first")
            return
        held = {role: _fitting(getattr(choice, role), names) - marked for role in ROLES}
        if not (choice.observed or choice.controlled):
            held["observed"] = set(names) - marked
        if to:
            held[to] |= marked
        self._choose({role: patterns(held[role], names) for role in ROLES})

    def _set_kind(self, value: str) -> None:
        names, marked = self._desk.names(), set(self._marked())
        if not marked:
            self._complain("mark one channel or more in the table first")
            return
        held = {kind.value: _fitting(getattr(self._desk.choice, kind.value), names) - marked for kind in Kind}
        if value in held:
            held[value] |= marked
        self._choose({kind: patterns(those, names) for kind, those in held.items()})

    def _take_typed(self) -> None:
        if self._filling:
            return
        try:
            self._choose({role: words(box.value) for role, box in self._typed.items()})
        except InphaseError as error:
            self._complain(error)

    def _choose(self, changed: dict[str, Any]) -> None:
        try:
            check(Choice(**{**vars(self._desk.choice), **changed}), self._desk.names())
        except InphaseError as error:
            self._complain(error)
            return
        self._wrong.visible = False
        self._desk.choose(**changed)

    def _complain(self, what: object) -> None:
        self._wrong.text, self._wrong.visible = as_html(what), True


def _fitting(given: tuple[str, ...], names: tuple[str, ...]) -> set[str]:
    with suppress(InphaseError):
        return fitting(given, names)
    return set()


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
