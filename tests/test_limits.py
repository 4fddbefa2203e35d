"""Whatever is wanted, what is sent keeps its limits: measured by differences of what was sent."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from inphase.errors import OptionError
from inphase.runtime.limits import Limits, approach

INF = float("inf")
HELD = float("nan")


def one(low: float = -INF, high: float = INF, velocity: float = INF, acceleration: float = INF) -> Limits:
    return Limits(*(np.array([value]) for value in (low, high, velocity, acceleration)))


@dataclass
class Sent:
    """A robot that is told what the limits allow, and remembers all of it."""

    limits: Limits
    positions: list[np.ndarray]
    steps: list[float] = field(default_factory=list)
    velocities: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.velocities = np.zeros(len(self.limits))

    def send(self, wanted: object, dt: float, moving: object = None) -> float:
        goal = np.broadcast_to(np.asarray(wanted, dtype=float), (len(self.limits),))
        moves = None if moving is None else np.broadcast_to(np.asarray(moving, dtype=float), (len(self.limits),))
        position, self.velocities = self.limits.limited(self.positions[-1], self.velocities, goal, dt, moves)
        self.positions.append(position)
        self.steps.append(dt)
        return float(position[0])

    def broken(self) -> list[str]:
        """Which limits the differences of what was sent do not keep, but for rounding."""
        limits, positions = self.limits, np.array(self.positions)
        dt = np.array(self.steps)[:, None]
        velocity = np.diff(positions, axis=0) / dt
        acceleration = np.diff(velocity, axis=0, prepend=0.0) / dt
        rounding = 8 * np.finfo(float).eps * np.abs(positions).max()
        return [
            name
            for name, kept in (
                ("finite", np.isfinite(positions)),
                ("low", positions >= limits.low),
                ("high", positions <= limits.high),
                ("velocity", np.abs(velocity) <= limits.velocity * (1 + 1e-9) + rounding / dt),
                (
                    "acceleration",
                    np.abs(acceleration) <= limits.acceleration * (1 + 1e-9) + 4 * rounding / dt.min() ** 2,
                ),
            )
            if not kept.all()
        ]


rates = st.one_of(st.just(INF), st.floats(0.1, 20.0))
times = st.floats(1e-3, 1.0)
numbers = st.one_of(st.floats(-20.0, 20.0), st.floats(allow_nan=True, allow_infinity=True))


@st.composite
def limits_of(draw: st.DrawFn) -> Limits:
    low = draw(st.one_of(st.just(-INF), st.floats(-10.0, 0.0)))
    high = draw(st.one_of(st.just(INF), st.floats(0.0, 10.0)))
    return one(low, high, draw(rates), draw(rates))


@given(limits_of(), st.lists(st.tuples(numbers, times, st.one_of(st.none(), numbers)), min_size=1, max_size=40))
def test_whatever_is_wanted_the_limits_are_kept(
    limits: Limits, cycles: list[tuple[float, float, float | None]]
) -> None:
    sent = Sent(limits, [np.zeros(1)])
    for wanted, dt, moving in cycles:
        sent.send(wanted, dt, moving)
    assert sent.broken() == []


@pytest.mark.parametrize("steady", [True, False])
def test_channels_are_limited_each_by_its_own(rng: np.random.Generator, steady: bool) -> None:
    limits = Limits(
        np.array([-1.0, -INF, -2.0]), np.array([1.0, 5.0, 2.0]), np.array([1.0, 8.0, INF]), np.array([2.0, INF, 30.0])
    )
    together = Sent(limits, [np.zeros(3)])
    alone = [
        Sent(
            one(*(float(part[i]) for part in (limits.low, limits.high, limits.velocity, limits.acceleration))),
            [np.zeros(1)],
        )
        for i in range(3)
    ]
    for _ in range(2000):
        wanted = np.where(rng.random(3) < 0.1, HELD, 4 * rng.normal(size=3))
        dt = 0.01 if steady else float(rng.uniform(0.001, 0.1))
        together.send(wanted, dt)
        for i, robot in enumerate(alone):
            robot.send(wanted[i], dt)
    assert together.broken() == []
    assert_allclose(np.array(together.positions), np.hstack([np.array(robot.positions) for robot in alone]), atol=0)


@settings(max_examples=20)
@given(st.floats(0.5, 10.0), st.floats(0.5, 10.0), st.lists(times, min_size=300, max_size=300))
def test_at_full_speed_it_stops_before_the_limit(velocity: float, acceleration: float, steps: list[float]) -> None:
    """However the cycles fall, and whether it is driven into the limit or told to hold at the last moment."""
    driven = Sent(one(high=7.0, velocity=velocity, acceleration=acceleration), [np.zeros(1)])
    for dt in steps:
        driven.send(1e6, dt)
    assert driven.broken() == []
    seconds = sum(steps)
    if seconds > 4 * (7.0 / velocity + velocity / acceleration + np.sqrt(7.0 / acceleration)):
        assert driven.positions[-1][0] == pytest.approx(7.0, abs=1e-2)


@given(limits_of(), st.floats(-30.0, 30.0), st.lists(times, min_size=5, max_size=30))
def test_a_slow_stop_ends_at_rest_within_the_limits(limits: Limits, wanted: float, steps: list[float]) -> None:
    """From any motion: braked with all that is allowed, and not a cycle longer."""
    sent = Sent(limits, [np.zeros(1)])
    for dt in steps:
        sent.send(wanted, dt)
    speed = abs(float(sent.velocities[0]))
    dt, cycles = 0.01, 0
    while sent.velocities[0] != 0:
        sent.send(HELD, dt)
        cycles += 1
        assert cycles <= speed / (limits.acceleration[0] * dt) + 2
    stood = sent.send(HELD, dt)
    assert sent.send(HELD, dt) == stood
    assert sent.broken() == []


@settings(max_examples=40)
@given(st.floats(-5.0, 5.0), st.floats(0.5, 10.0), st.floats(0.5, 10.0), st.floats(0.005, 0.1))
def test_a_standing_position_is_reached_without_swinging_and_held(
    wanted: float, velocity: float, acceleration: float, dt: float
) -> None:
    sent = Sent(one(-5.0, 5.0, velocity, acceleration), [np.zeros(1)])
    # As fast as physics allows (to full speed, along, and down again), and a few cycles for beginning and end.
    full = min(velocity, np.sqrt(abs(wanted) * acceleration))
    shortest = abs(wanted) / full + full / acceleration if wanted else 0.0
    for _ in range(int(1.2 * shortest / dt) + 40):
        sent.send(wanted, dt)
    course = np.array(sent.positions)[:, 0]
    assert course[-1] == pytest.approx(wanted, abs=1e-9)
    assert (np.diff(course) * np.sign(wanted) >= -1e-12).all()
    assert sent.send(wanted, dt) == pytest.approx(course[-1], abs=1e-12)
    assert sent.broken() == []


def test_a_robot_that_moves_too_fast_to_stop_in_time_comes_back() -> None:
    sent = Sent(one(velocity=5.0, acceleration=3.0), [np.zeros(1)])
    for _ in range(200):
        sent.send(100.0, 0.01)
    here = sent.positions[-1][0]
    course = [sent.send(here, 0.01) for _ in range(1000)]
    assert max(course) > here + 1.0
    assert course[-1] == pytest.approx(here, abs=1e-9)
    assert sent.broken() == []


@pytest.mark.parametrize("dt", [0.002, 0.01, 0.1])
def test_what_keeps_the_limits_is_sent_as_it_is(dt: float) -> None:
    """Told how fast it moves: a sine of amplitude 1 that starts gently, speeds below 1, accelerations below 1."""
    time = np.arange(0, 10, dt)
    course = (1 - np.exp(-(time**2) / 8)) * np.sin(0.8 * time)
    sent = Sent(one(-1.5, 1.5, 1.0, 1.5), [course[:1]])
    for before, wanted in pairwise(course):
        assert sent.send(wanted, dt, (wanted - before) / dt) == pytest.approx(wanted, abs=1e-12)


def test_a_moving_position_is_caught_up_with_and_a_blind_pursuit_stays_behind() -> None:
    """From rest, after a jump: told of its speed the robot ends on it, else v · dt + v² / 2a behind."""
    dt, speed, acceleration = 0.01, 0.5, 2.0
    told, blind = (Sent(one(velocity=2.0, acceleration=acceleration), [np.zeros(1)]) for _ in range(2))
    for i in range(1000):
        wanted = 1.0 + speed * dt * i
        gap_told, gap_blind = wanted - told.send(wanted, dt, speed), wanted - blind.send(wanted, dt)
    assert gap_told == pytest.approx(0.0, abs=1e-9)
    assert gap_blind == pytest.approx(speed**2 / (2 * acceleration), rel=1e-3)
    assert told.broken() == blind.broken() == []


def test_without_limits_what_is_wanted_is_sent(rng: np.random.Generator) -> None:
    sent = Sent(Limits.none(4), [np.zeros(4)])
    for dt in rng.uniform(0.001, 1.0, 100):
        wanted = rng.normal(size=4)
        sent.send(wanted, float(dt))
        assert_allclose(sent.positions[-1], wanted, atol=1e-12)


@pytest.mark.parametrize("dt", [0.0, -1.0, HELD, INF, 1e-12])
def test_where_no_time_has_passed_nothing_changes(dt: float) -> None:
    positions, velocities = one(velocity=1.0).limited(np.array([0.3]), np.array([0.7]), np.array([5.0]), dt)
    assert positions == 0.3
    assert velocities == 0.7


def test_from_outside_it_comes_back_in_when_something_is_wanted_and_goes_no_further_out() -> None:
    for start in (-3.0, 3.0):
        sent = Sent(one(-1.0, 1.0, 1.0, 2.0), [np.array([start])])
        assert sent.send(HELD, 0.01) == start
        course = [sent.send(2 * start, 0.01) for _ in range(500)]
        assert max(np.abs(course)) <= abs(start)
        assert course[-1] == pytest.approx(start / 3, abs=1e-9)
        assert set(sent.broken()) <= {"low", "high"}


@given(st.floats(-100, 100), rates, times)
def test_the_approach_solves_its_equation(distance: float, acceleration: float, dt: float) -> None:
    speed = abs(float(approach(np.array([distance]), np.array([acceleration]), dt)[0]))
    assert speed * dt + speed**2 / (2 * acceleration) == pytest.approx(abs(distance), rel=1e-9)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ((1.0, -1.0, 1.0, 1.0), "expected low <= high of channel 0, got 1 and -1"),
        ((HELD, 1.0, 1.0, 1.0), "low <= high of channel 0"),
        ((INF, INF, 1.0, 1.0), "low <= high of channel 0"),
        ((-1.0, 1.0, 0.0, 1.0), "velocity > 0 of channel 0, got 0"),
        ((-1.0, 1.0, HELD, 1.0), "velocity > 0 of channel 0, got nan"),
        ((-1.0, 1.0, 1.0, -2.0), "acceleration > 0 of channel 0, got -2"),
    ],
)
def test_what_are_no_limits_is_refused(parts: tuple[float, float, float, float], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        one(*parts)


def test_what_leaves_or_stays_is_never_changed() -> None:
    limits = one(-1.0, 1.0, 1.0, 1.0)
    given = [np.array([0.5]), np.array([0.2]), np.array([HELD])]
    kept = [array.copy() for array in given]
    limits.limited(*given, 0.1)
    for array, before in zip(given, kept, strict=True):
        assert_allclose(array, before, atol=0)
    with pytest.raises(ValueError, match="read-only"):
        limits.low[0] = 3.0
