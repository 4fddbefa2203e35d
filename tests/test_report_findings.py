"""What the report says in words: constructed runs whose truth is known are called late, paused, blind or troubled."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interactions import CONTROLLED, OBSERVED, chance_model, phase_model
from numpy.testing import assert_allclose

from inphase import Estimate, Status
from inphase.channels import make_channels
from inphase.recording import RecordedEvent, Recording
from inphase.report.account import Account
from inphase.report.findings import find
from inphase.report.lateness import lateness
from inphase.report.spells import MOST, blind_stretches, events_of, pauses_of, status_spells
from inphase.report.summary import summarise

MODEL = chance_model(np.random.default_rng(0), phase_model())
TYPICAL = 0.8  # its tempo [1/s]
TIMES = np.arange(251) / 200  # one typical interaction
PHASES = TYPICAL * TIMES
STATUSES = [*[Status.FOLLOWING] * (len(TIMES) - 2), *[Status.FINISHED] * 2]
BUMPS = (0.3, 0.45, 0.62)  # where the controlled channels do most, as a share of the run


def course(times, channels=2, length=TIMES[-1]):
    """(T, C) what controlled channels do: at rest before and after, no two alike."""
    share = np.clip(np.asarray(times) / length, -1, 2)[:, None]
    at, wide = np.resize(BUMPS, channels), 0.05 + 0.02 * np.arange(channels)
    return np.tanh((share - at) / wide) + np.exp(-0.5 * ((share - at) / wide) ** 2) * np.arange(channels)


def account(
    times=TIMES, *, now=None, truth=None, std=0.3, tempo=TYPICAL, phase=PHASES, status=STATUSES, values=None, **more
):
    """A run that went as the typical one does, unless told."""
    count = len(times)
    model = more.pop("model", MODEL)
    truth = course(np.arange(count) / 200) if truth is None else truth
    now = truth if now is None else now
    names = tuple(f"c{k}" for k in range(now.shape[1]))
    channels = more.pop("channels", make_channels(OBSERVED, names))
    tempos, stds = np.broadcast_to(tempo, count), np.broadcast_to(std, now.shape)
    values = np.zeros((count, len(channels))) if values is None else values
    made = tuple(
        Estimate(float(t), float(p), 0.02, float(v), 0.05, 0.0, s)
        for t, p, v, s in zip(times, np.broadcast_to(phase, count), tempos, status, strict=True)
    )
    recording = Recording("run", channels, times, values, made, (None,) * count, events=tuple(more.pop("events", ())))
    now_times = more.pop("now_times", times)
    return Account("run", recording, model, names, now_times, now, np.array(stds), truth, (), **more)


def sentences(told, *words):
    """Those that have all these words in them."""
    return [finding for finding in find(told) if all(word in finding.says for word in words)]


# --------------------------------------------------------------------------------------------------------- late answers


@given(
    late=st.floats(-0.2, 0.2),
    channels=st.integers(1, 3),
    units=st.floats(-3, 3),
    gaps=st.floats(0, 0.4),
    begin=st.sampled_from([0.0, -7.0, 1.7e9]),
    seed=st.integers(0, 9),
)
@settings(max_examples=40)
def test_an_answer_that_is_late_is_found_to_be_as_late(late, channels, units, gaps, begin, seed):
    rng, length = np.random.default_rng(seed), float(TIMES[-1])
    scale = 10 ** (units * np.arange(1, channels + 1))
    truth, now = course(TIMES, channels) * scale, course(TIMES - late * length, channels) * scale
    for part in (truth, now):
        part[rng.random(part.shape) < gaps] = np.nan
    found = lateness(account(TIMES + begin, now=now, truth=truth))
    assert found is not None
    assert abs(found.seconds - late * length) <= 0.006 * length
    assert found.explains == (abs(late) > 0.003) or abs(late) < 0.01
    assert found.remains < 0.05 or abs(late) < 0.03  # who is nearly in time has little error to lose


def test_a_channel_in_other_units_textthe_same():
    now = course(TIMES - 0.1) + 0.1 * np.sin(9 * TIMES)[:, None]
    one, other = (lateness(account(now=now * s, truth=course(TIMES) * s)) for s in (np.ones(2), np.array([1e3, 1e-3])))
    assert one.seconds == other.seconds == pytest.approx(0.1, abs=0.008)
    assert one.remains == pytest.approx(other.remains)


def test_answers_for_the_time_ahead_are_compared_with_that_time():
    ahead = TIMES + 0.08
    assert not lateness(account(now=course(ahead), now_times=ahead)).explains
    assert lateness(account(now=course(ahead - 0.1), now_times=ahead)).seconds == pytest.approx(0.1, abs=0.008)


def test_an_angle_that_is_a_turn_away_is_not_late():
    channels = make_channels(OBSERVED, ("c0", "c1"), kinds={"c?": "angle"})
    turns = 2 * np.pi * np.array([1, -3])
    found = lateness(account(now=course(TIMES) + turns, truth=course(TIMES), channels=channels))
    assert found.remains == 1.0 or found.seconds == 0.0
    found = lateness(account(now=course(TIMES - 0.1) + turns, truth=course(TIMES), channels=channels))
    assert found.seconds == pytest.approx(0.1, abs=0.008)


def test_what_is_wrong_but_in_time_is_not_called_late(rng):
    for off in (0.4 * rng.standard_normal((len(TIMES), 2)), 0.5, 0.4 * course(TIMES)):
        assert not lateness(account(now=course(TIMES) + off)).explains
    assert not lateness(account()).explains


def test_a_part_of_the_run_may_be_late_alone():
    def twice(second):  # what happens at 0.3 s, and again at 0.9 s or later
        return (np.exp(-200 * (TIMES - 0.3) ** 2) + np.exp(-200 * (TIMES - 0.9 - second) ** 2))[:, None]

    told = account(now=twice(0.1), truth=twice(0.0))
    assert lateness(told, (0.6, 1.2)).seconds == pytest.approx(0.1, abs=0.007)
    assert not lateness(told, (0.0, 0.55)).explains


def test_of_a_run_without_truth_nothing_is_known():
    nothing = np.full((len(TIMES), 2), np.nan)
    assert lateness(account(truth=nothing, now=course(TIMES))) is None
    assert lateness(account(now=nothing, truth=course(TIMES))) is None
    assert lateness(account(truth=np.ones((len(TIMES), 2)))) is None  # what rests is never late


# ------------------------------------------------------------------------------------------------------------ stretches


@given(st.lists(st.sampled_from(list(Status)), min_size=2, max_size=60))
def test_spells_are_the_runs_of_equal_statuses(statuses):
    times = np.cumsum(np.linspace(0.01, 0.03, len(statuses)))
    found = status_spells(account(times, status=statuses, phase=0.5))
    expected, at = [], 0
    for status, same in itertools.groupby(statuses):
        start, at = at, at + len(list(same))
        if status is not Status.FOLLOWING:
            expected.append((times[start], times[min(at, len(times) - 1)], status))
    assert [(spell.start, spell.end, spell.status) for spell in found] == expected


def test_of_very_many_spells_the_longest_are_told_in_order():
    count = 4 * (MOST + 50)
    lasting = np.zeros(count, dtype=bool)
    statuses = [Status.NOTHING_SEEN if i % 4 else Status.FOLLOWING for i in range(count)]
    times = np.arange(count, dtype=float)
    short = np.random.default_rng(0).choice(count // 4, 50, replace=False)
    for k in short:  # these last for one step, the others for three
        statuses[4 * k + 2] = statuses[4 * k + 3] = Status.FOLLOWING
        lasting[4 * k + 1] = True
    found = status_spells(account(times, status=statuses, phase=0.5))
    assert len(found) == MOST
    starts = [spell.start for spell in found]
    assert starts == sorted(starts)
    assert not lasting[np.array(starts, dtype=int)].any()


@given(start=st.integers(10, 120), length=st.integers(1, 100), slow=st.floats(0, 0.24))
@settings(max_examples=30)
def test_a_pause_is_found_where_it_was_made(start, length, slow):
    tempo = np.full(len(TIMES), TYPICAL)
    tempo[start : start + length] = slow * TYPICAL
    found = pauses_of(account(tempo=tempo))
    long_enough = TIMES[start + length] - TIMES[start] >= 0.03 / TYPICAL
    assert found == ([(TIMES[start], TIMES[start + length])] if long_enough else [])
    assert pauses_of(account(tempo=np.where(tempo < TYPICAL, 0.26 * TYPICAL, TYPICAL))) == []


@given(start=st.integers(1, 100), length=st.integers(1, 140), both=st.booleans())
@settings(max_examples=30)
def test_a_stretch_without_a_reading_is_found_where_it_was_made(start, length, both):
    values = np.zeros((len(TIMES), 4))
    values[start : start + length, : 1 + both] = np.nan
    found = blind_stretches(account(values=values))
    gap = (float(TIMES[start - 1]), float(TIMES[start + length]))
    assert found == ([gap] if both and gap[1] - gap[0] > 0.05 / TYPICAL else [])


def test_a_run_that_was_never_or_not_yet_seen_is_blind_from_end_to_end():
    whole = (float(TIMES[0]), float(TIMES[-1]))
    assert blind_stretches(account(values=np.full((len(TIMES), 4), np.nan))) == [whole]
    late = np.full((len(TIMES), 4), np.nan)
    late[100:150] = 0.0
    assert blind_stretches(account(values=late)) == [(0.0, TIMES[100]), (TIMES[149], TIMES[-1])]


# ------------------------------------------------------------------------------------------------------------ sentences


def event(time, kind="safety", before="RUNNING", after="STOPPED", reason="too fast"):
    return RecordedEvent(time, kind, reason, before, after)


def blinded():
    values = np.zeros((len(TIMES), 4))
    values[80:140, :2] = np.nan
    return values


def troubled(status):
    return [*STATUSES[:50], *[status] * 20, *STATUSES[70:120], *[status] * 30, *STATUSES[150:]]


PAUSED = np.where((TIMES >= 0.4) & (TIMES < 0.6), 0.0, TYPICAL)
WAITED = np.maximum(PHASES - 0.25, 0.0)
NARROW = np.concatenate([np.full((150, 2), 0.3), np.full((101, 2), 1e-3)])
OFF = course(TIMES) + np.where(TIMES[:, None] < 0.75, 0.0, [[0.0, 0.02]])
# words of a sentence, and a run of which it is said; whether it is grave; the moment it points to [s]
SAID = {
    "late": (("came 0.10 s late",), {"now": course(TIMES - 0.1)}, True, None),
    "early": (("came 0.10 s early",), {"now": course(TIMES + 0.1)}, True, None),
    "waited": (("hardly begun", "first 0.38 s", "there in 0.06 s"), {"phase": WAITED}, False, 0.38),
    "slow": (("went at 0.50 times the tempo",), {"tempo": 0.5 * TYPICAL}, False, None),
    "fast": (("went at 2.00 times the tempo",), {"tempo": 2 * TYPICAL}, False, None),
    "behind": (("up to 0.20 behind", "0.25 s of this"), {"phase": PHASES - 0.2 * (TIMES > 0.9)}, True, 0.905),
    "ahead": (("up to 0.20 ahead of", "0.25 s of this"), {"phase": PHASES + 0.2 * (TIMES == 0.5)}, True, 0.5),
    "paused": (("to pause for 0.20 s, from 0.40 to 0.60 s",), {"tempo": PAUSED}, False, 0.4),
    "blind": (("No observed channel was read for 0.30 s, from 0.40 to 0.70",), {"values": blinded()}, True, TIMES[79]),
    "unlike": (
        ("unlike (the partner moves", "2 times, 0.25 s", "from 0.60 s"),
        {"status": troubled(Status.UNLIKE)},
        True,
        0.6,
    ),
    "refused": (("refused (the readings", "2 times, 0.25 s"), {"status": troubled(Status.REFUSED)}, False, 0.6),
    "safety": (("running → stopped: too fast",), {"events": [event(0.7)]}, True, 0.7),
    "well again": (
        ("holding → running: all was well",),
        {"events": [event(0.7, before="HOLDING", after="RUNNING", reason="all was well")]},
        False,
        0.7,
    ),
    "band": (("c1 was in the 90 % band only 60 %",), {"now": OFF, "std": NARROW}, False, 0.75),
    "unended": (("never told",), {"status": [Status.FOLLOWING] * len(TIMES)}, False, None),
}


@pytest.mark.parametrize("case", SAID)
def test_what_strikes_is_said_and_where_to_look(case):
    words, changed, grave, time = SAID[case]
    told = account(progress=PHASES, **changed)
    found = sentences(told, *words)
    assert len(found) == 1, [finding.says for finding in find(told)]
    assert found[0].grave == grave
    if time is not None:
        assert found[0].time == pytest.approx(time, abs=0.006)
    events = [replace(e, time=1e6 + e.time) for e in changed.get("events", ())]
    later = account(TIMES + 1e6, progress=PHASES, **{**changed, "events": events})
    assert [finding.says for finding in find(later)] == [finding.says for finding in find(told)]  # whatever clocks read


def test_of_a_run_in_which_nothing_strikes_only_that_is_said():
    (only,) = find(account(progress=PHASES))
    assert only.says.startswith("The response kept time")
    assert not only.grave


def test_each_sentence_is_of_its_own_run_alone():
    for case, (_, changed, _, _) in SAID.items():
        says = [finding.says for finding in find(account(progress=PHASES, **changed))]
        told = [other for other, (words, *_) in SAID.items() if any(all(w in text for w in words) for text in says)]
        assert told == [case]
        assert len(says) <= 3


def test_a_late_answer_points_to_where_it_was_farthest_off():
    told = account(now=course(TIMES - 0.1))
    off = np.abs(told.now - told.truth) / told.truth.std(0)
    assert find(told)[0].time == TIMES[off.max(1).argmax()]


def test_nothing_is_said_of_what_is_not_known():
    nothing = np.full((len(TIMES), 2), np.nan)
    assert find(account(truth=nothing, now=course(TIMES))) == []
    says = find(account(times=np.empty(0), now=np.empty((0, 2)), truth=np.empty((0, 2)), phase=0.0, status=[]))
    assert [finding.says for finding in says] == ["Nothing was inferred in this run."]
    assert sentences(account(model=None, tempo=0.5 * TYPICAL), "times the tempo") == []
    assert sentences(account(status=[Status.FOLLOWING] * len(TIMES), model=None), "never told") == []


def test_events_are_told_from_the_beginning_without_the_loops_figures():
    given_ = [event(10.5), event(10.7, "report", reason="{}"), event(10.8, "reset", "", "", "asked for")]
    told = account(TIMES + 10.0, events=given_)
    assert [round(e["time"], 6) for e in events_of(told)] == [0.5, 0.8]
    assert [e["kind"] for e in events_of(told)] == ["safety", "reset"]
    assert len(events_of(account(events=[event(0.1)] * (MOST + 7)))) == MOST
    assert len(sentences(account(events=[event(0.1)] * 50), "stopped")) == 6


# --------------------------------------------------------------------------------------------------------------- tables


def table(told, title):
    return next(table for table in summarise(told) if table["title"] == title)


def test_the_figures_of_a_loop_are_shown_or_it_is_said_that_they_cannot_be_read():
    spread = {"count": 3, "p50": 0.001, "p99": 0.0025, "max": 0.004}
    report = {"timings": {"observe": spread, "idle": {**spread, "count": 0}}, "duration": 1.25, "cycles": 60}
    report |= {"overruns": 1, "commands": 30, "missed": 0, "lag": None, "ended": "the time was over"}
    report |= {"samples": {"camera": {"used": 50, "late": 2}}}
    told = account(events=[event(1.2, "report", reason=json.dumps(report))])
    assert table(told, "Latency of the loop")["rows"] == [["observe", "1.00", "2.50", "4.00"]]
    rows = dict(table(told, "Loop")["rows"])
    assert rows["overruns"] == "1"
    assert rows["robot behind [s]"] == "not known"
    assert rows["camera"] == "50 used, 2 late"
    for broken in ("", "[]", "{}", "null", json.dumps({**report, "timings": {"observe": {}}}), "{" * 5000):
        unread = table(account(events=[event(1.2, "report", reason=broken)]), "Loop")
        assert "cannot be read" in unread["note"]
    assert not any("oop" in t["title"] for t in summarise(account()))


def test_the_card_of_a_model_names_its_channels_in_their_units():
    told = account()
    rows = table(told, "Channels of the model")["rows"]
    assert [row[0] for row in rows] == [*OBSERVED, *CONTROLLED]
    assert [row[3] for row in rows] == ["gaussian × 5", "sigmoid × 4", "gaussian × 5", "polynomial × 4"]
    low, high = MODEL.scaling.low, MODEL.scaling.high
    for k, row in enumerate(rows):
        assert row[4] == f"{low[k]:.3g} … {high[k]:.3g}"
        assert float(row[5]) == pytest.approx(np.sqrt(MODEL.noise.var[k]) * (high[k] - low[k]), rel=0.06)
    assert dict(table(told, "Model")["rows"])["typical duration [s]"] == "1.25"
    assert "Not calibrated" in table(told, "Calibration")["note"]


def test_without_a_model_errors_are_measured_by_what_happened():
    told = account(model=None, now=course(TIMES) + 0.1)
    share = np.mean((0.1 / course(TIMES).std(0)) ** 2)
    assert table(told, "Response now")["rows"][0][3] == f"{share:.3g}"
    assert_allclose(float(table(told, "Response now")["rows"][1][1]), 0.1)
    unknown = replace(told, truth=np.full_like(told.truth, np.nan))
    assert "is not in this run" in table(unknown, "Errors")["note"]
