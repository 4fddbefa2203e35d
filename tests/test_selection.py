"""Which basis suits: the generating one is found, whatever the units, and the criteria are those of the textbooks."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import inphase
from inphase import DataError, Dataset, OptionError
from inphase.basis import Basis, Gaussian, Periodic, Polynomial, Sigmoid
from inphase.cli import main
from inphase.training.selection import SIZES, BasisSelection, grid, select_basis

ROOT = Path(__file__).parents[1]
TRUE = (Gaussian(8, math.sqrt(0.1), margin=0.0), Sigmoid(8, 0.05))


def drawn(bases: tuple[Basis, ...], count: int, noise: float, rng: np.random.Generator, lengths=(80, 120)) -> Dataset:
    """Demonstrations that are weighted sums of the functions, with some of every direction that these span."""
    times, values = [], []
    for _ in range(count):
        phases = np.linspace(0, 1, int(rng.integers(*lengths)))
        columns = []
        for basis in bases:
            _, mixing = np.linalg.qr(basis(np.linspace(0, 1, 400)))
            weights = np.linalg.solve(mixing / 20, rng.normal(size=basis.size) / (1 + np.arange(basis.size)))
            columns.append(basis(phases) @ weights)
        times.append(2 * phases)
        values.append(np.stack(columns, axis=1) + noise * rng.normal(size=(len(phases), len(bases))))
    names = [f"c{i}" for i in range(len(bases))]
    return Dataset.from_arrays(times, values, names[:1], names[1:])


def found(selection: BasisSelection, criterion: str) -> list[tuple[str, int]]:
    best = selection.best(criterion)
    return [(type(best[name]).__name__, best[name].size) for names in selection.members for name in names]


@pytest.mark.parametrize("seed", range(20))
def test_the_generating_family_is_found_and_its_size_within_one(seed: int) -> None:
    dataset = drawn(TRUE, 50, 0.01, np.random.default_rng(seed))
    selection = select_basis(dataset, per="channel")
    for criterion in ("bic", "held-out"):
        for (family, size), true in zip(found(selection, criterion), TRUE, strict=True):
            assert family == type(true).__name__, criterion
            assert abs(size - true.size) <= 1, criterion


def test_criteria_are_those_of_a_loop_over_demonstrations(rng: np.random.Generator) -> None:
    """AIC = 2 k - 2 log L and BIC = k log n - 2 log L (Akaike 1974, Schwarz 1978); the Gaussian of the others."""
    dataset = drawn((Gaussian(6),) * 2, 9, 0.05, rng, lengths=(60, 61))
    basis = Gaussian(5, 0.2, margin=0.0)
    selection = select_basis(dataset, candidates=[basis], per="channel")
    phases = np.linspace(0, 1, 60)
    functions = np.linalg.qr(basis(phases))[0]
    for channel in range(2):
        curves = np.array([d.values[:, channel] for d in dataset])
        weights = curves @ functions
        left = curves - weights @ functions.T
        var = (left**2).mean()
        log_likelihood = np.mean([stats.norm.logpdf(row, 0, np.sqrt(var)).sum() for row in left])
        assert selection.aic[channel, 0] * 60 == pytest.approx(2 * 5 - 2 * log_likelihood)
        assert selection.bic[channel, 0] * 60 == pytest.approx(5 * np.log(60) - 2 * log_likelihood)
        assert selection.error_std[channel, 0] == pytest.approx(np.sqrt(var / curves.var()))
        noise, scores = (left**2).sum() / 9 / (60 - 5), []
        for i in range(9):
            others = np.delete(weights, i, axis=0)
            # Eq. 2.11 and 2.14 for the others; the divisor is theirs, and all have the same noise.
            cov = np.cov(others, rowvar=False, ddof=1) + noise * np.eye(5)
            own = stats.multivariate_normal.logpdf(weights[i], others.mean(0), cov)
            scores.append(own + stats.norm.logpdf(left[i], 0, np.sqrt(noise)).sum())
        # What is left lies in 55 directions, not 60: of as many readings as there are phases, 5 are the weights.
        expected = -2 * np.mean(scores) - 5 * np.log(2 * np.pi * noise)
        assert selection.held_out[channel, 0] * 60 == pytest.approx(expected)


def test_units_and_order_change_nothing(rng: np.random.Generator) -> None:
    dataset = drawn(TRUE, 12, 0.05, rng)
    straight = select_basis(dataset, per="channel")
    turned = Dataset.from_arrays(
        [1e-3 * d.times + 5 for d in reversed(list(dataset))],
        [d.values[:, ::-1] * [1e3, -1e-2] for d in reversed(list(dataset))],
        ["c1"],
        ["c0"],
    )
    other = select_basis(turned, per="channel")
    for criterion in ("aic", "bic", "held-out"):
        assert straight.best(criterion) == other.best(criterion)
        offset = other.values(criterion)[::-1] - straight.values(criterion)
        finite = np.isfinite(offset).all(0)
        # Other units shift every candidate alike.
        np.testing.assert_allclose(offset[:, finite] - offset[:, finite][:, :1], 0, atol=1e-6)


def test_all_channels_together_are_the_mean_of_each(rng: np.random.Generator) -> None:
    dataset = drawn(TRUE, 8, 0.05, rng)
    each, together = (select_basis(dataset, per=per, sizes=(6, 8)) for per in ("channel", "all"))
    np.testing.assert_allclose(together.held_out[0], each.held_out.mean(0))
    assert together.members == (("c0", "c1"),)
    assert [value for _, value in together.ranking("all channels")] == sorted(together.held_out[0])
    groups = select_basis(dataset, per="group", sizes=(6,))
    assert [name for names in groups.members for name in names] == ["c0", "c1"]


def test_a_quaternion_and_an_angle_have_one_basis_each(rng: np.random.Generator) -> None:
    times = [np.linspace(0, 1, 70)] * 5
    turn = [t * rng.normal(2, 0.2) for t in times]
    half = [np.stack([0 * a, 0 * a, np.sin(a / 2), np.cos(a / 2)], axis=1) for a in turn]
    values = [np.column_stack([q, np.angle(np.exp(1j * 4 * a))]) for q, a in zip(half, turn, strict=True)]
    values = [v + 1e-3 * rng.normal(size=v.shape) for v in values]
    dataset = Dataset.from_arrays(times, values, ["h_qx", "h_qy", "h_qz", "h_qw"], ["a"], kinds={"a": "angle"})
    selection = select_basis(dataset, per="channel", sizes=(5, 6))
    assert selection.members == (("h_qx", "h_qy", "h_qz", "h_qw"), ("a",))
    model = inphase.fit(dataset, basis=selection.best(), calibrate=False)
    assert model.layout.bases[0] == selection.best()["h_qx"]


def test_missing_readings_are_bridged(rng: np.random.Generator) -> None:
    dataset = drawn(TRUE, 20, 0.01, rng)
    holes = [d.values.copy() for d in dataset]
    for values in holes:
        values[rng.random(values.shape) < 0.02] = np.nan
    holes[3][:, 0] = np.nan
    broken = Dataset.from_arrays([d.times for d in dataset], holes, ["c0"], ["c1"])
    assert found(select_basis(broken, per="channel", sizes=(6, 8, 10)), "bic") == [("Gaussian", 8), ("Sigmoid", 8)]


def test_rhythms_are_compared_round_the_circle(rng: np.random.Generator) -> None:
    dataset = drawn((Periodic(7), Periodic(7)), 20, 0.01, rng)
    selection = select_basis(dataset, periodic=True, sizes=(5, 6, 7, 8, 9))
    assert all(basis.periodic for basis in selection.candidates)
    assert abs(selection.best("bic")["c0"].size - 7) <= 1


def test_what_cannot_be_supported_is_not_chosen(rng: np.random.Generator) -> None:
    dataset = drawn(TRUE, 4, 0.01, rng, lengths=(20, 30))
    selection = select_basis(dataset, sizes=(5, 300))
    assert selection.best()["c0"].size == 5
    assert np.isinf(selection.held_out).any()


def test_a_channel_that_rests_says_nothing_of_the_others(rng: np.random.Generator) -> None:
    dataset = drawn(TRUE[:1] * 2, 10, 0.01, rng)
    values = [np.column_stack([d.values, np.full(len(d), 3.0)]) for d in dataset]
    still = Dataset.from_arrays([d.times for d in dataset], values, ["c0", "still"], ["c1"])
    selection = select_basis(still, sizes=(6, 8, 10), per="channel")
    assert all(np.isfinite(selection.values(c)[:, :5]).all() for c in ("aic", "bic", "held-out"))
    assert selection.error_std.max() < 2


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"per": "finger"}, OptionError, "per: expected one of all, group, channel, got 'finger'"),
        ({"families": ["fourier"]}, OptionError, "unknown family 'fourier'; one of gaussian, sigmoid, polynomial"),
        ({"candidates": []}, OptionError, "at least one candidate"),
        ({"candidates": [Periodic(5), Gaussian(5)]}, OptionError, "all periodic or none"),
        ({"sizes": [1]}, OptionError, "Gaussian size"),
    ],
)
def test_mistakes_are_told(rng: np.random.Generator, options: dict, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        select_basis(drawn(TRUE, 4, 0.01, rng), **options)


def test_too_few_demonstrations_and_unseen_channels_are_told(rng: np.random.Generator) -> None:
    with pytest.raises(DataError, match="at least 3 demonstrations to compare bases on, got 2"):
        select_basis(drawn(TRUE, 2, 0.01, rng))
    unseen = Dataset.from_arrays([np.arange(9.0)] * 3, [np.full((9, 2), np.nan)] * 3, ["a"], ["b"])
    with pytest.raises(DataError, match="channel 'a': expected readings, got none in any of 3"):
        select_basis(unseen)
    selection = select_basis(drawn(TRUE, 4, 0.01, rng), sizes=(5,), per="channel")
    with pytest.raises(OptionError, match="unknown unit None; one of c0, c1"):
        selection.ranking()
    with pytest.raises(OptionError, match="unknown criterion 'dic'; one of aic, bic, held-out"):
        selection.best("dic")


def test_the_grid_holds_every_family_and_size() -> None:
    bases = list(grid())
    assert {basis.size for basis in bases} == set(SIZES)
    assert {type(basis) for basis in bases} == {Gaussian, Sigmoid, Polynomial}
    assert len(set(bases)) == len(bases)


# ---------------------------------------------------------------------------------------------------- the command


@pytest.fixture
def recordings(tmp_path, rng: np.random.Generator):
    for i, d in enumerate(drawn(TRUE, 6, 0.01, rng)):
        np.savetxt(
            tmp_path / f"e{i}.csv",
            np.column_stack([d.times, d.values]),
            delimiter=",",
            header="time,c0,c1",
            comments="",
        )
    return tmp_path


def test_the_command_ranks_and_draws(recordings, capsys) -> None:
    picture = recordings / "selection.png"
    command = ["select", str(recordings), "--observed", "c0", "--controlled", "c1", "--sizes", "5", "8", "12"]
    assert main([*command, "--picture", str(picture), "--per", "channel"]) == 0
    said = capsys.readouterr().out
    assert "gaussian:8:0.316:0" in said.split("c1\n")[0]
    assert "sigmoid:8:0.05" in said.split("c1\n")[1]
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert main([*command, "--json", "--criterion", "bic"]) == 0
    described = json.loads(capsys.readouterr().out)
    assert [unit["channels"] for unit in described["units"]] == [["c0", "c1"]]
    assert set(described["best"]) == {"aic", "bic", "held-out"}


def test_the_benchmark_compares_with_a_loop() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "selection.py"), "--quick"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "75 candidates, 5 demonstrations of 2 channels" in said
    assert "times faster" in said


def test_the_command_chooses_channels(tmp_path, rng: np.random.Generator, capsys) -> None:
    for i in range(30):
        t, told, other = np.linspace(0, 1, 40), *rng.normal(size=2)
        wave = np.sin(3 * t)
        table = np.column_stack([t, told * wave, other * wave, told * np.cos(3 * t)]) + 0.01 * rng.normal(size=(40, 4))
        table[:, 0] = t
        np.savetxt(tmp_path / f"e{i}.csv", table, delimiter=",", header="time,tells,idle,arm", comments="")
    command = [
        "select",
        str(tmp_path),
        "--observed",
        "tells",
        "idle",
        "--controlled",
        "arm",
        "--channels",
        "*s",
        "idle",
    ]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert said.strip().splitlines()[-1] == "keep: --observed tells"
    assert main([*command, "--json", "--estimator", "neighbours"]) == 0
    assert json.loads(capsys.readouterr().out)["chosen"] == ["tells"]


def test_the_command_tells_mistakes_in_a_line(recordings, capsys) -> None:
    for wrong in (["--criterion", "dic"], ["--per", "finger"], ["--families", "fourier"], ["--sizes", "1"]):
        assert main(["select", str(recordings), "--observed", "c0", "--controlled", "c1", *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1
