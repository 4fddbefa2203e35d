"""Training: from a data set to a model, part by part."""

from inphase.training.fit import fit
from inphase.training.noise import learn_noise
from inphase.training.tempo import learn_phase

__all__ = ["fit", "learn_noise", "learn_phase"]
