"""The gate of the benchmark: what passes, what fails, what is named; no test asserts a time."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from baseline import better, complaints, gate, read_baseline, typical, worsening, write_baseline

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
ROW = "62x9,80 ebip"
ONE_ROW = "--quick", "--sizes", "2x8,100", "--filters", "bip"
BEFORE = {"loop/step": 12.0, "step/floor": 1.6}


def times_worse(factor: float) -> dict[str, float]:
    """The row as if a step took `factor` times as long, all else being equal."""
    return {"loop/step": BEFORE["loop/step"] / factor, "step/floor": BEFORE["step/floor"] * factor}


@pytest.mark.parametrize("factor", [1.0, 1.2, 0.5])
def test_as_good_a_little_worse_and_better_pass(factor: float) -> None:
    assert complaints(ROW, BEFORE, times_worse(factor)) == []


@pytest.mark.parametrize("ratio", BEFORE)
def test_worse_by_more_than_a_quarter_fails_in_either_ratio(ratio: str) -> None:
    (found,) = complaints(ROW, BEFORE, BEFORE | {ratio: times_worse(1.3)[ratio]})
    assert found.startswith(f"{ROW}: {ratio} ")
    assert "1.30 times worse than" in found


@pytest.mark.parametrize("ratio", BEFORE)
def test_what_takes_longer_is_worse_by_as_much(ratio: str) -> None:
    assert worsening(ratio, BEFORE[ratio], times_worse(1.7)[ratio]) == pytest.approx(1.7)


def test_what_is_missing_is_named() -> None:
    (found,) = complaints(ROW, None, BEFORE)
    assert found.startswith(f"{ROW}: expected a row of the baseline")
    (found,) = complaints(ROW, BEFORE, {"loop/step": 12.0})
    assert found.startswith(f"{ROW}: expected step/floor, as in the baseline, got none")
    (found,) = complaints(ROW, {"loop/step": 12.0}, BEFORE)
    assert found.startswith(f"{ROW}: expected step/floor in the baseline, got none")


def test_the_better_of_two_is_that_of_each_ratio() -> None:
    assert better({"loop/step": 9.0, "step/floor": 2.0}, {"loop/step": 10.0, "step/floor": 3.0}) == {
        "loop/step": 10.0,
        "step/floor": 2.0,
    }


def test_a_baseline_is_made_of_what_is_typical() -> None:
    assert typical([times_worse(factor) for factor in (0.1, 1.0, 1.1)]) == BEFORE


@pytest.mark.parametrize(
    ("factors", "measured", "fails"),
    [
        ([1.0], 1, False),
        ([2.0, 1.0], 2, False),
        ([2.0, 1.9, 2.0, 1.9, 1.1], 5, False),
        ([2.0, 1.9, 2.0, 2.0, 1.8], 5, True),
    ],
)
def test_a_row_that_fails_is_measured_again_after_a_while(factors: list[float], measured: int, fails: bool) -> None:
    asked: list[str] = []
    pauses: list[None] = []
    left: Iterator[float] = iter(factors)

    def measure(row: str) -> dict[str, float]:
        asked.append(row)
        return times_worse(next(left))

    found = gate({ROW: BEFORE}, [ROW], measure, pause=lambda: pauses.append(None))
    assert asked == [ROW] * measured
    assert len(pauses) == measured - 1
    assert len(found) == (2 if fails else 0)
    assert all("1.80 times worse" in sentence for sentence in found)


def test_only_what_fails_is_measured_again() -> None:
    other, asked = "2x8,100 bip", []

    def measure(row: str) -> dict[str, float]:
        asked.append(row)
        return times_worse(2.0 if row == ROW and len(asked) < 4 else 1.0)

    assert gate({ROW: BEFORE, other: BEFORE}, [ROW, other], measure, pause=lambda: None) == []
    assert asked == [ROW, other, ROW, ROW]


@pytest.mark.parametrize(("margin", "fails"), [(1.9, True), (2.1, False)])
def test_a_margin_may_be_given(margin: float, fails: bool) -> None:
    found = gate({ROW: BEFORE}, [ROW], lambda row: times_worse(2.0), margin, pause=lambda: None)
    assert bool(found) == fails


def test_attempts_are_not_spent_on_a_row_without_a_baseline() -> None:
    asked: list[str] = []

    def measure(row: str) -> dict[str, float]:
        asked.append(row)
        return BEFORE

    assert len(gate({}, [ROW], measure)) == 1
    assert asked == [ROW]


def test_a_baseline_is_read_as_it_was_written_and_other_rows_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "baseline.json"
    write_baseline(path, {ROW: BEFORE, "2x8,100 bip": times_worse(2)})
    write_baseline(path, {ROW: times_worse(3)})
    assert read_baseline(path) == {ROW: pytest.approx(times_worse(3)), "2x8,100 bip": times_worse(2)}


# ------------------------------------------------------------------------------------------------------- the program


def speed(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", BENCHMARKS / "speed.py", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, float]]:
    """The baseline that the program writes of one row."""
    path = tmp_path_factory.mktemp("speed") / "baseline.json"
    assert speed(*ONE_ROW, "--baseline", path, "--write-baseline").returncode == 0
    return read_baseline(path)


def test_a_quick_run_writes_what_it_prints(tmp_path: Path) -> None:
    path = tmp_path / "speed.json"
    result = speed("--quick", "--sizes", "2x8,100", "--filters", "ebip", "--json", path)
    assert (result.returncode, result.stderr) == (0, "")
    assert max(map(len, result.stdout.splitlines())) <= 120
    found = json.loads(path.read_text(encoding="utf-8"))
    for rows in (found["steps"], found["sessions"]):
        ((row),) = rows
        assert (row.pop("size"), row.pop("filter")) == ("2x8,100", "ebip")
        assert all(value > 0 for value in row.values())
    assert {"median", "p99", "max", "bytes", "calls", *BEFORE} <= set(found["steps"][0])


@pytest.mark.parametrize(("faster", "code"), [(0.01, 0), (100.0, 1)])
def test_the_gate_is_shut_by_a_step_that_was_much_faster(
    tmp_path: Path,
    measured: dict[str, dict[str, float]],
    faster: float,
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    import baseline
    import speed as program

    path = tmp_path / "baseline.json"
    ((row, now),) = measured.items()
    was = {ratio: value * faster if ratio == "loop/step" else value / faster for ratio, value in now.items()}
    path.write_text(json.dumps({row: was}), encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["speed.py", *ONE_ROW, "--baseline", str(path), "--gate"])
    monkeypatch.setattr(baseline, "PAUSE", 0.0)
    assert program.main() == code
    printed = capsys.readouterr().out
    assert printed.count("2x8,100 bip: ") == len(was) * code
    assert ("no ratio is more than 1.25 times worse" in printed) == (code == 0)


def test_a_gate_without_a_baseline_says_how_to_make_one(tmp_path: Path) -> None:
    result = speed("--gate", "--baseline", tmp_path / "none.json")
    assert (result.returncode, result.stdout) == (2, "")
    assert "--write-baseline makes it" in result.stderr


def test_the_baseline_names_every_size_and_filter() -> None:
    from sizes import SIZES

    from inphase.filters import FILTERS

    committed = read_baseline(BENCHMARKS / "baseline.json")
    assert set(committed) == {f"{size} {name}" for size in SIZES for name in FILTERS}
    assert all(set(ratios) == set(BEFORE) for ratios in committed.values())
