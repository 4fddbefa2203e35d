"""The phase prior: where interactions begin, how fast they go, how much that changes on the way."""

from __future__ import annotations

import numpy as np

from inphase.errors import OptionError
from inphase.phase import ORDERS, PhaseModel
from inphase.trajectory import Dataset

START_STD = 0.01  # of phase: recordings begin with the interaction, give or take a hundredth (4.2.7.1)
TEMPO_STD = 0.2  # of the mean tempo, at least: recordings cut to one length say nothing about how tempo varies
TEMPO_CHANGE = 0.3  # of the mean tempo, its standard deviation after one interaction of random changes


def learn_phase(
    dataset: Dataset, order: int = 1, periodic: bool = False, *, start: float = 0.0, start_std: float = START_STD
) -> PhaseModel:
    """The phase prior of a data set (Eq. 2.12, 2.14).

    order: 0 for phase alone, 1 with a velocity that wanders, 2 with an acceleration that wanders. periodic: a
    demonstration is one cycle. start, start_std: the phase at which interactions will be seen first, give or take
    that much; 0.5 and 1 for anywhere. Raises OptionError for another order, or a start outside 0 … 1.
    """
    if order not in ORDERS:
        raise OptionError(f"expected a phase model of order 0, 1 or 2, got {order!r}")
    tempos = np.array([1.0 / demonstration.duration for demonstration in dataset])
    tempo = float(tempos.mean())  # Eq. 2.12
    tempo_std = max(float(tempos.std(ddof=1)) if len(tempos) > 1 else 0.0, TEMPO_STD * tempo)
    # In units of one typical interaction the random changes are the same for all: q = change² · tempo^(2 order + 1).
    std = np.array([0.0, tempo_std, TEMPO_CHANGE * tempo**2])[: order + 1]
    change = 1.0 if order == 0 else TEMPO_CHANGE  # a phase without tempo must wander all the way
    return PhaseModel(
        mean=np.array([0.0, tempo, 0.0])[: order + 1],
        cov=np.diag(std**2),
        diffusion=change**2 * tempo ** (2 * order + 1),
        nominal_velocity=tempo,
        periodic=periodic,
    ).starting(start, start_std)
