"""Basis functions and their sum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inphase.basis import Basis
from inphase.channels import match
from inphase.errors import OptionError, listing
from inphase.model import Model
from inphase.report.look import COLOURS, INK, plain, verbatim
from inphase.report.plots.panels import MOST, Axes, finish, label_x, make_panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PHASES = 400
NAMED = 3  # features in a title


def plot_basis(
    basis: Basis | Model, *, channels: Sequence[str] | str | None = None, total: bool = True, axes: Axes = None
) -> Figure:
    """The basis functions over phase, and their sum (2.3.1); of a model one panel for each basis that features share.

    channels: of a model, names or patterns: only their bases. total: draw the sum. axes: as in `plot_model`, one a
    basis. Raises ChannelError, OptionError.
    """
    bases = _bases_of(basis, channels) if isinstance(basis, Model) else {basis: []}
    if channels is not None and not isinstance(basis, Model):
        raise OptionError("channels=: expected a model, a basis knows none")
    if len(bases) > MOST:
        raise OptionError(f"expected at most {MOST} different bases in a figure, got {len(bases)}; name some channels")
    figure, panels = make_panels(len(bases), axes)
    phases = np.linspace(0, 1, PHASES)
    for (one, names), panel in zip(bases.items(), panels, strict=True):
        values = one(phases)
        for i, curve in enumerate(values.T):
            panel.plot(phases, curve, color=COLOURS[i % len(COLOURS)], lw=1.2)
        if total:
            panel.plot(phases, values.sum(1), color=INK, lw=1.4, ls="--", label="sum")
        family = type(one).__name__
        panel.set_title(verbatim(f"{listing(names, NAMED)}: {family}" if names else family), fontsize=10)
        panel.set_xlim(0, 1)
        plain(panel)
    label_x(panels, "phase")
    if axes is None:
        finish(figure, panels)
    return figure


def _bases_of(model: Model, channels: Sequence[str] | str | None) -> dict[Basis, list[str]]:
    """The different bases, and the features that have them."""
    columns = range(len(model.channels)) if channels is None else match(channels, model.names)
    found: dict[Basis, list[str]] = {}
    for i in model.coordinates.features_of(columns):
        found.setdefault(model.layout.bases[i], []).append(model.coordinates.names[i])
    return found
