"""Jumps: further in one step than the channel could have moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from inphase.channels import Channel, Kind
from inphase.preprocess.checks.clock import median_step
from inphase.preprocess.checks.finding import Finding, FindingKind, clock, times_over
from inphase.preprocess.checks.stillness import is_switch, spread_of
from inphase.preprocess.checks.tracks import Track, group_spreads, tracks
from inphase.trajectory import SHORTEST

TAU = 2 * np.pi
SHARE = 0.4  # of how far the group moves: a smaller step is no jump ...
OUTLIER = 10.0  # ... nor is one below this many standard deviations (1.4826 MAD) of the channel's steps ...
SUDDEN = 0.5  # ... nor one of which more than this share continues the step before it or leads into the one after
COUNTS = {Kind.ANGLE: 2.0, Kind.QUATERNION: 1.0}  # of how far these move, at most: 0.4 of it is a turn by 46 degrees
TURN = 0.3  # [rad] a jump this close to a whole turn is one
RADIANS = ("", "rad")  # units in which a channel may be an angle


def check_jumps(
    name: str,
    times: Float[np.ndarray, " T"],
    values: Float[np.ndarray, "T D"],
    channels: Sequence[Channel],
    usual: Mapping[str, float] | None = None,
) -> list[Finding]:
    """Jumps of the channels of an episode; whole turns of angles apart, quaternions by all four numbers.

    `usual` is how far each group moves in the other episodes, where it is known (`usual_spreads`).
    """
    findings = []
    found = tracks(values, channels)
    spreads = group_spreads(found)
    for track in found:
        if len(track.samples) < SHORTEST:
            continue
        # What hardly moves jumps within its noise; what counts is how far its group moves, here or in other episodes.
        spread = max(spreads[track.group], (usual or {}).get(track.group, 0.0))
        when = times[track.samples]
        channel = channels[track.columns[0]]
        kind = channel.kind if len(track.columns) == 1 else Kind.QUATERNION
        jumped = _sudden(when, track.path, min(spread, COUNTS.get(kind, np.inf)))
        if kind is not Kind.QUATERNION:
            turned = _turned(channel, when, values[track.samples, track.columns[0]])
            if turned.any():
                findings.append(_turns(name, channel, when, turned))
            if kind is Kind.LINEAR:
                jumped &= ~turned
        if jumped.any() and not all(is_switch(component) for component in track.path.T):
            findings.append(_jumped(name, track, when, spread, np.flatnonzero(jumped) + 1))
    return findings


def _sudden(times: Float[np.ndarray, " N"], path: Float[np.ndarray, "N C"], spread: float) -> Bool[np.ndarray, " N-1"]:
    """(N-1,) whether each step of the path is one that no smooth movement takes."""
    lasts = np.diff(times) / median_step(times)
    # Over a longer step more may happen; but a stamp that comes too soon makes no movement faster.
    speeds = np.diff(path, axis=0) / np.where(lasts > 1, lasts, 1.0)[:, None]
    sizes = np.linalg.norm(speeds, axis=1)
    # How much of the step is news to one who has seen the step before it, and to one who knows the step after it.
    change = np.linalg.norm(np.diff(speeds, axis=0), axis=1)
    news = np.minimum(np.concatenate([[np.inf], change]), np.concatenate([change, [np.inf]]))
    usual = OUTLIER * 1.4826 * float(np.median(sizes))
    return np.asarray((sizes > max(SHARE * spread, usual)) & (news > SUDDEN * sizes))


def _turned(
    channel: Channel, times: Float[np.ndarray, " N"], path: Float[np.ndarray, " N"]
) -> Bool[np.ndarray, " N-1"]:
    """(N-1,) whether each step is a whole turn and no movement."""
    steps = np.diff(path)
    if channel.kind is Kind.ANGLE:
        return np.asarray(np.abs(steps) > np.pi)
    if channel.unit not in RADIANS:
        return np.zeros(len(steps), dtype=bool)
    turns = np.round(steps / TAU)
    whole = (turns != 0) & (np.abs(steps - TAU * turns) < TURN)
    return np.asarray(whole & _sudden(times, path[:, None], spread_of(path))) if whole.any() else whole


def _turns(name: str, channel: Channel, times: Float[np.ndarray, " N"], turned: Bool[np.ndarray, " N-1"]) -> Finding:
    at = np.flatnonzero(turned) + 1
    cure = "it is unwrapped" if channel.kind is Kind.ANGLE else f"kinds={{{channel.name!r}: 'angle'}} unwraps it"
    message = f"jumps by a whole turn (2π) {times_over(len(at))}, first at {clock(times[at[0]])}; {cure}"
    return Finding(name, channel.name, float(times[at[0]]), FindingKind.BRANCH, message)


def _jumped(
    name: str, track: Track, times: Float[np.ndarray, " N"], spread: float, at: Int[np.ndarray, " J"]
) -> Finding:
    sizes = np.linalg.norm(track.path[at] - track.path[at - 1], axis=1)
    largest = int(np.argmax(sizes))
    message = (
        f"jumps {times_over(len(at))}, furthest by {sizes[largest]:.3g} at {clock(times[at[largest]])}; "
        f"all of its movement spans {spread:.3g}"
    )
    return Finding(name, track.name, float(times[at[0]]), FindingKind.JUMP, message)
