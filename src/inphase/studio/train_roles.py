"""The roles of channels where training needs them: shown, and changed, as the names or patterns that commands take."""

from __future__ import annotations

import shlex
from functools import partial

from bokeh.models import LayoutDOM
from bokeh.models.widgets import TextInput

from inphase.errors import InphaseError, OptionError
from inphase.studio.desk import Choice, Desk
from inphase.studio.grid import grid
from inphase.studio.roles import check, words
from inphase.studio.text import as_html, text

ROLES = ("observed", "controlled")


class Roles:
    """A field for either partner; what is typed is the desk's choice, and what is chosen elsewhere is shown."""

    def __init__(self, desk: Desk) -> None:
        self._desk, self._filling = desk, False
        self._wrong = text(kind="error")
        self._wrong.visible = False
        self._fields = {
            role: TextInput(title=f"{role.capitalize()} channels: names or patterns", sizing_mode="stretch_width")
            for role in ROLES
        }
        for role, field in self._fields.items():
            field.on_change("value", partial(self._typed, role))
        desk.listen(" ".join(ROLES), self._show)
        self.layout: LayoutDOM = grid([*self._fields.values(), self._wrong])
        self._show()

    def _typed(self, role: str, attr: str, old: str, line: str) -> None:
        if self._filling:
            return
        try:
            changed = {role: words(line)}
            check(Choice(**{**vars(self._desk.choice), **changed}), self._desk.names())
        except InphaseError as error:
            self._wrong.text, self._wrong.visible = as_html(error), True
            return
        self._wrong.visible = False
        self._desk.choose(**changed)

    def _show(self) -> None:
        self._filling = True
        for role, field in self._fields.items():
            field.value = shlex.join(getattr(self._desk.choice, role))
        self._filling = False


def check_ready(choice: Choice) -> None:
    """Raise OptionError, which says what to do, unless there are recordings and channels of either partner."""
    if not choice.recordings:
        raise OptionError(
            "expected recordings to learn from: put some into the folder, and choose them on the Data tab"
        )
    for role in ROLES:
        if not getattr(choice, role):
            raise OptionError(f"expected {role} channels: name them above, or mark them on the Data tab")
