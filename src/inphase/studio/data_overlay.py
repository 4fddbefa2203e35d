"""All demonstrations over each other, a channel at a time."""

from __future__ import annotations

from bokeh.layouts import column, row
from bokeh.models.widgets import Button, Select, Spinner

from inphase.errors import InphaseError
from inphase.io import load
from inphase.io.files import episode_names
from inphase.studio.data_episodes import Episodes
from inphase.studio.desk import Desk
from inphase.studio.figures.overlay import Overlay, draw_overlay
from inphase.studio.text import as_html, text

AT_ONCE = 30_000_000  # bytes of recordings that are read without being asked


class OverlayPanel:
    """Which channel, of how many basis functions, and the figure."""

    def __init__(self, desk: Desk, episodes: Episodes) -> None:
        self._desk, self._episodes = desk, episodes
        self._overlay: Overlay | None = None
        self._asked = 0  # for which reading of the recordings: an older one may come late
        self._feature = Select(title="Channel", sizing_mode="stretch_width")
        self._size = Spinner(title="Basis functions of the chosen one", low=3, high=100, step=1, value=20, width=220)
        self._read = Button(label="Read all recordings", visible=False)
        self._said = text(kind="quiet")
        self._figure = column(sizing_mode="stretch_width")
        self.layout = column(
            row(self._feature, self._size, css_classes=["wrap"], sizing_mode="stretch_width"),
            self._read,
            self._said,
            self._figure,
            sizing_mode="stretch_width",
        )
        self._read.on_click(self._load)
        self._feature.on_change("value", lambda name, before, value: self._draw())
        self._size.on_change("value", lambda name, before, value: self._draw())
        episodes.listeners.append(self._draw)

    def update(self, usable: bool) -> None:
        """The recordings are others, or other ones are used; usable: whether they can be read."""
        self._overlay, self._figure.children = None, []
        self._asked += 1
        self._read.visible = False
        if not usable:
            self._say("nothing to draw: the recordings cannot be read together")
            return
        size = sum(self._desk.path(file).stat().st_size for file in self._desk.episodes.values())
        if size > AT_ONCE:
            self._say(f"{size / 1e6:.0f} MB of recordings")
            self._read.visible = True
        else:
            self._load()

    def _load(self) -> None:
        choice, asked = self._desk.choice, self._asked
        source = [self._desk.path(place) for place in choice.recordings]
        kinds = {name: kind for kind in ("angle", "quaternion", "linear") for name in getattr(choice, kind)}
        self._say("reading …")
        self._read.visible = False
        self._desk.worker.think(
            lambda: Overlay.of(load(source, choice.observed, choice.controlled, kinds=kinds)),
            lambda overlay: self._loaded(overlay, asked),
            lambda error: self._say(error),
        )

    def _loaded(self, overlay: Overlay, asked: int) -> None:
        if asked != self._asked:
            return
        self._overlay = overlay
        names = list(overlay.names)
        if list(self._feature.options) != names:
            self._feature.options = names  # type: ignore[assignment]
        if self._feature.value not in names:
            self._feature.value = names[0]
        self._draw()

    def _draw(self) -> None:
        overlay = self._overlay
        if overlay is None or self._feature.value not in overlay.names:
            return
        # Of equal names, that of an episode depends on how its file was called: here they are read by whole paths.
        episodes = self._desk.episodes
        whole = episode_names([self._desk.path(file) for file in episodes.values()])
        called = dict(zip(whole, episodes, strict=True))
        places = [called.get(d.name, d.name) for d in overlay.dataset]
        chosen = places.index(self._episodes.chosen) if self._episodes.chosen in places else None
        try:
            figure = draw_overlay(
                overlay, overlay.names.index(self._feature.value), chosen, int(self._size.value or 20)
            )
        except InphaseError as error:
            self._say(error)
            return
        left_out = "" if chosen is not None else "; the chosen episode is left out"
        self._say(f"{len(places)} demonstrations over phase{left_out}")
        self._figure.children = [figure]

    def _say(self, what: object) -> None:
        self._said.text = as_html(what)
