"""Training: from a data set to a model, part by part."""

from inphase.training.active import learn_active
from inphase.training.channel_selection import select_channels
from inphase.training.discrepancy import leave_one_out
from inphase.training.fit import fit
from inphase.training.noise import regression_noise
from inphase.training.quality import EpisodeQuality, Quality, assess
from inphase.training.selection import BasisSelection, select_basis
from inphase.training.sparse import sparse_bases, sparse_basis
from inphase.training.tempo import learn_phase

__all__ = [
    "BasisSelection",
    "EpisodeQuality",
    "Quality",
    "assess",
    "fit",
    "learn_active",
    "learn_phase",
    "leave_one_out",
    "regression_noise",
    "select_basis",
    "select_channels",
    "sparse_bases",
    "sparse_basis",
]
