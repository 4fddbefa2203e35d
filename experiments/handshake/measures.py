"""What the dissertation measures of an encounter (2.6.3), and what only a simulation can: whether the hands met."""

from __future__ import annotations

import numpy as np

from experiments.handshake.encounter import LASTS
from experiments.handshake.sensors import HAND, RATE

WINDOW = 2.0  # [s]
CALM = 0.001  # variance [m², MPa²] of a window in which a channel has come to rest, as in the dissertation
MET = 0.05  # [m]


def completion(read: np.ndarray) -> float:
    """Time-to-Completion of (T, 30), as a share of the encounter: when all channels have come to rest for 2 s.

    The start of the first window after the first movement in which the variance of every channel is below its
    threshold; 1 where there is none.
    """
    calm = _moving(read, lambda part: np.nanvar(part, axis=0)) < CALM
    begins = np.flatnonzero(~calm.all(1))
    if not len(begins):
        return 0.0
    after = calm.all(1) & (np.arange(len(calm)) > begins[0])
    return float(np.argmax(after) / RATE / LASTS) if after.any() else 1.0


def apart(truth: np.ndarray) -> np.ndarray:
    """(..., T) [m] between the hands of (..., T, 6)."""
    return np.asarray(np.linalg.norm(truth[..., :3] - truth[..., 3:], axis=-1))


def at_end(truth: np.ndarray) -> float:
    """[m] between the hands, the mean over the last second."""
    return float(apart(truth)[-round(RATE) :].mean())


def met_at(truth: np.ndarray) -> float:
    """[s] when the hands first were within 5 cm; infinite where they never were."""
    near = apart(truth) < MET
    return float(np.argmax(near) / RATE) if near.any() else np.inf


def gone(hand: np.ndarray, share: float) -> float:
    """[s] when a hand (T, 3) first has gone more than that share of its way, from its first place to its last."""
    far = np.linalg.norm(hand - hand[0], axis=1)
    return float(np.argmax(far > share * far[-1]) / RATE)


def correlations(read: np.ndarray) -> np.ndarray:
    """(30, 30) of Pearson, pressures first and the hand last, as in Fig. 19."""
    seen = read[np.isfinite(read).all(1)]
    return np.corrcoef(np.roll(seen, -len(HAND), axis=1).T)


def sliding(read: np.ndarray, first: int, second: int) -> np.ndarray:
    """(W,) of Pearson, of two channels in windows of 2 s, as in Fig. 20."""

    def correlated(part: np.ndarray) -> np.ndarray:
        both = part[np.isfinite(part).all(1)]
        return np.atleast_1d(np.corrcoef(both.T)[0, 1]) if len(both) > 10 else np.array([np.nan])

    return np.asarray(_moving(read[:, [first, second]], correlated)[:, 0])


def _moving(values: np.ndarray, of: object) -> np.ndarray:
    """(W, ...) of every window of 2 s."""
    width = round(WINDOW * RATE)
    return np.stack([of(values[i : i + width]) for i in range(len(values) - width + 1)])  # type: ignore[operator]
