"""Incremental open-end dynamic time warping: how far a partner has come along the mean trajectory (DESIGN 4, trap 9).

The reference is the mean trajectory on a grid of phases. To every cell of it belongs the cheapest path that ends there
now: what the samples so far cost at the cells the path was in, and what its slope cost on the way. The whole past is
in that one column: a sample costs as much work at the end of an interaction as at its start.

The step pattern is asymmetric. In one tick, a hundredth of a typical interaction, a path moves on by 0, 1, … 12 cells,
four of them being the nominal tempo: it may stand still, never turns back, and goes at most three times as fast. A
step costs stiffness · (slope - slope so far)² a tick, in nominal slopes, the slope so far being the expected tempo. A
path that has arrived at the end may stay there, or is taken back to the start when the movement is periodic. Every
sample is paid for exactly once by every path, so that open ends can be compared as they are.

As the ticks come from the clock and a sample weighs as much as it is news (`Noise.at`), the sample rate hardly matters.
The costs are -2 log densities: exp(-cost / 2) over the open ends is a distribution over the phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from inphase.arrays import freeze, frozen
from inphase.model import Model
from inphase.observation import Observation

CELLS = 400  # of the reference
TICKS = 100  # of a typical interaction
FASTEST = 3  # times the nominal tempo: the steepest slope
STIFFNESS = 16.0  # a whole typical interaction, 25 % off the expected tempo, is one standard deviation off
WINDOW = 0.3  # of a typical interaction: over so much of a path its tempo is averaged
MOST_TICKS = 4 * TICKS  # after four whole interactions out of sight nothing is known any more
TIE = 1e-9  # of two paths that cost the same, the one that moved less in the last tick: rounding must not choose
NEVER = 1000.0  # typical interactions ago
LEAST_NEWS = 1e-12  # of a style that was seen a moment ago
NODES = 20  # open ends that speak for all of them where a response is asked for


@dataclass(frozen=True, eq=False)
class Reference:
    """What partners read on the grid of phases, how far they lie from it, and for how long.

    phases: (G,). mean, spread: (G, F) mean and variance of the prior. lasting: (F,) of an interaction, for which a
    partner's own way keeps away from the mean: one over the number of directions that way has (the participation ratio
    of its covariance between phases), so that a style, too, is no news when it is seen again.
    """

    phases: Float[np.ndarray, " G"]
    mean: Float[np.ndarray, "G F"]
    spread: Float[np.ndarray, "G F"]
    lasting: Float[np.ndarray, " F"]

    def __post_init__(self) -> None:
        freeze(self, phases=self.phases, mean=self.mean, spread=self.spread, lasting=self.lasting)

    @classmethod
    def of(cls, model: Model) -> Reference:
        """The mean trajectory of a model and its prior's deviations from it."""
        phases = np.linspace(0.0, 1.0, CELLS, endpoint=not model.phase.periodic)
        curves = model.layout.project_each(phases, model.prior.factor)
        spread = (curves**2).sum(1)
        between = curves.transpose(2, 1, 0) @ curves.transpose(2, 0, 1)  # (F, R, R), with the eigenvalues of (G, G)
        total = np.maximum(spread.sum(0), np.finfo(float).tiny)
        lasting = ((between / total[:, None, None]) ** 2).sum((1, 2))
        return cls(phases, model.layout.predict(phases, model.prior.mean), spread, np.maximum(lasting, 1 / CELLS))


@dataclass(frozen=True, eq=False)
class Alignment:
    """The column of open ends.

    costs: (G,) of the cheapest path to each cell, beyond that of the cheapest of all. tempos: (G,) [1/s] of these
    paths, averaged over the last window. pending: [s] since the last tick. tempo_var: [1/s²] what is left of the
    prior's doubt about the tempo. unseen: (F,) [s] since each feature was last seen.
    """

    model: Model
    reference: Reference
    costs: Float[np.ndarray, " G"]
    tempos: Float[np.ndarray, " G"]
    pending: float
    tempo_var: float
    unseen: Float[np.ndarray, " F"]

    def __post_init__(self) -> None:
        freeze(self, costs=self.costs - self.costs.min(), tempos=self.tempos, unseen=self.unseen)

    @classmethod
    def begin(cls, model: Model, reference: Reference) -> Alignment:
        """The start of an interaction, as the phase prior has it, as far as a grid can tell."""
        phase = model.phase
        off = reference.phases - phase.mean[0]
        off = off - np.round(off) if phase.periodic else off
        known = phase.order > 0
        tempo = float(phase.mean[1]) if known else phase.nominal_velocity
        return cls(
            model,
            reference,
            costs=off**2 / max(phase.cov[0, 0], (0.5 * reference.phases[1]) ** 2),
            tempos=np.full(len(off), np.clip(tempo, 0.0, FASTEST * phase.nominal_velocity)),
            pending=0.0,
            tempo_var=float(phase.cov[1, 1]) if known else 0.0,
            unseen=np.full(model.layout.count, NEVER / phase.nominal_velocity),
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
        moved = self.reference.phases + self.tempo * self.pending
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
        phase = self.model.phase
        tick, cell = 1 / (TICKS * phase.nominal_velocity), float(self.reference.phases[1])
        ticks, pending = divmod(self.pending + dt, tick)
        steps = np.arange(round(FASTEST * phase.nominal_velocity * tick / cell) + 1)
        rates = steps * cell / tick
        expected = self.tempo
        prices = STIFFNESS / TICKS * ((rates - expected) / phase.nominal_velocity) ** 2
        forgotten = -np.expm1(-1 / (WINDOW * TICKS))
        costs, tempos, here = self.costs, self.tempos, np.arange(CELLS)
        for _ in range(min(int(ticks), MOST_TICKS)):
            before = costs[-steps[-1] :] if phase.periodic else np.full(steps[-1], np.inf)
            # paths[j, s] ends at cell j with a step of s cells.
            paths = np.lib.stride_tricks.sliding_window_view(np.concatenate([before, costs]), len(steps))[:, ::-1]
            paths = paths + prices
            if not phase.periodic:  # whoever would go beyond the end has arrived there
                paths[-1] += np.minimum.accumulate(prices[::-1])[::-1] - prices
            costs, last = paths.min(1), (paths + TIE * steps).argmin(1)
            latest = rates[last]
            if not phase.periodic:
                latest[-1] = max(latest[-1], expected)  # who has arrived no longer shows a tempo
            tempos = tempos[here - last]
            tempos = tempos + forgotten * (latest - tempos)
        left = (1 - forgotten) ** (2 * min(int(ticks), MOST_TICKS))
        return Alignment(self.model, self.reference, costs, tempos, pending, self.tempo_var * left, self.unseen + dt)

    def seen(self, observation: Observation) -> Alignment:
        """The same open ends after a sample: each pays for how far it lies from the reference, in its metric."""
        features = observation.features
        place = self.phases / self.reference.phases[1]
        low = np.minimum(place.astype(np.int64), CELLS - 1)
        high = (low + 1) % CELLS if self.model.phase.periodic else np.minimum(low + 1, CELLS - 1)
        share = (place - low)[:, None]
        mean, spread = (
            (1 - share) * table[low][:, features] + share * table[high][:, features]
            for table in (self.reference.mean, self.reference.spread)
        )
        var = spread + self.model.noise.var[features]
        own = self.unseen[features] * self.model.phase.nominal_velocity / self.reference.lasting[features]
        news = np.minimum(np.tanh(own), self.model.noise.var[features] / observation.noise_var)
        repeated = observation.noise_var + spread / np.maximum(news, LEAST_NEWS)
        costs = self.costs + ((observation.values - mean) ** 2 / repeated + np.log(var) * (var / repeated)).sum(1)
        unseen = self.unseen.copy()
        unseen[features] = 0.0
        return replace(self, costs=costs, unseen=unseen)
