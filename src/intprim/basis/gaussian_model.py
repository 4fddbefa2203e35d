"""Gaussian radial basis functions (4.2.1)."""

from inphase.basis import Gaussian
from intprim.basis.placed import PlacedModel


class GaussianModel(PlacedModel):
    """`degree` Gaussians exp(-(φ - c)² / (2 scale)), their centres c uniform from `start_phase` to `end_phase`.

    scale: the variance [phase²]. end_phase: 1.0 where none is given, as in the text of chapter 4; its library took
    1.01, so that the weights it saved are for other functions: see `convert_old_weights`.
    """

    family = Gaussian
