"""What a notebook shows of a value: a few words, and a line as tall as a word for each of a few channels.

Plain HTML with the colours of the page around it, dark or light. All names are text, whatever they hold.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, Role, quaternions
from inphase.model import Model
from inphase.report.look import NINETY
from inphase.report.plots.panels import first_of_each
from inphase.report.steady import steady_together
from inphase.result import Estimate, Response
from inphase.trajectory import Dataset

ROWS = 6  # channels
POINTS = 40  # of a line
CURVES = 20  # demonstrations of a data set that are looked at
WIDTH, HEIGHT = 140, 26  # [px]
CELL = 'style="text-align:left;padding:1px 12px 1px 0;border:none"'


def model_html(model: Model) -> str:
    """A model: how much it learned from, and mean and 90 % band of some channels over phase."""
    shown = first_of_each(model.channels, ROWS)
    phases = np.linspace(0, 1, POINTS)
    mean, std = _distribution(model, phases, shown)
    lines = [sparkline(phases, mean[:, i], std[:, i]) for i in shown]
    duration = 1 / model.phase.nominal_velocity
    facts = [f"{len(model.prior.samples)} demonstrations of {duration:.2f} s", _partners(model.channels)]
    return _block("Model", facts, model.channels, shown, lines)


def dataset_html(dataset: Dataset) -> str:
    """A data set: how much there is, and mean and 90 % band of some channels over phase."""
    shown = first_of_each(dataset.channels, ROWS)
    durations = [demonstration.duration for demonstration in dataset]
    shortest, longest = f"{min(durations):.2f}", f"{max(durations):.2f}"
    spent = f"{shortest} s" if shortest == longest else f"{shortest} to {longest} s"
    count = f"{len(dataset)} demonstration{'s' if len(dataset) > 1 else ''}"
    lines = [sparkline(*line) for line in _courses(dataset, shown)]
    return _block("Dataset", [f"{count} of {spent}", _partners(dataset.channels)], dataset.channels, shown, lines)


def response_html(response: Response) -> str:
    """A response: from when to when, and mean and 90 % band of some channels over time."""
    known = [Channel(name, Role.CONTROLLED) for name in response.channels]
    shown = first_of_each(known, ROWS)
    facts = [f"{len(response)} sample{'s' if len(response) != 1 else ''}"]
    if len(response):
        facts.append(f"{response.times[0]:.2f} to {response.times[-1]:.2f} s")
        facts.append(f"phase {response.phases[0]:.2f} to {response.phases[-1]:.2f}")
    lines = [sparkline(response.times, response.mean[:, i], response.std[:, i]) for i in shown]
    return _block("Response", facts, known, shown, lines, roles=False)


def estimate_html(estimate: Estimate) -> str:
    """An estimate: where the interaction is, and how surely."""
    rows = [
        ("phase", f"{estimate.phase:.3f} ± {estimate.phase_std:.3f}"),
        ("phase velocity", f"{estimate.phase_velocity:.3f} ± {estimate.phase_velocity_std:.3f} 1/s"),
        ("log-likelihood", f"{estimate.log_likelihood:.2f}"),
        ("status", estimate.status.value),
    ]
    return _heading("Estimate", [f"at {estimate.time:.2f} s"]) + _table(map(escape, row) for row in rows) + "</div>"


def sparkline(at: Float[np.ndarray, " S"], mean: Float[np.ndarray, " S"], std: Float[np.ndarray, " S"]) -> str:
    """A line with its 90 % band as SVG in the colour of the text; a dash where nothing is known."""
    known = np.isfinite(mean) & np.isfinite(std)
    if not known.any():
        return "–"
    at, low, high, mean = at[known], (mean - NINETY * std)[known], (mean + NINETY * std)[known], mean[known]
    left, bottom = at[0], low.min()
    across, up = max(at[-1] - left, 1e-300), max(high.max() - bottom, 1e-300)

    def points(x: Float[np.ndarray, " S"], y: Float[np.ndarray, " S"]) -> str:
        places = zip(1 + (WIDTH - 2) * (x - left) / across, HEIGHT - 2 - (HEIGHT - 4) * (y - bottom) / up, strict=True)
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in places)

    band = f"{points(at, high)} {points(at[::-1], low[::-1])}"
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" aria-hidden="true" '
        f'style="vertical-align:middle"><polygon points="{band}" fill="currentColor" opacity="0.2"/>'
        f'<polyline points="{points(at, mean)}" fill="none" stroke="currentColor" stroke-width="1.5"/></svg>'
    )


def _block(
    kind: str,
    facts: Sequence[str],
    channels: Sequence[Channel],
    shown: Sequence[int],
    lines: Sequence[str],
    roles: bool = True,
) -> str:
    rows = []
    for i, line in zip(shown, lines, strict=True):
        channel = channels[i]
        named = f"<code>{escape(channel.name)}</code>"
        rows.append([named, *([channel.role.value] if roles else []), line, escape(channel.unit)])
    more = len(channels) - len(shown)
    rest = f'<div style="opacity:0.7">… and {more:,} more</div>' if more else ""
    return _heading(kind, facts) + _table(rows) + rest + "</div>"


def _heading(kind: str, facts: Iterable[str]) -> str:
    told = " · ".join(map(escape, facts))
    return f'<div style="overflow-x:auto"><div><b>{kind}</b> <span style="opacity:0.7">{told}</span></div>'


def _table(rows: Iterable[Iterable[str]]) -> str:
    cells = ("".join(f"<td {CELL}>{cell}</td>" for cell in row) for row in rows)
    return f'<table style="border:none">{"".join(f"<tr>{row}</tr>" for row in cells)}</table>'


def _partners(channels: Sequence[Channel]) -> str:
    observed = sum(channel.role is Role.OBSERVED for channel in channels)
    return f"{observed:,} observed, {len(channels) - observed:,} controlled channels"


def _distribution(
    model: Model, phases: Float[np.ndarray, " P"], columns: Sequence[int]
) -> tuple[Float[np.ndarray, "P D"], Float[np.ndarray, "P D"]]:
    """`model.distribution` of some channels alone, the others 0: not by the factor, slow with many."""
    layout, prior, features = model.layout, model.prior, model.coordinates.features_of(columns)
    mean, var = np.zeros((2, len(phases), layout.count))
    mean[:, features] = layout.predict(phases, prior.mean, features)
    rows = layout.project_each(phases, prior.samples - prior.mean, features)
    var[:, features] = (rows**2).sum(1) / (len(prior.samples) - 1) + model.noise.var[features]
    mean, var = model.to_channels(mean, var)
    return mean, np.sqrt(var)


def _courses(
    dataset: Dataset, columns: Sequence[int]
) -> list[tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"], Float[np.ndarray, " P"]]]:
    """Phases, mean and standard deviation of each column over the demonstrations, as far as it was seen."""
    whole = [xyzw for xyzw in quaternions(dataset.channels) if set(xyzw) & set(columns)]
    taken = sorted({*columns, *(i for xyzw in whole for i in xyzw)})
    picked = np.unique(np.linspace(0, len(dataset) - 1, CURVES).round().astype(int)).tolist()
    channels = [dataset.channels[i] for i in taken]
    values = steady_together(channels, [dataset[i].values[:, taken] for i in picked])
    phases, found = np.linspace(0, 1, POINTS), []
    for column in columns:
        curves = []
        for i, readings in zip(picked, values, strict=True):
            one = readings[:, taken.index(column)]
            seen = np.isfinite(one)
            if seen.any():
                curves.append(np.interp(phases, dataset[i].phases[seen], one[seen]))
        nothing = np.full((1, POINTS), np.nan)
        drawn = np.array(curves) if curves else nothing
        found.append((phases, drawn.mean(0), drawn.std(0, ddof=min(1, len(drawn) - 1))))
    return found
