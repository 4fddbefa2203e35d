"""Stretches of a run in which something lasted: a status, a pause, nothing seen; and what was told beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from inphase.channels import Role
from inphase.report.account import Account
from inphase.result import Status

PAUSED = 0.25  # times the typical tempo: slower is a pause
SHORTEST = 0.03  # of a typical interaction: what is over sooner is none
BLIND = 0.05  # of a typical interaction without a reading
MOST = 300  # spells, and events, that are told
REPORT = "report"  # the kind of event that holds a run's figures


@dataclass(frozen=True)
class Spell:
    """A status that lasted from one time until another [s]."""

    start: float
    end: float
    status: Status

    def plain(self, begin: float) -> dict[str, Any]:
        """For the page: times from the beginning of the run."""
        return {"start": self.start - begin, "end": self.end - begin, "status": list(Status).index(self.status)}


def status_spells(account: Account) -> list[Spell]:
    """When the inference did not simply follow, in order; of very many the longest."""
    times, estimates = account.times, account.estimates
    found = []
    for start, end in _stretches([estimate.status for estimate in estimates]):
        if estimates[start].status is not Status.FOLLOWING:
            found.append(Spell(float(times[start]), _until(times, end), estimates[start].status))
    longest = sorted(found, key=lambda spell: spell.start - spell.end)[:MOST]
    return sorted(longest, key=lambda spell: spell.start)


def pauses_of(account: Account) -> list[tuple[float, float]]:
    """From when until when [s] the partner was believed to stand still, or nearly so."""
    typical = typical_tempo(account)
    if not typical > 0:
        return []
    velocity = np.array([estimate.phase_velocity for estimate in account.estimates])
    return _lasting(account.times, velocity < PAUSED * typical, SHORTEST / typical)


def blind_stretches(account: Account) -> list[tuple[float, float]]:
    """From when until when [s] no observed channel was read, for longer than a moment."""
    recording = account.recording
    columns = [i for i, channel in enumerate(recording.channels) if channel.role is Role.OBSERVED]
    seen = np.isfinite(recording.values[:, columns]).any(1)
    times = np.concatenate([recording.times[:1], recording.times[seen], recording.times[-1:]])
    gaps = np.diff(times)
    long = BLIND / typical_tempo(account) if typical_tempo(account) > 0 else np.inf
    return [(float(times[i]), float(times[i + 1])) for i in np.flatnonzero(gaps > long)]


def typical_tempo(account: Account) -> float:
    """That of the demonstrations, or without a model the median of the run [1/s]; 0 where nothing is known."""
    if account.model is not None:
        return account.model.phase.nominal_velocity
    velocity = [estimate.phase_velocity for estimate in account.estimates if np.isfinite(estimate.phase_velocity)]
    return float(np.median(velocity)) if velocity else 0.0


def events_of(account: Account) -> list[dict[str, Any]]:
    """What was told during the run, less its figures; of very many the first."""
    told = [event for event in account.recording.events if event.kind != REPORT][:MOST]
    return [
        {
            "time": event.time - account.begin,
            "kind": event.kind,
            "reason": event.reason,
            "before": event.before,
            "after": event.after,
        }
        for event in told
    ]


def _lasting(times: Float[np.ndarray, " T"], so: Bool[np.ndarray, " T"], least: float) -> list[tuple[float, float]]:
    found = [(float(times[a]), _until(times, b)) for a, b in _stretches(so.tolist()) if so[a]]
    return [(start, end) for start, end in found if end - start >= least]


def _until(times: Float[np.ndarray, " T"], end: int) -> float:
    return float(times[min(end, len(times) - 1)])


def _stretches(values: Sequence[object]) -> list[tuple[int, int]]:
    """(start, end) of equal neighbours, the end being the first that differs."""
    if not values:
        return []
    changes = [i for i in range(1, len(values)) if values[i] != values[i - 1]]
    return list(zip([0, *changes], [*changes, len(values)], strict=True))
