"""Training: from a data set to a model, part by part."""

from inphase.training.discrepancy import held_out_noise
from inphase.training.fit import fit
from inphase.training.noise import regression_noise
from inphase.training.tempo import learn_phase

__all__ = ["fit", "held_out_noise", "learn_phase", "regression_noise"]
