"""Laws of trimming: what was planted is found, what moves is kept, and nothing else changes."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from inphase.channels import match
from inphase.errors import ChannelError, OptionError
from inphase.preprocess.trim import trim
from inphase.trajectory import Dataset

MARGIN = 0.1


def minimum_jerk(times, onset, offset):
    """0 before the onset, 1 after the offset, and the way people reach in between."""
    s = np.clip((times - onset) / (offset - onset), 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def episode(rng, onset, offset, duration, rate=60.0, noise=0.001, missing=0.1, jitter=0.3):
    """Two hands that reach at once and stand still before and after, seen by a noisy sensor that misses samples."""
    times = np.arange(0.0, duration, 1 / rate)
    times = times + rng.uniform(-jitter, jitter, len(times)) / 2 / rate
    reach = minimum_jerk(times, onset, offset)
    values = reach[:, None] * np.array([0.5, -0.8, 0.1, 0.7]) + np.array([1.0, 2.0, 0.0, -4.0])
    values += noise * rng.normal(size=values.shape)
    values[rng.random(values.shape) < missing] = np.nan
    return times, values


def dataset(episodes):
    times, values = zip(*episodes, strict=True)
    return Dataset.from_arrays(
        times, values, ["a_x", "a_y"], ["b_x", "b_y"], names=[f"no {i}" for i in range(len(times))]
    )


@settings(max_examples=30)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.5, 2.0),
    st.floats(1.0, 3.0),
    st.floats(0.5, 2.0),
    st.sampled_from([20.0, 60.0, 120.0]),
)
def test_the_planted_movement_is_found_through_noise_and_gaps(seed, before, moving, after, rate):
    rng = np.random.default_rng(seed)
    recorded = dataset([episode(rng, before, before + moving, before + moving + after, rate) for _ in range(2)])
    for was, now in zip(recorded, trim(recorded, margin=MARGIN), strict=True):
        start, end = now.times[0] + MARGIN, now.times[-1] - MARGIN
        # A slope looks 0.1 s to either side.
        assert start > before - 0.1 - 2 / rate
        assert end < before + moving + 0.1 + 2 / rate
        # What goes less far than a twentieth of the way is not told from standing.
        assert minimum_jerk(start, before, before + moving) < 0.05
        assert minimum_jerk(end, before, before + moving) > 0.95
        kept = np.isin(was.times, now.times)
        assert_array_equal(was.times[kept], now.times)
        assert_array_equal(was.values[kept], now.values)
        assert kept.sum() == np.flatnonzero(kept)[-1] - np.flatnonzero(kept)[0] + 1
        assert now.name == was.name


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_trimmed_twice_is_trimmed_once(seed):
    rng = np.random.default_rng(seed)
    once = trim(dataset([episode(rng, *rng.uniform([0.5, 2.0, 4.0], [1.5, 3.5, 6.0])) for _ in range(4)]))
    for a, b in zip(once, trim(once), strict=True):
        assert len(a) - len(b) <= 0.1 * 60


def test_a_slow_sensor_is_enough(rng):
    """Also where the neighbours of a sample lie further off than a slope looks, and a channel was seen but once."""
    times, values = episode(rng, 4.0, 7.0, 12.0, rate=4.0, noise=0.0, missing=0.0)
    values[1:, 3] = np.nan
    trimmed = trim(dataset([(times, values)]))[0]
    assert trimmed.times[0] == pytest.approx(4.0, abs=0.5)
    assert trimmed.times[-1] == pytest.approx(7.0, abs=0.5)


def test_the_margin_is_kept_on_both_sides(rng):
    recorded = dataset([episode(rng, 2.0, 3.5, 6.0, jitter=0.0)])
    tight, wide = (trim(recorded, margin=margin)[0] for margin in (0.0, 0.5))
    assert tight.times[0] - wide.times[0] == pytest.approx(0.5, abs=0.02)
    assert wide.times[-1] - tight.times[-1] == pytest.approx(0.5, abs=0.02)
    everything = trim(recorded, margin=10.0)[0]
    assert_array_equal(everything.times, recorded[0].times)


def test_fidgeting_before_the_movement_is_no_movement(rng):
    times, values = episode(rng, 3.0, 5.0, 7.0, noise=0.0)
    values[:, 0] += 0.01 * minimum_jerk(times, 0.5, 0.8) + 0.01 * minimum_jerk(times, 6.2, 6.6)
    trimmed = trim(dataset([(times, values)]))[0]
    assert trimmed.times[0] == pytest.approx(3.0 - MARGIN, abs=0.2)
    assert trimmed.times[-1] == pytest.approx(5.0 + MARGIN, abs=0.2)


def test_every_one_of_many_equal_movements_is_kept(rng):
    """None of them is small beside the others, however many there are."""
    times = np.arange(0.0, 50.0, 1 / 30)
    nods = sum(minimum_jerk(times, at, at + 0.7) * (-1) ** i for i, at in enumerate(np.arange(2.0, 47.0, 1.5)))
    trimmed = trim(dataset([(times, nods[:, None] * np.ones(4))]))[0]
    assert trimmed.times[0] == pytest.approx(2.0 - MARGIN, abs=0.1)
    assert trimmed.times[-1] == pytest.approx(45.5 + 0.7 + MARGIN, abs=0.1)


def test_units_and_order_do_not_matter(rng):
    episodes = [episode(rng, 1.0, 3.0, 5.0) for _ in range(2)]
    metres = trim(dataset(episodes))
    millimetres = trim(dataset([(t + 100.0, v * 1000 + 7.0) for t, v in episodes]))
    swapped = trim(dataset([(t, v[:, [1, 0, 3, 2]]) for t, v in episodes]))
    for a, b, c in zip(metres, millimetres, swapped, strict=True):
        np.testing.assert_allclose(b.times - 100.0, a.times)
        assert_array_equal(c.times, a.times)


def test_an_axis_that_hardly_moves_does_not_lend_its_noise(rng):
    """In its group it is small; blown up to its own span it would look like a movement all the time."""
    times, values = episode(rng, 2.0, 3.5, 5.0, missing=0.0)
    values[:, 0] = 0.002 * rng.normal(size=len(times))
    trimmed = trim(dataset([(times, values)]))[0]
    assert trimmed.times[0] == pytest.approx(2.0 - MARGIN, abs=0.2)
    assert trimmed.times[-1] == pytest.approx(3.5 + MARGIN, abs=0.2)


def test_only_the_channels_that_are_named_tell(rng):
    times = np.arange(0.0, 6.0, 1 / 60)
    early, late = minimum_jerk(times, 1.0, 2.5), minimum_jerk(times, 3.0, 4.5)
    recorded = dataset([(times, np.column_stack([early, early, late, late]))])
    for channels, onset, offset in ((None, 1.0, 4.5), (["a_x"], 1.0, 2.5), (["b_?"], 3.0, 4.5)):
        trimmed = trim(recorded, channels=channels)[0]
        assert trimmed.times[0] == pytest.approx(onset - MARGIN, abs=0.1)
        assert trimmed.times[-1] == pytest.approx(offset + MARGIN, abs=0.1)
        assert trimmed.values.shape[1] == 4


def test_angles_and_quaternions_move_when_they_turn_and_not_when_they_are_written_otherwise(rng):
    times = np.arange(0.0, 5.0, 1 / 60)
    angle = 3.0 + minimum_jerk(times, 1.5, 3.0)
    half = minimum_jerk(times, 1.5, 3.0) / 2
    q = np.column_stack([0 * half, 0 * half, np.sin(half), np.cos(half)]) * rng.choice([-1, 1], (len(times), 1))
    values = np.column_stack([angle + 2 * np.pi * rng.integers(-1, 2, len(times)), q])
    recorded = Dataset.from_arrays(
        [times], [values], ["j", "h_qx", "h_qy", "h_qz", "h_qw"], [], kinds={"j": "angle", "h_q?": "quaternion"}
    )
    for channels in (["j"], ["h_qx"], None):
        trimmed = trim(recorded, channels=channels)[0]
        assert trimmed.times[0] == pytest.approx(1.5 - MARGIN, abs=0.1)
        assert trimmed.times[-1] == pytest.approx(3.0 + MARGIN, abs=0.1)


def test_what_has_no_idle_end_or_would_vanish_is_left_whole(rng):
    times = np.arange(0.0, 10.0, 1 / 30)
    always = np.sin(times[:, None] + np.arange(4))
    short = np.where(times[:, None] < 5.0, 0.0, 1.0) * np.ones(4)  # a twitch of one sample
    still = np.ones((len(times), 4))
    unseen = np.full((len(times), 4), np.nan)
    recorded = dataset([(times, always), (times, short), (times, still), (times, unseen), (times[:3], always[:3])])
    for was, now in zip(recorded, trim(recorded), strict=True):
        assert_array_equal(now.times, was.times)
        assert_array_equal(now.values, was.values)
    nothing = dataset([(times, still)])
    assert_array_equal(trim(nothing)[0].values, still)


def test_provenance_and_channels_stay_and_mistakes_are_named(rng):
    recorded = dataset([episode(rng, 1.0, 2.0, 4.0)])
    recorded = Dataset(recorded.channels, recorded.demonstrations, {"source": "here"})
    trimmed = trim(recorded)
    assert trimmed.provenance == recorded.provenance
    assert trimmed.channels == recorded.channels
    with pytest.raises(OptionError, match="threshold between 0 and 1, got 5"):
        trim(recorded, threshold=5.0)
    with pytest.raises(OptionError, match="margin of at least 0 s, got -1 s"):
        trim(recorded, margin=-1.0)
    with pytest.raises(ChannelError, match="no channel fits 'c_x'; the channels are a_x, a_y, b_x, b_y"):
        trim(recorded, channels=["c_x"])


def test_people_who_wait_for_a_handover_are_cut_until_they_move(shared_data):
    times, values, names = [], [], []
    for path in sorted((shared_data / "handover").glob("*.csv"))[::6]:
        with path.open() as file:
            names = next(csv.reader(file))[1:]
            table = np.loadtxt(file, delimiter=",")
        times.append(table[:, 0])
        values.append(table[:, 1:])
    recorded = Dataset.from_arrays(times, values, names[:7], names[7:])
    axes = ["*_x", "*_y", "*_z"]
    positions = match(axes, names)
    cut, reached = [], []
    for was, now in zip(recorded, trim(recorded, channels=axes), strict=True):
        waiting = was.values[was.times < now.times[0]][:, positions]
        if len(waiting):
            assert np.ptp(waiting, axis=0).max() < 0.08  # [m] a hand's breadth
        gone = np.abs(now.values[:, positions] - now.values[0, positions]).max(axis=1)
        cut.append(now.times[0] - was.times[0])
        reached.append(now.times[gone > 0.05][0] - now.times[0])
    # They wait for more than a second, and are on their way within half a second of the new start.
    assert np.median(cut) > 1.0
    assert np.median(reached) < 0.6
