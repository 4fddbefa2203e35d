"""When a hug has succeeded, in physical terms. The dissertation judges by impression; this can be counted."""

from __future__ import annotations

import numpy as np

from experiments.hugging.hug import Hug

TOUCH = 3.0  # [N] with which an arm holds somebody
FIRMEST = 150.0  # [N] an arm never presses harder for longer than a quarter of a second
SOON = 1.0  # [s] after the partner's arms are around the robot
MOST_OF_IT = 0.7  # of the time the partner holds
LET_GO = 1.5  # [s] after the partner has begun to let go
RAISED = 0.80  # [m] above the floor; hands at rest are at 0.5, raised ones at 1.2
CLOSED = 0.40  # [m] between the hands, from side to side; arms that are open have 0.8
NEAR = 0.8  # [m]


def judge(hug: Hug) -> dict[str, bool]:
    """What was asked of this hug, and whether it was so. All of it: success."""
    visit, clock = hug.visit, hug.clock
    holds = (clock >= visit.holds_from + min(SOON, 0.6 * visit.hold)) & (clock < visit.withdraws)
    quarter = max(1, round(0.25 / (clock[1] - clock[0])))
    lasting = np.stack([np.convolve(arm, np.ones(quarter) / quarter, "valid") for arm in hug.pressing.T])
    closed = (hug.gap < CLOSED) & (hug.raised > RAISED)
    asked = {"gentle": bool((lasting < FIRMEST).all())}
    if visit.kind == "nothing":
        return asked | {"does not hug": bool((hug.raised < RAISED).all())}
    if visit.kind == "air":
        return asked | {"does not close": bool(not closed.any())}
    after = clock >= visit.withdraws + LET_GO
    asked["lets go"] = bool((hug.holding[after] < TOUCH).all())
    if visit.kind == "apart":
        return asked
    asked["holds"] = bool((hug.pressing[holds] > TOUCH).all(1).mean() >= MOST_OF_IT)
    if visit.kind == "late":
        asked["waits"] = bool((hug.raised[clock < visit.raises] < RAISED).all())
    if visit.kind == "raised":
        asked["waits"] = not bool(closed[hug.near > NEAR].any())
    return asked
