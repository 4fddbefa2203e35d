"""Groups of channels as one: in a data set and in the live stream, seen in part or not at all."""

from __future__ import annotations

import numpy as np
import pytest
from interactions import shapes_unchecked, taught
from numpy.testing import assert_allclose, assert_array_equal

import inphase

NAN = np.nan
NAMES = ["hand", "touch_left_0", "touch_left_1", "lean", "touch_right_0", "touch_right_1", "touch_right_2"]
ROWS = np.array(
    [
        [1, 2, 3, 9, 3, 4, 12],
        [1, NAN, 3, 9, NAN, 4, 3],
        [1, NAN, NAN, 9, -3, NAN, NAN],
        [NAN, -2, -3, 9, 0, 0, 0],
    ]
)
BOTH = {"left": ("touch_left_*", "max"), "right": (["touch_right_0", "touch_right_[12]"], "norm")}


def demos(rows: np.ndarray = ROWS, **options) -> inphase.Dataset:
    values = np.column_stack([rows, np.arange(len(rows))])
    return inphase.Dataset.from_arrays([np.arange(float(len(rows)))] * 3, [values] * 3, NAMES, ["arm"], **options)


def test_one_channel_a_group_where_its_first_was():
    reduced = inphase.Reduction(BOTH).dataset(demos(units={"touch_l*": "N", "touch_right_0": "N", "hand": "m"}))
    assert reduced.observed == ("hand", "left", "lean", "right")
    assert reduced.controlled == ("arm",)
    assert [channel.unit for channel in reduced.channels] == ["m", "N", "", "", ""]
    left = [3, 3, NAN, -2]
    right = [13, 5, 3, 0]
    assert_allclose(reduced[1].values, np.column_stack([ROWS[:, 0], left, ROWS[:, 3], right, np.arange(4)]))
    assert (reduced[1].name, len(reduced)) == ("demonstration 1", 3)


def test_the_mean_of_what_was_seen():
    reduced = inphase.Reduction({"touch": ("touch_*", "mean")}).dataset(demos())
    assert_allclose(reduced[0].values[:, 1], [24 / 5, 10 / 3, -3, -1])


@pytest.mark.parametrize("way", ["max", "mean", "norm"])
def test_a_live_sample_is_what_the_data_set_is(way):
    reduction = inphase.Reduction({"left": ("touch_left_*", way), "right": ("touch_right_*", way)})
    expected = reduction.dataset(demos())[0].values[:, :4]
    for row, wanted in zip(ROWS, expected, strict=True):
        assert_array_equal(reduction.sample(row, observed=NAMES), wanted)
        by_name = reduction.sample(dict(zip(NAMES, row, strict=True)))
        assert list(by_name) == ["hand", "left", "lean", "right"]
        assert_array_equal(list(by_name.values()), wanted)
        seen = {name: value for name, value in zip(NAMES, row, strict=True) if not np.isnan(value)}
        assert reduction.sample(seen) == {name: value for name, value in by_name.items() if not np.isnan(value)}


def test_what_is_infinite_is_not_seen_and_what_is_not_there_is_left_out():
    reduction = inphase.Reduction(BOTH)
    assert reduction.sample({"touch_left_0": np.inf, "touch_left_1": 2.0}) == {"left": 2.0}
    assert reduction.sample({}) == {}
    shown = {"touch_left_0": 1.0}
    assert reduction.sample(shown) == {"left": 1.0}
    assert shown == {"touch_left_0": 1.0}


def test_the_order_and_the_unit_of_sensors_make_no_difference(rng):
    rows = rng.standard_normal((20, 7))
    mixed = rows[:, [0, 2, 1, 3, 6, 4, 5]]
    reduction = inphase.Reduction(BOTH)
    expected = reduction.dataset(demos(rows))[0].values
    assert_allclose(reduction.dataset(demos(mixed))[0].values, expected)
    assert_allclose(reduction.dataset(demos(7 * rows))[0].values[:, :4], 7 * expected[:, :4])


def test_a_group_of_one_and_a_group_that_is_called_as_its_channel():
    reduced = inphase.Reduction({"lean": ("lean", "max")}).dataset(demos())
    assert_array_equal(reduced[0].values, demos()[0].values)
    assert reduced.names == demos().names


def test_a_session_takes_the_reduced_stream(rng):
    times = np.linspace(0, 2, 40)
    values = [
        np.outer(np.sin(times) * size, np.arange(1, 9)) + 0.01 * rng.standard_normal((40, 8)) for size in (1, 1.2, 0.9)
    ]
    made = inphase.Dataset.from_arrays([times] * 3, values, NAMES, ["arm"])
    reduction = inphase.Reduction(BOTH)
    model = taught(reduction.dataset(made))
    sessions = [model.session("bip") for _ in range(2)]
    for time, row in zip(times, values[0], strict=True):
        array = sessions[0].observe(time, reduction.sample(row[:7], made.observed))
        assert sessions[1].observe(time, reduction.sample(dict(zip(NAMES, row, strict=False)))) == array


@pytest.mark.parametrize(
    ("groups", "expected"),
    [
        ({}, "expected groups"),
        ({"left": ((), "max")}, "expected groups"),
        ({"left": ("touch_left_*", "median")}, "left: unknown way to reduce 'median'; one of max, mean, norm"),
        ({"left": "touch_left_*"}, "left: expected"),
        ({"left": ("touch_left_*",)}, "left: expected"),
    ],
)
def test_groups_that_are_none(groups, expected):
    with shapes_unchecked(), pytest.raises(inphase.OptionError, match=expected):
        inphase.Reduction(groups)


@pytest.mark.parametrize(
    ("groups", "expected"),
    [
        ({"nose": ("nose_*", "max")}, r"no channel fits 'nose_\*'; the channels are hand, touch_left_0"),
        (
            {"a": ("touch_*", "max"), "b": ("touch_left_*", "max")},
            "b: .* no other group, got touch_left_0, touch_left_1",
        ),
        ({"hand": ("touch_*", "max")}, "names of groups that no other channel has, got hand"),
        ({"all": ("*", "max")}, r"all: expected linear channels of one role, got hand \(observed, linear\)"),
        ({"both": (["lean", "hand"], "max")}, r"both: expected linear .* lean \(observed, angle\)"),
    ],
)
def test_groups_that_do_not_fit_the_channels(groups, expected):
    with pytest.raises(inphase.ChannelError, match=expected):
        inphase.Reduction(groups).dataset(demos(kinds={"lean": "angle"}))


@pytest.mark.parametrize(
    ("values", "observed", "expected"),
    [
        (ROWS[0], None, "expected observed="),
        (ROWS[0][:3], NAMES, r"expected 7 values, one for each of hand, .* got shape \(3,\)"),
        (["one"] * 7, NAMES, "expected numbers for hand"),
        ({"hand": "near"}, None, "expected numbers for hand"),
    ],
)
def test_samples_that_do_not_fit(values, observed, expected):
    with shapes_unchecked(), pytest.raises(inphase.ObservationError, match=expected):
        inphase.Reduction(BOTH).sample(values, observed)


def test_a_reduction_is_a_value():
    one, other = inphase.Reduction(BOTH), inphase.Reduction({name: tuple(entry) for name, entry in BOTH.items()})
    assert one == other
    assert hash(one) == hash(other)
    with pytest.raises(AttributeError):
        one.groups = {}  # type: ignore[misc]
