"""Windows of the phase: outside of its window a channel is not there, and inside nothing is changed."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from interactions import CONTROLLED, OBSERVED, dataset, recording, shapes_unchecked, taught, waves
from numpy.testing import assert_allclose, assert_array_equal

import inphase
from inphase.active import open_at
from inphase.filters import FILTERS

NAMES = pytest.mark.parametrize("name", sorted(FILTERS))
FEW = {"particle": {"particles": 50}, "rbpf": {"particles": 50}, "ebip": {"members": 30}}
NEVER = (0.5, 0.5)


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return taught(dataset(np.random.default_rng(7), rate=25.0))


@pytest.fixture
def live() -> tuple[np.ndarray, np.ndarray]:
    return recording(np.random.default_rng(99), rate=12.0)


def windowed(model: inphase.Model, **windows: tuple[float, float]) -> inphase.Model:
    """The model with windows of some features (of a model whose channels are its features)."""
    active = model.active.copy()
    for name, window in windows.items():
        active[model.names.index(name)] = window
    return replace(model, active=active)


def answers(model: inphase.Model, times, rows, name: str) -> tuple[str, bytes, bytes]:
    """All that a session says, to the last bit. The seed is used up as in any other."""
    session = model.session(name, seed=3, **FEW.get(name, {}))
    said = []
    for time, row in zip(times, rows, strict=True):
        said.append(repr(session.observe(time, row)))
        response = session.respond(samples=3, channels="*")
        said.append((response.mean.tobytes(), response.std.tobytes()))
    return repr(said)


@NAMES
def test_a_window_that_never_opens_is_a_channel_that_is_never_seen(name, model, live):
    times, values = live
    rows = values[:, :2]
    gone = np.where([False, True], np.nan, rows)
    expected = answers(model, times, gone, name)
    assert answers(windowed(model, lift=NEVER), times, rows, name) == expected
    # Not even a reading that no partner could give, or one that surprises.
    wild = np.where([False, True], 1e6, rows)
    assert answers(windowed(model, lift=NEVER), times, wild, name) == expected
    assert answers(model, times, rows, name) != expected


@NAMES
def test_the_whole_phase_changes_no_bit(name, model, live):
    times, values = live
    rows = values[:, :2]
    expected = answers(model, times, rows, name)
    assert answers(windowed(model, reach=(0.0, 1.0)), times, rows, name) == expected
    nearly = windowed(model, grip=(0.1, 0.2))  # a window of a channel that is not shown: all the code, no effect
    assert answers(nearly, times, rows, name) == expected


@NAMES
def test_inside_the_window_a_channel_is_seen_and_outside_it_is_not(name, model, live):
    """The phase foreseen is the last estimate, moved on at its tempo."""
    times, values = live
    opening = windowed(model, lift=(0.3, 0.6))
    one = opening.session(name, seed=3, **FEW.get(name, {}))
    other = model.session(name, seed=3, **FEW.get(name, {}))
    opened = []
    before = None
    for time, row in zip(times, values[:, :2], strict=True):
        if before is None:
            foreseen = model.phase.mean[0]
        else:
            mean = one.belief.phase_mean
            tempo = mean[1] if len(mean) > 1 else model.phase.nominal_velocity
            foreseen = mean[0] + tempo * (time - before)
        opened.append(0.3 <= foreseen < 0.6)
        shown = row if opened[-1] else np.array([row[0], np.nan])
        assert one.observe(time, row) == other.observe(time, shown)
        before = time
    assert 0.2 < np.mean(opened) < 0.4


def test_controlled_channels_have_windows_too(model, live):
    times, values = live
    session, other = (m.session("bip") for m in (windowed(model, grip=NEVER), model))
    for time, row in zip(times, values, strict=True):
        assert session.observe(time, {"reach": row[0], "grip": row[2]}) == other.observe(time, {"reach": row[0]})


def test_which_windows_are_open():
    active = np.array([[0.0, 1.0], [0.3, 0.7], [0.8, 0.2], [0.5, 0.5], [0.9, 1.0], [0.0, 0.0]])
    expected = {
        0.0: [1, 0, 1, 0, 0, 0],
        0.3: [1, 1, 0, 0, 0, 0],
        0.5: [1, 1, 0, 0, 0, 0],
        0.7: [1, 0, 0, 0, 0, 0],
        0.8: [1, 0, 1, 0, 0, 0],
        1.0: [1, 0, 1, 0, 1, 0],
    }
    for phase, open_there in expected.items():
        assert_array_equal(open_at(active, phase), np.array(open_there, dtype=bool))


def test_a_window_round_the_circle():
    rng = np.random.default_rng(5)
    times, values = waves(rng)
    demos = inphase.Dataset.from_arrays([times] * len(values), values, OBSERVED, CONTROLLED)
    options = {"phase": inphase.learn_phase(demos, periodic=True)}
    model = taught(demos, active={"lift": (0.8, 0.2)}, **options)
    whole = replace(model, active=np.empty((0, 2)))
    session, other = model.session("rbpf", particles=50), whole.session("rbpf", particles=50)
    times, (rows, *_) = waves(rng, count=1, cycles=2)
    opened = []
    for i, row in enumerate(rows[:, :2]):
        phase, tempo = session.belief.phase_mean
        foreseen = (phase + tempo * (times[i] - times[i - 1] if i else 0.0)) % 1.0
        opened.append(not 0.2 <= foreseen < 0.8)
        assert session.observe(times[i], row) == other.observe(times[i], row if opened[-1] else [row[0], np.nan])
    assert 0.3 < np.mean(opened[30:]) < 0.5


def test_a_turning_head_with_a_window(rng):
    from test_model_file import turning

    demos = turning(rng)
    model = taught(demos, active={"head_q*": NEVER})
    assert_array_equal(model.active[1:4], [NEVER] * 3)
    assert_array_equal(np.delete(model.active, [1, 2, 3], axis=0), [[0, 1]] * 5)
    whole = replace(model, active=np.empty((0, 2)))
    session, other = model.session("bip"), whole.session("bip")
    for time, row in zip(demos[0].times, demos[0].values, strict=True):
        gone = np.concatenate([row[:1], np.full(4, np.nan)])
        assert session.observe(time, row[:5]) == other.observe(time, gone)


# ------------------------------------------------------------------------------------------------------ in the model


def test_windows_by_name_and_pattern(rng):
    demos = dataset(rng, count=4)
    model = taught(demos, active={"*": (0.2, 0.9), "lift": (0.1, 0.3)})
    assert_array_equal(model.active, [[0.2, 0.9], [0.1, 0.3], [0.2, 0.9], [0.2, 0.9]])
    assert not model.always_active
    assert taught(demos).always_active
    assert_array_equal(taught(demos).active, [[0, 1]] * 4)
    with pytest.raises(ValueError, match="read-only"):
        model.active[0, 0] = 0.5


def test_held_out_models_have_the_windows(rng, monkeypatch):
    """What is chosen by playing is chosen with them."""
    learned = []

    def calibrated(part, model, learn, **options):
        learned.append(learn(part))
        return model

    monkeypatch.setattr(sys.modules["inphase.training.fit"], "calibrated", calibrated)
    inphase.fit(dataset(rng, count=4), active={"lift": (0.1, 0.3)})
    assert_array_equal(learned[0].active[1], [0.1, 0.3])


@pytest.mark.parametrize(
    ("active", "expected"),
    [
        ({"lift": (0.7, 0.2)}, "from <= until for 'lift'"),
        ({"lift": (-0.1, 0.2)}, "between 0 and 1"),
        ({"lift": (0.1, 1.2)}, "between 0 and 1"),
        ({"lift": (np.nan, 0.2)}, "between 0 and 1"),
        ({"lift": 0.3}, r"expected \(from, until\) for 'lift', got 0.3"),
        ({"lift": (0.1, 0.2, 0.3)}, "expected"),
        ({"lift": ("0", "1")}, "expected"),
        ({"nose": (0.1, 0.2)}, "no channel fits 'nose'; the channels are reach, lift"),
    ],
)
def test_windows_that_are_none(active, expected, rng):
    with shapes_unchecked(), pytest.raises((inphase.OptionError, inphase.ChannelError), match=expected):
        taught(dataset(rng, count=3), active=active)


@pytest.mark.parametrize("shape", [(3, 2), (4, 3), (8,)])
def test_windows_of_another_shape(shape, model):
    with shapes_unchecked(), pytest.raises(inphase.OptionError, match="each of 4 features"):
        replace(model, active=np.full(shape, 0.5))


# ---------------------------------------------------------------------------------------------------------- learned


def touches(rng: np.random.Generator, begin: float, end: float, noise: float = 0.3) -> inphase.Dataset:
    """Demonstrations in which a sensor feels something between two phases; one beside it feels nothing."""
    times, values = np.linspace(0, 2, 101), []
    for _ in range(10):
        phases = times / 2
        inside = (phases - begin) % 1.0 < (end - begin) % 1.0
        force = rng.uniform(20, 100) * inside + noise * rng.standard_normal(101) + 12
        quiet = noise * rng.standard_normal(101)
        values.append(np.stack([force, quiet, np.full(101, 5.0), np.sin(phases + rng.normal())], axis=1))
    return inphase.Dataset.from_arrays([times] * 10, values, ["touch", "quiet", "still"], ["arm"])


@pytest.mark.parametrize("noise", [0.0, 0.3, 2.0])
@pytest.mark.parametrize(("begin", "end"), [(0.4, 0.7), (0.1, 0.3), (0.7, 0.999)])
def test_the_window_of_a_contact_is_found(begin, end, noise, rng):
    found = inphase.learn_active(touches(rng, begin, end, noise), ["touch"])
    assert list(found) == ["touch"]
    assert found["touch"][0] <= begin < found["touch"][0] + 0.05
    assert found["touch"][1] - 0.05 < end <= found["touch"][1]


def test_what_never_leaves_its_rest_never_opens(rng):
    found = inphase.learn_active(touches(rng, 0.4, 0.7), "*")
    for name in ("quiet", "still"):
        assert not open_at(np.array([found[name]]), 0.0)[0]
        assert found[name][0] == found[name][1]


def test_the_window_of_a_contact_round_the_circle(rng):
    begin, end = inphase.learn_active(touches(rng, 0.9, 0.15), "touch", periodic=True)["touch"]
    assert_allclose([begin, end], [0.88, 0.18], atol=0.021)
    begin, end = inphase.learn_active(touches(rng, 0.4, 0.7), "touch", periodic=True)["touch"]
    assert_allclose([begin, end], [0.38, 0.72], atol=0.021)


def test_units_rate_and_order_make_no_difference(rng):
    demos = touches(rng, 0.4, 0.7)
    inches = [inphase.Demonstration(d.times, d.values * [-0.039, 1, 1, 1] + [7, 0, 0, 0], d.name) for d in demos]
    other = inphase.Dataset(demos.channels, tuple(inches[::-1]))
    assert inphase.learn_active(other, "touch") == inphase.learn_active(demos, "touch")


def test_channels_without_readings(rng):
    demos = touches(rng, 0.4, 0.7)
    blind = [inphase.Demonstration(d.times, d.values * [np.nan, 1, 1, 1], d.name) for d in demos]
    other = inphase.Dataset(demos.channels, tuple(blind))
    with pytest.raises(inphase.DataError, match="'touch': expected readings"):
        inphase.learn_active(other, "t*")
    with pytest.raises(inphase.ChannelError, match="no channel fits 'nose'"):
        inphase.learn_active(other, ["nose"])
    assert inphase.learn_active(demos.subset([0]), "touch")["touch"] == pytest.approx((0.39, 0.71), abs=0.03)
