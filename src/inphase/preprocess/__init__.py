"""From the channels of a recording to the numbers a model learns: coordinates, scaling, trimming, checks."""

from inphase.preprocess.coordinates import Coordinates
from inphase.preprocess.reduction import Reduction
from inphase.preprocess.scaling import Scaling
from inphase.preprocess.trim import trim

__all__ = ["Coordinates", "Reduction", "Scaling", "trim"]
