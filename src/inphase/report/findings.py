"""What strikes in a run, in sentences, each with the moment to look at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from inphase.metrics import NINETY
from inphase.report.account import Account
from inphase.report.lateness import Lateness, lateness, worst_stretch
from inphase.report.spells import Spell, blind_stretches, pauses_of, status_spells, typical_tempo
from inphase.result import Status

BEGUN = 0.05  # of the phase: a partner who is farther has begun
LONG_WAIT = 0.08  # of a typical interaction
OTHER_TEMPO = 0.25  # relative difference that is worth a sentence
MOMENT = 0.02  # of the run: who is as late is in time
BEHIND = 0.1  # of the phase
FEW_INSIDE = 0.75  # of the readings in the 90 % band
MOST = 6  # of one kind
WELL = "RUNNING"  # the state of a loop in which the robot is led by the response


@dataclass(frozen=True)
class Finding:
    """A sentence. time: from the beginning of the run [s], or None where it is about the whole. grave: to be seen."""

    says: str
    time: float | None = None
    grave: bool = False

    @property
    def plain(self) -> dict[str, Any]:
        """For the page."""
        return {"says": self.says, "time": self.time, "grave": self.grave}


def find(account: Account) -> list[Finding]:
    """In the order of what explains most: late answers, beliefs of the timing, what was not seen, troubles."""
    if not account.estimates:
        return [Finding("Nothing was inferred in this run.", grave=True)]
    return [
        *_of_lateness(account),
        *_of_waiting(account),
        *_of_tempo(account),
        *_of_progress(account),
        *_of_pauses(account),
        *_of_sight(account),
        *_of_status(account),
        *_of_events(account),
        *_of_band(account),
    ]


def _of_lateness(account: Account) -> Iterator[Finding]:
    late = lateness(account)
    if late is None:
        return
    length = float(account.times[-1] - account.times[0])
    if late.explains and abs(late.seconds) > MOMENT * length:
        yield Finding(
            f"The response came {_how(late)}: moved by that, {_nearer(late.channels)}.", _worst(account), grave=True
        )
        return
    stretch = worst_stretch(account)
    if stretch is None or abs(stretch[1].seconds) <= MOMENT * length:
        yield Finding("The response kept time: no shift in time would have brought it much nearer to what happened.")
        return
    (start, end), late = stretch
    yield Finding(
        f"From {start - account.begin:.2f} to {end - account.begin:.2f} s the response came {_how(late)}: moved by "
        f"that, {_nearer(late.channels)}. {_timing_between(account, start, end)}",
        (start + end) / 2 - account.begin,
        grave=True,
    )


def _how(late: Lateness) -> str:
    return f"{abs(late.seconds):.2f} s {'late' if late.seconds > 0 else 'early'}"


def _timing_between(account: Account, start: float, end: float) -> str:
    """What was believed of the timing then."""
    own = [i for i, time in enumerate(account.times) if start <= time <= end]
    estimates = [account.estimates[i] for i in own]
    typical = typical_tempo(account)
    if not estimates or typical <= 0:
        return ""
    slowest = min(estimates, key=lambda estimate: estimate.phase_velocity)
    said = (
        f"The tempo was believed to be as low as {slowest.phase_velocity / typical:.2f} of the typical one, at "
        f"{slowest.time - account.begin:.2f} s"
    )
    if len(account.progress) != len(account.estimates):
        return f"{said}."
    off = [account.estimates[i].phase - account.progress[i] for i in own]
    at = max(range(len(off)), key=lambda i: abs(off[i]))
    return (
        f"{said}; the phase was {abs(off[at]):.2f} {'ahead of' if off[at] > 0 else 'behind'} the time that had passed."
    )


def _nearer(channels: Mapping[str, float]) -> str:
    """Which channels would have been how much nearer, those that gain most first."""
    gains = sorted(channels.items(), key=lambda item: item[1])
    told = ", ".join(f"{name} {100 * (1 - share):.0f} %" for name, share in gains[:MOST])
    return f"the squared error would have been less, of {told}"


def _worst(account: Account) -> float | None:
    """When the response was farthest from what happened, from the beginning of the run [s]."""
    spread = np.nanstd(account.truth, axis=0) if np.isfinite(account.truth).any() else np.ones(account.truth.shape[1])
    off = np.abs(account.now - account.truth) / np.where(spread > 0, spread, 1.0)
    known = np.isfinite(off).any(1)
    if not known.any():
        return None
    worst = np.where(known, np.nan_to_num(off, nan=-1.0).max(1), -1.0).argmax()
    return float(account.times[worst] - account.begin)


def _of_waiting(account: Account) -> Iterator[Finding]:
    typical = typical_tempo(account)
    phases = np.array([estimate.phase for estimate in account.estimates])
    begun = np.flatnonzero(phases > BEGUN)
    wait = (account.times[begun[0]] if len(begun) else account.times[-1]) - account.begin
    if typical > 0 and wait > LONG_WAIT / typical:
        yield Finding(
            f"The partner was taken to have hardly begun (phase below {BEGUN:g}) for the first {wait:.2f} s; "
            f"the typical interaction gets there in {BEGUN / typical:.2f} s.",
            float(wait),
        )


def _of_tempo(account: Account) -> Iterator[Finding]:
    if account.model is None:
        return
    typical = typical_tempo(account)
    moving = [e for e in account.estimates if BEGUN < e.phase < 1 - BEGUN]
    if not moving:
        return
    tempo = float(np.median([e.phase_velocity for e in moving])) / typical
    if abs(np.log(max(tempo, 1e-3))) > np.log(1 + OTHER_TEMPO):
        yield Finding(f"The partner went at {tempo:.2f} times the tempo of the demonstrations (median).")


def _of_progress(account: Account) -> Iterator[Finding]:
    if len(account.progress) != len(account.estimates):
        return
    off = np.array([e.phase for e in account.estimates]) - account.progress
    length = account.times[-1] - account.times[0]
    for sign, how in ((-1, "behind"), (1, "ahead of")):
        at = int((sign * off).argmax())
        if sign * off[at] > BEHIND:
            yield Finding(
                f"The phase was up to {abs(off[at]):.2f} {how} the share of the time that had passed, which is "
                f"{abs(off[at]) * length:.2f} s of this interaction.",
                float(account.times[at] - account.begin),
                grave=True,
            )


def _of_pauses(account: Account) -> Iterator[Finding]:
    pauses = pauses_of(account)
    for start, end in sorted(pauses, key=lambda pause: pause[0] - pause[1])[:MOST]:
        yield Finding(
            f"The partner was taken to pause for {end - start:.2f} s, from {start - account.begin:.2f} to "
            f"{end - account.begin:.2f} s.",
            start - account.begin,
        )


def _of_sight(account: Account) -> Iterator[Finding]:
    for start, end in blind_stretches(account)[:MOST]:
        yield Finding(
            f"No observed channel was read for {end - start:.2f} s, from {start - account.begin:.2f} to "
            f"{end - account.begin:.2f} s.",
            start - account.begin,
            grave=True,
        )


def _of_status(account: Account) -> Iterator[Finding]:
    spells = status_spells(account)
    for status in Status:
        own = [spell for spell in spells if spell.status is status]
        if own and status is not Status.FINISHED:
            yield _told_spells(own, account)
    if not any(spell.status is Status.FINISHED for spell in spells) and account.model is not None:
        yield Finding("The end of the interaction was never told: the phase did not come to 0.99.")


def _told_spells(spells: list[Spell], account: Account) -> Finding:
    longest = max(spells, key=lambda spell: spell.end - spell.start)
    total = sum(spell.end - spell.start for spell in spells)
    often = "once" if len(spells) == 1 else f"{len(spells)} times"
    return Finding(
        f"{longest.status.name.lower().replace('_', ' ')} ({longest.status.value}): {often}, {total:.2f} s in all, "
        f"longest from {longest.start - account.begin:.2f} s.",
        longest.start - account.begin,
        grave=not longest.status.trustworthy,
    )


def _of_events(account: Account) -> Iterator[Finding]:
    changes = [event for event in account.recording.events if event.kind == "safety" and event.after]
    for event in changes[:MOST]:
        says = f"{event.before.lower()} → {event.after.lower()}: {event.reason}"
        yield Finding(says, event.time - account.begin, grave=event.after != WELL)


def _of_band(account: Account) -> Iterator[Finding]:
    known = np.isfinite(account.truth) & np.isfinite(account.now)
    for k, name in enumerate(account.names):
        if known[:, k].sum() < 10:
            continue
        off = np.abs(account.now[:, k] - account.truth[:, k]) / np.maximum(account.now_std[:, k], 1e-300)
        inside = float((off[known[:, k]] <= NINETY).mean())
        if inside < FEW_INSIDE:
            at = int(np.where(known[:, k], off, -1.0).argmax())
            yield Finding(
                f"{name} was in the 90 % band only {100 * inside:.0f} % of the time.",
                float(account.times[at] - account.begin),
            )
