"""A report in the studio: where the next one is written, and the frame in which the last one is shown."""

from __future__ import annotations

import secrets
from html import escape
from pathlib import Path

from bokeh.models.widgets import Div

from inphase.studio.command import Command, Value
from inphase.studio.desk import Desk
from inphase.studio.worker import Outcome


class ReportFrame:
    """Shows a page that `inphase report` wrote; the page can reach nothing of the studio.

    layout: the frame, which is empty until there is a page.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._shown: Path | None = None
        self._next = self._new_page()
        self.layout = Div(disable_math=True, sizing_mode="stretch_width", css_classes=["report"])

    def command(self, *sources: str, **options: Value) -> Command:
        """`inphase report` of these, to be shown here."""
        return Command.of("report", *sources, options={**options, "o": str(self._next)})

    def show(self, outcome: Outcome) -> bool:
        """Show what such a command wrote, in the place of the page before; returns whether there is a page."""
        page = Path(outcome.command.arguments[-1])
        if not (outcome.fine and page.is_file()):
            return False
        if self._shown is not None:
            self._shown.unlink(missing_ok=True)
        self._shown, self._next = page, self._new_page()
        address = escape(self._desk.address_of(page), quote=True)
        self.layout.text = (
            f'<p><a href="{address}" target="_blank" rel="noopener">open it in a tab of its own</a></p>'
            f'<iframe src="{address}" title="report" sandbox="allow-scripts allow-downloads"></iframe>'
        )
        return True

    def clear(self) -> None:
        """Show nothing."""
        self.layout.text = ""

    def _new_page(self) -> Path:
        return self._desk.pages / f"report-{secrets.token_hex(4)}.html"
