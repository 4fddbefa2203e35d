"""All demonstrations over each other, the chosen one in front with what basis functions make of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Range1d
from bokeh.plotting import figure as Figure
from jaxtyping import Float

from inphase.basis import Gaussian, Layout
from inphase.basis.fit import fit_weights
from inphase.preprocess.coordinates import Coordinates
from inphase.studio.figures.extent import extent
from inphase.studio.figures.look import FAINT, LEGEND, MARK, MEAN, labelled, new_figure, tips
from inphase.trajectory import Dataset

PHASES = 201
MOST = 60  # demonstrations that are drawn: more would be a grey block


@dataclass(frozen=True, eq=False)
class Overlay:
    """A data set in the features that are learned: angles and quaternions unwrapped, from the mean of all [rad].

    curves: (T, F) a demonstration.
    """

    dataset: Dataset
    coordinates: Coordinates
    curves: tuple[Float[np.ndarray, "_ F"], ...]

    @classmethod
    def of(cls, dataset: Dataset) -> Overlay:
        """Of a data set; raises DataError where it has no such features."""
        coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
        return cls(dataset, coordinates, tuple(coordinates.from_channels(d.values) for d in dataset))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the features."""
        return self.coordinates.names

    def approximation(self, feature: int, demonstration: int, size: int) -> Float[np.ndarray, " P"]:
        """What so many Gaussian basis functions make of it (2.3.1), at phases evenly from 0 to 1."""
        layout = Layout((Gaussian(size),))
        phases = [d.phases for d in self.dataset]
        values = [curve[:, [feature]] for curve in self.curves]
        weights, _ = fit_weights(layout, phases, values, names=[self.names[feature]])
        return layout.predict(np.linspace(0, 1, PHASES), weights[demonstration])[:, 0]


def draw_overlay(overlay: Overlay, feature: int, chosen: int | None, size: int) -> Figure:
    """One feature of all demonstrations over phase."""
    channels = overlay.coordinates.channel_of[feature]
    unit = "rad" if len(channels) > 1 else overlay.dataset.channels[channels[0]].unit
    name = overlay.names[feature]
    figure = new_figure(labelled(name, unit), "phase", height=300, tools="xpan,xwheel_zoom,reset")
    others = [i for i in _picked(len(overlay.dataset)) if i != chosen]
    data: dict[str, Sequence[object]] = {
        "x": [overlay.dataset[i].phases for i in others],
        "y": [overlay.curves[i][:, feature] for i in others],
        "name": [overlay.dataset[i].name for i in others],
    }
    lines = figure.multi_line("x", "y", source=ColumnDataSource(data), color=FAINT, alpha=0.55, line_width=1)
    figure.add_tools(HoverTool(renderers=[lines], tooltips=tips({"episode": "name"})))
    if chosen is not None and np.isfinite(overlay.curves[chosen][:, feature]).any():
        demonstration = overlay.dataset[chosen]
        figure.line(
            demonstration.phases, overlay.curves[chosen][:, feature], color=MEAN, line_width=2.4, legend_label="chosen"
        )
        figure.line(
            np.linspace(0, 1, PHASES),
            overlay.approximation(feature, chosen, size),
            color=MARK,
            line_width=2,
            line_dash="dashed",
            legend_label=f"by {size} basis functions",
        )
        figure.legend.orientation, figure.legend.background_fill_alpha = "horizontal", 0
        figure.legend.border_line_color, figure.legend.label_text_font_size = None, "11px"
        figure.legend.label_text_color = LEGEND
        figure.add_layout(figure.legend[0], "below")
    figure.x_range, figure.y_range = Range1d(start=0, end=1), extent(curve[:, feature] for curve in overlay.curves)
    return figure


def _picked(count: int) -> list[int]:
    return [int(i) for i in np.unique(np.linspace(0, count - 1, min(count, MOST)).round())]
