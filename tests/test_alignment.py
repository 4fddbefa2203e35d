"""The alignment of promp: against a full matrix of costs, and what open ends, slopes and clocks must obey."""

from __future__ import annotations

import gc
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from interactions import chance_model, phase_model

import inphase
from inphase.filters import alignment
from inphase.filters.alignment import Alignment, grid
from inphase.observation import Observation

KINDS = pytest.mark.parametrize(
    ("order", "periodic"), [(0, False), (1, False), (2, False), (1, True)], ids=["order 0", "1", "2", "periodic"]
)
FARTHEST = 12  # cells a tick
DEAR = 1e9


def chance(rng: np.random.Generator, order: int = 1, periodic: bool = False) -> inphase.Model:
    return chance_model(rng, phase_model(order, periodic))


def reading(model: inphase.Model, rng: np.random.Generator, features: Sequence[int]) -> Observation:
    """Some features, each more or less news than the last time."""
    seen = np.array(features, dtype=np.int64)
    return Observation(seen, rng.normal(size=len(seen)), model.noise.var[seen] * rng.uniform(1, 5, len(seen)))


def beginning(model: inphase.Model, cell: int) -> Alignment:
    """An alignment that knows in which cell it begins."""
    return replace(Alignment.begin(model), costs=np.where(np.arange(alignment.CELLS) == cell, 0.0, DEAR))


def tick_of(model: inphase.Model) -> float:
    return 1 / (alignment.TICKS * model.phase.nominal_velocity)


# -------------------------------------------------------------------------------------------- against a full matrix


@dataclass
class Matrix:
    """Open-end dynamic time warping as textbooks have it: every cost since the start, and where it came from.

    costs[k][j]: of the cheapest path to cell j at tick k. came[k][j]: the cell it was in a tick before, and the tempo
    that it then showed.
    """

    model: inphase.Model
    cells: int
    costs: list[list[float]]
    came: list[list[tuple[int, float]]]
    time: float = 0.0

    @classmethod
    def begin(cls, model: inphase.Model, cells: int) -> Matrix:
        matrix = cls(model, cells, [], [])
        start, var = model.phase.mean[0], max(model.phase.cov[0, 0], (0.5 * matrix.cell) ** 2)
        off = [j * matrix.cell - start for j in range(cells)]
        off = [min(abs(d), 1 - abs(d)) if model.phase.periodic else d for d in off]
        matrix.costs, matrix.came = [[d**2 / var for d in off]], [[]]
        return matrix

    @property
    def cell(self) -> float:
        return 1 / self.cells if self.model.phase.periodic else 1 / (self.cells - 1)

    @property
    def nominal(self) -> float:
        return self.model.phase.nominal_velocity

    def tempo_of(self, j: int) -> float:
        """The tempo of the path that ends in cell j now, averaged from its start on."""
        shown = []
        for came in reversed(self.came[1:]):
            j, tempo = came[j]
            shown.append(tempo)
        order = self.model.phase.order
        tempo = min(max(self.model.phase.mean[1], 0), 3 * self.nominal) if order > 0 else self.nominal
        keep = np.exp(-1 / (alignment.WINDOW * alignment.TICKS))
        for latest in reversed(shown):
            tempo = keep * tempo + (1 - keep) * latest
        return tempo

    def probabilities(self) -> np.ndarray:
        last = np.array(self.costs[-1])
        shares = np.exp(-0.5 * (last - last.min()))
        return shares / shares.sum()

    def expected(self) -> float:
        return sum(p * self.tempo_of(j) for j, p in enumerate(self.probabilities()))

    def ends(self) -> np.ndarray:
        """Where the open ends are between two ticks."""
        pending = self.time - (len(self.costs) - 1) * tick_of(self.model)
        at = self.cell * np.arange(self.cells) + self.expected() * pending
        return at % 1.0 if self.model.phase.periodic else np.minimum(at, 1.0)

    def passed(self, dt: float) -> None:
        self.time += dt
        tick, last = tick_of(self.model), self.cells - 1
        while len(self.costs) <= self.time / tick:
            before, expected = self.costs[-1], self.expected()
            ways: list[list[tuple[float, int, float]]] = [[] for _ in range(self.cells)]
            for i in range(self.cells):
                for step in range(FARTHEST + 1):
                    slope = step * self.cell / tick / self.nominal
                    off = slope - expected / self.nominal
                    price = (
                        alignment.STIFFNESS / alignment.TICKS * ((off**2 + alignment.SLACK**2) ** 0.5 - alignment.SLACK)
                    )
                    j = (i + step) % self.cells if self.model.phase.periodic else min(i + step, last)
                    moved = (j - i) % self.cells
                    ways[j].append((before[i] + price, i, moved * self.cell / tick))
            # Of ways that cost the same, the one that moved less in this tick: rounding must not choose.
            least = [min(cost for cost, _, _ in way) for way in ways]
            best = [
                min((w for w in way if w[0] < c + 1e-9), key=lambda w: w[2]) for way, c in zip(ways, least, strict=True)
            ]
            self.costs.append([cost for cost, _, _ in best])
            self.came.append([(i, tempo) for _, i, tempo in best])
            if not self.model.phase.periodic:  # who has arrived no longer shows a tempo
                i, tempo = self.came[-1][last]
                self.came[-1][last] = (i, max(tempo, expected))

    def seen(self, observation: Observation, mean: np.ndarray, var: np.ndarray) -> None:
        at, period = self.ends(), 1.0 if self.model.phase.periodic else None
        phases = np.linspace(0, 1, len(mean), endpoint=period is None)
        for m, feature in enumerate(observation.features):
            expected, spread = (np.interp(at, phases, table[:, m], period=period) for table in (mean, var))
            news = self.model.noise.var[feature] / observation.noise_var[m]
            paid = news * ((observation.values[m] - expected) ** 2 / spread + np.log(spread))
            self.costs[-1] = [cost + more for cost, more in zip(self.costs[-1], paid, strict=True)]


@KINDS
@pytest.mark.parametrize("seed", range(3))
def test_one_column_is_the_last_of_a_full_matrix(
    seed: int, order: int, periodic: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a coarse grid; samples of some features, at irregular times, each with a reference of its own."""
    monkeypatch.setattr(alignment, "CELLS", 40 if periodic else 41)
    monkeypatch.setattr(alignment, "TICKS", 10)
    rng = np.random.default_rng(seed)
    model = chance(rng, order, periodic)
    column, matrix = Alignment.begin(model), Matrix.begin(model, alignment.CELLS)
    for i in range(24):
        dt = 0.0 if i % 5 == 0 else rng.exponential(1.2) * tick_of(model)
        column = column.passed(dt)
        matrix.passed(dt)
        features = np.flatnonzero(rng.random(4) < 0.5)
        if len(features):
            sample = reading(model, rng, features)
            mean, var = rng.normal(size=(23, len(features))), rng.uniform(0.1, 2, (23, len(features)))
            column = column.seen(sample, mean, var)
            matrix.seen(sample, mean, var)
        costs = np.array(matrix.costs[-1])
        np.testing.assert_allclose(column.costs, costs - costs.min(), atol=1e-9)
        np.testing.assert_allclose(column.tempos, [matrix.tempo_of(j) for j in range(matrix.cells)], atol=1e-12)
        np.testing.assert_allclose(column.weights, matrix.probabilities(), atol=1e-12)
        np.testing.assert_allclose(column.phases, matrix.ends(), atol=1e-12)
        assert column.phase == pytest.approx(matrix.ends()[costs.argmin()])
        assert column.tempo == pytest.approx(matrix.expected())
    assert len(matrix.costs) > 12  # ticks
    doubt = model.phase.cov[1, 1] if order else 0.0
    assert column.tempo_var == pytest.approx(doubt * np.exp(-2 * (len(matrix.costs) - 1) / (0.3 * 10)))


# ------------------------------------------------------------------------------------------------------------ paths


@KINDS
@pytest.mark.parametrize("cell", [0, 150, 390])
def test_a_path_never_turns_back_nor_goes_faster_than_the_steepest_slope(
    cell: int, order: int, periodic: bool, rng: np.random.Generator
) -> None:
    model = chance(rng, order, periodic)
    column = beginning(model, cell)
    for ticks in range(1, 25):
        column = column.passed(tick_of(model) * (1 + 1e-9))
        sample = reading(model, rng, [0, 3])
        column = column.seen(sample, rng.normal(size=(50, 2)), rng.uniform(0.1, 2, (50, 2)))
        ahead = np.arange(alignment.CELLS) - cell
        ahead = ahead % alignment.CELLS if periodic else ahead
        reached = (ahead >= 0) & (ahead <= FARTHEST * ticks)
        assert (column.costs[reached] < DEAR / 2).all()
        assert (column.costs[~reached] > DEAR / 2).all()
        assert (column.tempos >= 0).all()
        # 400 cells from 0 to 1 are 399 steps.
        assert (column.tempos <= 400 / 399 * 3 * model.phase.nominal_velocity).all()


@KINDS
def test_with_nothing_seen_a_place_is_dearer_the_further_it_is_from_where_all_would_be(
    order: int, periodic: bool, rng: np.random.Generator
) -> None:
    model = chance(rng, order, periodic)
    column = beginning(model, 10)
    for ticks in range(1, 25):
        column = column.passed(tick_of(model) * (1 + 1e-9))
        among = column.costs[10 : 10 + FARTHEST * ticks + 1]
        cheapest = among.argmin()
        assert (np.diff(among)[:cheapest] < 0).all()
        assert (np.diff(among)[cheapest:] > 0).all()
        assert (np.diff(among, 2) > -1e-9).all()  # each further cell more than the one before
        if order == 0:  # at the nominal tempo
            assert cheapest == 4 * ticks


def test_a_place_is_dearer_the_further_a_sample_lies_from_what_it_says_there(rng: np.random.Generator) -> None:
    model = chance(rng)
    flat = replace(Alignment.begin(model), costs=np.zeros(alignment.CELLS))
    mean, sample = rng.normal(size=(alignment.CELLS, 1)), reading(model, rng, [1])
    seen = flat.seen(sample, mean, np.full(mean.shape, 0.3))
    nearest_first = np.abs(sample.values - mean[:, 0]).argsort()
    assert (np.diff(seen.costs[nearest_first]) > 0).all()
    other = flat.seen(sample, mean, np.full(mean.shape, 0.6))  # the metric: half as far
    np.testing.assert_allclose(other.costs, seen.costs / 2, atol=1e-12)


def test_who_has_arrived_may_stay(rng: np.random.Generator) -> None:
    model = chance(rng)
    column = beginning(model, alignment.CELLS - 1)
    for _ in range(50):
        column = column.passed(tick_of(model))
    assert column.phase == 1.0
    assert column.weights[-1] == pytest.approx(1.0)
    assert column.tempo == pytest.approx(model.phase.mean[1])  # and says nothing of the tempo


def test_a_sample_is_as_much_work_at_the_end_as_at_the_start(rng: np.random.Generator) -> None:
    """Calls are counted, and bytes."""
    phase = replace(phase_model(periodic=True), nominal_velocity=1.28)  # ticks of 1/128 s lose no digit
    model = chance_model(rng, phase)
    mean, var = rng.normal(size=(50, 2)), rng.uniform(0.1, 2, (50, 2))
    column, work = Alignment.begin(model), []
    for _ in range(300):
        sample, calls = reading(model, rng, [0, 2]), [0]

        def count(frame: object, event: str, argument: object, calls: list[int] = calls) -> None:
            calls[0] += event in ("call", "c_call")

        before = sys.getprofile()
        gc.disable()  # what it would call in between, to end what others left behind, is not counted
        sys.setprofile(count)
        try:
            column = column.passed(1 / 128).seen(sample, mean, var)
        finally:
            sys.setprofile(before)
            gc.enable()
        held = sum(value.nbytes for value in vars(column).values() if isinstance(value, np.ndarray))
        work.append((calls[0], held))
    assert len({*work[5:]}) == 1


# ------------------------------------------------------------------------------------------------------------ clocks


@KINDS
def test_how_often_nothing_is_seen_does_not_matter(order: int, periodic: bool, rng: np.random.Generator) -> None:
    model = chance(rng, order, periodic)
    begun = Alignment.begin(model).passed(0.3 * tick_of(model))
    gap = 30.5 * tick_of(model)
    once, often = begun.passed(gap), begun
    for _ in range(100):
        often = often.passed(gap / 100)
    for name, whole in vars(once).items():
        if name != "model":
            np.testing.assert_allclose(getattr(often, name), whole, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("tempo", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("periodic", [False, True])
def test_the_rate_of_samples_hardly_matters(tempo: float, periodic: bool, rng: np.random.Generator) -> None:
    """A fourth, and half, of the samples: the same phase within a third of its doubt, and a doubt alike."""
    model = chance(rng, periodic=periodic)
    nominal = model.phase.nominal_velocity
    lasting = np.array([0.06, 0.08]) / nominal  # [s] noise that is correlated for longer than all the intervals
    model = replace(model, noise=replace(model.noise, correlation_time=np.tile(lasting, 2)))
    phases, features = grid(model.phase, 100), np.array([0, 1])
    mean = model.layout.predict(phases, model.prior.mean, features)
    var = np.full(mean.shape, 0.05)
    found = {}
    for every in (1, 2, 4):
        column, found[every] = Alignment.begin(model), []
        for i in range(0, round(140 / tempo) + 1, every):
            dt = every / 160 / nominal if i else 0.0
            truth = np.array([0.05 + tempo * i / 160])
            values = model.layout.predict(truth, model.prior.mean, features)[0]
            noise_var = model.noise.at(np.full(4, dt if i else np.inf))[features]
            column = column.passed(dt).seen(Observation(features, values, noise_var), mean, var)
            turn = np.exp(2j * np.pi * (column.phases - truth))  # the whole interaction is less than one turn
            off = np.angle(turn) / (2 * np.pi) if periodic else column.phases - truth
            centre = column.weights @ off
            found[every].append((centre, np.sqrt(column.weights @ (off - centre) ** 2)))
    fastest = np.array(found[1])
    for every in (2, 4):
        slower, same = np.array(found[every]), fastest[::every][: len(found[every])]
        assert (np.abs(slower[:, 0] - same[:, 0]) < same[:, 1] / 3).all()
        assert np.abs(np.log(slower[5:, 1] / same[5:, 1])).max() < np.log(1.3)
