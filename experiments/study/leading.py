"""A robot in a simulation, led by the live loop."""

from __future__ import annotations

from inphase.runtime import Clock, Loop


def lead(loop: Loop, clock: Clock, end: float) -> None:
    """Let the loop lead until that time [s] of the clock, or until it is over. Raises what made a device fail.

    Not `Loop.run`: Ctrl-C is to end the study, not to bring a robot to rest.
    """
    loop.begin()
    try:
        while not loop.over and loop.due < end:
            clock.wait_until(loop.due)
            loop.cycle()
    finally:
        loop.end()
    if loop.actuation.guard.failure is not None:
        raise loop.actuation.guard.failure
