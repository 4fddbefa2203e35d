"""Gathers what is wrong in a cycle, and keeps the state that follows from it."""

from __future__ import annotations

from inphase.result import Estimate
from inphase.runtime.safety import STATUS_TROUBLES, Event, Facts, Policy, Situation, State, Trouble, react


class Guard:
    """What is known of troubles that last, and the situation they have led to.

    interrupts: how often someone interrupted. failure: what made the program fail. lost_robot: why the robot counts as
    lost; None while it answers.
    """

    def __init__(self, policy: Policy, late_commands: int, now: float) -> None:
        self.policy = policy
        self.situation = Situation(now)
        self.interrupts = 0
        self.failure: Exception | None = None
        self.lost_robot: str | None = None
        self._late_commands = late_commands
        self._going_on = False

    @property
    def state(self) -> State:
        """What the robot does."""
        return self.situation.state

    def go_on(self) -> None:
        """Someone says so: interrupts are over."""
        self._going_on, self.interrupts = True, 0

    def react(
        self,
        now: float,
        estimate: Estimate | None,
        unseen: tuple[str, ...],
        missed: int,
        braked: str,
        *,
        at_rest: bool,
        arrived: bool,
    ) -> Event | None:
        """The event, if the situation is another one now.

        unseen: channels without which the partner is not seen. missed: commands that were left out. braked: why the
        watchdog braked, "" where it did not.
        """
        troubles: dict[Trouble, str] = {}
        if estimate is not None and (trouble := STATUS_TROUBLES.get(estimate.status)):
            troubles[trouble] = estimate.status.value
        if unseen:
            troubles[Trouble.STALE_SENSORS] = ", ".join(unseen)
        if braked:
            troubles[Trouble.MISSED_DEADLINES] = braked
        elif missed >= self._late_commands:
            troubles[Trouble.MISSED_DEADLINES] = f"{missed} commands were not sent"
        if self.lost_robot is not None:
            troubles[Trouble.LOST_ROBOT] = self.lost_robot
        if self.interrupts:
            troubles[Trouble.INTERRUPT] = ""
        if self.failure is not None:
            troubles[Trouble.CRASH] = f"{type(self.failure).__name__}: {self.failure}"
        facts = Facts(now, troubles, at_rest, arrived, self._going_on)
        self.situation, event = react(self.situation, facts, self.policy)
        self._going_on = False
        return event
