"""What a model believes: expected movements, ranges, correlations, and what calibration changed."""

from __future__ import annotations

import numpy as np
from bokeh.layouts import column
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Select, TextInput

from inphase.errors import InphaseError
from inphase.model import Model
from inphase.studio.correlations import Correlations
from inphase.studio.desk import Desk
from inphase.studio.details import details
from inphase.studio.figures.prior import draw_prior, movements_of
from inphase.studio.figures.ranges import draw_ranges, groups_of
from inphase.studio.figures.trials import WHAT, draw_trials, trial_names
from inphase.studio.grid import grid
from inphase.studio.shown import picked
from inphase.studio.text import heading, text

MOVEMENTS, MATRIX = 6, 12  # channels drawn unasked: pictures of movements, and rows of the matrix
MOST = 24  # channels that are drawn when asked for
PHASES = (0.0, 0.25, 0.5, 0.75, 1.0)  # in the table of movements


class ModelView:
    """A model of the folder, chosen here or elsewhere, and its pictures."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._model: Model | None = None
        self._choose = Select(title="Model", value="", options=self._options(), width=260)
        self._names = TextInput(title="Channels to show: names or patterns; empty: the busiest", visible=False)
        self._names.sizing_mode = "stretch_width"
        self._shown = column(sizing_mode="stretch_width")
        self._choose.on_change("value", lambda attr, old, new: desk.choose(model=new))
        self._names.on_change("value", lambda attr, old, new: self._draw())
        desk.listen("models", self._look)
        self.layout: LayoutDOM = column(grid([self._choose, self._names]), self._shown, sizing_mode="stretch_width")
        if desk.choice.model:
            self.show(desk.choice.model)

    def show(self, name: str) -> None:
        """Read a model file of the folder and show it; what cannot be read is said."""
        self._look()
        self._choose.value = name
        self._model, self._names.visible = None, False
        if not name:
            self._shown.children = []
            return
        try:
            self._model = Model.load(self._desk.path(name))
        except (InphaseError, OSError) as error:
            self._shown.children = [text(error, kind="error")]
            return
        self._names.visible = True
        self._draw()

    def _options(self) -> list[str | tuple[str, str]]:
        names = dict.fromkeys(name for name in (*self._desk.contents.models, self._desk.choice.model) if name)
        return [("", "choose one"), *((name, name) for name in names)]

    def _look(self) -> None:
        self._choose.options = self._options()

    def _draw(self) -> None:
        if self._model is None:
            return
        line = self._names.value
        try:
            moving, left_out = picked(self._model, line, MOST if line.strip() else MOVEMENTS)
            related, fewer = picked(self._model, line, MOST if line.strip() else MATRIX)
        except InphaseError as error:
            self._shown.children = [text(error, kind="error")]
            return
        self._shown.children = [
            text(_summary(self._model)),
            *_movements(self._model, moving, left_out),
            *_correlations(self._model, related, fewer),
            *_ranges(self._model, related, fewer),
            *_calibration(self._model),
        ]


def _summary(model: Model) -> str:
    return (
        f"{len(model.observed)} observed and {len(model.controlled)} controlled channels, "
        f"{len(model.prior.samples)} demonstrations of about {1 / model.phase.nominal_velocity:.2f} s, "
        f"{model.layout.size} basis weights"
    )


def _movements(model: Model, channels: list[int], left_out: str) -> list[LayoutDOM]:
    movements = movements_of(model)
    at = [int(np.abs(movements.phases - phase).argmin()) for phase in PHASES]
    rows = [
        [model.names[c], model.channels[c].role.value]
        + [f"{movements.mean[i, c]:.4g} ± {movements.std[i, c]:.2g}" for i in at]
        for c in channels
    ]
    titles = ["channel", "role", *(f"phase {phase:g}" for phase in PHASES)]
    return [
        heading("Movements"),
        text(
            "Over phase, before a partner is seen: mean, and one standard deviation on either side; behind, grey, what "
            "the basis functions make of the demonstrations.",
            *([f"Shown: {left_out}."] if left_out else []),
            kind="quiet",
        ),
        grid([draw_prior(model, movements, channel) for channel in channels]),
        details("mean ± standard deviation in a table", titles, rows),
    ]


def _correlations(model: Model, channels: list[int], left_out: str) -> list[LayoutDOM]:
    trust = model.prior.trust
    return [
        heading("Correlations"),
        text(
            "Over the whole interaction: filled where two channels go together, hollow where they go against each "
            "other; the area is how strongly. Tap a square, or choose two channels, to see their basis weights.",
            *([f"Between the partners they are believed to {100 * trust:.0f} %."] if trust < 1 else []),
            *([f"Shown: {left_out}."] if left_out else []),
            kind="quiet",
        ),
        Correlations(model, channels).layout,
    ]


def _ranges(model: Model, channels: list[int], left_out: str) -> list[LayoutDOM]:
    features = sorted(model.coordinates.features_of(channels))
    rows = [[g.name, g.unit, g.low, g.high, g.span, ", ".join(g.channels)] for g in groups_of(model)]
    titles = ["scaled together", "unit", "from", "to", "1 is", "channels"]
    return [
        heading("Scaling"),
        text(
            "Channels of a group keep their geometry: they are scaled together, so that the one that goes farthest is "
            "1 long. A short bar beside a long one counts for less.",
            *([f"Shown: {left_out}."] if left_out else []),
            kind="quiet",
        ),
        draw_ranges(model, features),
        details("all groups in a table", titles, rows),
    ]


def _calibration(model: Model) -> list[LayoutDOM]:
    head, evidence = heading("Calibration"), model.evidence
    if evidence is None:
        return [head, text("Not calibrated: no demonstrations were held out. A full fit does that.", kind="quiet")]
    before, after = evidence.before, evidence.after
    rows = [
        [name, "yes" if t.chosen else "", t.error, t.error_std, f"{100 * t.coverage:.0f} %", t.nll]
        for name, t in zip(trial_names(evidence), evidence.trials, strict=True)
    ]
    titles = ["tried", "chosen", "error", "±", "inside 90 % band", "negative log likelihood"]
    return [
        head,
        text(
            f"Before → after: error {before.error:.3g} → {after.error:.3g}, inside the 90 % band "
            f"{100 * before.coverage:.0f} % → {100 * after.coverage:.0f} %, negative log likelihood "
            f"{before.nll:.3g} → {after.nll:.3g}; playing the mean by the clock: error {evidence.by_the_clock:.3g}."
        ),
        text(
            f"{evidence.held_out} demonstrations were held out, and each was played to a model that had not seen it: "
            f"{', '.join(evidence.conditions)}. Filled: what the model has; dashed "
            "lines: before and after; dotted: 90 %, and the error of playing by the clock.",
            kind="quiet",
        ),
        grid([draw_trials(evidence, what) for what in WHAT], narrowest=360),
        details("all that was tried, in a table", titles, rows),
    ]
