"""What a robot does when something is wrong: which trouble is answered how, and when all is well again.

    HOLDING ──(good for so many cycles)──▶ RUNNING
       ▲ ▲                                    │
       │ └──────────── trouble: hold ─────────┤
       │                                      │        (from any state, whatever the trouble asks for)
       │               trouble: retreat ──▶ RETREATING ──(arrived)──────┐
       │                                      │ (trouble, or too long)  │
       │               trouble: stop ─────▶ STOPPING ──(at rest)──▶ STOPPED
       └──────────────────(someone says to go on)──────────────────────┘

A state gives way to the ones further down only. There are two ways up, and both lead through HOLDING: nothing moves
again before all has been well for some time.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from inphase.errors import OptionError, listing
from inphase.result import Status

GO_ON = "someone said to go on"


class State(str, enum.Enum):
    """What the robot does; the value is the sentence to show. In order: each is further from going on than the last."""

    RUNNING = "plays the response"
    HOLDING = "comes to rest, and goes on when all is well"
    RETREATING = "moves back to where it is out of the way"
    STOPPING = "comes to rest, for good"
    STOPPED = "stands still until someone says to go on"

    @property
    def rank(self) -> int:
        """0 for RUNNING … 4 for STOPPED."""
        return list(State).index(self)


class Answer(str, enum.Enum):
    """What is done about a trouble."""

    HOLD = "hold"
    RETREAT = "retreat"
    STOP = "stop"

    @property
    def state(self) -> State:
        """The state it leads to."""
        return {Answer.HOLD: State.HOLDING, Answer.RETREAT: State.RETREATING, Answer.STOP: State.STOPPING}[self]


class Trouble(str, enum.Enum):
    """What can be wrong; the name in small letters is that of its policy, the value is the sentence to show."""

    STALE_SENSORS = "nothing is read of the partner"
    COLLAPSED_FILTER = "the filter has lost the interaction"
    UNLIKE_PARTNER = "the partner moves unlike any demonstration"
    MISSED_DEADLINES = "the loop is too slow"
    LOST_ROBOT = "the robot does not answer"
    INTERRUPT = "someone interrupted"
    CRASH = "the program failed"

    @property
    def policy(self) -> str:
        """The name of what the policy says of it."""
        return self.name.lower()

    @property
    def lasting(self) -> bool:
        """Whether it is over only when someone says so: that it is gone from a cycle's facts says nothing."""
        return self in (Trouble.INTERRUPT, Trouble.CRASH)


STATUS_TROUBLES: Mapping[Status, Trouble] = MappingProxyType(
    {
        Status.BLIND: Trouble.STALE_SENSORS,
        Status.UNLIKE: Trouble.UNLIKE_PARTNER,
        Status.COLLAPSED: Trouble.COLLAPSED_FILTER,
    }
)


@dataclass(frozen=True)
class Policy:
    """What is done about each trouble, and when it is over.

    good_cycles: how many in a row without trouble lead from HOLDING to RUNNING. longest_retreat: [s] after which a
    retreat that has not arrived becomes a stop. Raises OptionError for an answer that is none, and for numbers that
    are not positive.
    """

    stale_sensors: Answer = Answer.HOLD
    collapsed_filter: Answer = Answer.HOLD
    unlike_partner: Answer = Answer.HOLD
    missed_deadlines: Answer = Answer.HOLD
    lost_robot: Answer = Answer.STOP
    interrupt: Answer = Answer.STOP
    crash: Answer = Answer.STOP
    good_cycles: int = 10
    longest_retreat: float = 10.0

    def __post_init__(self) -> None:
        for trouble in Trouble:
            answer = getattr(self, trouble.policy)
            if not isinstance(answer, Answer):
                allowed = listing(answer.value for answer in Answer)
                raise OptionError(f"safety: expected {trouble.policy} to be one of {allowed}, got {answer!r}")
        if self.lost_robot is Answer.RETREAT:
            raise OptionError("safety: expected lost_robot to be one of hold, stop: a lost robot cannot retreat")
        if self.good_cycles < 1:
            raise OptionError(f"safety: expected good_cycles >= 1, got {self.good_cycles}")
        if not 0 < self.longest_retreat < float("inf"):
            raise OptionError(f"safety: expected a finite longest_retreat > 0, got {self.longest_retreat}")

    @property
    def retreats(self) -> tuple[str, ...]:
        """The names of what is answered by a retreat."""
        return tuple(trouble.policy for trouble in Trouble if self.answer(trouble) is Answer.RETREAT)

    def answer(self, trouble: Trouble) -> Answer:
        """What is done about it."""
        answer: Answer = getattr(self, trouble.policy)
        return answer


@dataclass(frozen=True)
class Facts:
    """What is known in one cycle.

    time: [s]. troubles: what is wrong, each with more about it ("" for nothing to add), such as the channels that are
    stale. at_rest: whether what is sent stands still. arrived: whether it stands where retreats end. go_on: whether
    someone said to go on.
    """

    time: float
    troubles: Mapping[Trouble, str] = field(default_factory=dict)
    at_rest: bool = False
    arrived: bool = False
    go_on: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "troubles", MappingProxyType(dict(self.troubles)))


@dataclass(frozen=True)
class Situation:
    """The state, and what has to be remembered of how it came about; a loop begins HOLDING.

    since: [s] when the state began. good: cycles in a row without trouble. waits: whether good cycles are not enough,
    and someone has to say to go on.
    """

    since: float
    state: State = State.HOLDING
    good: int = 0
    waits: bool = False


@dataclass(frozen=True)
class Event:
    """A transition, and why.

    time: [s]. before, after: the same where a robot that holds now waits for someone, or no longer does.
    """

    time: float
    before: State
    after: State
    reason: str


def react(situation: Situation, facts: Facts, policy: Policy) -> tuple[Situation, Event | None]:
    """The situation after one more cycle, and the event if it is another one."""
    state, waits, reason = _next(situation, facts, policy)
    if state is situation.state and waits == situation.waits:
        good = 0 if facts.troubles else situation.good + 1
        return Situation(situation.since, state, good, waits), None
    since = situation.since if state is situation.state else facts.time
    return Situation(since, state, 0, waits), Event(facts.time, situation.state, state, reason)


def _next(situation: Situation, facts: Facts, policy: Policy) -> tuple[State, bool, str]:
    """The next state, whether it waits for someone, and why."""
    state, waits = situation.state, situation.waits
    asked = {trouble: policy.answer(trouble).state for trouble in facts.troubles}
    worst = max(asked.values(), key=lambda s: s.rank, default=State.RUNNING)
    reason = "; ".join(_sentence(trouble, facts) for trouble in facts.troubles if asked[trouble] is worst)
    if worst.rank > state.rank:
        return worst, worst is State.HOLDING and _lasting(facts), reason
    if state is State.HOLDING and not waits and _lasting(facts):
        return state, True, reason
    if state is State.HOLDING and waits and facts.go_on and not _lasting(facts):
        return state, False, GO_ON
    if state is State.HOLDING and not waits and not facts.troubles and situation.good + 1 >= policy.good_cycles:
        return State.RUNNING, False, f"all was well for {situation.good + 1} cycles"
    if state is State.RETREATING and facts.arrived:
        return State.STOPPED, False, "the retreat is over"
    if state is State.RETREATING and facts.time - situation.since > policy.longest_retreat:
        return State.STOPPING, False, f"the retreat took longer than {policy.longest_retreat:g} s"
    if state is State.STOPPING and facts.at_rest:
        return State.STOPPED, False, "the stop is over"
    if state is State.STOPPED and facts.go_on and worst.rank <= State.HOLDING.rank and not _lasting(facts):
        return State.HOLDING, False, GO_ON
    return state, waits, ""


def _sentence(trouble: Trouble, facts: Facts) -> str:
    more = facts.troubles[trouble]
    return f"{trouble.value}: {more}" if more else trouble.value


def _lasting(facts: Facts) -> bool:
    return any(trouble.lasting for trouble in facts.troubles)
