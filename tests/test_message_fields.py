"""Every number that a message is said to hold is found at its place, and what is not there is NaN."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inphase.errors import OptionError
from inphase.runtime.adapters.message_fields import LONGEST, Field, fields_of, stamp_of


@dataclass
class Stamp:  # as rosbags makes them
    sec: int
    nanosec: int


@dataclass
class Header:
    stamp: Stamp
    frame_id: str = "base"


@dataclass
class Vector:
    x: float
    y: float


@dataclass
class Joints:
    name: list[str]
    position: Any
    header: Header = field(default_factory=lambda: Header(Stamp(0, 0)))


@dataclass
class Point:
    positions: Any
    time_from_start: Stamp


@dataclass
class Trajectory:
    joint_names: list[str]
    points: list[Point]


class Slots:  # as rospy makes them
    __slots__ = ["nsecs", "secs"]

    def __init__(self, secs: int, nsecs: int) -> None:
        self.secs, self.nsecs = secs, nsecs


class Bytes:
    __slots__ = ["data", "lit", "since", "text"]

    def __init__(self) -> None:
        self.data, self.lit, self.text, self.since = b"\x00\x07\xff", True, "no number", Slots(2, 500_000_000)


def test_places_by_attribute_number_and_name():
    joints = Joints(["base.elbow", "wrist"], np.array([1.5, -2.5]))
    assert Field("position[base.elbow]").of(joints) == 1.5
    assert Field("position[wrist]").of(joints) == Field("position[1]").of(joints) == -2.5
    assert Field("pose.x").of(SimpleNamespace(pose=Vector(3.0, 4.0))) == 3.0
    assert fields_of(joints) == ["position[base.elbow]", "position[wrist]"]


def test_a_joint_is_found_wherever_its_name_stands():
    one, other = Joints(["a", "b"], [1.0, 2.0]), Joints(["b", "c", "a"], [2.0, 3.0, 1.0])
    assert Field("position[a]").of(one) == Field("position[a]").of(other) == 1.0


def test_names_that_are_not_of_these_entries_are_not_taken_for_theirs():
    assert math.isnan(Field("position[a]").of(Joints(["a", "b"], [1.0])))  # of which of them?
    assert math.isnan(Field("position[a]").of(Joints(["a", "a"], [1.0, 2.0])))
    assert fields_of(Joints(["a", "a"], [1.0, 2.0])) == ["position[0]", "position[1]"]
    named = SimpleNamespace(name="ab", data=[1.0, 2.0])  # the message's own name is none of entries
    assert math.isnan(Field("data[a]").of(named))
    assert Field("position[1]").of(Joints(["1", "0"], [5.0, 6.0])) == 5.0  # a name before a number


def test_lists_of_messages_are_entered_and_named_by_what_is_around_them():
    points = [Point([1.0, 2.0], Stamp(0, 0)), Point([3.0, 4.0], Stamp(1, 250_000_000)), Point([], Stamp(2, 0))]
    path = Trajectory(["elbow", "wrist"], points)
    assert Field("points[1].positions[wrist]").of(path) == 4.0
    assert Field("points[1].positions[0]").of(path) == 3.0
    assert Field("points[1].time_from_start").of(path) == 1.25
    assert math.isnan(Field("points[2].positions[wrist]").of(path))
    assert fields_of(path) == [
        *("points[0].positions[elbow]", "points[0].positions[wrist]", "points[0].time_from_start"),
        *("points[1].positions[elbow]", "points[1].positions[wrist]", "points[1].time_from_start"),
        "points[2].time_from_start",
    ]
    bodies = SimpleNamespace(name=["cup", "table"], pose=[Vector(1, 2), Vector(3, 4)])
    assert Field("pose[table].y").of(bodies) == 4.0


def test_bytes_truths_and_times_are_numbers_and_texts_are_not():
    message = Bytes()
    assert fields_of(message) == ["data[0]", "data[1]", "data[2]", "lit", "since"]
    assert [Field(place).of(message) for place in fields_of(message)] == [0, 7, 255, 1, 2.5]
    assert math.isnan(Field("text").of(message))
    assert math.isnan(Field("text[0]").of(message))
    flags = SimpleNamespace(data=np.array([True, False]), small=np.array([3], dtype=np.uint8))
    assert [Field(f"data[{i}]").of(flags) for i in range(2)] == [1.0, 0.0]
    assert Field("small[0]").of(flags) == 3.0


@pytest.mark.parametrize("place", ["velocity[0]", "position[2]", "position[x]", "position.x", "position", "a.b.c[1].d"])
def test_what_is_not_there_is_nan(place):
    assert math.isnan(Field(place).of(Joints(["a", "b"], [1.0, 2.0])))


@pytest.mark.parametrize("place", ["", ".x", "x.", "a..b", "[0]", "a[]", "a[0", "a[[0]]", "a b", "a]", "1a", "a[0]b"])
def test_a_text_that_is_no_place_is_refused(place):
    with pytest.raises(OptionError, match=r"expected a place in a message, such as .* got"):
        Field(place)


def test_stamps_of_ros_1_and_2():
    assert stamp_of(Joints([], [], Header(Stamp(5, 250_000_000)))) == 5.25
    assert stamp_of(SimpleNamespace(header=SimpleNamespace(stamp=Slots(7, 500_000_000)))) == 7.5
    assert stamp_of(Joints([], [])) is None  # never set
    assert stamp_of(Vector(1, 2)) is None


def test_of_a_long_list_the_first_entries_are_told():
    image = SimpleNamespace(data=np.zeros(10**6, dtype=np.uint8))
    image.__dataclass_fields__ = {"data": None}
    assert fields_of(image) == [f"data[{i}]" for i in range(LONGEST)]
    assert Field("data[999999]").of(image) == 0.0


names = st.lists(st.text(min_size=1, max_size=4), max_size=4)
numbers = st.lists(st.floats(allow_nan=False), max_size=4)


@given(names=names, position=numbers, points=st.lists(numbers, max_size=3))
def test_each_place_that_is_told_leads_to_its_number(names, position, points):
    message = Joints(names, position)
    assert [Field(place).of(message) for place in fields_of(message)] == position
    path = Trajectory(names, [Point(p, Stamp(1, 0)) for p in points])
    expected = [number for p in points for number in [*p, 1.0]]
    assert [Field(place).of(path) for place in fields_of(path)] == expected
