"""The data tab: which recordings, whose channels, how good each episode is, and what all of them look like."""

from __future__ import annotations

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Select

from inphase.studio.action import Action
from inphase.studio.command import Command
from inphase.studio.data_channels import Channels
from inphase.studio.data_episodes import Episodes
from inphase.studio.data_overlay import OverlayPanel
from inphase.studio.desk import Desk
from inphase.studio.quality import Quality
from inphase.studio.text import heading, text
from inphase.studio.worker import Outcome

ALL = "*"  # no folder is called so


def make_tab(desk: Desk) -> LayoutDOM:
    """The tab, of this desk."""
    return DataTab(desk).layout


class DataTab:
    """What the tab is made of."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
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
        if self._desk.episodes:
            self._look.rerun()

    def _looked(self, outcome: Outcome) -> None:
        self._quality.read(outcome.output)
        self._show()
        self._overlay.update(outcome.fine)

    def _noted(self, outcome: Outcome) -> None:
        """A decision was noted, and what is left was looked at."""
        self._looked(outcome)
        if self._look.running:  # it has begun before, and would tell what no longer holds
            self._look.rerun()
        else:
            self._look.show(outcome)

    def _show(self) -> None:
        self._episodes.show()
        self._channels.show()
        self._summary.text = text(*(part for part in (self._quality.error, *self._quality.summary) if part)).text


def _named(place: str) -> str:
    return "this folder" if place == "." else place
