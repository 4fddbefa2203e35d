"""The correlation of channels, which opens into that of the basis weights of a chosen pair."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Select
from jaxtyping import Float

from inphase.model import Model
from inphase.report.correlation import channel_correlation, weight_correlation
from inphase.studio.details import details
from inphase.studio.figures.hinton import draw_hinton, squares_of
from inphase.studio.grid import grid


class Correlations:
    """The matrix of some channels beside that of two channels' weights; channels: which, by their places."""

    def __init__(self, model: Model, channels: Sequence[int]) -> None:
        self._model = model
        self._names = [model.names[i] for i in channels]
        between = channel_correlation(model)[np.ix_(channels, channels)]
        first, second = strongest(model, channels, between)
        figure = draw_hinton("Channels", self._names, self._names, between)
        self._squares = squares_of(figure)
        options: list[str | tuple[str, str]] = [(name, name) for name in self._names]
        self._first = Select(title="Weights of", options=options, value=self._names[first], width=170)
        self._second = Select(title="With those of", options=options, value=self._names[second], width=170)
        self._weights = column(sizing_mode="stretch_width")
        for choice in (self._first, self._second):
            choice.on_change("value", lambda attr, old, new: self._open())
        self._squares.selected.on_change("indices", lambda attr, old, new: self._tapped(new))
        rows = [
            [self._names[i], self._names[j], float(between[i, j])]
            for i, j in sorted(combinations(range(len(channels)), 2), key=lambda pair: -abs(between[pair]))
        ]
        self.layout: LayoutDOM = grid(
            [
                column(
                    figure,
                    details("pairs of channels in a table, the strongest first", ["channel", "with", "r"], rows),
                    sizing_mode="stretch_width",
                ),
                column(row(self._first, self._second), self._weights, sizing_mode="stretch_width"),
            ],
            narrowest=420,
        )
        self._open()

    def _tapped(self, squares: Sequence[int]) -> None:
        if squares:
            row, column = (int(self._squares.data[name][squares[0]]) for name in ("row", "column"))
            self._first.value, self._second.value = self._names[row], self._names[column]

    def _open(self) -> None:
        first, second = self._first.value, self._second.value
        rows, columns, between = weights_of_pair(self._model, first, second)
        order = np.argsort(-np.abs(between), axis=None, kind="stable")
        at = [(int(i), int(j)) for i, j in zip(*np.unravel_index(order, between.shape), strict=True)]
        listed = [[rows[i], columns[j], float(between[i, j])] for i, j in at]
        figure = draw_hinton("Basis weights", rows, columns, between)
        self._weights.children = [
            figure,
            details(
                f"weights of {first} and {second} in a table, the strongest first", ["weight", "with", "r"], listed
            ),
        ]


def strongest(model: Model, channels: Sequence[int], between: Float[np.ndarray, "M M"]) -> tuple[int, int]:
    """The places of the observed and the controlled channel that say most of each other, of those shown."""
    count = len(model.observed)
    seen = np.array([i < count for i in channels])
    across = np.abs(between) * (seen[:, None] & ~seen[None, :])
    if not across.any():
        return 0, len(channels) - 1
    first, second = np.unravel_index(int(across.argmax()), across.shape)
    return int(first), int(second)


def weights_of_pair(model: Model, first: str, second: str) -> tuple[list[str], list[str], Float[np.ndarray, "R C"]]:
    """Names of the first channel's weights (R,) and of the second's (C,), and how they correlate (R, C).

    Parts of one quaternion share their features, and so their weights.
    """
    features = [list(model.coordinates.features_of([model.names.index(name)])) for name in (first, second)]
    together = sorted({*features[0], *features[1]})
    names, between = weight_correlation(model, channels=[first, second])
    of = np.repeat(together, [model.layout.bases[f].size for f in together])
    rows, columns = (np.flatnonzero(np.isin(of, own)) for own in features)
    return [names[i] for i in rows], [names[i] for i in columns], between[np.ix_(rows, columns)]
