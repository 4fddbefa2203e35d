"""What a session answers: an `Estimate` for every sample, a `Response` when asked."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Status(str, enum.Enum):
    """How the inference fares; the value is the sentence to show."""

    FOLLOWING = "following the partner"
    NOTHING_SEEN = "nothing was seen in this sample: the estimate is a prediction"
    BLIND = "nothing has been seen for long: the estimate is a prediction and drifts"
    UNLIKE = "the partner moves unlike any demonstration: do not trust the response"
    REFUSED = "the readings lie far from all that is expected and were not used: the estimate is a prediction"
    COLLAPSED = "the sample could not be used: if this goes on, reset the session"
    FINISHED = "the interaction is over"

    @property
    def trustworthy(self) -> bool:
        """Whether a robot may act on the response."""
        return self not in (Status.BLIND, Status.UNLIKE, Status.COLLAPSED)


@dataclass(frozen=True)
class Estimate:
    """Where the interaction is after one sample.

    time: [s]. phase: 0 … 1. phase_velocity: [1/s]. *_std: their standard deviations. log_likelihood: of this
    sample given all before, in the units of the channels; 0 where nothing was seen.
    """

    time: float
    phase: float
    phase_std: float
    phase_velocity: float
    phase_velocity_std: float
    log_likelihood: float
    status: Status

    def _repr_html_(self) -> str:
        from inphase.report.notebook import estimate_html

        return estimate_html(self)


@dataclass(frozen=True, eq=False)
class Response:
    """What the channels should read from now on, with a standard deviation; all arrays are read-only.

    times: (S,) [s]. phases: (S,). mean, std: (S, C), in the units of `channels`.
    """

    times: Float[np.ndarray, " S"]
    phases: Float[np.ndarray, " S"]
    mean: Float[np.ndarray, "S C"]
    std: Float[np.ndarray, "S C"]
    channels: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self, times=self.times, phases=self.phases, mean=self.mean, std=self.std)

    def __len__(self) -> int:
        return len(self.times)

    # Doors upward: docs/decisions/0014-pictures.md.

    def plot(self, *, channels: Sequence[str] | str | None = None, phase: bool = False, **options: Any) -> Figure:
        """A picture of each channel's mean and 90 % band over time: `inphase.report.plot_response`, with its options.

        Raises ChannelError, and OptionError where matplotlib is missing.
        """
        from inphase.report.plots.response import plot_response

        return plot_response(self, channels=channels, phase=phase, **options)

    def _repr_html_(self) -> str:
        from inphase.report.notebook import response_html

        return response_html(self)
