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
WINDOW, EVERY = 0.3, 0.1  # of the run: stretches that are looked at by themselves
MOVES = 0.5  # of its deviation over the run: less in a stretch is resting
EXACT = 0.03  # of a channel's spread: nearer than that is near enough, and nothing to explain
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
        return self.remains < WORTH and self.seconds != 0.0 and bool(self.channels)


def lateness(account: Account, within: tuple[float, float] | None = None) -> Lateness | None:
    """Of all controlled channels together, or of the answers for the times within [s]; None where nothing is known.

    The shift with the least sum of the logarithms of squared errors: the likeliest one, where every channel has an
    error of a size of its own. Units do not matter, and a channel that is noise says nothing.
    """
    times, truth = account.times, account.truth
    if len(times) < 3 or times[-1] <= times[0]:
        return None
    start, end = within or (times[0], times[-1])
    moving = _moving(account, start, end)
    if not moving or 2 * len(moving) < len(_moving(account, times[0], times[-1])):
        return None  # most of it rests: what the others do is no measure of all
    channels = [c for c in account.recording.channels if c.role is Role.CONTROLLED]
    moments = np.linspace(start, end, MOMENTS)
    answered = _course(account.now_times, account.now, moments)
    farthest = min(FARTHEST * (times[-1] - times[0]), (end - start) / 2)
    shifts = np.linspace(-farthest, farthest, SHIFTS)
    errors = np.empty((SHIFTS, len(moving)))
    for i, shift in enumerate(shifts.tolist()):
        off = difference(channels, answered, _course(times, truth, moments - shift))[:, moving]
        errors[i] = np.nanvar(off, axis=0)  # that it is off by as much all the time is not being late
    least = EXACT**2 * np.nanvar(truth[:, moving], axis=0)
    logarithms = np.log(np.maximum(errors, least))
    gains = logarithms - logarithms[SHIFTS // 2]
    over_all = gains.mean(1)
    near_enough = np.flatnonzero(over_all <= over_all.min() + 1e-9)
    best = int(near_enough[len(near_enough) // 2])
    kept = np.exp(gains[best])
    nearer = {account.names[k]: float(share) for k, share in zip(moving, kept, strict=True) if share < WORTH}
    return Lateness(float(shifts[best]), float(np.exp(gains[best].mean())), nearer)


def _moving(account: Account, start: float, end: float) -> list[int]:
    """The controlled channels of which both what happened and the answers move between two times, as on the whole."""
    times, truth = account.times, account.truth
    found = []
    for k, column in enumerate(truth.T):
        known = np.isfinite(column) & np.isfinite(account.now[:, k])
        then = known & (times >= start) & (times <= end)
        courses = (column, account.now[:, k])
        if then.sum() > 2 and all(course[then].std() > MOVES * course[known].std() > 0 for course in courses):
            found.append(k)
    return found


def worst_stretch(account: Account) -> tuple[tuple[float, float], Lateness] | None:
    """From when until when [s] being late or early explains most, and what it was then; None where it does nowhere."""
    times = account.times
    if len(times) < 3:
        return None
    length = float(times[-1] - times[0])
    found = []
    for start in np.arange(times[0], times[-1] - WINDOW * length + 1e-9, EVERY * length).tolist():
        within = (start, start + WINDOW * length)
        late = lateness(account, within)
        if late is not None and late.explains:
            found.append((within, late))
    return min(found, key=lambda one: one[1].remains) if found else None


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
