"""The scoring protocol: predictors of known scores, conditions that keep what they must, no influence of order."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import threadpoolctl
from interactions import CONTROLLED, OBSERVED, dataset, shapes_unchecked
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import inphase
from inphase.channels import make_channels
from inphase.evaluation import BASELINES, CONDITIONS, METRICS, Evaluation, Predictor, Row, evaluate, replay, warp
from inphase.evaluation.baselines import GRID, MeanTrajectory, Ridge
from inphase.evaluation.conditions import ticks
from inphase.evaluation.partners import Partners
from inphase.filters import FILTERS

AS_RECORDED = ["as recorded"]
NINETY = 1.6449
LINEAR = make_channels(["hand"], ["robot"])
Answer = tuple[np.ndarray, np.ndarray]


def means(found: Evaluation, metric: str, predictor: str) -> np.ndarray:
    """(conditions,) the mean figures."""
    return np.array([found.figure(metric, predictor, condition).mean for condition in found.conditions])


def scores(row: Row) -> list[float]:
    return [getattr(row, metric) for metric in METRICS]


def plain(train: inphase.Dataset) -> inphase.Model:
    """A model that is learned in no time."""
    return inphase.fit(train, calibrate=False)


def pairs(values: Sequence[np.ndarray], step: float = 0.1) -> inphase.Dataset:
    """Recordings (T, 2) of a hand and a robot."""
    return inphase.Dataset.from_arrays([step * np.arange(len(v)) for v in values], values, ["hand"], ["robot"])


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Shapes are checked elsewhere: here it would only take time."""
    with shapes_unchecked():
        yield


# ---------------------------------------------------------------------------------------- predictors of known scores


class Oracle:
    """Knows that the robot is 2 hand + 1, and where it ends."""

    def __init__(self, std: float, end: float) -> None:
        self.std, self.end = std, end

    def learn(self, _: inphase.Dataset) -> Oracle:
        return self

    def begin(self) -> Callable[[float, np.ndarray], Answer]:
        return lambda _, values: (np.stack([2 * values + 1, [self.end]]), np.full((2, 1), self.std))


class Mean:
    """Always answers the mean of all training readings, as uncertain as they are spread."""

    def __init__(self, train: inphase.Dataset) -> None:
        readings = np.concatenate([d.values[:, len(train.observed) :] for d in train])
        self.mean, self.std = np.nanmean(readings, 0), np.nanstd(readings, 0)

    def begin(self) -> Callable[[float, np.ndarray], Answer]:
        return lambda *_: (np.stack([self.mean] * 2), np.stack([self.std] * 2))


@pytest.mark.parametrize("std", [0.0, 0.1])
def test_an_oracle_scores_nothing_and_covers_all(std, rng):
    hands = [np.append(rng.normal(size=rng.integers(12, 30)), 1.0) for _ in range(6)]
    tied = pairs([np.column_stack([hand, 2 * hand + 1]) for hand in hands])
    # Between samples, too, a straight line of the one goes with a straight line of the other.
    conditions = ["as recorded", "slow x2", "fast x2"]
    found = evaluate(tied, (), conditions=conditions, others={"oracle": Oracle(std, end=3.0).learn})
    for metric in ("now", "end25", "end50", "end75"):
        assert_allclose(means(found, metric, "oracle"), 0, atol=1e-12)
    assert_array_equal(means(found, "cover", "oracle"), 1)


def test_the_training_mean_scores_one():
    """To the last digit where the held-out episodes are like the others, in any unit; at other tempos, about."""
    hand = np.linspace(0, 20, 400)
    robot = 0.001 * np.sin(hand) + 5
    found = evaluate(pairs([np.column_stack([hand, robot])] * 4), (), others={"mean": Mean})
    now = dict(zip(found.conditions, means(found, "now", "mean"), strict=True))
    assert_allclose([now["as recorded"], now["lost 30 %"]], 1, rtol=1e-9)
    still = np.append(robot, np.full(20, robot[133]))  # two seconds more at a third
    assert now["pause 2 s"] == pytest.approx(np.mean((still - robot.mean()) ** 2) / robot.var())
    assert now["fast x2"] == pytest.approx(1, abs=0.01)
    assert_allclose(means(found, "end50", "mean"), (robot[-1] - robot.mean()) ** 2 / robot.var(), rtol=1e-9)


def test_nll_and_cover_are_those_of_the_density_that_was_claimed(rng):
    values = rng.normal(size=(4, 30, 2)) * [1, 7]
    found = evaluate(pairs(list(values)), (), conditions=AS_RECORDED, others={"mean": Mean})
    for i, row in enumerate(found.rows):
        train = np.delete(values[:, :, 1], i, axis=0)
        r = (values[i, :, 1] - train.mean()) / train.std()
        assert_allclose(scores(row)[0], np.mean(r**2))
        assert_allclose(scores(row)[4:], [np.mean(np.abs(r) <= NINETY), np.mean(r**2 / 2) + np.log(2 * np.pi) / 2])


def test_only_what_was_recorded_is_scored(rng):
    values = rng.normal(size=(5, 20, 2))
    values[1, 3:9, 1] = np.nan
    values[2, -1, 1] = np.nan
    values[3, :, 1] = np.nan
    found = evaluate(pairs(list(values)), (), folds=5, conditions=AS_RECORDED, others={"mean": Mean})
    for i, row in enumerate(found.rows):
        train = np.delete(values[:, :, 1], i, axis=0)
        relative = (values[i, :, 1] - np.nanmean(train)) / np.nanstd(train)
        seen = relative[~np.isnan(relative)]
        assert row.episode == f"demonstration {i}"
        assert row.now == pytest.approx(np.mean(seen**2) if i != 3 else np.nan, nan_ok=True)
        assert row.cover == pytest.approx(np.mean(np.abs(seen) <= NINETY) if i != 3 else np.nan, nan_ok=True)
        assert row.end75 == pytest.approx(relative[-1] ** 2, nan_ok=True)
    known = [row.now for row in found.rows if row.episode != "demonstration 3"]
    assert found.figure("now", "mean", "as recorded").mean == pytest.approx(np.mean(known))


def test_a_filter_is_scored_as_its_replay(rng):
    demos = dataset(rng, count=4, rate=4.0)
    found = evaluate(demos, ["ebip"], conditions=["pause 2 s"], seed=3, fit=plain, others={})
    for i, row in enumerate(found.rows):
        played = replay(plain(demos.without(i)), warp(demos[i], demos.channels, "pause 2 s"), "ebip", seed=3)
        assert row.fold == i
        assert_allclose([row.now, row.cover, row.nll], [played.now.nmse, played.now.coverage, played.now.nll])
        assert_allclose([row.end25, row.end50, row.end75], [played.final_pose(share) for share in (0.25, 0.5, 0.75)])


# ---------------------------------------------------------------------------------------------------------- baselines


def answers(predictor: Predictor, times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (T, 2, Dc) and standard deviation of one interaction."""
    step = predictor.begin()
    given = [step(float(t), y) for t, y in zip(times, values, strict=True)]
    return np.array([mean for mean, _ in given]), np.array([std for _, std in given])


def test_the_mean_trajectory_is_played_by_the_clock(rng):
    """Movements of known shape, size and duration: their mean at equal shares of the time, at the mean duration."""
    durations, sizes = np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 6.0])
    times = [np.linspace(5, 5 + d, n) for d, n in zip(durations, (21, 31, 61), strict=True)]
    lines = [size * (t - 5) / d for t, d, size in zip(times, durations, sizes, strict=True)]
    demos = inphase.Dataset.from_arrays(times, [np.column_stack([0 * x, x]) for x in lines], ["hand"], ["robot"])
    at = np.array([0.0, 0.3, 1.1, 1.9, 2.0, 7.0])
    shares = np.round(np.minimum(at / 2.0, 1) * (GRID - 1)) / (GRID - 1)
    mean, std = answers(MeanTrajectory.learn(demos), 100 + at, rng.normal(size=(6, 1)))
    assert_allclose(mean[:, 0, 0], sizes.mean() * shares, atol=1e-12)
    assert_allclose(std[:, 0, 0], sizes.std() * shares, atol=1e-12)
    assert_allclose(mean[:, 1, 0], sizes.mean())
    assert_allclose(std[:, 1, 0], sizes.std())


def test_gaps_in_a_straight_line_are_bridged(rng):
    demos = pairs([np.column_stack([rng.normal(size=30), (i + 1) * np.linspace(0, 1, 30)]) for i in range(3)])
    gaps = [d.values.copy() for d in demos]
    gaps[0][5:20, 1] = gaps[2][11, 1] = np.nan
    one, other = MeanTrajectory.learn(demos), MeanTrajectory.learn(pairs(gaps))
    assert_allclose(one.mean, other.mean, atol=1e-12)
    assert_allclose(one.std, other.std, atol=1e-12)


def test_ridge_finds_what_the_past_tells_linearly(rng):
    """The robot repeats the hand of ten samples ago: nothing is left but what the ridge holds back."""
    hands = [rng.normal(size=200) for _ in range(6)]
    follows = [np.column_stack([hand, 3 * hand[np.maximum(np.arange(200) - 10, 0)]]) for hand in hands]
    found = evaluate(pairs(follows), (), conditions=AS_RECORDED, others=BASELINES)
    assert means(found, "now", "ridge")[0] < 1e-3
    assert means(found, "now", "mean trajectory")[0] > 0.5


def test_a_hand_out_of_sight_is_taken_to_stay_where_it_was(rng):
    demos = dataset(rng, count=4, rate=10.0)
    times, shown = np.arange(60) * 0.1, rng.normal(size=(60, 2))
    gone, still = shown.copy(), shown.copy()
    gone[20:50, 0], still[20:50, 0] = np.nan, shown[19, 0]
    ridge = Ridge.learn(demos)
    one, other = (answers(ridge, times, values) for values in (gone, still))
    assert_array_equal(one[0], other[0])
    assert_array_equal(one[1], other[1])


def test_a_hand_that_was_never_seen_has_no_influence_on_ridge(rng):
    demos = dataset(rng, count=4, rate=10.0)
    times, more = [d.times for d in demos], [np.insert(d.values, 1, np.nan, axis=1) for d in demos]
    wider = inphase.Dataset.from_arrays(times, more, [OBSERVED[0], "unseen", OBSERVED[1]], CONTROLLED)
    conditions = [name for name in CONDITIONS if name != "pause 2 s"]  # in which every channel trembles in its own way
    one, other = (evaluate(data, (), conditions=conditions, others={"ridge": Ridge.learn}) for data in (demos, wider))
    for row, same in zip(one.rows, other.rows, strict=True):
        assert_allclose(scores(row), scores(same), rtol=1e-9)


def test_baselines_survive_what_was_not_seen(rng):
    demos = dataset(rng, count=5, rate=10.0)
    holes = [np.where(rng.random(d.values.shape) < 0.3, np.nan, d.values) for d in demos]
    holes[0][:, 0] = holes[1][:, 2] = holes[2][0] = np.nan
    torn = inphase.Dataset.from_arrays([d.times for d in demos], holes, OBSERVED, CONTROLLED)
    whole, found = evaluate(demos, ()), evaluate(torn, ())
    for name in BASELINES:
        assert np.isfinite([means(found, metric, name) for metric in METRICS]).all()
    assert_allclose(means(found, "now", "mean trajectory"), means(whole, "now", "mean trajectory"), rtol=0.3)


# -------------------------------------------------------------------------------------------------------- the manifold


def turning(rng: np.random.Generator, flip: bool) -> inphase.Dataset:
    """A hand that turns, and arm and wrist of a robot with it; flip: angles wrapped, quaternions of any sign."""
    times, values = [], []
    for _ in range(5):
        time = np.arange(16) * 0.15 * (1 + 0.1 * rng.random())
        angle = 2.4 + (1.0 + 0.2 * rng.random()) * time
        wrist = Rotation.from_rotvec(np.outer(0.8 * angle, [0.6, 0.0, 0.8])).as_quat()
        signs = rng.choice([-1.0, 1.0], size=(len(time), 1))
        if flip:
            angle, wrist = (angle + np.pi) % (2 * np.pi) - np.pi, wrist * signs
        times.append(time)
        values.append(np.column_stack([angle, angle, wrist]))
    names = ["arm", *(f"wrist_q{axis}" for axis in "xyzw")]
    return inphase.Dataset.from_arrays(times, values, ["hand"], names, kinds={"hand": "angle", "arm": "angle"})


@pytest.mark.usefixtures("unchecked")
def test_how_a_turn_is_written_does_not_matter():
    """Wrapped angles and quaternions of changing sign score as continuous ones do, in every condition."""
    for filters, conditions in (([], CONDITIONS), (["bip"], ["fast x2"])):
        smooth, flipped = (
            evaluate(turning(np.random.default_rng(1), flip), filters, folds=2, conditions=list(conditions), fit=plain)
            for flip in (False, True)
        )
        for one, other in zip(smooth.rows, flipped.rows, strict=True):
            assert_allclose(scores(one), scores(other), rtol=1e-6, atol=1e-9)
        assert means(smooth, "now", "ridge")[0] < 0.1


def test_errors_are_measured_by_the_spread_that_a_model_learns(rng):
    """On one branch of the circle, a quaternion's channels together."""
    for demos in (turning(rng, flip=True), dataset(rng, count=4, rate=10.0)):
        expected = plain(demos).spread[len(demos.observed) :]
        assert_allclose(Partners.learn(demos).spread(demos), expected, rtol=1e-12)


def test_a_hand_that_goes_round_and_round_is_followed(rng):
    """Three times round, written between -π and π; the robot goes as far as the hand has gone in all."""
    gone = [1 + np.linspace(0, 6 * np.pi + rng.random(), 80) for _ in range(5)]
    values = [np.column_stack([(angle + np.pi) % (2 * np.pi) - np.pi, 2 * angle]) for angle in gone]
    demos = inphase.Dataset.from_arrays(
        [0.05 * np.arange(80)] * 5, values, ["hand"], ["robot"], kinds={"hand": "angle"}
    )
    found = evaluate(demos, (), conditions=AS_RECORDED)
    assert means(found, "now", "ridge")[0] < 1e-3


@pytest.mark.parametrize(("condition", "factor"), [("slow x2", 0.5), ("fast x2", 2.0)])
def test_a_turn_goes_on_at_another_speed(condition, factor):
    """A wheel that turns steadily, wrapped: about half, or twice, as fast, and no reading off its circle."""
    time = np.arange(100) * 0.05
    angle, spin = 2 + 1.5 * time, Rotation.from_rotvec(np.outer(1 + 0.7 * time, [1.0, 0, 0]))
    written = spin.as_quat() * np.where(np.arange(100) % 2, 1, -1)[:, None]
    channels = make_channels(["arm"], [f"q{axis}" for axis in "xyzw"], kinds={"arm": "angle", "q?": "quaternion"})
    wrapped = np.column_stack([(angle + np.pi) % (2 * np.pi) - np.pi, written])
    moved = warp(inphase.Demonstration(time, wrapped), channels, condition)
    speed = 1.5 * 99 / (len(moved) - 1)
    assert speed == pytest.approx(1.5 * factor, rel=0.02)
    count = np.arange(len(moved))
    assert_allclose(np.exp(1j * moved.values[:, 0]), np.exp(1j * (2 + speed * 0.05 * count)), atol=1e-9)
    expected = Rotation.from_rotvec(np.outer(1 + 0.7 / 1.5 * speed * 0.05 * count, [1.0, 0, 0]))
    assert (expected.inv() * Rotation.from_quat(moved.values[:, 1:])).magnitude().max() < 1e-6
    assert_allclose(np.linalg.norm(moved.values[:, 1:], axis=1), 1)


# --------------------------------------------------------------------------------------------------------- conditions


def hand_and_robot(times: np.ndarray) -> inphase.Demonstration:
    """The hand goes along a straight line in time, the robot along its square."""
    return inphase.Demonstration(times, np.column_stack([times, times**2]), "a walk")


@pytest.mark.parametrize("condition", CONDITIONS)
def test_conditions_keep_the_sample_rate_the_name_and_the_ends(condition):
    walk = hand_and_robot(3 + 0.04 * np.arange(120))
    moved = warp(walk, LINEAR, condition)
    assert moved.name == "a walk"
    assert moved.times[0] == 3
    assert_allclose(np.diff(moved.times), 0.04)
    assert_allclose(moved.values[[0, -1]], walk.values[[0, -1]], rtol=1e-2)
    assert_allclose(moved.values[[0, -1], 1], walk.values[[0, -1], 1])
    expected = {"slow x2": 240, "fast x2": 60, "pause 2 s": 170}.get(condition, 120)
    assert len(moved) == expected


@pytest.mark.parametrize("condition", ["slow x2", "fast x2"])
def test_other_tempos_stay_on_the_curve(condition):
    """Every sample lies on the recorded polygon, and is passed in the same order."""
    walk = hand_and_robot(0.04 * np.arange(50))
    moved = warp(walk, LINEAR, condition)
    assert_allclose(moved.values[:, 1], np.interp(moved.values[:, 0], *walk.values.T), rtol=1e-12)
    assert_allclose(np.diff(moved.values[:, 0], 2), 0, atol=1e-12)


def test_an_irregular_clock_is_no_change_of_tempo(rng):
    """A steady walk, sampled when it pleases, is a steady walk at half and double speed."""
    walk = hand_and_robot(np.cumsum(rng.uniform(0.02, 0.06, 150)))
    step = np.median(np.diff(walk.times))
    for condition in ("slow x2", "fast x2"):
        moved = warp(walk, LINEAR, condition)
        assert_allclose(np.diff(moved.times), step)
        assert_allclose(np.diff(moved.values[:, 0]), np.diff(moved.values[:, 0])[0], rtol=1e-9)
    paused = warp(walk, LINEAR, "pause 2 s")
    assert paused.times[-1] - walk.times[-1] == pytest.approx(2, abs=step)
    assert_allclose(np.diff(paused.times)[: 150 // 3 - 1], np.diff(walk.times)[: 150 // 3 - 1])


def test_a_clock_that_is_read_with_few_digits_ticks_evenly():
    times = 7 + np.round(np.arange(300) / 60, 5)
    places, step = ticks(times)
    assert_array_equal(places, np.arange(300))
    assert step == pytest.approx(1 / 60, abs=1e-5)
    lacking = np.delete(times, [10, 11, 50])
    assert_array_equal(ticks(lacking)[0], np.delete(np.arange(300), [10, 11, 50]))
    assert ticks(np.array([0.0, 1.0, 2.0, 3.5]))[0].tolist() == [0, 1, 2, 3.5]


def test_in_a_pause_the_robot_stands_and_the_partner_trembles():
    walk = hand_and_robot(0.04 * np.arange(120))
    paused = warp(walk, LINEAR, "pause 2 s")
    assert_allclose(paused.values[40:91, 1], walk.values[40, 1])
    assert_allclose(np.delete(paused.values[:, 1], slice(40, 90)), walk.values[:, 1])
    tremor = paused.values[:, 0] - np.insert(walk.values[:, 0], 40, np.full(50, walk.values[40, 0]))
    assert tremor.std() == pytest.approx(1e-3 * walk.values[:, 0].std(), rel=0.2)
    assert_array_equal(paused.values, warp(walk, LINEAR, "pause 2 s").values)


def test_a_partner_out_of_sight_hides_nothing_else():
    walk = hand_and_robot(0.04 * np.arange(120))
    lost = warp(walk, LINEAR, "lost 30 %")
    assert_array_equal(np.flatnonzero(np.isnan(lost.values[:, 0])), np.arange(40, 76))
    assert_array_equal(lost.values[:, 1], walk.values[:, 1])
    assert_array_equal(lost.values[~np.isnan(lost.values)], walk.values[~np.isnan(lost.values)])
    assert not np.isnan(walk.values).any()


@pytest.mark.parametrize("condition", CONDITIONS)
def test_what_was_not_seen_is_not_made_up(condition):
    values = hand_and_robot(0.04 * np.arange(120)).values.copy()
    values[60:80, 1] = np.nan
    unseen = np.isnan(warp(inphase.Demonstration(0.04 * np.arange(120), values), LINEAR, condition).values[:, 1])
    assert unseen.sum() / 20 == pytest.approx({"slow x2": 2, "fast x2": 0.5}.get(condition, 1), rel=0.1)
    assert np.flatnonzero(np.diff(unseen)).size == 2  # one gap
    channels = make_channels(["hand"], [f"q{axis}" for axis in "xyzw"], kinds={"q?": "quaternion"})
    never = np.column_stack([values[:, 0], np.full((120, 4), np.nan)])
    assert np.isnan(warp(inphase.Demonstration(0.04 * np.arange(120), never), channels, condition).values[:, 1:]).all()


def test_an_unknown_condition_is_refused():
    with pytest.raises(inphase.OptionError, match=r"unknown condition 'upside down'; one of 'as recorded', 'slow x2'"):
        warp(hand_and_robot(np.arange(9.0)), LINEAR, "upside down")


# ------------------------------------------------------------------------------------------------------- no influence


@pytest.mark.usefixtures("unchecked")
def test_the_number_of_processes_changes_no_bit():
    demos = turning(np.random.default_rng(2), flip=True)
    one, two = (
        evaluate({"turn": demos}, list(FILTERS), folds=2, conditions=["fast x2"], seed=1, fit=plain, jobs=jobs)
        for jobs in (1, 2)
    )
    assert len(one.rows) == 5 * (len(FILTERS) + len(BASELINES))
    assert one.rows == two.rows


@pytest.mark.usefixtures("unchecked")
def test_the_order_of_episodes_in_a_fold_does_not_matter(rng):
    demos = dataset(rng, count=8, rate=4.0)
    names = [f"episode {i}" for i in range(8)]
    one, other = (
        evaluate(
            inphase.Dataset.from_arrays(
                [demos[i].times for i in order],
                [demos[i].values for i in order],
                OBSERVED,
                CONTROLLED,
                names=[names[i] for i in order],
            ),
            ["bip"],
            conditions=["lost 30 %"],
            fit=plain,
        )
        for order in (range(8), [0, 5, 2, 3, 4, 1, 6, 7])  # 1 and 5 are held out together
    )
    found = {(row.predictor, row.condition, row.episode): row for row in other.rows}
    for row in one.rows:
        same = found[row.predictor, row.condition, row.episode]
        assert row.fold == same.fold
        assert_allclose(scores(row), scores(same), rtol=0 if row.fold == 1 else 1e-6)


@pytest.mark.usefixtures("unchecked")
def test_tasks_do_not_know_each_other(rng):
    tasks = {name: dataset(rng, count=4, rate=4.0) for name in ("reach", "lift")}
    together = evaluate(tasks, ["bip"], folds=2, conditions=["fast x2"], fit=plain)
    alone = [
        evaluate({name: data}, ["bip"], folds=2, conditions=["fast x2"], fit=plain).rows for name, data in tasks.items()
    ]
    assert together.rows == (*alone[0], *alone[1])
    assert evaluate(tasks["lift"], (), conditions=AS_RECORDED).tasks == ("data",)


def test_every_episode_is_held_out_once_and_never_learned_from(rng):
    demos = dataset(rng, count=7, rate=4.0)
    learned: list[set[bytes]] = []

    def fit(train: inphase.Dataset) -> inphase.Model:
        learned.append({d.values.tobytes() for d in train})
        return inphase.fit(train, basis=inphase.basis.Gaussian(5), calibrate=False)

    told: list[float] = []
    found = evaluate(demos, ["bip"], folds=3, conditions=AS_RECORDED, fit=fit, progress=told.append)
    assert len(learned) == 3  # once a fold, whatever is made of it
    for row in found.rows:
        i = int(row.episode.split()[1])
        assert row.fold == i % 3
        assert learned[row.fold] == {demos[j].values.tobytes() for j in range(7) if j % 3 != i % 3}
    assert sorted(row.episode for row in found.rows if row.predictor == "bip") == sorted(d.name for d in demos)
    assert told == [i / 12 for i in range(1, 13)]
    usual = evaluate(demos, ["bip"], folds=3, conditions=AS_RECORDED, fit=plain)
    assert means(usual, "now", "bip") != means(found, "now", "bip")


class Threads:
    """Tells how many threads BLAS has while it learns and follows, instead of answers."""

    def __init__(self, train: inphase.Dataset) -> None:
        self.most = self.now()

    @staticmethod
    def now() -> int:
        import scipy.linalg  # noqa: F401

        return max(found["num_threads"] for found in threadpoolctl.threadpool_info() if found["user_api"] == "blas")

    def begin(self) -> Callable[[float, np.ndarray], Answer]:
        return lambda *_: (np.full((2, 1), float(max(self.most, self.now()))), np.ones((2, 1)))


def test_blas_has_one_thread(rng):
    """Answered in units of the spread, against a truth of 1."""
    values = np.ones((4, 6, 2))
    values[:, ::2, 1] += 1e-3
    with threadpoolctl.threadpool_limits(limits=2, user_api="blas"):
        found = evaluate(pairs(list(values)), (), conditions=AS_RECORDED, others={"threads": Threads})
    assert means(found, "now", "threads")[0] < 5  # a second thread would be a thousand spreads off


# ------------------------------------------------------------------------------------------------------------- figures


def made_up(rng: np.random.Generator) -> Evaluation:
    counts = {"waving": 5, "rocket": 2}
    rows = [
        Row(task, name, condition, i % 2, f"episode {i}", *rng.normal(size=6))
        for task, count in counts.items()
        for name in ("rbpf", "ridge")
        for condition in ("as recorded", "slow x2")
        for i in range(count)
    ]
    return Evaluation(tuple(rows))


def test_a_figure_is_the_mean_of_the_means_of_tasks(rng):
    found = made_up(rng)
    by_task = {
        task: np.array(
            [r.cover for r in found.rows if [r.task, r.predictor, r.condition] == [task, "ridge", "slow x2"]]
        )
        for task in found.tasks
    }
    for task, values in by_task.items():
        figure = found.figure("cover", "ridge", "slow x2", [task])
        assert_allclose([figure.mean, figure.error], [values.mean(), values.std(ddof=1) / np.sqrt(len(values))])
    figure = found.figure("cover", "ridge", "slow x2")
    assert figure.mean == pytest.approx(np.mean([values.mean() for values in by_task.values()]))
    # The variance of a mean of independent means.
    errors = [found.figure("cover", "ridge", "slow x2", [task]).error for task in found.tasks]
    assert figure.error == pytest.approx(np.hypot(*errors) / 2)
    assert (found.tasks, found.predictors) == (("waving", "rocket"), ("rbpf", "ridge"))


def test_a_single_episode_has_no_standard_error_and_none_no_figure(rng):
    row = made_up(rng).rows[0]
    figure = Evaluation((row,)).figure("now", "rbpf", "as recorded")
    assert figure.mean == row.now
    assert np.isnan(figure.error)
    nothing = Evaluation((Row("waving", "rbpf", "as recorded", 0, "a", *[float("nan")] * 6),))
    assert np.isnan(nothing.figure("now", "rbpf", "as recorded").mean)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("later", "rbpf", "as recorded", None), r"unknown metric 'later'; one of 'now', 'end25'"),
        (("now", "bip", "as recorded", None), r"unknown predictor 'bip'; one of 'rbpf', 'ridge'"),
        (("now", "rbpf", "fast x2", None), r"unknown condition 'fast x2'; one of 'as recorded', 'slow x2'"),
        (("now", "rbpf", "slow x2", ["flying"]), r"unknown task 'flying'; one of 'waving', 'rocket'"),
    ],
)
def test_figures_of_nothing_are_refused(names, words, rng):
    with pytest.raises(inphase.OptionError, match=words):
        made_up(rng).figure(*names)


# ------------------------------------------------------------------------------------------------------------- refusal


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"filters": ["oracle"]}, r"unknown filter 'oracle'; one of 'bip'"),
        ({"conditions": ["upside down"]}, r"unknown condition 'upside down'; one of 'as recorded'"),
        ({"conditions": []}, r"at least one filter or baseline and one condition"),
        ({"filters": [], "others": {}}, r"at least one filter or baseline and one condition"),
        ({"folds": 1}, r"folds: expected a whole number of at least 2, got 1"),
        ({"folds": 7}, r"reach: expected at least 7 episodes, one for each of 7 folds, got 3"),
        ({"folds": 2}, r"reach: expected at least 2 episodes to learn from in each of 2 folds, got 3 episodes in all"),
        ({"folds": 3, "jobs": 0}, r"jobs: expected a whole number of at least 1, got 0"),
        ({"data": {}}, r"expected at least one data set, got none"),
    ],
)
def test_what_cannot_be_evaluated_is_refused_before_the_work(options, words, rng):
    def never(_: inphase.Dataset) -> inphase.Model:
        raise AssertionError

    options = {"data": {"reach": dataset(rng, count=3, rate=10.0)}, "fit": never, **options}
    with pytest.raises(inphase.InphaseError, match=words):
        evaluate(options.pop("data"), **options)


def test_data_that_cannot_be_learned_from_are_named(rng):
    values = [np.column_stack([rng.normal(size=9), np.full(9, np.nan)]) for _ in range(4)]
    with pytest.raises(inphase.DataError, match=r"waving: channel 'robot': expected readings, got none in any of 3"):
        evaluate({"waving": pairs(values)}, ())
    only = inphase.Dataset.from_arrays([np.arange(9.0)] * 4, [v[:, :1] for v in values], ["hand"], [])
    with pytest.raises(inphase.DataError, match=r"data: expected observed and controlled channels, got hand and none"):
        evaluate(only, ())


# -------------------------------------------------------------------------------------- the script it has to agree with


@pytest.fixture(scope="module")
def score(shared_data: Path) -> ModuleType:
    """The script that scores predictors on the recordings."""
    path = shared_data.parent / "score" / "score.py"
    if not path.is_file():
        pytest.skip("../shared/score/score.py is not beside the repository")
    spec = importlib.util.spec_from_file_location("score", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@contextmanager
def one_blas_thread() -> Iterator[None]:
    import scipy.linalg  # noqa: F401

    with threadpoolctl.threadpool_limits(limits=1):
        yield


@pytest.mark.parametrize(
    ("folder", "roles", "every", "filter", "conditions"),
    [
        ("handover", "HANDOVER", 20, "rbpf", ["as recorded", "pause 2 s"]),
        ("nuisi/rocket", "NUISI", 6, "bip", list(CONDITIONS)),
    ],
)
def test_it_gives_the_numbers_of_the_script(folder, roles, every, filter, conditions, score, shared_data):
    """On a few real episodes, thinned; the script rounds the constant of the Gaussian density."""
    observed, controlled = getattr(score, roles)
    files = sorted((shared_data / folder).glob("*.csv"))[:4]
    episodes = [score.read(file, observed, controlled, every) for file in files]
    splits = {folder: (observed, controlled, [(episodes[1 - k :: 2], episodes[k::2]) for k in (0, 1)])}
    times, values = [t for t, _, _ in episodes], [np.hstack([y, z]) for _, y, z in episodes]
    demos = inphase.Dataset.from_arrays(times, values, observed, controlled)
    predictors = {"mean trajectory": score.mean_trajectory, "ridge": score.ridge}
    predictors[filter] = score.inphase_predictor(filter)
    with shapes_unchecked(), one_blas_thread():
        found = evaluate(demos, [filter], folds=2, conditions=conditions)
        for name, make in predictors.items():
            rows = score.score(make, splits, conditions, verbose=False)
            for (_, condition), expected in rows.items():
                expected["nll"] += 0.5 * np.log(2 * np.pi) - 0.9189
                for metric in METRICS:
                    figure = found.figure(metric, name, condition)
                    assert figure.mean == pytest.approx(expected[metric], abs=1e-9, rel=1e-9)
    assert tuple(CONDITIONS) == score.CONDITIONS
