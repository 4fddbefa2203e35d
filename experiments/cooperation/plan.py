"""What is going to happen in a trial: where the thing is, what the person does, where the robot is led."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.bodies.person import SHARES
from experiments.cooperation.people import PEOPLE, Someone, Sway, Track, someone
from experiments.cooperation.world import HANDLE, HANDOVER, LIFT, Place

Way = Callable[[float], np.ndarray]


@dataclass(frozen=True, eq=False)
class Plan:
    """One trial. All ways are functions of time [s].

    thing: (3,) where it is at first. palms: (2, 3) right and left. pelvis: (2,). feet: (2, 3). grip: (2,) how hard the
    fingers close, 0 to 1. holds: from when to when the person holds on. tool: (4,) where the robot is led: the place
    between its fingers, and how far it looks down [rad]. closed: (1,) of the gripper.
    """

    place: Place
    person: Someone
    back: float  # how much of bending down the back does
    duration: float
    thing: np.ndarray
    palms: Way
    pelvis: Way
    feet: Way
    grip: Way
    holds: tuple[float, float]
    waits: float
    tool: Way
    closed: Way


def plan(place: Place, seed: int, trial: int) -> Plan:
    """The plan of a trial; the people take turns."""
    rng = np.random.default_rng([seed, 2000, place is LIFT, trial])
    person = someone(seed, trial % PEOPLE)
    return (_handover if place is HANDOVER else _lift)(person, rng)


def _clock(person: Someone, rng: np.random.Generator) -> Callable[..., list[float]]:
    """When things begin that take so long, one after another, in somebody's pace."""

    def begins(*lasting: float) -> list[float]:
        mine = person.pace * np.exp(0.10 * rng.standard_normal(len(lasting))) * np.array(lasting)
        return [0.0, *np.cumsum(mine)]

    return begins


def _handover(person: Someone, rng: np.random.Generator) -> Plan:
    h = person.height
    thing = np.array([rng.uniform(0.98, 1.12), rng.uniform(-0.28, 0.28), HANDOVER.tops[0][4] + HANDOVER.thing[2]])
    # idle, robot begins, reached, at the thing, closed, lifted, brought, taken, opened, put away
    t = _clock(person, rng)(rng.uniform(0.2, 0.9), 0.55, 1.5, 0.8, 0.5, 0.6, 1.6, 0.45, 0.45, 1.1)
    reached = t[1] + person.pace * 1.15 * np.exp(0.1 * rng.standard_normal())
    stand = rng.normal([0.0, 0.0], [0.03, 0.04])
    rest = np.array([[0.07, -0.145 * h, 0.46 * h], [0.07, 0.145 * h, 0.46 * h]]) + rng.normal(0, 0.015, (2, 3))
    rest[:, :2] += stand
    shoulder = np.array([stand[0], stand[1] - h * SHARES["shoulders"] / 2, 0.81 * h])
    way = thing - shoulder
    far = 0.387 * h + 0.12 + 0.4 * (np.linalg.norm(way) - 1.15) + rng.normal(0, 0.02)
    shown = shoulder + way / np.linalg.norm(way) * far + rng.normal(0, 0.02, 3)
    take = np.array([0.56, 0.4 * thing[1] - 0.10, 0.62 * h]) + person.hold + rng.normal(0, 0.025, 3)
    home = np.array([0.30, -0.12, 0.68 * h]) + rng.normal(0, 0.02, 3)
    waits = t[5] + 0.15 * person.pace
    right = Track([t[1], reached, waits, t[7] - 0.1, t[9] + 0.05, t[10]], [rest[0], shown, shown, take, take, home])
    left = Track([0.0, t[10]], [rest[1], rest[1] + rng.normal(0, 0.03, 3)])
    grip = Track(
        [0.0, t[1], reached, waits, t[7], t[8], t[10]],
        [[0.03, 0.03], [0.03, 0.03], [0.15, 0.03], [0.1, 0.03], [0.1, 0.03], [0.6, 0.03], [0.45, 0.03]],
    )
    lead = rng.normal(0, 0.004, 3)  # who leads it does not hit the middle
    begin = np.array([1.02, -0.13, 1.10]) + rng.normal(0, 0.005, 3)
    at = thing + np.array([0, 0, 0.01]) + lead
    lifted = thing + np.array([-0.05, 0.0, 0.16]) + rng.normal(0, 0.015, 3)
    before = at + 0.07 * _out(at, HANDOVER) + np.array([0, 0, 0.12]) + rng.normal(0, 0.01, 3)
    given = take + np.array([0.075, 0.0, 0.02]) + rng.normal(0, 0.008, 3)
    back = given + 0.16 * _out(given, HANDOVER) + np.array([0, 0, 0.03])
    tool = Track(
        [t[2], t[3], t[4], t[5], t[6], t[7], t[9], t[10]],
        [
            [*p, a]
            for p, a in (
                (begin, 1.0),
                (before, 0.9),
                (at, 0.8),
                (at, 0.8),
                (lifted, 0.7),
                (given, 0.4),
                (given, 0.4),
                (back, 0.4),
            )
        ],
    )
    closed = Track([t[4], t[5], t[8] + 0.1, t[9]], [[0.0], [1.0], [1.0], [0.0]])
    sway, wobble = _sway(rng), Sway([0.003, 0.003, 0.003, 0.01], rng)
    feet = np.array([[stand[0], stand[1] - 0.07 * h, 0.0], [stand[0], stand[1] + 0.07 * h, 0.0]])
    return Plan(
        HANDOVER,
        person,
        0.9 + 0.1 * person.back,
        t[10],
        thing,
        palms=lambda time: np.stack([right(time), left(time)]) + sway(time)[:6].reshape(2, 3),
        pelvis=lambda time: stand + sway(time)[6:],
        feet=lambda time: feet,
        grip=grip,
        holds=(t[8], np.inf),
        waits=t[8] - 0.02,
        tool=lambda time: tool(time) + wobble(time),
        closed=closed,
    )


def _lift(person: Someone, rng: np.random.Generator) -> Plan:
    h, (half, wide, high) = person.height, LIFT.thing
    low, top = LIFT.tops
    thing = np.array([low[0] + rng.uniform(-0.04, 0.04), low[1] + rng.uniform(-0.16, 0.16), low[4] + high])
    goal = np.array([top[0] + rng.uniform(-0.03, 0.04), top[1] + rng.uniform(-0.15, 0.15), top[4] + high])
    carried = goal[2] + rng.uniform(0.06, 0.16)
    # idle, robot begins, both there, closed, up, across, down, let go, away
    t = _clock(person, rng)(rng.uniform(0.2, 0.9), 0.5, 1.9, 0.6, 1.4, 1.9, 1.0, 0.5, 1.1)
    gripped = t[1] + person.pace * 1.6 * np.exp(0.1 * rng.standard_normal())
    aside = t[5] - 0.25 * (t[5] - t[4])  # they go aside before it is quite up
    box_y = Track([aside, t[6]], [[thing[0], thing[1]], [goal[0], goal[1]]])
    box_z = Track([t[4], t[5], t[6], t[7]], [[thing[2]], [carried], [carried], [goal[2] - 0.01]])
    sway = _sway(rng)

    def box(time: float) -> np.ndarray:
        return np.concatenate([box_y(time), box_z(time)])

    def stand(time: float) -> np.ndarray:
        return np.array([0.0, thing[1] + there[1] + (box_y(time)[1] - thing[1])])

    there = rng.normal([0.0, 0.0], [0.02, 0.04])
    held = np.array([[-half + 0.07, -wide - 0.012, -0.09], [-half + 0.07, wide + 0.012, -0.09]])
    held += rng.normal(0, [0.015, 0.0, 0.02], (2, 3))
    rest = np.array([[0.07, -0.145 * h, 0.46 * h], [0.07, 0.145 * h, 0.46 * h]])
    from_rest = Track([t[1], gripped, t[8], t[9]], [[0.0], [1.0], [1.0], [0.0]])

    def palms(time: float) -> np.ndarray:
        share = from_rest(time)[0]
        hanging = rest + np.array([*stand(time), 0.0])
        wider = np.array([[0.0, -0.12, 0.06], [0.0, 0.12, 0.06]]) * 4 * share * (1 - share)
        return np.asarray(share * (box(time) + held) + (1 - share) * hanging + wider) + sway(time)[:6].reshape(2, 3)

    feet = _steps(stand, aside, t[6], h)
    grip = Track([gripped - 0.3, t[4], t[7], t[8] + 0.2], [[0.03] * 2, [0.6] * 2, [0.6] * 2, [0.03] * 2])
    knob = np.array([half + 0.6 * HANDLE, 0.0, 0.0]) + rng.normal(0, 0.004, 3)
    begin = np.array([1.02, 0.25, 0.80]) + rng.normal(0, 0.005, 3)
    before = thing + knob + [0.13, 0.0, 0.03] + rng.normal(0, 0.01, 3)
    near = Track([t[2], t[3] - 0.25 * (t[3] - t[2]), t[3]], [begin, before, thing + knob])
    away = Track([t[8], t[9]], [[0.0, 0.0, 0.0], [0.16, 0.0, 0.02]])
    pitch = rng.normal(0.12, 0.02)
    wobble = Sway([0.002, 0.002, 0.002, 0.005], rng)

    def tool(time: float) -> np.ndarray:
        where = near(time) if time < t[3] else box(time) + knob + away(time)
        return np.array([*where, pitch]) + wobble(time)

    return Plan(
        LIFT,
        person,
        person.back,
        t[9],
        thing,
        palms=palms,
        pelvis=lambda time: stand(time) + sway(time)[6:],
        feet=feet,
        grip=grip,
        holds=(t[4] - 0.1, t[8]),
        waits=t[4] - 0.12,
        tool=tool,
        closed=Track([t[3], t[4] - 0.1, t[7] + 0.1, t[8]], [[0.0], [1.0], [1.0], [0.0]]),
    )


def _sway(rng: np.random.Generator) -> Sway:
    return Sway([0.006] * 6 + [0.008] * 2, rng)


def _out(at: np.ndarray, place: Place) -> np.ndarray:
    """Level, from a thing towards the robot."""
    way = np.array([place.base[0] - at[0], place.base[1] - at[1], 0.0])
    return np.asarray(way / np.linalg.norm(way))


def _steps(stand: Way, begin: float, end: float, height: float) -> Way:
    """Feet that go aside with the body in two steps each, the left first."""
    apart, first, last = 0.07 * height, stand(begin), stand(end)
    turns = np.linspace(begin, end, 5)
    marks = {1: (0, 2), 0: (1, 3)}  # whose turns these are
    tracks = []
    for side, sign in ((0, -1), (1, 1)):
        times, points = [0.0], [[*first, 0.0]]
        for i, turn in enumerate(marks[side]):
            was, to = (first + (last - first) * (i + k) / 2 for k in (0, 1))
            middle = (turns[turn] + turns[turn + 1]) / 2
            times += [turns[turn], middle, turns[turn + 1]]
            points += [[*was, 0.0], [*(was + to) / 2, 0.06], [*to, 0.0]]
        if times[1] <= 0:
            raise ValueError(f"expected steps after the beginning, got {times}")
        tracks.append(Track(times, [[p[0], p[1] + sign * apart, p[2]] for p in _distinct(times, points)]))
    return lambda time: np.stack([track(time) for track in tracks])


def _distinct(times: list[float], points: list[list[float]]) -> list[list[float]]:
    for i in range(len(times) - 1, 0, -1):
        if times[i] <= times[i - 1]:
            del times[i], points[i]
    return points
