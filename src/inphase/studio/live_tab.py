"""The studio's live tab: a run that goes on, as its recording is written."""

from __future__ import annotations

import time

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Button, Div, MultiSelect, Select

from inphase.channels import Role
from inphase.errors import OptionError
from inphase.io import Follower, follow_recording
from inphase.studio import live_words as words
from inphase.studio.action import Action
from inphase.studio.command import Command
from inphase.studio.desk import Desk
from inphase.studio.figures.live import ChannelFigure, EstimateFigure, move, time_range
from inphase.studio.live_window import LiveWindow
from inphase.studio.report_frame import ReportFrame
from inphase.studio.runs import Run, runs
from inphase.studio.text import as_html, heading, text
from inphase.studio.worker import Outcome

PERIOD = 200  # [ms] between two looks at the file
REST = 10  # looks between two at the folder
PATIENCE = 0.02  # of the time, that looking through the folder may take
WINDOWS = ("10 s", "30 s", "60 s", "300 s")
AT_ONCE = 8_000_000  # bytes that one look may read: of a long run they are of several looks
DRAWN = 4  # channels at once
ADVICE = (
    "A run is started at a terminal, by who stands beside the robot: inphase live FILE.toml. Its recording can be "
    "watched here while it is written. The run knows nothing of that: its file is only read."
)


class LiveTab:
    """Attaches to a recording and shows its last seconds; `layout` is what is seen."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._follower: Follower | None = None
        self._name = ""  # of the run it is attached to
        self._window = LiveWindow(_seconds(WINDOWS[1]))
        self._known: tuple[str, ...] = ()  # channels in the chooser
        self._listed = set[str]()  # names of runs that were there
        self._looks, self._rest = 0, REST
        self._runs = Select(
            title="Recording of a run", options=[], sizing_mode="stretch_width", min_width=280, max_width=520
        )
        self._seconds = Select(
            title="Window", value=WINDOWS[1], options=list[str | tuple[str, str]](WINDOWS), width=110
        )
        self._attach = Button(label="Attach", button_type="primary", width=100, align="end")
        self._channels = MultiSelect(
            title=f"Channels (up to {DRAWN})", options=[], size=4, sizing_mode="stretch_width", max_width=520
        )
        self._state, self._figures, self._age = text(), text(), text(kind="quiet")
        self._events, self._summary = _block("events"), _block("summary")
        self._said: dict[int, str] = {}
        times = time_range(self._window.seconds)
        self._times = times
        self._estimates = [
            EstimateFigure(times, "phase", "", "phase", "phase_std", fixed=True),
            EstimateFigure(times, "tempo", "1/s", "phase_velocity", "phase_velocity_std"),
            EstimateFigure(times, "log-likelihood of the samples", "", "log_likelihood", height=150),
        ]
        self._drawn = [ChannelFigure(times) for _ in range(DRAWN)]
        self._shown = ReportFrame(desk)
        self._report = Action(desk, "Make its report", self._report_command, self._made, with_output=False)
        self._plots = column(
            *(each.figure for each in self._estimates),
            self._channels,
            *(each.figure for each in self._drawn),
            sizing_mode="stretch_width",
        )
        self._after = column(self._summary, self._report.layout, self._shown.layout, sizing_mode="stretch_width")
        self._all = column(
            self._state,
            self._figures,
            self._age,
            self._after,
            self._plots,
            heading("Events and troubles, the newest first"),
            self._events,
            sizing_mode="stretch_width",
        )
        self._all.visible = False
        self.layout = column(
            text(ADVICE, kind="quiet"),
            row(self._runs, self._seconds, self._attach, sizing_mode="stretch_width", css_classes=["wrap"]),
            self._all,
            sizing_mode="stretch_width",
        )
        self._attach.on_click(self._toggle)
        self._seconds.on_change("value", lambda attr, old, new: self._reattach())
        self._channels.on_change("value", lambda attr, old, new: self._show())
        self._runs.on_change("value", lambda attr, old, new: self._switch())
        desk.listen("runs", self._list)
        self._list()
        desk.every(self._look, PERIOD)

    # ------------------------------------------------------------------------------------------------ what is attached

    def _list(self) -> None:
        """The recordings of the folder, the newest first."""
        found = runs(self._desk.folder, self._desk.contents.runs)
        options = [(run.name, words.run_label(run)) for run in found]
        if options != self._runs.options:
            self._runs.options = options  # type: ignore[assignment]
        names = [run.name for run in found]
        began = [run.name for run in found if run.running and run.name not in self._listed]
        if self._follower is None and (began or self._runs.value not in names):
            self._runs.value = began[0] if began else _first(found)
        self._listed = set(names)
        self._attach.disabled = not names and not self._follower

    def _toggle(self) -> None:
        if self._follower is None:
            self._follow(self._runs.value or "")
        else:
            self._detach()

    def _switch(self) -> None:
        """Another run was chosen while one is watched."""
        if self._follower is not None and self._runs.value and self._runs.value != self._name:
            self._follow(self._runs.value)

    def _reattach(self) -> None:
        if self._follower is not None:
            self._follow(self._name)

    def _follow(self, name: str) -> None:
        if not name:
            return
        seconds = _seconds(self._seconds.value or WINDOWS[1])
        self._name, self._window = name, LiveWindow(seconds)
        self._follower = follow_recording(self._desk.path(name), last=seconds)
        self._attach.label = "Detach"
        self._shown.clear()
        self._after.visible = False
        self._all.visible = True
        self._report.refresh()
        self._look()

    def _detach(self) -> None:
        """Read no more; what was shown last stays."""
        self._follower = None
        self._attach.label = "Attach"
        self._say(self._state, as_html("Detached: this is what was seen last."), "quiet")
        self._list()

    # ------------------------------------------------------------------------------------------------------- the looks

    def _look(self) -> None:
        """What has come since the last time, and now and then what is in the folder."""
        self._looks += 1
        if self._looks >= self._rest:
            begun = time.monotonic()
            self._desk.look()
            self._list()
            taken = time.monotonic() - begun
            self._looks, self._rest = 0, max(REST, int(1e3 * taken / PATIENCE / PERIOD))
        if self._follower is None:
            return
        news = self._follower.news(AT_ONCE)
        self._window.hear(news, self._follower.channels)
        self._choose()
        told = news.anew or len(news.times) or news.estimates or news.responses or news.commands or news.events
        if told:
            self._show()
        self._speak()

    def _choose(self) -> None:
        """The channels there are, in the chooser; the first controlled ones are drawn unless chosen."""
        names = tuple(channel.name for channel in self._window.channels)
        if names == self._known or not names:
            return
        self._known = names
        ordered = sorted(self._window.channels, key=lambda channel: channel.role is not Role.CONTROLLED)
        self._channels.options = [(channel.name, f"{channel.name} · {channel.role.value}") for channel in ordered]
        controlled = [channel.name for channel in ordered if channel.role is Role.CONTROLLED]
        self._channels.value = (controlled or list(names))[:2]

    def _show(self) -> None:
        """Draw the window."""
        move(self._times, self._window)
        for each in self._estimates:
            each.show(self._window)
        by_name = {channel.name: channel for channel in self._window.channels}
        chosen = [by_name[name] for name in self._channels.value if name in by_name][:DRAWN]
        for i, drawn in enumerate(self._drawn):
            drawn.figure.visible = i < len(chosen)
            if i < len(chosen):
                drawn.show(self._window, chosen[i])
        self._say(self._events, words.events(self._window))

    def _speak(self) -> None:
        """Say how it fares."""
        follower = self._follower
        if follower is None:
            return
        try:
            written = time.time() - follower.path.stat().st_mtime
        except OSError:
            written = 0.0
        said, look = words.state(follower, self._window, written)
        self._say(self._state, as_html(said), look)
        self._say(self._figures, as_html(words.figures(self._window)))
        self._say(self._age, as_html(words.age(follower, self._window, written)))
        self._say(self._summary, words.summary(self._window))
        self._after.visible = follower.ended or bool(follower.trouble)

    def _say(self, where: Div, html: str, look: str = "") -> None:
        """Change what is not the same already."""
        if self._said.get(id(where)) != html + look:
            self._said[id(where)] = html + look
            where.text = html
            if look:
                where.css_classes = ["said", look]

    # ----------------------------------------------------------------------------------------------------- when it ends

    def _report_command(self) -> Command:
        if not self._name:
            raise OptionError("attach to a run first")
        return self._shown.command(self._name)

    def _made(self, outcome: Outcome) -> None:
        """The page that was written; the next is another."""
        if self._shown.show(outcome):
            self._report.refresh()


def make_tab(desk: Desk) -> LayoutDOM:
    """The tab, of this desk."""
    return LiveTab(desk).layout


def _seconds(window: str) -> float:
    return float(window.split()[0])


def _block(name: str) -> Div:
    return Div(disable_math=True, css_classes=["said", name], sizing_mode="stretch_width")


def _first(found: list[Run]) -> str:
    """The one that runs, or the newest."""
    return next((run.name for run in found if run.running), found[0].name if found else "")
