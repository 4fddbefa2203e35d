"""Logistic sigmoid basis functions (4.2.1)."""

from inphase.basis import Sigmoid
from intprim.basis.placed import PlacedModel


class SigmoidalModel(PlacedModel):
    """`degree` steps 1 / (1 + exp(-(φ - c) / scale)), their centres c uniform from `start_phase` to `end_phase`.

    scale: the width of a step [phase]. end_phase: 1.0 where none is given, see `GaussianModel`.
    """

    family = Sigmoid
