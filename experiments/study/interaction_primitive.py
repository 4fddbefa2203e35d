"""Interaction Primitives with time warping, which chapter 2 compares itself with (2.5, 2.6.2)."""

from __future__ import annotations

import numpy as np

import inphase

EVERY = 5  # updates between two searches (2.5)
POINTS = 100  # of the reference


class InteractionPrimitive:
    """Every fifth update all samples so far are aligned with the trajectory expected now, and the weights conditioned.

    The reference is that of the weights conditioned last. Samples are aligned by dynamic time warping from the
    beginning to wherever the last one fits best; then the prior is conditioned on all of them, each at its own phase
    (Eqs. 2.7 to 2.9 without a phase in the state). Between two searches the phase moves on at the tempo so far. For
    linear channels.
    """

    def __init__(self, model: inphase.Model) -> None:
        self.model = model
        self._shown = np.arange(model.observed_features)
        self.reset()

    def reset(self, seed: int = 0) -> None:
        """Begin a new interaction; nothing is random here."""
        self._rows: list[np.ndarray] = []
        self._times: list[float] = []
        self._weights = self.model.prior.mean
        self._aligned = (0.0, 0.0)  # when, and at which phase
        self.phase = 0.0

    def observe(self, time: float, values: np.ndarray) -> float:
        """Take in a sample, and say the phase."""
        row = np.full(len(self.model.channels), np.nan)
        row[: len(values)] = values
        self._rows.append(self.model.scaling.scale(row[None])[0, self._shown])
        self._times.append(time)
        if len(self._rows) % EVERY == 0:
            self._align()
        then, phase = self._aligned
        tempo = phase / (then - self._times[0]) if then > self._times[0] else self.model.phase.nominal_velocity
        self.phase = float(np.clip(phase + tempo * (time - then), 0.0, 1.0))
        return self.phase

    def expect(self, phases: np.ndarray) -> np.ndarray:
        """(P, D) what all channels are expected to read at phases (P,), in their units."""
        return self.model.predict(phases, self._weights)

    def _align(self) -> None:
        grid = np.linspace(0.0, 1.0, POINTS)
        reference = self.model.layout.predict(grid, self._weights)[:, self._shown]
        phases = grid[warped(np.array(self._rows), reference)]
        self._weights = self._conditioned(phases)
        self._aligned = self._times[-1], float(phases[-1])

    def _conditioned(self, phases: np.ndarray) -> np.ndarray:
        """The mean weights given all samples, in the span of the demonstrations, where the prior has its variance."""
        prior, rows = self.model.prior, np.array(self._rows)
        plain, span = self.model.layout.predict_and_project(phases, prior.mean, prior.factor, self._shown)
        seen, var = np.isfinite(rows), self.model.noise.var[self._shown]
        news, weight = np.where(seen, rows - plain, 0.0).ravel(), (seen / var).ravel()
        span = span.swapaxes(1, 2).reshape(len(news), -1)  # what one of each direction adds to a reading
        weighted = span * weight[:, None]
        along = np.linalg.solve(weighted.T @ span + np.eye(span.shape[1]), weighted.T @ news)
        return prior.mean + along @ prior.factor


def warped(rows: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(T,) where in the reference (P, F) each of the rows (T, F) is, by open-end dynamic time warping.

    Both begin together; either may stand while the other moves. What was not seen costs nothing.
    """
    cost = np.nansum((rows[:, None] - reference[None]) ** 2, axis=2)
    total = np.empty_like(cost)
    total[0] = np.cumsum(cost[0])
    for i in range(1, len(rows)):
        before = np.minimum(total[i - 1], np.concatenate([[np.inf], total[i - 1, :-1]]))
        along = np.cumsum(cost[i])
        # total[i, j] = cost[i, j] + min(before[j], total[i, j - 1]), without a loop over j
        total[i] = along + np.minimum.accumulate(before - along + cost[i])
    path = np.empty(len(rows), dtype=int)
    i, j = len(rows) - 1, int(np.argmin(total[-1]))
    path[i] = j
    while i > 0:
        left, up = total[i, j - 1] if j else np.inf, total[i - 1, j]
        across = total[i - 1, j - 1] if j else np.inf
        if left < min(up, across):
            j -= 1
            continue
        i, j = i - 1, j - 1 if across <= up else j
        path[i] = j
    return path
