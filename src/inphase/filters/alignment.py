"""Incremental open-end dynamic time warping: how far a partner has come along a reference (DESIGN 4, trap 9).

To every cell of a grid of phases belongs the cheapest path that ends there now: what the samples cost it at the cells
it was in, and what its slope cost on the way. All of the past is in that one column: a sample is as much work at the
end of an interaction as at its start.

The step pattern is asymmetric. In one tick, a hundredth of a typical interaction, a path moves on by 0, 1, … 12 cells,
four of them being the nominal tempo: it may stand still, never turns back, and goes at most three times as fast. A tick
costs as much as its slope, the tempo over the nominal one, is off the expected slope, and less within the slack: most
go on as they did, and who does not may do anything. A path that would go beyond the end has arrived there and may stay;
in a periodic movement it begins again. Every path pays once for every sample, so that open ends can be compared as they
are.

Ticks come from the clock, and a sample weighs as much as it is news (`Noise.at`): the sample rate hardly matters. Costs
are -2 log densities: exp(-cost / 2) over the open ends is a distribution over the phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze, frozen
from inphase.model import Model
from inphase.observation import Observation
from inphase.phase import PhaseModel

CELLS = 400
TICKS = 100  # of a typical interaction
FASTEST = 3  # times the nominal tempo: the steepest slope
STIFFNESS = 32.0  # the price of a typical interaction spent one nominal tempo off the expected one
SLACK = 0.125  # times the nominal tempo: the price grows with the square of what is less, in proportion to what is more
WINDOW = 0.3  # of a typical interaction: over so much of a path its tempo is averaged, and so long an error lasts
MOST_TICKS = 4 * TICKS  # after four whole interactions out of sight nothing is known any more
TIE = 1e-9  # of two paths that cost the same, the one that moved less in the last tick: rounding must not choose
NODES = 20  # open ends that speak for all of them where a response is asked for


@dataclass(frozen=True, eq=False)
class Alignment:
    """The column of open ends.

    costs: (G,) of the cheapest path to each cell, beyond that of the cheapest of all. tempos: (G,) [1/s] of these
    paths, averaged over the last window. pending: [s] since the last tick. tempo_var: [1/s²] what is left of the
    prior's doubt about the tempo. unseen: (F,) [s] since each feature was last seen, while that matters.
    """

    model: Model
    costs: Float[np.ndarray, " G"]
    tempos: Float[np.ndarray, " G"]
    pending: float
    tempo_var: float
    unseen: Float[np.ndarray, " F"]

    def __post_init__(self) -> None:
        freeze(self, costs=self.costs - self.costs.min(), tempos=self.tempos, unseen=self.unseen)

    @classmethod
    def begin(cls, model: Model) -> Alignment:
        """The start of an interaction, as the phase prior has it, as far as a grid can tell."""
        phase, cells = model.phase, grid(model.phase, CELLS)
        off = cells - phase.mean[0]
        off = off - np.round(off) if phase.periodic else off
        known = phase.order > 0
        tempo = float(phase.mean[1]) if known else phase.nominal_velocity
        return cls(
            model,
            costs=off**2 / max(phase.cov[0, 0], (0.5 * cells[1]) ** 2),
            tempos=np.full(CELLS, np.clip(tempo, 0.0, FASTEST * phase.nominal_velocity)),
            pending=0.0,
            tempo_var=float(phase.cov[1, 1]) if known else 0.0,
            unseen=np.full(model.layout.count, MOST_TICKS / (TICKS * phase.nominal_velocity)),
        )

    @property
    def phase(self) -> float:
        """The phase of the cheapest end."""
        return float(self.phases[self.costs.argmin()])

    @property
    def tempo(self) -> float:
        """The expected tempo [1/s]."""
        return float(self.weights @ self.tempos)

    @cached_property
    def weights(self) -> Float[np.ndarray, " G"]:
        """(G,) the probability of each open end."""
        weights = np.exp(-0.5 * self.costs)
        return frozen(weights / weights.sum())

    @cached_property
    def phases(self) -> Float[np.ndarray, " G"]:
        """(G,) where the open ends are now: between two ticks all of them move at the expected tempo."""
        moved = grid(self.model.phase, CELLS) + self.tempo * self.pending
        return frozen(moved % 1.0 if self.model.phase.periodic else np.minimum(moved, 1.0))

    @property
    def nodes(self) -> Int[np.ndarray, " n"]:
        """(n,) ends that speak for all, in equal parts: quantiles of the distribution over the phase."""
        quantiles = (np.arange(NODES) + 0.5) / NODES
        return np.minimum(np.searchsorted(np.cumsum(self.weights), quantiles), CELLS - 1)

    @property
    def node_weights(self) -> Float[np.ndarray, " n"]:
        """(n,) the probability of each node."""
        return np.full(NODES, 1 / NODES)

    def passed(self, dt: float) -> Alignment:
        """The open ends dt [s] later."""
        tick = 1 / (TICKS * self.model.phase.nominal_velocity)
        ticks, pending = divmod(self.pending + dt, tick)
        column = self
        for _ in range(int(min(ticks, MOST_TICKS))):
            column = column._ticked()
        return replace(column, pending=pending, unseen=np.minimum(self.unseen + dt, MOST_TICKS * tick))

    def _ticked(self) -> Alignment:
        """The open ends a tick later."""
        phase, cell = self.model.phase, float(grid(self.model.phase, CELLS)[1])
        steps = np.arange(round(FASTEST / (TICKS * cell)) + 1)
        rates, expected = steps * cell * TICKS * phase.nominal_velocity, self.tempo
        off = (rates - expected) / phase.nominal_velocity
        prices = STIFFNESS / TICKS * (np.hypot(off, SLACK) - SLACK)
        before = self.costs[-steps[-1] :] if phase.periodic else np.full(steps[-1], np.inf)
        # paths[j, s] comes to cell j by a step of s cells.
        paths = np.lib.stride_tricks.sliding_window_view(np.concatenate([before, self.costs]), len(steps))[:, ::-1]
        paths = paths + prices
        if not phase.periodic:  # a step to the end stands for all that would go beyond
            paths[-1] += np.minimum.accumulate(prices[::-1])[::-1] - prices
        last = (paths + TIE * steps).argmin(1)
        tempos, latest = self.tempos[np.arange(CELLS) - last], rates[last]
        if not phase.periodic:
            latest[-1] = max(latest[-1], expected)  # who has arrived no longer shows a tempo
        forgotten = -np.expm1(-1 / (WINDOW * TICKS))
        return replace(
            self,
            costs=paths.min(1),
            tempos=tempos + forgotten * (latest - tempos),
            tempo_var=self.tempo_var * (1 - forgotten) ** 2,
        )

    def seen(
        self, observation: Observation, mean: Float[np.ndarray, "P M"], var: Float[np.ndarray, "P M"]
    ) -> Alignment:
        """The open ends after a sample, each having paid for how far the sample lies from the reference.

        mean, var: (P, M) what is expected of the features seen, at the phases of a `grid`, and the metric: its
        variance, noise included.
        """
        place = self.phases / grid(self.model.phase, len(mean))[1]
        low = np.minimum(place.astype(np.int64), len(mean) - 1)
        high = (low + 1) % len(mean) if self.model.phase.periodic else np.minimum(low + 1, len(mean) - 1)
        share = (place - low)[:, None]
        mean, var = ((1 - share) * table[low] + share * table[high] for table in (mean, var))
        news = self.model.noise.var[observation.features] / observation.noise_var
        unseen = self.unseen.copy()
        unseen[observation.features] = 0.0
        costs = self.costs + ((observation.values - mean) ** 2 / var + np.log(var)) @ news
        return replace(self, costs=costs, unseen=unseen)


def grid(phase: PhaseModel, count: int) -> Float[np.ndarray, " G"]:
    """(G,) `count` phases, evenly spaced from 0 to 1, or round the circle when the phase is periodic."""
    return _grid(count, phase.periodic)


@cache
def _grid(count: int, periodic: bool) -> Float[np.ndarray, " G"]:
    return frozen(np.linspace(0.0, 1.0, count, endpoint=not periodic))
