"""A partner who moves as a model says partners do, at a tempo of their own, and may pause."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor

import numpy as np
from jaxtyping import Float

from inphase.arrays import frozen
from inphase.errors import OptionError
from inphase.model import Model
from inphase.runtime.clock import Clock
from inphase.runtime.device import Sample, Signal


class SimulatedPartner:
    """The observed channels of an interaction that was drawn from a model, read at a rate.

    rate: [1/s]. tempo: of the demonstrations', drawn as the model's usual ones are unless told. pauses: (begin, length)
    [s] since the start, in which the partner stands still. noise: of a reading, as a share of the channel's spread.
    At the end it rests, or begins again where the interaction is periodic. Raises OptionError for values out of range.
    """

    def __init__(
        self,
        model: Model,
        seed: int = 0,
        *,
        rate: float = 60.0,
        tempo: float | None = None,
        pauses: Sequence[tuple[float, float]] = (),
        noise: float = 0.01,
        name: str = "partner",
    ) -> None:
        rng = np.random.default_rng(seed)
        drawn = float(np.exp(model.tempo.usual_std * rng.standard_normal()))
        self.tempo = drawn if tempo is None else tempo
        for what, value, least in (("rate", rate, 0.0), ("tempo", self.tempo, 0.0)):
            if not least < value < np.inf:
                raise OptionError(f"{name}: expected a finite {what} > 0, got {value}")
        if not 0 <= noise < np.inf:
            raise OptionError(f"{name}: expected a finite noise >= 0, got {noise}")
        if any(not (begin >= 0 and length >= 0) for begin, length in pauses):
            raise OptionError(f"{name}: expected pauses (begin, length) of at least 0 s, got {list(pauses)}")
        self.name = name
        self.signals = tuple(Signal(c.name, c.unit) for c in model.channels[: len(model.observed)])
        self.weights = frozen(model.prior.draw(1, rng)[0])
        self._model, self._rng, self._rate = model, rng, rate
        self._pauses = sorted(pauses)
        self._noise = noise * model.spread[: len(model.observed)]
        self._clock: Clock | None = None
        self._begun = 0.0
        self._next = 0

    def start(self, clock: Clock) -> None:
        """Begin to move, now; noise goes on where it was."""
        self._clock, self._begun, self._next = clock, clock.now(), 0

    def read(self) -> list[Sample]:
        """All that came since the last call."""
        if self._clock is None:
            return []
        due = floor((self._clock.now() - self._begun) * self._rate * (1 + 1e-12)) + 1
        times = [self._begun + i / self._rate for i in range(self._next, due)]
        self._next = due
        if not times:
            return []
        values = self.truth(times)[:, : len(self.signals)]
        values = values + self._noise * self._rng.standard_normal(values.shape)
        return [Sample(row, time, time) for row, time in zip(values, times, strict=True)]

    def stop(self) -> None:
        """Fall silent."""
        self._clock = None

    def phase(self, time: float) -> float:
        """How far the interaction truly is at that time of the clock [s]; whole cycles count where it is periodic."""
        since = max(time - self._begun, 0.0)
        moving, end = since, 0.0
        for begin, length in self._pauses:
            stop = max(begin + length, end)
            moving -= max(min(since, stop) - max(begin, end), 0.0)
            end = stop
        phase = moving * self.tempo * self._model.phase.nominal_velocity
        return phase if self._model.phase.periodic else min(phase, 1.0)

    def truth(self, times: Sequence[float]) -> Float[np.ndarray, "T D"]:
        """(T, D) what all channels of the model truly read at those times [s], without noise: the response aimed at."""
        phases = np.array([self.phase(time) for time in times])
        return self._model.predict(phases % 1.0 if self._model.phase.periodic else phases, self.weights)
