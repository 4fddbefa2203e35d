"""`inphase evaluate` and `make accuracy`: they say what the library says, in files that are whole or not there."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interactions import curves, shapes_unchecked
from rich.progress import Progress

import inphase
from inphase.cli import console, main
from inphase.evaluation import BASELINES, CONDITIONS, METRICS, Evaluation, Row, evaluate
from inphase.io.csv import write_csv

ROOT = Path(__file__).parents[1]
NAMES = ("hand_x", "hand_y", "robot_x", "robot_y")
ROLES = ["--observed", "hand_?", "--controlled", "robot_?"]
ONE_JOB = [*ROLES, "--filters", "bip", "--jobs", "1", "--folds", "3", "--quick"]
SOME = ["--conditions", "as recorded", "lost 30 %"]


@pytest.fixture(autouse=True)
def unchecked() -> Iterator[None]:
    """As users run the command."""
    with shapes_unchecked():
        yield


def write(folder: Path, count: int = 4, names: tuple[str, ...] = NAMES, seed: int = 0) -> None:
    folder.mkdir(parents=True)
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        times = np.arange(15) * 0.15 * (1 + 0.1 * rng.random())
        values = curves(times / times[-1], rng.standard_normal(2)) + 0.005 * rng.standard_normal((15, 4))
        write_csv(folder / f"episode_{i}.csv", names, times, values[:, : len(names)])


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with two tasks of unequal size."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    write(tmp_path / "reach")
    write(tmp_path / "wave", count=3, seed=1)
    return tmp_path


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run the command in this process: exit code, output, errors."""

    def command(*arguments: object) -> tuple[int, str, str]:
        try:
            code = main(["evaluate", *map(str, arguments)])
        except SystemExit as end:
            code = int(end.code or 0)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return command


def plain(train: inphase.Dataset) -> inphase.Model:
    return inphase.fit(train, calibrate=False)


def tree(folder: Path) -> dict[str, bytes | None]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


def loaded(name: str) -> inphase.Dataset:
    return inphase.load(name, observed=["hand_?"], controlled=["robot_?"])


# ------------------------------------------------------------------------------------------------------- what it says


def test_it_says_what_the_library_says(here, run):
    code, out, err = run("reach", *ONE_JOB, *SOME, "--folds", 2, "--seed", 4, "--json")
    assert (code, err) == (0, "")
    said = json.loads(out)
    assert (said["folds"], said["seed"]) == (2, 4)
    expected = evaluate(
        {"reach": loaded("reach")}, ["bip"], folds=2, conditions=["as recorded", "lost 30 %"], seed=4, fit=plain
    )
    assert len(said["episodes"]) == len(expected.rows) == 4 * 3 * 2
    for got, row in zip(said["episodes"], expected.rows, strict=True):
        assert got == vars(row)
    for got in said["figures"]:
        for metric in METRICS:
            figure = expected.figure(metric, got["predictor"], got["condition"])
            assert (got[metric], got[f"{metric}_error"]) == (figure.mean, figure.error)
    assert [row["task"] for row in said["figures"]] == ["reach"] * 6 + [None] * 6


def cells(block: str) -> dict[str, list[tuple[str, str, str]]]:
    """The rows of a table by predictor, less its title: number, mark and share inside."""
    found = {}
    for line in block.splitlines()[1:]:
        name = next(name for name in ("bip", *BASELINES) if line.startswith(name))
        found[name] = re.findall(r" ([-\d.e+]+)(\*?)(?: ?\((\d+)%\))?", line[len(name) :])
    return found


def test_tables_hold_the_figures_and_mark_the_best(here, run):
    code, out, err = run("reach", *ONE_JOB, *SOME)
    assert (code, err) == (0, "")
    expected = evaluate(
        {"reach": loaded("reach")}, ["bip"], folds=3, conditions=["as recorded", "lost 30 %"], fit=plain
    )
    head, now = out.split("\n\n")[0].split("\n", 1)
    assert head == "reach: 4 episodes"
    tables = dict(zip(("now", "end50", "nll"), [now, *out.split("\n\n")[1:3]], strict=True))
    for metric, block in tables.items():
        assert block.startswith(metric)
        assert re.search(r" as recorded +lost 30 %$", block.splitlines()[0])
        rows = cells(block)
        assert list(rows) == ["bip", *BASELINES]
        for column, condition in enumerate(expected.conditions):
            means = {name: expected.figure(metric, name, condition).mean for name in rows}
            for name, row in rows.items():
                number, mark, inside = row[column]
                assert float(number) == pytest.approx(
                    means[name], rel=0.051 if abs(means[name]) > 999 else 1e-3, abs=6e-4
                )
                assert bool(mark) == (f"{means[name]:.3f}" == f"{min(means.values()):.3f}")
                if metric == "now":
                    assert int(inside) == pytest.approx(100 * expected.figure("cover", name, condition).mean, abs=0.51)
    assert "best of a column" in out


def test_the_best_stands_out_whatever_its_name(capsys):
    """Of equals both; where nothing was scored, none."""
    from inphase.cli.accuracy import print_evaluation

    nothing = [float("nan")] * 6
    figures = {"bip": [0.1] * 6, "rbpf": [0.1] * 6, "ridge": [0.2] * 6, "mean trajectory": nothing}
    rows = [Row("a", name, "as recorded", 0, "e", *of) for name, of in figures.items()]
    print_evaluation(console.Output(), Evaluation(tuple(rows)))
    marked = [line.split()[0] for line in capsys.readouterr().out.splitlines() if "*" in line]
    assert marked == ["bip", "rbpf"] * 3
    print_evaluation(console.Output(), Evaluation((Row("a", "bip", "as recorded", 0, "e", *nothing),)))
    out = capsys.readouterr().out
    assert "*" not in out
    assert "–" in out


def test_several_folders_are_several_tasks(here, run):
    said = json.loads(run("reach", "wave", *ONE_JOB, *SOME, "--json")[1])
    alone = {
        name: evaluate({name: loaded(name)}, ["bip"], folds=3, conditions=["as recorded", "lost 30 %"], fit=plain)
        for name in ("reach", "wave")
    }
    by = {(f["task"], f["predictor"], f["condition"]): f for f in said["figures"]}
    for name in ("bip", *BASELINES):
        for condition in ("as recorded", "lost 30 %"):
            means = [alone[task].figure("now", name, condition).mean for task in ("reach", "wave")]
            assert [by[task, name, condition]["now"] for task in ("reach", "wave")] == means
            assert by[None, name, condition]["now"] == pytest.approx(np.mean(means))
    out = run("reach", "wave", *ONE_JOB, *SOME)[1]
    assert [line for line in out.splitlines() if line.startswith(("reach", "wave", "mean of"))] == [
        "reach: 4 episodes",
        "wave: 3 episodes",
        "mean of 2 tasks",
    ]
    assert out.count("now (inside)") == 3


def test_files_of_one_folder_or_of_many_are_one_task(here, run):
    for data, name, count in (
        (["reach/"], "reach", 4),
        (["reach/episode_[0-2].csv"], "recordings", 3),
        (["reach/episode_0.csv", "wave/*.csv"], "recordings", 4),
        ([here / "reach" / ".." / "wave"], "wave", 3),
    ):
        out = run(*data, *ONE_JOB, "--conditions", "as recorded")[1]
        assert out.startswith(f"{name}: {count} episodes\n")


def test_folders_of_equal_names_are_told_apart(here, run):
    write(here / "monday" / "reach", seed=2)
    said = json.loads(run("reach", "monday/reach", *ONE_JOB, "--conditions", "as recorded", "--json")[1])
    assert {row["task"] for row in said["episodes"]} == {"reach", "monday/reach"}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the library was asked for, without an answer."""
    options: dict[str, Any] = {}

    def never(tasks: dict[str, inphase.Dataset], filters: tuple[str, ...], **more: Any) -> Evaluation:
        options.update(more, filters=filters)
        raise KeyboardInterrupt

    monkeypatch.setattr("inphase.cli.evaluate.cross_validate", never)
    return options


def test_the_library_is_asked_for_what_was_wanted(run, asked, here):
    words = ["--filters", "bip", "ebip", "--folds", 3, "--conditions", "pause 2 s", "--seed", 7, "--jobs", 5]
    assert run("reach", *ROLES, *words) == (130, "", "inphase: stopped\n")
    assert asked.pop("progress") is None
    assert asked.pop("keep") is not None
    assert asked.pop("fit").keywords == {"calibrate": True}
    assert asked == {
        "filters": ("bip", "ebip"),
        "folds": 3,
        "conditions": ("pause 2 s",),
        "seed": 7,
        "jobs": 5,
        "known": [],
    }


def test_who_names_nothing_gets_the_recommended_filter_and_all_conditions(run, asked, here):
    run("reach", *ROLES)
    assert asked["filters"] == (inphase.filters.RECOMMENDED,)
    assert asked["conditions"] == tuple(CONDITIONS)
    assert asked["jobs"] >= 1
    run("reach", *ROLES, "--quick")
    assert asked["fit"].keywords == {"calibrate": False}
    out = run("--help")[1]
    assert "'pause 2 s'" in out
    for clutter in ("default: )", "None", "--no-"):
        assert clutter not in out


def test_baselines_can_be_had_alone(here, run):
    said = json.loads(run("reach", *ROLES, "--filters", "--jobs", 1, "--folds", 2, *SOME, "--json")[1])
    assert {row["predictor"] for row in said["episodes"]} == set(BASELINES)


def test_an_error_in_another_process_is_told_in_one_line(here, run):
    for i in range(3):
        path = here / "wave" / f"episode_{i}.csv"
        lines = path.read_text().splitlines()
        path.write_text("\n".join([lines[0], *(line.rsplit(",", 1)[0] + "," for line in lines[1:])]) + "\n")
    code, out, err = run("reach", "wave", *ROLES, "--filters", "bip", "--folds", 3, "--quick", "--jobs", 2, *SOME)
    assert (code, out) == (2, "")
    assert err == "inphase: wave: channel 'robot_y': expected readings, got none in any of 2 demonstrations\n"


def test_eighty_columns_are_enough(here, run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    out = run("reach", "wave", *ONE_JOB)[1]
    assert len([line for line in out.splitlines() if "lost 30 %" in line]) == 5
    assert [line for line in out.splitlines() if len(line) > 80 or line != line.rstrip()] == []


# ------------------------------------------------------------------------------------------------------ what it writes


def test_files_are_what_was_said(here, run):
    code, out, err = run("reach", *ONE_JOB, *SOME, "-o", "found.json", "--picture", "found.png")
    assert (code, err) == (0, "")
    assert out.endswith("wrote found.json\nwrote found.png\n")
    assert json.loads(Path("found.json").read_text()) == json.loads(run("reach", *ONE_JOB, *SOME, "--json")[1])
    assert Path("found.png").read_bytes().startswith(b"\x89PNG")
    assert {p.name for p in here.iterdir()} == {"reach", "wave", "found.json", "found.png"}


def test_what_was_not_scored_is_null(here, run):
    for i in range(3):
        path = here / "wave" / f"episode_{i}.csv"
        lines = path.read_text().splitlines()
        path.write_text("\n".join([*lines[:-1], lines[-1].rsplit(",", 2)[0] + ",,"]) + "\n")
    said = json.loads(run("wave", *ONE_JOB, *SOME, "--json")[1])
    assert {row["end50"] for row in said["episodes"]} == {None}
    assert {row["end50"] for row in said["figures"]} == {None}
    assert all(row["now"] > 0 for row in said["episodes"])


@pytest.mark.parametrize(
    "at", ["inphase.cli.evaluate.cross_validate", "pathlib.Path.write_text", "inphase.cli.reading.load"]
)
def test_an_interrupt_leaves_nothing(at, here, run, monkeypatch):
    def interrupted(first: object, *_: object, **__: object) -> None:
        if isinstance(first, Path):
            first.write_bytes(b"half of the")
        raise KeyboardInterrupt

    (here / "found.json").write_text("the old figures")
    before = tree(here)
    monkeypatch.setattr(at, interrupted)
    code, _, err = run("reach", *ONE_JOB, *SOME, "-o", "found.json")
    assert (code, err) == (130, "inphase: stopped\n")
    assert tree(here) == before


def test_a_terminal_is_shown_how_far_it_is(here, run, monkeypatch):
    shown: list[float] = []
    monkeypatch.setattr(console.Output, "is_terminal", property(lambda self: True))
    monkeypatch.setattr(Progress, "update", lambda self, task, completed: shown.append(completed))
    assert run("reach", *ONE_JOB, *SOME, "--folds", 2)[0] == 0
    assert shown == [i / 14 for i in range(1, 15)]
    monkeypatch.setattr(console.Output, "is_terminal", property(lambda self: False))
    shown.clear()
    assert run("reach", *ONE_JOB, *SOME, "--folds", 2)[2] == ""
    assert shown == []


# ---------------------------------------------------------------------------------------------------- what it refuses

BAD = [
    (["reach", *ONE_JOB, "--folds", "6"], ["reach: expected at least 6 episodes, one for each of 6 folds, got 4"]),
    (["wave", *ONE_JOB, "--folds", "1"], ["folds", "at least 2, got 1"]),
    (["wave", *ROLES, "--jobs", "0"], ["--jobs", "at least 1, got 0"]),
    (["wave", *ROLES, "--filters", "oracle"], ["unknown filter 'oracle'", "'bip'"]),
    (["wave", *ROLES, "--conditions", "upside down"], ["unknown condition 'upside down'", "'pause 2 s'"]),
    (["wave"], ["--observed and --controlled", "hand_x, hand_y, robot_x, robot_y"]),
    (["wave", "--observed", "hand_?"], ["--observed and --controlled", "hand_x, hand_y, and as controlled none"]),
    (["wave", "--observed", "paw_?", "--controlled", "robot_?"], ["no channel fits 'paw_?'", "hand_x"]),
    (ROLES, ["expected at least one file, folder or pattern, got none"]),
    (["nowhere", *ROLES], ["nowhere: no such file or folder"]),
    (["reach", "wave/episode_0.csv", *ROLES], ["expected folders, each a task", "reach", "wave/episode_0.csv"]),
    (["reach", "./reach", *ROLES], ["expected every folder once, got twice", "reach"]),
    (
        ["reach", "other", "--observed", "hand_*", "--controlled", "robot_*"],
        ["other", "hand_x, hand_y", "hand_x, hand_z"],
    ),
    (["wave", *ROLES, "-o", "no/a.json"], ["no/a.json: expected the folder no to exist"]),
    (["wave", *ROLES, "-o", "reach"], ["reach: expected a file name, got a folder"]),
    (["wave", *ROLES, "--picture", "a.docx"], ["'a.docx'", ".png, .svg, .pdf"]),
    (["wave", *ROLES, "--picture", "no/a.png"], ["no/a.png: expected the folder no to exist"]),
]


@pytest.mark.parametrize(("arguments", "words"), BAD, ids=[" ".join(arguments)[:60] for arguments, _ in BAD])
def test_bad_input_gives_one_clear_line_before_the_work(arguments, words, here, run, monkeypatch):
    def never(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("inphase.evaluation.protocol._learn", never)
    write(here / "other", names=("hand_x", "hand_z", "robot_x", "robot_y"))
    before = tree(here)
    code, out, err = run(*arguments)
    assert code == 2
    assert out == ""
    assert tree(here) == before
    assert err.startswith("inphase: ")
    assert err.count("\n") == 1
    assert [word for word in words if word not in err] == []


# ------------------------------------------------------------------------------------------------------ make accuracy


def accuracy(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", ROOT / "benchmarks" / "accuracy.py", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


def test_the_page_on_accuracy_is_made(shared_data, tmp_path):
    """Quick, of one filter; the whole takes half an hour."""
    page = tmp_path / "accuracy.md"
    result = accuracy("--quick", "--filters", "bip", "--jobs", 1, "--output", page, "--data", shared_data)
    assert (result.returncode, result.stderr) == (0, "")
    assert f"wrote {page}" in result.stdout
    assert "handover: 100 %" in result.stdout
    text = page.read_text(encoding="utf-8")
    assert "no evidence" in text
    for title in ("Hand-over", "Two people", "person and a robot"):
        assert re.search(rf"^## .*{title}", text, flags=re.MULTILINE)
    assert re.findall(r"^\| \*wanted\* \| (.*) \|$", text, flags=re.MULTILINE) == [
        "≤ 0.045 (85 … 95 %)",
        "≤ 0.52 (85 … 95 %)",
        "≤ 0.65 (85 … 95 %)",
    ]
    for name in ("bip", *BASELINES):
        assert len(re.findall(rf"^\| {name} \| .*\d\.\d", text, flags=re.MULTILINE)) == 3 * 3
    assert list(tmp_path.iterdir()) == [page]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--data", "nowhere"], "expected the recordings nowhere"), (["--quick"], "--quick is no evidence")],
)
def test_without_recordings_the_benchmark_says_so(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs" / "accuracy.md"
    before = page.read_bytes() if page.exists() else None
    result = accuracy(*arguments)
    assert (result.returncode, result.stdout) == (2, "")
    assert words in result.stderr.splitlines()[-1]
    assert (page.read_bytes() if page.exists() else None) == before
