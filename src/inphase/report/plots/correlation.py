"""How channels, or their basis weights, are believed to move together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from inphase.channels import Role, match
from inphase.errors import OptionError
from inphase.filters import Belief
from inphase.model import Model
from inphase.report.correlation import channel_correlation, weight_correlation
from inphase.report.look import INK, check_matplotlib, verbatim
from inphase.report.plots.panels import Axes, finish, make_panels
from inphase.session import Session

if TYPE_CHECKING:
    from matplotlib.axes import Axes as AnyAxes
    from matplotlib.figure import Figure

NEGATIVE, ZERO, POSITIVE = "#b5482a", "#ffffff", "#0b6e99"
NAMED = 40  # rows whose names can be read
SQUARES = 100  # rows of a Hinton diagram
MOST = 2000  # weights: beyond, a pixel is many of them


def plot_correlation(
    source: Model | Belief | Session,
    *,
    channels: Sequence[str] | str = "*",
    phase: float | None = None,
    weights: bool = False,
    hinton: bool = False,
    axes: Axes = None,
) -> Figure:
    """The correlation of the channels, or of their basis weights, as a matrix.

    source: a model (what demonstrations say), a belief or a session (what is left of it now). phase: of the channels at
    that phase, None over the whole interaction. weights: of the basis weights, feature after feature. hinton: squares
    as large as the correlation is strong, instead of colours alone. A line parts observed from controlled. channels,
    axes: as in `plot_model`. Raises ChannelError, OptionError.
    """
    check_matplotlib()
    belief = None if isinstance(source, Model) else source.belief if isinstance(source, Session) else source
    model = source if isinstance(source, Model) else source.model
    columns = match(channels, model.names)
    if weights:
        if phase is not None:
            raise OptionError("phase=: expected channels, the correlation of weights is the same at every phase")
        features = model.coordinates.features_of(columns)
        count = sum(model.layout.bases[i].size for i in features)
        if count > MOST:
            raise OptionError(f"expected at most {MOST} weights in a figure, got {count}; name some channels")
        correlation = weight_correlation(model, belief, channels)[1]
        names = [model.coordinates.names[i] for i in features for _ in range(model.layout.bases[i].size)]
        observed = sum(model.layout.bases[i].size for i in features if i < model.observed_features)
    else:
        correlation = channel_correlation(model, belief, phase)[np.ix_(columns, columns)]
        names = [model.names[i] for i in columns]
        observed = sum(model.channels[i].role is Role.OBSERVED for i in columns)
    if hinton and len(names) > SQUARES:
        raise OptionError(f"expected at most {SQUARES} rows in a Hinton diagram, got {len(names)}; name some channels")
    figure, (panel,) = make_panels(1, axes)
    if axes is None:
        side = min(8.0, 3.6 + 0.16 * min(len(names), NAMED))
        figure.set_size_inches(side + 0.9, side)
        figure.set_layout_engine("compressed")  # for panels whose shape is fixed
    _draw(panel, correlation, hinton)
    _name(panel, names, weights)
    if 0 < observed < len(names):
        panel.axhline(observed - 0.5, color=INK, lw=1)
        panel.axvline(observed - 0.5, color=INK, lw=1)
    if axes is None:
        finish(figure, [panel])
    return figure


def _draw(panel: AnyAxes, correlation: Float[np.ndarray, "M M"], hinton: bool) -> None:
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LinearSegmentedColormap

    shades = LinearSegmentedColormap.from_list("correlation", [NEGATIVE, ZERO, POSITIVE])
    count = len(correlation)
    shown: Any
    if hinton:
        row, column = (part.ravel() for part in np.indices(correlation.shape))
        half = 0.46 * np.sqrt(np.abs(correlation).ravel())  # the area is what counts
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        squares = np.stack([column, row], axis=1)[:, None] + half[:, None, None] * corners
        shown = PolyCollection(list(squares), cmap=shades, array=np.sign(correlation).ravel(), lw=0)
        shown.set_clim(-1, 1)
        panel.add_collection(shown)
        panel.set_facecolor("#eef0f3")
        for colour, label in ((POSITIVE, "together"), (NEGATIVE, "against each other")):
            panel.plot([], [], "s", color=colour, label=label)
    else:
        shown = panel.imshow(correlation, cmap=shades, vmin=-1, vmax=1, interpolation="nearest")
        panel.figure.colorbar(shown, ax=panel, label="correlation", ticks=[-1, -0.5, 0, 0.5, 1], shrink=0.8)
    panel.set_xlim(-0.5, count - 0.5)
    panel.set_ylim(count - 0.5, -0.5)
    panel.set_aspect("equal")


def _name(panel: AnyAxes, names: Sequence[str], weights: bool) -> None:
    """Names beside rows and above nothing; of weights one for all those of a feature."""
    runs = [(name, len(list(group))) for name, group in groupby(names)] if weights else [(name, 1) for name in names]
    ends = np.cumsum([count for _, count in runs])
    middles = ends - np.array([count for _, count in runs]) / 2 - 0.5
    panel.tick_params(length=0, labelsize=8)
    panel.spines[:].set_visible(False)
    if len(runs) > NAMED:
        panel.set_xticks([])
        panel.set_yticks([])
        panel.set_xlabel(f"{len(runs):,} {'features' if weights else 'channels'}")
        return
    labels = [verbatim(name) for name, _ in runs]
    panel.set_yticks(middles, labels)
    panel.set_xticks(middles, labels, rotation=90 if max(map(len, labels)) > 3 else 0)
    if weights:
        for end in ends[:-1] - 0.5:
            panel.axhline(end, color=INK, lw=0.4, alpha=0.4)
            panel.axvline(end, color=INK, lw=0.4, alpha=0.4)
