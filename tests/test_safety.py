"""Every trouble is answered within a cycle, every transition says why, and nothing moves again too soon."""

from __future__ import annotations

import itertools
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inphase.errors import OptionError
from inphase.result import Status
from inphase.runtime.limits import Limits
from inphase.runtime.safety import STATUS_TROUBLES, Answer, Event, Facts, Policy, Situation, State, Trouble, react
from inphase.runtime.watchdog import Watchdog

ALLOWED = [(t, a) for t, a in itertools.product(Trouble, Answer) if (t, a) != (Trouble.LOST_ROBOT, Answer.RETREAT)]
policies = st.builds(
    Policy,
    **{t.policy: st.sampled_from([a for u, a in ALLOWED if u is t]) for t in Trouble},
    good_cycles=st.integers(1, 5),
    longest_retreat=st.floats(0.5, 10.0),
)
cycles = st.lists(
    st.tuples(
        st.one_of(st.just(set()), st.sets(st.sampled_from(Trouble))), st.booleans(), st.booleans(), st.booleans()
    ),
    min_size=1,
    max_size=60,
)


@pytest.mark.parametrize(("trouble", "answer"), ALLOWED)
@pytest.mark.parametrize("state", State)
def test_every_trouble_is_answered_within_one_cycle(trouble: Trouble, answer: Answer, state: State) -> None:
    policy = Policy(**{trouble.policy: answer})
    after, event = react(Situation(0.0, state), Facts(7.0, {trouble: "of the left arm"}), policy)
    if answer.state.rank > state.rank:
        assert after == Situation(7.0, answer.state, 0, trouble.lasting and answer is Answer.HOLD)
        assert event == Event(7.0, state, answer.state, f"{trouble.value}: of the left arm")
    else:
        assert after.state is state


def test_the_table_of_a_policy_names_every_trouble_and_every_status_that_no_robot_may_act_on() -> None:
    assert {t.policy for t in Trouble} == set(Policy.__dataclass_fields__) - {"good_cycles", "longest_retreat"}
    assert set(STATUS_TROUBLES) == {status for status in Status if not status.trustworthy}


@given(policies, cycles)
def test_over_any_course_of_troubles(policy: Policy, course: list) -> None:
    situation, good = Situation(0.0), 0
    for time, (troubles, at_rest, arrived, go_on) in enumerate(course, start=1):
        facts = Facts(float(time), dict.fromkeys(troubles, ""), at_rest, arrived, go_on)
        before, (situation, event) = situation, react(situation, facts, policy)
        good = 0 if troubles else good + 1
        worst = max((policy.answer(t).state.rank for t in troubles), default=0)
        # What is sent is at least as careful as what is asked, or a stop that is under way or over has its end; only
        # two ways lead up.
        assert situation.state.rank >= min(worst, State.STOPPING.rank)
        if situation.state.rank < before.state.rank:
            up = (before.state, situation.state)
            assert up in {(State.HOLDING, State.RUNNING), (State.STOPPED, State.HOLDING)}
            assert situation.state is not State.RUNNING or good >= policy.good_cycles
            assert situation.state is not State.HOLDING or go_on
        # Every transition has its event and every event its reason.
        assert (event is None) == ((situation.state, situation.waits) == (before.state, before.waits))
        if event is not None:
            assert (event.time, event.before, event.after) == (time, before.state, situation.state)
            assert event.reason
        # Who was interrupted waits for a word.
        if before.waits and situation.state is State.HOLDING and not situation.waits:
            assert go_on
        assert situation.state is State.HOLDING or not situation.waits


@given(policies, cycles)
def test_no_state_is_without_a_way_out(policy: Policy, course: list) -> None:
    """When all is well, what is asked is done in time and someone says to go on, it runs again."""
    situation = Situation(0.0)
    for time, (troubles, at_rest, arrived, go_on) in enumerate(course, start=1):
        situation, _ = react(
            situation, Facts(float(time), dict.fromkeys(troubles, ""), at_rest, arrived, go_on), policy
        )
    for i in range(20 + policy.good_cycles):  # a retreat never arrives: it takes too long, and becomes a stop
        situation, _ = react(situation, Facts(len(course) + 1.0 + i, at_rest=True, go_on=True), policy)
    assert situation.state is State.RUNNING


@pytest.mark.parametrize("needed", [1, 3, 10])
def test_a_robot_runs_after_the_named_number_of_good_cycles_and_no_sooner(needed: int) -> None:
    policy, situation = Policy(good_cycles=needed), Situation(0.0)
    for start in (0.0, 100.0):
        for i in range(needed):
            assert situation.state is State.HOLDING
            situation, event = react(situation, Facts(start + i), policy)
        assert situation.state is State.RUNNING
        assert event is not None
        assert str(needed) in event.reason
        for i in range(3):  # one bad cycle, and it begins anew
            situation, event = react(situation, Facts(start + 50 + i, {Trouble.STALE_SENSORS: "wrist"}), policy)
            assert (event is not None) == (i == 0)


def test_all_that_asks_for_the_answer_is_told() -> None:
    facts = Facts(1.0, {Trouble.LOST_ROBOT: "", Trouble.STALE_SENSORS: "wrist", Trouble.CRASH: "KeyError"})
    _, event = react(Situation(0.0, State.RUNNING), facts, Policy())
    assert event is not None
    assert event.reason == "the robot does not answer; the program failed: KeyError"


def test_a_pause_by_a_person_is_over_when_a_person_says_so() -> None:
    policy = Policy(interrupt=Answer.HOLD, good_cycles=2)
    situation, _ = react(Situation(0.0, State.RUNNING), Facts(1.0, {Trouble.INTERRUPT: ""}), policy)
    for time in range(2, 50):
        situation, event = react(situation, Facts(float(time)), policy)
        assert situation.waits
        assert event is None
    situation, event = react(situation, Facts(50.0, go_on=True), policy)
    assert event == Event(50.0, State.HOLDING, State.HOLDING, "someone said to go on")
    states = []
    for time in (51.0, 52.0):
        situation, _ = react(situation, Facts(time), policy)
        states.append(situation.state)
    assert states == [State.HOLDING, State.RUNNING]


@settings(max_examples=25)
@given(policies, st.integers(0, 2**32 - 1))
def test_through_any_trouble_what_is_sent_keeps_the_limits(policy: Policy, seed: int) -> None:
    """The two together, as a loop uses them; and each stop ends at rest."""
    rng, dt, home = np.random.default_rng(seed), 0.05, np.array([0.2])
    limits = Limits(np.array([-1.0]), np.array([1.0]), np.array([2.0]), np.array([4.0]))
    situation, position, velocity = Situation(0.0), np.zeros(1), np.zeros(1)
    for i in range(150):
        troubles = {t: "" for t in Trouble if rng.random() < 0.01}
        at_rest = bool((velocity == 0).all())
        arrived = at_rest and bool(abs(position - home) < 1e-6)
        situation, _ = react(situation, Facts(i * dt, troubles, at_rest, arrived, rng.random() < 0.1), policy)
        wanted = {State.RUNNING: 5 * rng.normal(size=1), State.RETREATING: home}.get(
            situation.state, np.full(1, np.nan)
        )
        before, before_velocity = position, velocity
        position, velocity = limits.limited(position, velocity, wanted, dt)
        measured = (position - before) / dt
        assert abs(position) <= 1
        assert abs(measured) <= 2 + 1e-9
        assert abs(measured - before_velocity) <= 4 * dt + 1e-9
        if situation.state is State.STOPPED:
            assert i * dt - situation.since < dt or velocity == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lost_robot": Answer.RETREAT}, "lost robot cannot retreat"),
        ({"good_cycles": 0}, "good_cycles >= 1, got 0"),
        ({"longest_retreat": 0.0}, "longest_retreat > 0"),
        ({"longest_retreat": float("inf")}, "longest_retreat > 0"),
    ],
)
def test_what_is_no_policy_is_refused(changes: dict, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        Policy(**changes)


# ------------------------------------------------------------------------------------------------------- the watchdog


class Hands:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.time = 0.0

    def __call__(self) -> float:
        return self.time


@given(st.lists(st.floats(0.0, 0.99), max_size=30))
def test_fed_in_time_it_never_barks_and_unfed_once(meals: list[float]) -> None:
    clock, barks = Hands(), []
    dog = Watchdog(1.0, lambda: barks.append(clock.time), clock)
    for wait in meals:
        clock.time += wait
        assert 0 < dog.check() <= 1.0 + 1e-9  # rounding
        dog.feed()
    assert barks == []
    for lapse in (1, 2):
        for late in (1.001, 0.5, 7.0):
            clock.time += late
            dog.check()
            assert len(barks) == lapse
            assert dog.barked
        dog.feed()
        assert not dog.barked


def test_a_bark_that_fails_is_told_and_the_watch_goes_on() -> None:
    clock, barks = Hands(), []

    def fail() -> None:
        barks.append(clock.time)
        raise OSError("the robot is gone")

    dog = Watchdog(1.0, fail, clock)
    for _ in range(2):
        dog.feed()
        clock.time += 2.0
        dog.check()
    assert len(barks) == 2
    assert isinstance(dog.failure, OSError)


def test_its_thread_barks_when_the_loop_hangs_and_ends_when_told() -> None:
    barked = threading.Event()
    with Watchdog(0.01, barked.set) as dog:
        assert barked.wait(30.0)
        assert dog.barked
    assert not any(thread.name == "inphase watchdog" for thread in threading.enumerate())


def test_its_thread_may_be_stopped_by_its_own_bark() -> None:
    done = threading.Event()

    def bark() -> None:
        dog.stop()
        done.set()

    dog = Watchdog(0.01, bark)
    dog.start()
    assert done.wait(30.0)


@pytest.mark.parametrize("patience", [0.0, -1.0, float("nan"), float("inf")])
def test_a_watchdog_without_patience_is_refused(patience: float) -> None:
    with pytest.raises(OptionError, match="patience > 0"):
        Watchdog(patience, lambda: None)
