"""Basis functions over phase, as a model would have them."""

from __future__ import annotations

import numpy as np
from bokeh.plotting import figure as Figure

from inphase.basis import Basis
from inphase.studio.figures.look import MEAN, new_figure

PHASES = 201
WIDEST = 760  # [px]


def draw_basis(title: str, basis: Basis) -> Figure:
    """Every function of a basis over phase."""
    phases = np.linspace(0, 1, PHASES)
    values = basis(phases)
    figure = new_figure(title, "phase", height=170, max_width=WIDEST, x_range=(0, 1))
    figure.multi_line([phases.tolist()] * basis.size, values.T.tolist(), color=MEAN, line_width=1.2, line_alpha=0.8)
    return figure
