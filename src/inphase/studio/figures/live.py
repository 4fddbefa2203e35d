"""Figures of a run that goes on: made once, and given other numbers as it goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import BasicTicker, ColumnDataSource, Range1d
from bokeh.models.annotations import Legend, LegendItem, Span
from bokeh.plotting import figure as Figure

from inphase.channels import Channel
from inphase.studio.figures.look import FAINT, LEGEND, MARK, MEAN, PLUS, labelled, new_figure
from inphase.studio.live_window import Course, LiveWindow
from inphase.studio.text import plain

NINETY = 1.6449  # standard deviations on either side that hold 90 % of a Gaussian
AHEAD = 0.25  # of the window, how far beyond now is drawn


def time_range(seconds: float) -> Range1d:
    """The range of time that all figures of a window share."""
    return Range1d(start=-seconds, end=AHEAD * seconds)


def move(times: Range1d, window: LiveWindow) -> None:
    """Have the newest sample stand where it stood, and nothing beyond it once the run has ended."""
    now, ahead = window.now, AHEAD * window.seconds
    if window.report is not None:
        ahead = 0.02 * min(now, window.seconds)
    times.start, times.end = max(now - window.seconds, -0.02 * min(now + ahead, window.seconds)), now + ahead


class EstimateFigure:
    """One part of the estimates, with its 90 % band where it has a standard deviation; events are dotted lines."""

    def __init__(
        self, times: Range1d, title: str, unit: str, value: str, std: str = "", fixed: bool = False, height: int = 180
    ) -> None:
        self._value, self._std, self._fixed = value, std, fixed
        self._range = Range1d(start=-0.05, end=1.05)
        self._band, self._line = _source("x low high"), _source("x y")
        self._events = ColumnDataSource({"x": []})
        self.figure = new_figure(labelled(title, unit), "time [s]", height=height, x_range=times, y_range=self._range)
        self.figure.yaxis.ticker = BasicTicker(desired_num_ticks=4)
        self.figure.varea("x", "low", "high", source=self._band, color=MEAN, alpha=0.25)
        self.figure.line("x", "y", source=self._line, color=MEAN, line_width=2)
        self.figure.vspan("x", source=self._events, color=MARK, line_dash="dotted", line_alpha=0.7)
        self._now = _now_line(self.figure)

    def show(self, window: LiveWindow) -> None:
        """Draw the window as it is now."""
        times, estimates = window.estimates
        mean = np.array([getattr(estimate, self._value) for estimate in estimates], dtype=np.float64)
        std = np.array([getattr(estimate, self._std, np.nan) for estimate in estimates], dtype=np.float64)
        course = Course(times, mean, std)
        self._band.data, self._line.data = _band(course), _line(course)
        if not self._fixed:
            _fit(self._range, [course], [course])
        begin = window.begin or 0.0
        self._events.data = {"x": np.array([event.time - begin for event in window.events], dtype=np.float64)}
        self._now.location = window.now


class ChannelFigure:
    """One channel: what was read and sent and what the responses said, and from now on what the newest says."""

    def __init__(self, times: Range1d) -> None:
        self._range = Range1d(start=0.0, end=1.0)
        self._sources = {
            name: _source("x low high" if "band" in name else "x y")
            for name in ("past", "past band", "ahead", "ahead band", "sent", "read")
        }
        self.figure = new_figure("", "time [s]", height=250, x_range=times, y_range=self._range)
        self.figure.varea("x", "low", "high", source=self._sources["past band"], color=MEAN, alpha=0.15)
        self.figure.varea("x", "low", "high", source=self._sources["ahead band"], color=MEAN, alpha=0.3)
        drawn = {
            "read": self._line("read", color=FAINT, line_width=3),
            "response when made, 90 %": self._line("past", color=MEAN, line_width=1.5, line_dash="dashed"),
            "newest response, 90 %": self._line("ahead", color=MEAN, line_width=2.5),
            "sent": self._line("sent", color=PLUS, line_width=2, line_dash="dotdash"),
        }
        self._now = _now_line(self.figure)
        legend = Legend(
            items=[LegendItem(label=label, renderers=[line]) for label, line in drawn.items()],
            orientation="horizontal",
            ncols=2,
            label_text_font_size="11px",
            label_text_color=LEGEND,
            background_fill_alpha=0.0,
            border_line_color=None,
            margin=2,
            spacing=4,
            glyph_width=24,
        )
        self.figure.add_layout(legend, "below")

    def _line(self, name: str, **look: Any) -> Any:
        return self.figure.line("x", "y", source=self._sources[name], **look)

    def show(self, window: LiveWindow, channel: Channel) -> None:
        """Draw that channel of the window as it is now."""
        title = f"{labelled(channel.name, channel.unit)} · {channel.role.value}"
        if self.figure.title.text.text != title:  # type: ignore[union-attr]
            self.figure.title.text = plain(title)  # type: ignore[union-attr]
        name = channel.name
        past, ahead = window.course(name), window.response(name)
        seen = ahead.times <= window.now + AHEAD * window.seconds
        ahead = Course(ahead.times[seen], ahead.mean[seen], ahead.std[seen])
        sent, read = window.sent(name), window.read(name)
        _fit(self._range, [past, ahead, sent, read], [past, ahead])
        data = {
            "past": _line(past),
            "past band": _band(past),
            "ahead": _line(ahead),
            "ahead band": _band(ahead),
            "sent": _line(sent),
            "read": _line(read),
        }
        for part, columns in data.items():
            self._sources[part].data = columns
        self._now.location = window.now


def _source(columns: str) -> ColumnDataSource:
    return ColumnDataSource({name: np.zeros(0) for name in columns.split()})


def _line(course: Course) -> Mapping[str, Any]:
    return {"x": course.times, "y": _finite(course.mean)}


def _band(course: Course) -> Mapping[str, Any]:
    """What holds nine of ten; no band where nothing is known."""
    known = np.isfinite(course.mean) & np.isfinite(course.std)
    times, mean, reach = course.times[known], course.mean[known], NINETY * course.std[known]
    return {"x": times, "low": mean - reach, "high": mean + reach}


def _finite(values: Any) -> Any:
    return np.where(np.isfinite(values), values, np.nan)


def _fit(values: Range1d, lines: Sequence[Course], bands: Sequence[Course]) -> None:
    """Have all lines seen, and of the bands as much as leaves the lines half of the height."""
    low, high = _extent([course.mean for course in lines])
    if low > high:  # nothing is drawn
        return
    room = max((high - low) / 2, 1e-3 * max(abs(low), abs(high)), 1e-6)
    edges = [course.mean + sign * NINETY * course.std for course in bands for sign in (-1, 1)]
    widest = _extent(edges)
    values.start = max(min(low, widest[0]), low - room) - 0.1 * room
    values.end = min(max(high, widest[1]), high + room) + 0.1 * room


def _extent(values: Sequence[Any]) -> tuple[float, float]:
    """The lowest and the highest; infinity and less where nothing is known."""
    known = [found for each in values if len(found := each[np.isfinite(each)])]
    return min((float(v.min()) for v in known), default=np.inf), max((float(v.max()) for v in known), default=-np.inf)


def _now_line(on: Figure) -> Span:
    now = Span(location=0.0, dimension="height", line_color=FAINT, line_width=1)
    on.add_layout(now)
    return now
