"""How far every feature goes in the unit of the model, where the widest of its group is 1 long (4.2.5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.models.annotations import Span
from bokeh.plotting import figure as Figure
from jaxtyping import Float

from inphase.channels import Kind
from inphase.model import Model
from inphase.studio.figures.look import FAINT, MEAN, name_rows, new_figure, tips

ROW, EDGE = 20, 75  # [px] high: a feature, and what stands above and below
WIDEST = 760  # [px]
PHASES, MOST = 51, 30  # of the demonstrations that are looked at


@dataclass(frozen=True)
class Group:
    """Features that are scaled together. low, high: from where to where they go; span: what becomes 1 long."""

    name: str
    unit: str
    channels: tuple[str, ...]
    low: float
    high: float
    span: float


def groups_of(model: Model) -> list[Group]:
    """The groups of a model in their order, as its card has them; the unit of quaternions is [rad]."""
    features, scaling, found = model.coordinates, model.scaling, []
    for name in dict.fromkeys(features.groups):
        members = [f for f, group in enumerate(features.groups) if group == name]
        channels = [model.channels[i] for i in sorted({i for f in members for i in features.channel_of[f]})]
        turns = any(channel.kind is Kind.QUATERNION for channel in channels)
        unit = "rad" if turns else " or ".join(dict.fromkeys(channel.unit for channel in channels if channel.unit))
        low, high, span = scaling.low[members].min(), scaling.high[members].max(), scaling.span[members].max()
        names = tuple(channel.name for channel in channels)
        found.append(Group(name, unit, names, float(low), float(high), float(span)))
    return found


def scaled_ranges(model: Model, features: Sequence[int]) -> tuple[Float[np.ndarray, " M"], Float[np.ndarray, " M"]]:
    """(M,) lowest and (M,) highest that the bases make of the demonstrations, in the unit of the model."""
    samples = model.prior.samples
    picked = samples[np.unique(np.linspace(0, len(samples) - 1, MOST).round().astype(int))]
    phases = np.linspace(0, 1, PHASES)
    curves = model.layout.predict_each(np.tile(phases, (len(picked), 1)), picked, np.asarray(features, dtype=np.int64))
    return curves.min(axis=(0, 1)), curves.max(axis=(0, 1))


def draw_ranges(model: Model, features: Sequence[int]) -> Figure:
    """A bar a feature from its lowest to its highest, the features of a group beside each other.

    features: (M,) increasing indices of those shown.
    """
    groups = [model.coordinates.groups[f] for f in features]
    order = sorted(range(len(features)), key=lambda i: (groups.index(groups[i]), i))
    low, high = (values[order] for values in scaled_ranges(model, features))
    names = [model.coordinates.names[features[i]] for i in order]
    figure = new_figure(
        "Ranges, scaled by group",
        "1: the longest way in the group",
        height=ROW * len(names) + EDGE,
        max_width=WIDEST,
        y_range=(len(names) - 0.4, -0.6),
    )
    span = model.scaling.span
    source = ColumnDataSource(
        {
            "row": np.arange(len(names)),
            "low": low,
            "high": high,
            "name": names,
            "group": [groups[i] for i in order],
            "span": [f"{span[features[i]]:.4g}" for i in order],
        }
    )
    for edge in (0, 1):
        figure.add_layout(Span(location=edge, dimension="height", line_color=FAINT, line_dash="dashed"))
    bars = figure.hbar(y="row", left="low", right="high", height=0.55, source=source, color=MEAN, fill_alpha=0.7)
    shown = {"": "name", "scaled with": "group", "1 is, in its unit": "span", "from": "low", "to": "high"}
    figure.add_tools(HoverTool(renderers=[bars], tooltips=tips(shown)))
    name_rows(figure.yaxis[0], names)
    figure.ygrid.visible = False
    return figure
