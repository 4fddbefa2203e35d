"""What is believed of phase and tempo, at one moment or at several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Float

from inphase.errors import OptionError
from inphase.filters import Belief
from inphase.filters.cloud import Cloud
from inphase.recording import Recording
from inphase.report.density import cloud_of, phase_density, tempo_density
from inphase.report.look import COLOURS, plain, verbatim
from inphase.report.plots.panels import Axes, finish, make_panels
from inphase.result import Estimate
from inphase.session import Session

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOMENTS = 4  # of a recording, where none are named
GRID = 600

Moment: TypeAlias = Belief | Estimate | Session
Moments: TypeAlias = Moment | Recording | Sequence[Moment] | Mapping[str, Moment]


def plot_phase_densities(moments: Moments, *, at: Sequence[float] | None = None, axes: Axes = None) -> Figure:
    """The densities of phase and of phase velocity [1/s] side by side, a colour for each moment.

    moments: a belief, a session (what it believes now) or an estimate; several of them, or several with names; or a
    recording. Of beliefs all is drawn, points smoothed; of estimates the Gaussian that they tell of. at: of a recording
    or of estimates, the times [s] of those to draw, None for some of them. axes: two of matplotlib's, to draw in a
    figure of your own. Raises OptionError.
    """
    named = _named(moments, at)
    if not 0 < len(named) <= 2 * len(COLOURS):
        raise OptionError(f"expected 1 to {2 * len(COLOURS)} moments in a figure, got {len(named)}")
    figure, (left, right) = make_panels(2, axes)
    beliefs = {name: moment.belief if isinstance(moment, Session) else moment for name, moment in named.items()}
    clouds = [cloud_of(belief) for belief in beliefs.values()]
    phases, tempos = np.linspace(0, 1, GRID), _tempos(clouds)
    for i, ((name, belief), seen) in enumerate(zip(beliefs.items(), clouds, strict=True)):
        label, style = verbatim(name) if name else "_nolegend_", "-" if i < len(COLOURS) else "--"
        colour = COLOURS[i % len(COLOURS)]
        periodic = not isinstance(belief, Estimate) and belief.model.phase.periodic
        for panel, grid, density in (
            (left, phases, phase_density(seen, phases, periodic)),
            (right, tempos, tempo_density(seen, tempos)),
        ):
            panel.fill_between(grid, 0, density, color=colour, alpha=0.15, lw=0)
            panel.plot(grid, density, style, color=colour, lw=1.6, label=label)
    for panel, label in ((left, "phase"), (right, "phase velocity [1/s]")):
        panel.set_xlabel(label)
        panel.set_ylim(0)
        panel.set_yticks([])
        plain(panel, "x")
        panel.spines["left"].set_visible(False)
    left.set_xlim(0, 1)
    left.set_ylabel("density")
    if axes is None:
        figure.set_size_inches(7.2, 3.2)
        finish(figure, [left, right])
    return figure


def _named(moments: Moments, at: Sequence[float] | None) -> dict[str, Moment]:
    if isinstance(moments, Recording):
        moments = moments.estimates
        if not moments:
            raise OptionError("expected a recording in which something was observed, got none")
    if isinstance(moments, Mapping):
        listed, names = [*moments.values()], [*moments]
    elif isinstance(moments, Sequence):
        listed, names = [*moments], []
    else:
        listed, names = [moments], [""]
    estimates = [moment for moment in listed if isinstance(moment, Estimate)]
    if at is not None and len(estimates) < len(listed):
        raise OptionError("at=: expected estimates, which have a time; got beliefs")
    if not names and len(estimates) == len(listed):
        estimates = _at(estimates, at)
        return {f"{estimate.time:.2f} s": estimate for estimate in estimates}
    names = names or [f"moment {i + 1}" for i in range(len(listed))]
    return dict(zip(names, listed, strict=True))


def _at(estimates: Sequence[Estimate], at: Sequence[float] | None) -> list[Estimate]:
    """The last estimate at or before each time, or some of them, evenly spread."""
    if at is None:
        if len(estimates) <= 2 * len(COLOURS):
            return [*estimates]
        places = np.linspace(0, len(estimates) - 1, MOMENTS + 2)[1:-1].round().astype(int)
        return [estimates[i] for i in places]
    times = np.array([estimate.time for estimate in estimates])
    early = [time for time in at if not time >= times[0]]
    if early:
        raise OptionError(f"at=: expected times from {times[0]:g} s on, got {early[0]:g} s")
    return [estimates[int(i) - 1] for i in np.searchsorted(times, at, side="right")]


def _tempos(clouds: Sequence[Cloud]) -> Float[np.ndarray, " G"]:
    """A grid of velocities that holds nearly all of every density."""
    lows, highs, forward = [], [], True
    for seen in clouds:
        points, shares, var = seen.moving[:, 1], seen.weights, seen.moving_var[:, 1]
        mean = float(shares @ points)
        std = float(np.sqrt(max(float(shares @ ((points - mean) ** 2 + var)), 0.0)))
        low, high = mean - 4 * std, mean + 4 * std
        if not var.any():  # points go no further
            low, high = max(low, points.min() - std), min(high, points.max() + std)
        lows.append(low)
        highs.append(high)
        forward = forward and points.min() >= 0
    first = max(min(lows), 0.0) if forward else min(lows)
    middle = (first + max(highs)) / 2
    half = max(max(highs) - middle, 0.05 * abs(middle), 1e-9)  # of a tempo that is known, too
    return np.linspace(max(middle - half, 0.0) if forward else middle - half, middle + half, GRID)
