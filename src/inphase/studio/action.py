"""A command that can be run from the page: shown before, its progress while it runs, and how it ended."""

from __future__ import annotations

import json
from collections.abc import Callable
from html import escape

from bokeh.layouts import column, row
from bokeh.models import CustomJS
from bokeh.models.widgets import Button, Div

from inphase.errors import InphaseError
from inphase.studio.command import Command
from inphase.studio.desk import Desk
from inphase.studio.text import as_html, text, typed
from inphase.studio.worker import Job, Outcome

LAST = 60  # lines of what a command says that are shown


class Action:
    """A panel: the command line, a button that runs it, one that stops it, and what came of it.

    build: the command as the page stands, asked by `refresh`; an InphaseError it raises is shown instead, and there is
    nothing to run. done: told how it ended. with_output: whether what it prints is shown, rather than only its errors.
    """

    def __init__(
        self,
        desk: Desk,
        label: str,
        build: Callable[[], Command],
        done: Callable[[Outcome], None] = lambda outcome: None,
        with_output: bool = True,
    ) -> None:
        self._desk, self._build, self._done, self._with_output = desk, build, done, with_output
        self._command: Command | None = None
        self._job: Job | None = None
        self._again = False
        self._line = Div(disable_math=True, css_classes=["command"], sizing_mode="stretch_width")
        self._copy = Button(label="Copy", css_classes=["copy"], width=70)
        self._start = Button(label=label, button_type="primary")
        self._stop = Button(label="Stop", visible=False)
        self._bar = Div(disable_math=True, visible=False, sizing_mode="stretch_width")
        self._outcome = text()
        self._outcome.visible = False
        self._start.on_click(self.run)
        self._stop.on_click(self.stop)
        self.layout = column(
            row(self._copy, self._line, sizing_mode="stretch_width"),
            row(self._start, self._stop),
            self._bar,
            self._outcome,
            sizing_mode="stretch_width",
            css_classes=["action"],
        )
        self.refresh()

    @property
    def command(self) -> Command | None:
        """What is shown, and is run next."""
        return self._command

    def refresh(self) -> None:
        """Show the command as the page stands now."""
        try:
            self._command = self._build()
        except InphaseError as error:
            self._command = None
            self._line.text = as_html(error)
        else:
            self._line.text = typed(self._command.shown)
            self._copy.js_event_callbacks = {}
            self._copy.js_on_click(CustomJS(code=f"navigator.clipboard.writeText({_as_js(self._command.shown)})"))
        self._copy.visible = self._command is not None
        self._start.disabled = self._command is None or self._job is not None

    @property
    def running(self) -> bool:
        """Whether it runs now."""
        return self._job is not None

    def run(self) -> None:
        """Run what is shown."""
        if self._command is None or self._job is not None:
            return
        self._outcome.visible = False
        self._job = self._desk.worker.run(self._command, self._ended, self._progress)
        self._start.disabled, self._stop.visible = True, True
        self._progress(self._job)

    def rerun(self) -> None:
        """Run what is shown; what runs already is stopped first."""
        if self._job is None:
            self.run()
        else:
            self._again = True
            self._job.stop()

    def stop(self) -> None:
        """Stop it, if it runs."""
        self._again = False
        if self._job is not None:
            self._job.stop()

    def _progress(self, job: Job) -> None:
        value = "" if job.share is None else f' value="{job.share:.3f}"'
        percent = "" if job.share is None else f" {100 * job.share:.0f} %"
        doing = escape(job.doing or "running")
        self._bar.text = f'<label>{doing} …{percent} <progress max="1"{value}></progress></label>'
        self._bar.visible = True

    def _ended(self, outcome: Outcome) -> None:
        self._job = None
        self._stop.visible = self._bar.visible = False
        again, self._again = self._again, False
        self._desk.look()
        self.refresh()
        if again:
            self.run()
        else:
            self.show(outcome)
            self._done(outcome)

    def show(self, outcome: Outcome) -> None:
        """Show how it ended."""
        said = "\n".join([*(outcome.output if self._with_output else "").splitlines(), *outcome.said.splitlines()])
        lines = said.splitlines()
        head = outcome.error or "done"
        shown = "\n".join(lines[-LAST:]) if lines and lines != [outcome.error] else ""
        if shown and len(lines) > LAST:
            shown = f"… {len(lines) - LAST} lines before\n{shown}"
        self._outcome.text = as_html(head) + (f"<pre>{escape(shown)}</pre>" if shown else "")
        self._outcome.css_classes = ["said", "fine" if outcome.fine else "error"]
        self._outcome.visible = True


def _as_js(value: str) -> str:
    """A string of JavaScript."""
    return json.dumps(value)
