"""How a partner's tempo may differ from the demonstrations': what `rbpf` believes of it (DESIGN 4, trap 7)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from inphase.errors import OptionError


@dataclass(frozen=True)
class Tempo:
    """A mixture: mostly the usual tempo, now and then another, for a moment or for good, pauses, and leaps.

    usual, usual_std: the share of interactions at the demonstrations' tempo, and the spread of the logarithm of theirs.
    other_std: that of all the others. change_rate: of new tempos, steady: the share of stretches that keep to the
    tempo, momentary_std: their spread, stretch_rate: of new stretches. stop_rate, go_rate: of pauses and their ends.
    leap_rate: of leaps ahead, by up to `leap` of the phase, as over a rest that is cut short. Rates are per typical
    interaction; where there are pauses, a tenth has not begun at first. Raises OptionError for shares outside 0 … 1,
    or negative numbers.
    """

    usual: float = 0.8
    usual_std: float = 0.05
    other_std: float = 0.5  # half and double lie at 1.4 standard deviations
    change_rate: float = 0.5
    steady: float = 0.9
    momentary_std: float = 0.05
    stretch_rate: float = 7.0
    stop_rate: float = 0.2
    go_rate: float = 7.0
    leap_rate: float = 0.5
    leap: float = 0.2

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            share = field.name in ("usual", "steady", "leap")
            if not (np.isfinite(value) and 0 <= value <= (1 if share else np.inf)):
                expected = "a share between 0 and 1" if share else "a finite number >= 0"
                raise OptionError(f"tempo {field.name}: expected {expected}, got {value}")
