"""Quaternions: of norm 1, and of one sign along the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel, Kind, group_of, quaternions
from inphase.preprocess.checks.finding import Finding, FindingKind, clock, times_over
from inphase.trajectory import QUATERNION_NORM

OFF_NORM = 0.01  # from 1: more than files round away


def check_quaternions(
    name: str, times: Float[np.ndarray, " T"], values: Float[np.ndarray, "T D"], channels: Sequence[Channel]
) -> list[Finding]:
    """Sign flips and wrong norms of the quaternions of an episode."""
    findings = []
    for group, columns in quaternion_columns(values, channels).items():
        seen = np.flatnonzero(np.isfinite(values[:, columns]).all(axis=1))
        path, when = values[seen][:, columns], times[seen]
        flips = np.flatnonzero((path[1:] * path[:-1]).sum(axis=1) < 0) + 1
        if len(flips):
            message = (
                f"changes sign {times_over(len(flips))}, first at {clock(when[flips[0]])}: q and -q are one rotation"
            )
            findings.append(Finding(name, group, float(when[flips[0]]), FindingKind.SIGN_FLIP, message))
        norms = np.linalg.norm(path, axis=1)
        off = np.flatnonzero(np.abs(norms - 1) > OFF_NORM)
        if len(off):
            worst = off[np.argmax(np.abs(norms[off] - 1))]
            message = f"expected norm 1, got {norms[worst]:.3g} at {clock(when[worst])} ({len(off)} samples are off)"
            findings.append(Finding(name, group, float(when[off[0]]), FindingKind.NORM, message))
    return findings


def quaternion_columns(values: Float[np.ndarray, "T D"], channels: Sequence[Channel]) -> dict[str, list[int]]:
    """The columns (x, y, z, w) of every quaternion by its group: those declared, and those named and measured so.

    A few samples off norm 1 do not hide a quaternion here, as they do from `Dataset.from_arrays`.
    """
    found = {channels[columns[0]].group: list(columns) for columns in quaternions(channels)}
    names = [channel.name for channel in channels]
    for name in names:
        stem = group_of(name)
        columns = [names.index(stem + axis) for axis in "xyzw" if stem + axis in names]
        if not name.endswith("qw") or len(columns) != 4 or any(channels[i].kind is not Kind.LINEAR for i in columns):
            continue
        norms = np.linalg.norm(values[:, columns], axis=1)
        norms = norms[np.isfinite(norms)]
        if len(norms) and QUATERNION_NORM[0] < np.median(norms) < QUATERNION_NORM[1]:
            found[stem] = columns
    return found


def sign_continuous(path: Float[np.ndarray, "N 4"]) -> Float[np.ndarray, "N 4"]:
    """The same rotations, each with the sign that is nearer to the one before it."""
    signs = np.where((path[1:] * path[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    return np.asarray(path * np.concatenate([np.ones(min(len(path), 1)), np.cumprod(signs)])[:, None])
