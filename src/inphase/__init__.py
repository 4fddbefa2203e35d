"""inphase learns how two partners move together, and then moves with one of them live."""

from inphase import basis
from inphase.channels import Channel, Kind, Role
from inphase.errors import (
    ChannelError,
    DataError,
    InphaseError,
    ModelFileError,
    ObservationError,
    OptionError,
    WorkerError,
)
from inphase.io import load
from inphase.model import Model
from inphase.noise import Noise
from inphase.observation import Observation
from inphase.phase import PhaseModel
from inphase.preprocess import Coordinates, Reduction, Scaling, trim
from inphase.recording import Recording
from inphase.result import Estimate, Response, Status
from inphase.session import Session
from inphase.training import (
    assess,
    fit,
    learn_active,
    learn_phase,
    select_basis,
    select_channels,
    sparse_bases,
    sparse_basis,
)
from inphase.trajectory import Dataset, Demonstration
from inphase.weight_prior import WeightPrior

__version__ = "0.1.0"

__all__ = [
    "Channel",
    "ChannelError",
    "Coordinates",
    "DataError",
    "Dataset",
    "Demonstration",
    "Estimate",
    "InphaseError",
    "Kind",
    "Model",
    "ModelFileError",
    "Noise",
    "Observation",
    "ObservationError",
    "OptionError",
    "PhaseModel",
    "Recording",
    "Reduction",
    "Response",
    "Role",
    "Scaling",
    "Session",
    "Status",
    "WeightPrior",
    "WorkerError",
    "assess",
    "basis",
    "fit",
    "learn_active",
    "learn_phase",
    "load",
    "select_basis",
    "select_channels",
    "sparse_bases",
    "sparse_basis",
    "trim",
]
