"""The try tab: play an episode to the model with one filter or several, side by side; and open the report of a run."""

from __future__ import annotations

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import CheckboxButtonGroup, MultiSelect, Select, Spinner

from inphase.errors import OptionError
from inphase.filters import FILTERS, RECOMMENDED
from inphase.studio.action import Action
from inphase.studio.command import Command
from inphase.studio.desk import Desk
from inphase.studio.report_frame import ReportFrame
from inphase.studio.text import heading, text
from inphase.studio.worker import Outcome


def make_tab(desk: Desk) -> LayoutDOM:
    """The tab, of this desk."""
    return TryTab(desk).layout


class TryTab:
    """What the tab is made of."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._report = ReportFrame(desk)
        self._model = Select(title="Model", sizing_mode="stretch_width")
        self._episode = Select(title="Episode", sizing_mode="stretch_width")
        self._filters = CheckboxButtonGroup(labels=list(FILTERS), active=[list(FILTERS).index(RECOMMENDED)])
        self._seed = Spinner(title="Seed", low=0, step=1, value=0, width=100)
        self._runs = MultiSelect(title="Recorded runs, the newest first", size=5, sizing_mode="stretch_width")
        self._play = Action(desk, "Play", self._played, self._show, with_output=False)
        self._open = Action(desk, "Open the report", self._reported, self._show, with_output=False)
        self._no_runs = text("There is no recorded run (.mcap) in the folder: inphase live writes one.", kind="quiet")
        self._model.on_change("value", lambda name, before, value: desk.choose(model=value))
        self._filters.on_change("active", lambda name, before, value: self._play.refresh())
        for box in (self._episode, self._seed):
            box.on_change("value", lambda name, before, value: self._play.refresh())
        self._runs.on_change("value", lambda name, before, value: self._open.refresh())
        desk.listen("models model recordings episodes", self._list)
        desk.listen("runs", self._list_runs)
        self.layout = column(
            row(
                column(
                    heading("Play an episode to a model"),
                    self._model,
                    self._episode,
                    text("Filters, side by side where there are several:", kind="quiet"),
                    self._filters,
                    self._seed,
                    self._play.layout,
                    css_classes=["half"],
                ),
                column(heading("Look at a run"), self._no_runs, self._runs, self._open.layout, css_classes=["half"]),
                css_classes=["wrap"],
                sizing_mode="stretch_width",
            ),
            self._report.layout,
            sizing_mode="stretch_width",
        )
        self._list()
        self._list_runs()

    def _list(self) -> None:
        """What there is to choose."""
        self._model.options = list(self._desk.contents.models)  # type: ignore[assignment]
        self._model.value = self._desk.choice.model
        episodes = [(file, name) for name, file in self._desk.episodes.items()]
        self._episode.options = episodes  # type: ignore[assignment]
        if self._episode.value not in self._desk.episodes.values():
            self._episode.value = episodes[0][0] if episodes else ""
        self._play.refresh()

    def _list_runs(self) -> None:
        runs = list(self._desk.contents.runs)
        self._runs.options = runs  # type: ignore[assignment]
        self._runs.value = [run for run in self._runs.value if run in runs] or runs[:1]
        self._runs.visible = self._open.layout.visible = bool(runs)
        self._no_runs.visible = not runs
        self._open.refresh()

    def _played(self) -> Command:
        if not self._model.value:
            raise OptionError("there is no model yet: the Train tab makes one")
        if not self._episode.value:
            raise OptionError("there is no episode to play: choose recordings in the Data tab")
        filters = [list(FILTERS)[i] for i in sorted(self._filters.active)]
        if not filters:
            raise OptionError("choose a filter, or several")
        source = str(self._model.value), str(self._episode.value)
        return self._report.command(*source, filter=filters, seed=int(self._seed.value or 0))

    def _reported(self) -> Command:
        if not self._runs.value:
            raise OptionError("choose a run, or several")
        return self._report.command(*self._runs.value)

    def _show(self, outcome: Outcome) -> None:
        """The page that was written; the next is another."""
        if self._report.show(outcome):
            self._play.refresh()
            self._open.refresh()
