"""The data tab: which recordings, whose channels, how good each episode is, and what all of them look like."""

from __future__ import annotations

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Select

from inphase.io.notes import NOTES
from inphase.studio.action import Action
from inphase.studio.command import Command
from inphase.studio.data_channels import Channels
from inphase.studio.data_episodes import Episodes
from inphase.studio.data_overlay import OverlayPanel
from inphase.studio.desk import Desk
from inphase.studio.memory import Key
from inphase.studio.quality import Quality
from inphase.studio.text import as_html, heading, text
from inphase.studio.worker import Outcome

ALL = "*"  # no folder is called so


def make_tab(desk: Desk) -> LayoutDOM:
    """The tab, of this desk."""
    return DataTab(desk).layout


class DataTab:
    """What the tab is made of."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._state: Key | None = None
        self._quality = Quality(desk)
        self._source = Select(title="Recordings", sizing_mode="stretch_width")
        self._nothing = text(kind="quiet")
        self._summary = text()
        self._look = Action(desk, "Look once more", self._command, self._looked, with_output=False)
        self._episodes = Episodes(desk, self._quality, self._noted)
        self._channels = Channels(desk, self._quality)
        self._overlay = OverlayPanel(desk, self._episodes)
        self._source.on_change("value", self._chosen)
        desk.listen("episodes", self._list)
        desk.listen("episodes recordings observed controlled angle quaternion linear", self._again)
        self._parts = column(
            row(
                column(
                    heading("Episodes"),
                    self._look.layout,
                    self._summary,
                    column(self._episodes.list, css_classes=["scroll"], sizing_mode="stretch_width"),
                    css_classes=["half"],
                ),
                column(heading("Channels"), self._channels.layout, css_classes=["half"]),
                css_classes=["wrap"],
                sizing_mode="stretch_width",
            ),
            row(
                column(heading("This episode"), self._episodes.layout, css_classes=["half"]),
                column(heading("All over each other"), self._overlay.layout, css_classes=["half"]),
                css_classes=["wrap"],
                sizing_mode="stretch_width",
            ),
            sizing_mode="stretch_width",
        )
        self.layout = column(self._source, self._nothing, self._parts, sizing_mode="stretch_width")
        self._list()
        self._channels.settle()
        self._again()

    def _list(self) -> None:
        """What there is to choose."""
        places = self._desk.contents.episodes
        options = [(place, f"{_named(place)} ({len(files)})") for place, files in places.items()]
        if len(places) > 1:
            options.append((ALL, f"all of them ({sum(map(len, places.values()))})"))
        self._source.options = options  # type: ignore[assignment]
        chosen = self._desk.choice.recordings
        if not set(chosen) <= set(places) or not chosen:
            chosen = tuple(places)[:1]
            self._desk.choose(recordings=chosen)
        self._source.value = ALL if len(chosen) > 1 else "".join(chosen)
        self._source.visible = self._parts.visible = bool(places)
        self._nothing.visible = not places
        self._nothing.text = text(
            f"There is no recording in {self._desk.folder}, nor below it: expected .csv or .npz files, an episode "
            "a file. Put some there, or end the studio and start it elsewhere: inphase studio FOLDER"
        ).text

    def _chosen(self, name: str, before: str, value: str) -> None:
        places = tuple(self._desk.contents.episodes)
        if value == ALL or value in places:
            self._desk.choose(recordings=places if value == ALL else (value,))
            self._channels.settle()

    def _command(self) -> Command:
        return Command.of("inspect", *self._desk.choice.recordings, options={**self._desk.choice.columns, "json": True})

    def _again(self) -> None:
        """Look at what is chosen now."""
        self._quality.read("")
        self._show()
        self._look.refresh()
        if not self._desk.episodes:
            return
        self._state = self._key()
        known = self._desk.memory.get(self._state)
        if known is None:
            self._look.rerun()
        else:
            self._look.stop()
            self._told(known, True)

    def _key(self) -> Key:
        """What the look goes by: the command, the recordings, and the notes beside them."""
        notes = [f"{place}/{NOTES}" for place in self._desk.choice.recordings]
        files = [self._desk.path(file) for file in [*self._desk.episodes.values(), *notes]]
        return self._desk.memory.key(self._command(), files)

    def _looked(self, outcome: Outcome) -> None:
        if outcome.stopped:
            return
        if outcome.fine and self._state == self._key():  # nothing has changed meanwhile
            self._desk.memory.keep(self._state, outcome.output)
        self._told(outcome.output, outcome.fine)

    def _told(self, output: str, fine: bool) -> None:
        self._quality.read(output)
        self._show()
        self._overlay.update(fine)

    def _noted(self, outcome: Outcome) -> None:
        """A decision was noted, and what is left was looked at."""
        self._told(outcome.output, outcome.fine)
        if self._look.running:  # it has begun before, and would tell what no longer holds
            self._state = self._key()
            self._look.rerun()
        else:
            self._look.show(outcome)

    def _show(self) -> None:
        self._episodes.show()
        self._channels.show()
        self._summary.text = as_html(*self._quality.summary)


def _named(place: str) -> str:
    return "this folder" if place == "." else place
