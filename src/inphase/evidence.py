"""What a model's choices were made by: held-out demonstrations, played with each candidate."""

from __future__ import annotations

from dataclasses import dataclass

from inphase.errors import OptionError


@dataclass(frozen=True)
class Trial:
    """Held-out demonstrations with one candidate.

    choice, value: of what, and which, in words. error: squared, over the variance of the controlled channels: 1 is what
    answering their mean scores. error_std: its standard error. coverage: share inside the 90 % band. nll: negative log
    density a reading, in standard deviations of the channels. chosen: whether the model has it.
    """

    choice: str
    value: str
    error: float
    error_std: float
    coverage: float
    nll: float
    chosen: bool


@dataclass(frozen=True)
class Evidence:
    """All trials in their order; those of one choice follow each other, and the choices before are kept.

    held_out: how many demonstrations were held out and played. conditions: how each was played. The first trial is
    the model before any choice, the last the model as it is. by_the_clock: the error of playing the mean movement.
    """

    held_out: int
    conditions: tuple[str, ...]
    trials: tuple[Trial, ...]
    by_the_clock: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "conditions", tuple(self.conditions))
        object.__setattr__(self, "trials", tuple(self.trials))
        if self.held_out < 1 or not self.trials:
            raise OptionError(f"expected trials with held-out demonstrations, got {self.held_out} and {self.trials}")

    @property
    def before(self) -> Trial:
        """The model before any choice."""
        return self.trials[0]

    @property
    def after(self) -> Trial:
        """The model as it is."""
        return self.trials[-1]
