"""The episodes of the chosen recordings in a table, one of them drawn, and what is decided of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bokeh.layouts import column
from bokeh.models.widgets import (
    MultiSelect,
    RadioButtonGroup,
    RangeSlider,
    Select,
    TextInput,
)

from inphase.errors import DataError, OptionError
from inphase.io import Table
from inphase.studio.action import Action
from inphase.studio.command import Command
from inphase.studio.desk import Desk
from inphase.studio.figures.episode import draw_episode, groups
from inphase.studio.quality import Quality, decided
from inphase.studio.table import fill, make_table
from inphase.studio.text import as_html, text
from inphase.studio.worker import Outcome

DRAWN = 4  # groups of channels that are drawn where none was asked for
LEAVE_OUT, CUT, KEEP = "Leave out", "Cut", "As recorded"


class Episodes:
    """The table (`list`) and what there is to see and decide of the chosen one (`layout`).

    noted: told how a decision ended. listeners: told when another is chosen.
    """

    def __init__(self, desk: Desk, quality: Quality, noted: Callable[[Outcome], None]) -> None:
        self._desk, self._quality = desk, quality
        self.listeners: list[Callable[[], None]] = []
        self._file: str | None = None  # of the chosen one
        self.list = make_table(
            {
                "name": ("episode", 130, None),
                "seconds": ("[s]", 50, 2),
                "rate": ("Hz", 50, 1),
                "gap": ("gap [s]", 55, 2),
                "missing": ("missing %", 70, 1),
                "far": ("far off", 55, 1),
                "said": ("", 240, None),
            },
            height=330,
        )
        self._rows: Any = self.list.source
        self._chosen = Select(title="Episode", sizing_mode="stretch_width")
        self._said = text()
        # No MultiChoice: it takes what names hold for markup.
        self._groups = MultiSelect(title="Drawn (Ctrl for several)", size=4, sizing_mode="stretch_width")
        self._figures = column(sizing_mode="stretch_width")
        self._what = RadioButtonGroup(labels=[LEAVE_OUT, CUT, KEEP], active=0)
        self._why = TextInput(title="Why", placeholder="dropped the baton", sizing_mode="stretch_width")
        self._span = RangeSlider(
            title="Used from, until [s]", start=0, end=1, value=(0, 1), sizing_mode="stretch_width", visible=False
        )
        self._note = Action(desk, "Note it", self._command, noted, with_output=False)
        self.layout = column(
            self._chosen,
            self._said,
            self._what,
            self._why,
            self._span,
            self._note.layout,
            self._groups,
            self._figures,
            sizing_mode="stretch_width",
        )
        self._rows.selected.on_change("indices", lambda name, before, value: self._marked(value))
        self._chosen.on_change("value", lambda name, before, value: self._choose())
        self._groups.on_change("value", lambda name, before, value: self._draw())
        self._what.on_change("active", lambda name, before, value: self._decide())
        self._why.on_change("value_input", lambda name, before, value: self._note.refresh())
        self._span.on_change("value", lambda name, before, value: self._note.refresh())
        self._span.on_change("value_throttled", lambda name, before, value: self._draw())

    @property
    def chosen(self) -> str:
        """The name of the chosen episode; empty where there is none."""
        return str(self._chosen.value)

    def show(self) -> None:
        """Fill in what is known now."""
        names = list(self._desk.episodes)
        fill(self.list, self._quality.table())
        if list(self._chosen.options) != names:
            self._chosen.options = names  # type: ignore[assignment]
        if self.chosen not in names:
            self._chosen.value = names[0] if names else ""
        elif self._file != self._desk.episodes[self.chosen]:  # of other recordings, by the same name
            self._choose()
        else:
            self._say()
        self._note.refresh()

    def _marked(self, rows: list[int]) -> None:
        names = self._rows.data["name"]
        if rows and rows[0] < len(names):
            self._chosen.value = names[rows[0]]

    def _choose(self) -> None:
        names = list(self._desk.episodes)
        self._file = self._desk.episodes.get(self.chosen)
        if self.chosen in names:
            self._rows.selected.indices = [names.index(self.chosen)]
        table = self._table()
        if table is not None:
            first, last = float(table.times.min()), float(table.times.max())
            note = self._quality.notes().get(self.chosen)
            end = last if last > first else first + 1.0
            self._span.update(start=first, end=end, step=_step(end - first))
            self._span.value = (
                first if note is None or note.start is None else note.start,
                end if note is None or note.end is None else note.end,
            )
            options = list(groups(table.columns))
            if list(self._groups.options) != options:
                self._groups.options = options  # type: ignore[assignment]
                self._groups.value = options[:DRAWN]
        self._say()
        self._draw()
        self._note.refresh()
        for told in self.listeners:
            told()

    def _table(self) -> Table | None:
        file = self._desk.episodes.get(self.chosen)
        if file is None:
            return None
        try:
            return self._desk.table(file)
        except DataError:
            return None

    def _say(self) -> None:
        """What is known of the chosen one, in words."""
        file = self._desk.episodes.get(self.chosen)
        lines: list[object] = []
        if file is not None:
            try:
                self._desk.table(file)
            except DataError as error:
                lines.append(error)
            known, note = self._quality.episodes.get(self.chosen, {}), self._quality.notes().get(self.chosen)
            lines += [decided(note) if note else "", known.get("verdict", "")]
            if known.get("score") is not None:
                lines.append(
                    f"far off: {known['score']:.1f} robust standard deviations; log-likelihood under the others "
                    f"{known['log_likelihood']:.2f} nat a reading; adds {known['contribution']:+.3f}"
                )
            if known and known["moves"] != [known["start"], known["end"]]:
                lines.append(
                    f"moves from {known['moves'][0]:.2f} s until {known['moves'][1]:.2f} s, idle before or after"
                )
        self._said.text = as_html(*(line for line in lines if line))

    def _draw(self) -> None:
        table = self._table()
        if table is None:
            self._figures.children = []
            return
        by_group = groups(table.columns)
        cut = self._cut() if self._what.active == 1 else self._noted_cut()
        self._figures.children = [
            draw_episode(table, by_group[group], group, cut) for group in self._groups.value if group in by_group
        ]

    def _noted_cut(self) -> tuple[float | None, float | None]:
        note = self._quality.notes().get(self.chosen)
        return (None, None) if note is None else (note.start, note.end)

    def _cut(self) -> tuple[float | None, float | None]:
        """What the slider says; None where it stands at an end."""
        low, high = self._span.value
        return (float(low) if low > self._span.start else None), (float(high) if high < self._span.end else None)

    def _decide(self) -> None:
        self._why.visible, self._span.visible = self._what.active == 0, self._what.active == 1
        self._note.refresh()
        self._draw()

    def _command(self) -> Command:
        if not self.chosen:
            raise OptionError("choose an episode first")
        what = (LEAVE_OUT, CUT, KEEP)[self._what.active or 0]
        if what == KEEP:
            option, said = "keep", self.chosen
        elif what == CUT:
            start, end = self._cut()
            if start is None and end is None:
                raise OptionError("move an end of the slider: nothing is cut yet")
            option, said = "cut", f"{self.chosen}={_time(start)}:{_time(end)}"
        else:
            why = self._why.value_input.strip()
            option, said = "drop", f"{self.chosen}={why}" if why else self.chosen
        choice = self._desk.choice
        return Command.of("inspect", *choice.recordings, options={**choice.columns, option: [said], "json": True})


def _time(time: float | None) -> str:
    return "" if time is None else f"{time:.10g}"


def _step(duration: float) -> float:
    """A round step of which an episode has a few hundred."""
    step = 0.001
    while duration / step > 1000:
        step *= 10
    return step
