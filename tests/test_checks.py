"""Checks of recordings: a planted fault is found where it was planted, a clean recording has no findings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from inphase import DataError
from inphase.channels import Channel, make_channels
from inphase.io import find_episodes, read_episode
from inphase.preprocess.checks import EVERY_EPISODE, Finding, FindingKind, check, check_episode, check_episodes

RATE = 60  # Hz
NAMES = ("hand_x", "hand_y", "hand_z", "elbow", "wheel", "head_qx", "head_qy", "head_qz", "head_qw")
UNITS = {"hand_?": "m", "elbow": "rad", "wheel": "rad"}
KINDS = {"wheel": "angle", "head_q?": "quaternion"}
CHANNELS = make_channels(NAMES, (), UNITS, KINDS)
HAND_X, HAND_Y, ELBOW, WHEEL = 0, 1, 3, 4
HEAD = slice(5, 9)


def clean(seed: int = 0, duration: float = 4.0, rate: float = RATE) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) [s] and values (T, D) of somebody who rests, reaches out, and rests, with noise of the sensor."""
    rng = np.random.default_rng(seed)
    times = np.round(np.arange(round(duration * rate) + 1) / rate, 5)
    share = times / duration
    reach = 1 / (1 + np.exp(-(share - rng.uniform(0.4, 0.6)) * 15))
    swing = np.sin(2 * np.pi * share * rng.uniform(0.9, 1.1))
    half = (0.3 + 1.2 * reach) / 2  # of the angle that the head turns by
    axis = np.array([2.0, 1.0, 2.0]) / 3
    head = np.column_stack([np.sin(half)[:, None] * axis, np.cos(half)])
    values = np.column_stack([0.6 * reach, 0.2 * swing, 1 + 0.3 * reach * swing, 0.5 + reach, 0.8 * swing, head])
    values[:, :5] += rng.normal(0, 5e-4, (len(times), 5))
    return times, values


def found(times: np.ndarray, values: np.ndarray, channels: tuple[Channel, ...] = CHANNELS) -> list[tuple]:
    """Kind, channel and time of every finding of one episode."""
    findings = check_episode("one", times, values, channels)
    assert all(finding.episode == "one" and "\n" not in finding.message for finding in findings)
    return [(finding.kind.value, finding.channel, finding.time) for finding in findings]


def across(episodes: dict[str, tuple[np.ndarray, np.ndarray]]) -> list[Finding]:
    return check_episodes([(name, *episode) for name, episode in episodes.items()], CHANNELS)


def crowd(count: int = 5) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Episodes of people who differ in pace, by up to a factor of 1.7."""
    return {f"episode_{i}": clean(i, duration=3 * 1.14**i) for i in range(count)}


# --------------------------------------------------------------------------------------------------------- nothing


@pytest.mark.parametrize("rate", [15, 30, 60, 240])
def test_nothing_is_found_in_clean_recordings(rate: float) -> None:
    for seed in range(10):
        assert found(*clean(seed, rate=rate)) == []
    assert check([(name, *episode) for name, episode in crowd().items()], CHANNELS) == []


def test_noise_and_rest_and_switches_are_no_faults(rng: np.random.Generator) -> None:
    times, values = clean()
    values[:, HAND_X] = rng.normal(size=len(times))  # nothing but noise
    values[:, HAND_Y] = np.round(1 / (1 + np.exp(10 - 5 * times)), 2)  # rests exactly, sets off slowly
    values[:, ELBOW] = times > 2  # a gripper
    assert found(times, values) == []


def test_jitter_of_the_clock_is_no_fault(rng: np.random.Generator) -> None:
    times, values = clean()
    times += rng.uniform(-0.2, 0.2, len(times)) / RATE
    assert found(times, values) == []
    times[120] = times[119] + 1e-6  # sent together
    assert found(times, values) == []


def test_a_fast_movement_that_announces_itself_is_no_jump() -> None:
    times, values = clean()
    values[:, HAND_X] = values[:, HAND_Y] * 0.01 + np.interp(
        np.arange(len(times)), range(60, 67), [0, 0.02, 0.1, 0.33, 0.75, 0.95, 1]
    )
    assert found(times, values) == []


def test_what_is_found_depends_on_neither_units_nor_order_nor_the_start_of_the_clock() -> None:
    times, values = clean()
    values[180, HAND_X] += 0.5
    values[105:136, HAND_Y] = values[105, HAND_Y]
    expected = {("jump", "hand_x", times[180]), ("frozen", "hand_y", times[105])}
    assert set(found(times, values)) == expected
    order = np.random.default_rng(1).permutation(len(NAMES))
    assert set(found(times, values[:, order], tuple(CHANNELS[i] for i in order))) == expected
    scale = np.where([channel.unit == "m" for channel in CHANNELS], 1000.0, 1.0)
    assert set(found(times, values * scale)) == expected
    assert set(found(times + 1024, values)) == {(kind, channel, time + 1024) for kind, channel, time in expected}


def test_arrays_are_left_alone() -> None:
    times, values = clean()
    values[10:15, ELBOW] = np.nan
    before = times.tobytes(), values.tobytes()
    times.setflags(write=False)
    values.setflags(write=False)
    check([("one", times, values), ("two", times, values)], CHANNELS)
    assert (times.tobytes(), values.tobytes()) == before


# ------------------------------------------------------------------------------------------------------- the clock


@pytest.mark.parametrize(("count", "kind"), [(0, "too-short"), (2, "too-short"), (3, "short"), (19, "short")])
def test_few_samples(count: int, kind: str) -> None:
    times, values = clean()
    assert (kind, None, None) in found(times[:count], values[:count])
    assert all(other not in ("too-short", "short") for other, _, _ in found(times[:20], values[:20]))


def test_times_that_stand_still_run_back_or_are_lost() -> None:
    times, values = clean()
    times[60] = times[59]
    assert found(times, values) == [("backwards", None, times[60])]
    times[100:] -= 0.5
    (finding,) = [f for f in check_episode("one", times, values, CHANNELS) if f.severity == "error"]
    assert finding.message == "time does not increase twice: first 0.9833 s comes after 0.9833 s"
    times, values = clean()
    times[[7, 9]] = np.nan, np.inf
    assert found(times, values) == [("backwards", None, None)]


def test_gaps() -> None:
    times, values = clean()
    keep = np.ones(len(times), dtype=bool)
    keep[60:70] = keep[120:150] = False
    (finding,) = check_episode("one", times[keep], values[keep], CHANNELS)
    assert (finding.kind, finding.channel, finding.time) == (FindingKind.GAP, None, times[59])
    assert "twice, the longest from 1.9833 s to 2.5 s" in finding.message
    keep[:] = True
    keep[60:62] = False  # two frames dropped are three steps: not longer than a gap must be
    assert found(times[keep], values[keep]) == []


def test_uneven_clock() -> None:
    times, values = clean()
    keep = np.arange(len(times)) % 3 != 0  # steps of one and two frames in turn
    assert found(times[keep], values[keep]) == [("clock", None, times[2])]


# ---------------------------------------------------------------------------------------------------- single channels


def test_infinite_values() -> None:
    times, values = clean()
    values[[30, 40], HAND_Y] = -np.inf, np.inf
    assert found(times, values) == [("infinite", "hand_y", times[30])]


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.integers(0, 240), st.integers(1, 30)), min_size=1, max_size=3), st.integers(0, len(NAMES) - 1)
)
def test_missing_values_are_one_finding_a_channel(runs: list[tuple[int, int]], column: int) -> None:
    times, values = clean()
    for start, length in runs:
        values[start : start + length, column] = np.nan
    missing = np.flatnonzero(np.isnan(values[:, column]))
    assert found(times, values) == [("not-a-number", NAMES[column], times[missing[0]])]
    (finding,) = check_episode("one", times, values, CHANNELS)
    assert f"{len(missing)} of {len(times)} samples" in finding.message


def test_missing_channels_and_the_longest_run() -> None:
    times, values = clean()
    values[:, ELBOW] = np.nan
    assert found(times, values) == [("not-a-number", "elbow", times[0])]
    times, values = clean()
    values[10:20, ELBOW] = values[60:91, ELBOW] = np.nan
    (finding,) = check_episode("one", times, values, CHANNELS)
    assert finding.message == "nothing at 41 of 241 samples (17.0%), lost twice, longest from 1 s to 1.5 s"


@pytest.mark.parametrize("level", [0.0, -0.7, 1e6])
def test_constant_channels(level: float) -> None:
    times, values = clean()
    values[:, ELBOW] = level
    values[20:30, ELBOW] = np.nan
    assert found(times, values) == [("not-a-number", "elbow", times[20]), ("constant", "elbow", None)]


@settings(max_examples=25)
@given(st.integers(30, 60), st.integers(10, 60))
def test_a_sensor_that_hangs_while_things_move(start: int, length: int) -> None:
    times, values = clean()
    values[start : start + length + 1, HAND_Y] = values[start, HAND_Y]
    # It may catch up in a jump; and at the crest of its swing, nobody can tell.
    wanted = [("frozen", "hand_y", times[start])]
    catching_up = abs(np.diff(values[start + length : start + length + 2, HAND_Y])[0])
    if catching_up > 0.02:
        assert [f for f in found(times, values) if f[0] != "jump"] == wanted
    elif catching_up < 0.003 and abs(np.diff(values[start - 1 : start + 1, HAND_Y])[0]) < 0.003:
        assert found(times, values) == []


def test_a_sensor_that_dies_and_a_recorder_that_hangs() -> None:
    times, values = clean()
    values[:, HAND_Y] = np.minimum(times, times[40]) ** 2
    assert found(times, values) == [("frozen", "hand_y", times[40])]
    values[:, HAND_Y] = values[::-1, HAND_Y]
    assert found(times, values) == [("frozen", "hand_y", times[0])]
    times, values = clean()
    values[100:150] = values[100]
    assert [f for f in found(times, values) if f[0] == "frozen"] == [("frozen", None, times[100])]


@settings(max_examples=30)
@given(st.integers(1, 238), st.sampled_from([-1, 1]), st.floats(0.75, 100), st.booleans())
def test_jumps(at: int, sign: int, size: float, stays: bool) -> None:
    times, values = clean()
    values[at : None if stays else at + 1, HAND_X] += sign * size * 0.6
    assert found(times, values) == [("jump", "hand_x", times[at])]


def test_jumps_are_one_finding_a_channel() -> None:
    times, values = clean()
    for at in (30, 90, 150):
        values[at, HAND_X] += 0.5
    values[90, HAND_X] += 0.5
    (finding,) = check_episode("one", times, values, CHANNELS)
    assert (finding.kind, finding.time) == (FindingKind.JUMP, times[30])
    assert finding.message.startswith("jumps 6 times, furthest by 1 at 1.5 s")


def test_what_moved_during_a_gap_did_not_jump() -> None:
    times, values = clean()
    keep = np.ones(len(times), dtype=bool)
    keep[90:160] = False
    assert found(times[keep], values[keep]) == [("gap", None, times[89])]
    values[90:160, HAND_X] = np.nan
    assert found(times, values) == [("not-a-number", "hand_x", times[90])]


def test_what_hardly_moves_here_is_judged_by_the_other_episodes() -> None:
    times, values = clean()
    values[:, ELBOW] = 0.5 + 0.01 * (times > 2) + np.random.default_rng(0).normal(0, 1e-4, len(times))
    assert found(times, values) == [("jump", "elbow", times[121])]
    assert check([("one", times, values), ("two", *clean(1)), ("three", *clean(2))], CHANNELS) == []


# ------------------------------------------------------------------------------------------- angles and quaternions


@pytest.mark.parametrize(("column", "name"), [(ELBOW, "elbow"), (WHEEL, "wheel")])
def test_whole_turns(column: int, name: str) -> None:
    times, values = clean()
    values[:, column] = (values[:, column] + 6 * times) % (2 * np.pi)
    wraps = np.flatnonzero(np.diff(values[:, column]) < -np.pi) + 1
    assert len(wraps) > 1
    (finding,) = check_episode("one", times, values, CHANNELS)
    assert (finding.kind, finding.channel, finding.time) == (FindingKind.BRANCH, name, times[wraps[0]])
    assert {2: "twice", 3: "3 times", 4: "4 times"}[len(wraps)] in finding.message
    metres = tuple(Channel(c.name, c.role, "m") if c.name == name else c for c in CHANNELS)
    assert found(times, values, metres) == [("jump", name, times[wraps[0]])], "metres have no turns"


def test_an_angle_jumps_beyond_its_turns() -> None:
    times, values = clean()
    values[:, WHEEL] = (values[:, WHEEL] + 3 * times + 1.5 * (times > 2)) % (2 * np.pi)
    assert ("jump", "wheel", times[121]) in found(times, values)


@settings(max_examples=30)
@given(st.lists(st.integers(1, 240), min_size=1, max_size=4, unique=True))
def test_sign_flips(flips: list[int]) -> None:
    times, values = clean()
    for at in flips:
        values[at:, HEAD] *= -1
    assert found(times, values) == [("sign-flip", "head_q", times[min(flips)])]


def test_quaternions_are_told_by_name_and_norm() -> None:
    times, values = clean()
    linear = make_channels(NAMES, ())
    values[100:, HEAD] *= -1
    values[60, HEAD] *= 0.5
    values[70, HEAD] *= 1.5
    assert found(times, values, linear) == [("sign-flip", "head_q", times[100]), ("norm", "head_q", times[60])]
    values[:, HEAD] *= 3  # four numbers of another kind
    assert {channel for _, channel, _ in found(times, values, linear)} <= set(NAMES)


def test_quaternions_off_norm() -> None:
    times, values = clean()
    values[:, HEAD] = np.round(values[:, HEAD], 3)
    assert found(times, values) == []
    values[150, HEAD] *= 1.02
    values[151, HEAD] = 0
    values[152:, HEAD] = values[152:, [8, 7, 6, 5]] * [1, -1, 1, -1]
    findings = check_episode("one", times, values, CHANNELS)
    (finding,) = [f for f in findings if f.kind is FindingKind.NORM]
    assert (finding.channel, finding.time) == ("head_q", times[150])
    assert finding.message == "expected norm 1, got 0 at 2.5167 s (2 samples are off)"
    assert [f.time for f in findings if f.kind is FindingKind.JUMP] == [times[152]], (
        "the rest is looked at all the same"
    )


def test_a_quaternion_jumps_as_one() -> None:
    times, values = clean()
    x, y, z, w = values[100:, HEAD].T.copy()
    values[100:, HEAD] += np.column_stack([w, z, -y, -x])  # turned by a quarter about x, but for the norm
    values[100:, HEAD] /= np.sqrt(2)
    assert found(times, values) == [("jump", "head_q", times[100])]


# -------------------------------------------------------------------------------------------------- across episodes


def test_an_episode_that_lasts_too_long_or_not_long_enough() -> None:
    for duration in (1.0, 20.0):
        episodes = crowd() | {"odd": clean(9, duration=duration)}
        assert [(f.kind.value, f.episode) for f in across(episodes)] == [("length", "odd")]


def test_durations_that_differ_as_people_do_are_no_fault() -> None:
    assert across({f"{d} {i}": clean(i, duration=d) for i, d in enumerate([4.0, 4.0, 4.0, 4.0, 7.0])}) == []
    assert across({str(d): clean(duration=d) for d in (2.0, 3.0, 5.0, 8.0, 12.0)}) == []


def test_unequal_clocks() -> None:
    (finding,) = across(crowd() | {"odd": clean(9, rate=30)})
    assert (finding.kind, finding.episode, finding.channel) == (FindingKind.CLOCK, "odd", None)
    assert finding.message == "30 samples a second, the others 60 (median)"
    (finding,) = across({"a": clean(0, rate=30), "b": clean(1, rate=60)})
    assert (finding.kind, finding.episode) == (FindingKind.CLOCK, "a")


def test_a_channel_that_is_dead_in_all() -> None:
    episodes = crowd()
    for i, (_, values) in enumerate(episodes.values()):
        values[:, ELBOW] = i
    (finding,) = across(episodes)
    expected = Finding(EVERY_EPISODE, "elbow", None, FindingKind.CONSTANT, "never moves: always 0 to 4")
    assert finding == expected
    data = [(name, *episode) for name, episode in episodes.items()]
    assert check(data, CHANNELS) == [expected], "once, and not again for every episode"
    episodes["episode_0"] = clean(0)
    assert across(episodes) == []


@pytest.mark.parametrize(("factor", "units"), [(1000, "millimetres"), (0.001, "millimetres"), (100, "centimetres")])
def test_other_units(factor: float, units: str) -> None:
    times, values = clean(9, duration=4)
    values[:, :3] *= factor
    (finding,) = across(crowd() | {"odd": (times, values)})
    assert (finding.kind, finding.episode, finding.channel) == (FindingKind.UNIT, "odd", "hand")
    assert units in finding.message


def test_degrees() -> None:
    times, values = clean(9, duration=4)
    values[:, ELBOW] = np.rad2deg(values[:, ELBOW])
    (finding,) = across(crowd() | {"odd": (times, values)})
    assert (finding.kind, finding.channel) == (FindingKind.UNIT, "elbow")
    assert "degrees and radians" in finding.message


def test_standing_still_is_no_other_unit() -> None:
    times, values = clean(9, duration=4)
    values[:, :3] = values[0, :3] + 0.001 * (values[:, :3] - values[0, :3])
    assert across(crowd() | {"odd": (times, values)}) == []


@pytest.mark.parametrize("turns", [-2, -1, 1])
@pytest.mark.parametrize(("column", "name"), [(ELBOW, "elbow"), (WHEEL, "wheel")])
def test_another_branch(column: int, name: str, turns: int) -> None:
    episodes = crowd()
    for odd in ("episode_1", "episode_3"):
        episodes[odd][1][:, column] += 2 * np.pi * turns
    findings = across(episodes)
    assert [(f.kind.value, f.episode, f.channel) for f in findings] == [
        ("branch", "episode_1", name),
        ("branch", "episode_3", name),
    ]
    assert f"{abs(turns)} × 2π {'above' if turns > 0 else 'below'} 3 of the others" in findings[0].message


@pytest.mark.parametrize(("column", "offset"), [(ELBOW, 3.0), (HAND_X, 2 * np.pi)])
def test_no_other_branch(column: int, offset: float) -> None:
    episodes = crowd()
    episodes["episode_1"][1][:, column] += offset
    assert across(episodes) == []


def test_one_episode_is_like_itself() -> None:
    times, values = clean()
    values[:, ELBOW] = 0
    assert across({"one": (times, values)}) == []
    assert across({"one": clean(), "empty": (np.empty(0), np.empty((0, len(NAMES))))}) == []


# ---------------------------------------------------------------------------------------------- what cannot be used


def test_errors_are_what_a_data_set_refuses() -> None:
    errors = {kind.value for kind in FindingKind if kind.severity == "error"}
    assert errors == {"unreadable", "too-short", "backwards", "infinite"}
    assert {kind.severity for kind in FindingKind} == {"error", "warning"}


WILD = st.sampled_from([0.0, -0.0, 1.0, 2.0, -5.0, np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300])


@settings(max_examples=25)
@given(hnp.arrays(np.float64, st.tuples(st.integers(0, 8), st.just(1 + len(NAMES))), elements=WILD))
def test_any_numbers_can_be_checked(cells: np.ndarray) -> None:
    wild = cells[:, 0], cells[:, 1:]
    for finding in check([("one", *wild), ("two", *clean()), ("three", *wild)], CHANNELS):
        assert finding.time is None or np.isfinite(finding.time)


def test_shapes_that_do_not_fit_are_refused() -> None:
    times, values = clean()
    with pytest.raises(DataError, match="one: expected 9 channels"):
        check_episode("one", times, values[:, :3], CHANNELS)
    with pytest.raises(DataError, match="two: expected 9 channels"):
        check([("one", times, values), ("two", times, values[:, :3])], CHANNELS)


# --------------------------------------------------------------------------------------------------- real recordings


@pytest.fixture(scope="module")
def real(shared_data: Path) -> dict[str, list[Finding]]:
    """What is found in every data set."""
    found = {}
    for source in ("handover/episode_0[369]?.csv", "nuisi/*/*.csv", "yumi/*/*.csv"):
        tables = [read_episode(path) for path in find_episodes(str(shared_data / source))]
        channels = make_channels(tables[0].columns, ())
        episodes = [("/".join(Path(t.name).with_suffix("").parts[-2:]), t.times, t.values) for t in tables]
        found[source.split("/")[0]] = check(episodes, channels)
    return found


def test_real_recordings_can_all_be_used(real: dict[str, list[Finding]]) -> None:
    findings = [finding for part in real.values() for finding in part]
    assert [finding for finding in findings if finding.severity == "error"] == []
    assert {finding.kind.value for finding in findings} == {"sign-flip", "jump", "branch"}


def test_real_faults_are_found(real: dict[str, list[Finding]]) -> None:
    def places(part: str, kind: str) -> set[tuple]:
        return {(f.episode, f.channel, f.time) for f in real[part] if f.kind.value == kind}

    # The baton turns by 83 degrees and back within two frames; the wrist moves 0.5 m and back within a third of a
    # second, at 17 m/s; the fifth joint was recorded one turn lower in one of the four actions.
    assert ("handover/episode_090", "giver_q", 2.28333) in places("handover", "jump")
    assert {channel for _, channel, _ in places("handover", "sign-flip")} == {"taker_q"}
    assert ("rocket/episode_02", "p2_wrist_z", 5.03333) in places("nuisi", "jump")
    assert places("yumi", "branch") == {(f"waving/episode_{i:02}", "yumi_joint_5", None) for i in range(1, 9)}
    assert places("yumi", "jump") == set()
