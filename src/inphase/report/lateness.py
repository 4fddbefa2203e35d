"""How late the answers of a run came: the shift in time by which they fit best what truly happened."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.channels import Role
from inphase.metrics import difference
from inphase.report.account import Account

FARTHEST = 0.25  # of the run, that an answer may be late or early
SHIFTS = 101
MOMENTS = 400  # at which answers are compared
WORTH = 0.8  # of the error as it is: a shift that leaves more of it explains nothing


@dataclass(frozen=True)
class Lateness:
    """By how much the answers came late, and what that explains.

    seconds: negative where they were early. remains: the share of the squared error that is left when they are moved,
    by the geometric mean over channels. channels: those that come much nearer by it, with the share that they keep.
    """

    seconds: float
    remains: float
    channels: Mapping[str, float]

    @property
    def explains(self) -> bool:
        """Whether being late, or early, is much of what was wrong."""
        return self.remains < WORTH and self.seconds != 0.0


def lateness(account: Account, within: tuple[float, float] | None = None) -> Lateness | None:
    """Of all controlled channels together, or of the answers for the times within [s]; None where nothing is known.

    The shift with the least sum of the logarithms of squared errors: the likeliest one, where every channel has an
    error of a size of its own. Units do not matter, and a channel that is noise says nothing.
    """
    times, truth = account.times, account.truth
    known = np.isfinite(account.now) & np.isfinite(truth)
    moving = [k for k in range(truth.shape[1]) if known[:, k].sum() >= 2 and np.ptp(truth[known[:, k], k]) > 0]
    if not moving or len(times) < 3 or times[-1] <= times[0]:
        return None
    channels = [c for c in account.recording.channels if c.role is Role.CONTROLLED]
    start, end = within or (times[0], times[-1])
    moments = np.linspace(start, end, MOMENTS)
    answered = _course(account.now_times, account.now, moments)
    farthest = FARTHEST * (times[-1] - times[0])
    shifts = np.linspace(-farthest, farthest, SHIFTS)
    errors = np.empty((SHIFTS, len(moving)))
    for i, shift in enumerate(shifts.tolist()):
        happened = _course(times, truth, moments - shift)
        errors[i] = np.nanmean(difference(channels, answered, happened)[:, moving] ** 2, axis=0)
    least = np.finfo(float).eps * np.nanvar(truth[:, moving], axis=0)
    logarithms = np.log(np.maximum(errors, least))
    gains = logarithms - logarithms[SHIFTS // 2]
    best = int(gains.mean(1).argmin())
    kept = np.exp(gains[best])
    nearer = {account.names[k]: float(share) for k, share in zip(moving, kept, strict=True) if share < WORTH}
    return Lateness(float(shifts[best]), float(np.exp(gains[best].mean())), nearer)


def _course(
    times: Float[np.ndarray, " T"], values: Float[np.ndarray, "T C"], at: Float[np.ndarray, " M"]
) -> Float[np.ndarray, "M C"]:
    """The values at other times; beyond the ends what is there, since both partners rest before and after."""
    course = np.full((len(at), values.shape[1]), np.nan)
    for k, column in enumerate(values.T):
        seen = np.isfinite(column) & np.isfinite(times)
        if seen.sum() >= 2:
            course[:, k] = np.interp(at, times[seen], column[seen])
    return course
