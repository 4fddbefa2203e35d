"""Ctrl-C loses nothing: what is finished is told and kept, and the same command goes on from there."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest
from interactions import curves, shapes_unchecked

import inphase
from inphase.cli import main
from inphase.errors import WorkerError
from inphase.evaluation import protocol
from inphase.io.csv import write_csv

NAMES = ("hand_x", "hand_y", "robot_x", "robot_y")
WORDS = ["reach", "--observed", "hand_?", "--controlled", "robot_?", "--filters", "bip", "rbpf", "--folds", "2"]
WORDS += ["--quick", "--conditions", "as recorded", "pause 2 s"]
ONE = [*WORDS, "--jobs", "1"]
PARTS, ROWS = 2 * 4 * 2, 4 * 4 * 2  # folds, predictors, conditions; episodes, predictors, conditions

# Runs the command, and says on standard error whenever rows are kept.
TALKATIVE = """
import sys
import inphase.cli.evaluate
from inphase.cli import main

original = inphase.cli.evaluate.cross_validate

def aloud(*arguments, keep, **options):
    def tell(rows):
        keep(rows)
        print("kept", len(rows), file=sys.stderr, flush=True)
    return original(*arguments, keep=tell, **options)

inphase.cli.evaluate.cross_validate = aloud
if __name__ == "__main__":
    sys.exit(main())
"""


@pytest.fixture(autouse=True)
def unchecked() -> Iterator[None]:
    """As users run the command."""
    with shapes_unchecked():
        yield


def write(folder: Path, samples: int = 24) -> None:
    folder.mkdir()
    for i in range(4):
        rng = np.random.default_rng(i)
        times = np.arange(samples) * 0.05 * (1 + 0.1 * rng.random())
        values = curves(times / times[-1], rng.standard_normal(2)) + 0.005 * rng.standard_normal((samples, 4))
        write_csv(folder / f"episode_{i}.csv", NAMES, times, values)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    write(folder / "reach")
    (folder / "talkative.py").write_text(TALKATIVE)
    return folder


@pytest.fixture(autouse=True)
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    def command(*words: object) -> tuple[int, str, str]:
        code = main(["evaluate", *map(str, words)])
        return code, *capsys.readouterr()

    return command


@pytest.fixture(scope="module")
def whole(folder: Path) -> str:
    """What an uninterrupted run writes."""
    with pytest.MonkeyPatch.context() as patch, shapes_unchecked():
        patch.chdir(folder)
        assert main(["evaluate", *ONE, "-o", "whole.json"]) == 0
    return (folder / "whole.json").read_text()


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is learned and scored in this process."""
    calls: list[str] = []
    for name in ("_learn", "_score"):
        original = getattr(protocol, name)
        monkeypatch.setattr(
            protocol, name, lambda *a, name=name, original=original: (calls.append(name), original(*a))[1]
        )
    return calls


# ------------------------------------------------------------------------------------------------------------ Ctrl-C


@pytest.mark.parametrize("place", [["--jobs", "1"], ["--jobs", "2"], ["--workers", "2"]], ids=" ".join)
def test_ctrl_c_in_the_middle_loses_nothing(place, whole, run, done, tmp_path):
    output = tmp_path / "results.json"
    command = [sys.executable, "-W", "error", "talkative.py", "evaluate", *WORDS, *place, "-o", str(output)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stderr is not None
    kept = [process.stderr.readline() for _ in range(3)]
    family = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: all processes get it
    out, errors = process.communicate(timeout=60)
    kept += [line for line in errors.splitlines(keepends=True) if line.startswith("kept")]
    assert (process.returncode, errors.replace("".join(kept[3:]), "")) == (130, "inphase: stopped\n")
    assert set(kept) == {"kept 2\n"}
    assert len(kept) < PARTS
    partial = json.loads(output.read_text())
    missing = partial["missing"]
    # What is being told when the signal comes may be kept and not told.
    assert missing in (ROWS - 2 * len(kept), ROWS - 2 * len(kept) - 2)
    assert f"\npartial: {missing} of {ROWS} scores are missing\n" in out
    assert out.startswith("reach: ")
    assert f"wrote {output}; the same command with --resume goes on\n" in out
    psutil.wait_procs(family, timeout=10)
    assert [p for p in family if p.is_running() and p.status() != psutil.STATUS_ZOMBIE] == []

    assert (partial["partial"], len(partial["episodes"])) == (True, ROWS - missing)
    expected = json.loads(whole)
    assert all(row in expected["episodes"] for row in partial["episodes"])
    assert run(*ONE, "-o", output, "--resume")[0] == 0
    assert done.count("_score") == missing // 2
    assert output.read_text() == whole
    assert (expected["partial"], expected["missing"]) == (False, 0)
    done.clear()
    assert run(*ONE, "-o", output, "--resume")[0] == 0
    assert done == []
    assert output.read_text() == whole


def interrupted(monkeypatch: pytest.MonkeyPatch, after: int, error: BaseException) -> None:
    """The work ends with an error after so many parts."""
    original, left = protocol._score, [after]

    def score(*arguments: object) -> object:
        if not left[0]:
            raise error
        left[0] -= 1
        return original(*arguments)

    monkeypatch.setattr(protocol, "_score", score)


def test_without_a_file_the_table_is_there(run, monkeypatch):
    interrupted(monkeypatch, 3, KeyboardInterrupt())
    code, out, err = run(*ONE)
    assert (code, err) == (130, "inphase: stopped\n")
    assert "now (inside)" in out
    assert f"partial: {ROWS - 6} of {ROWS} scores are missing" in out


def test_machines_are_told_what_is_missing(run, monkeypatch):
    interrupted(monkeypatch, 3, KeyboardInterrupt())
    said = json.loads(run(*ONE, "--json")[1])
    assert (said["partial"], said["missing"], len(said["episodes"])) == (True, ROWS - 6, 6)


def test_workers_that_are_lost_leave_what_they_found(run, monkeypatch, tmp_path):
    interrupted(monkeypatch, 5, WorkerError("the workers went home"))
    code, out, err = run(*ONE, "-o", tmp_path / "results.json")
    assert (code, err) == (2, "inphase: the workers went home\n")
    assert "partial: " in out
    assert json.loads((tmp_path / "results.json").read_text())["missing"] == ROWS - 10


def test_other_errors_leave_nothing(run, monkeypatch, tmp_path):
    interrupted(monkeypatch, 3, inphase.DataError("rain"))
    assert run(*ONE, "-o", tmp_path / "results.json") == (2, "", "inphase: rain\n")
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------------------ resume


def test_more_filters_and_conditions_do_only_what_is_new(run, done, whole, tmp_path):
    output = tmp_path / "results.json"
    some = [word for word in ONE if word not in ("rbpf", "pause 2 s")]
    run(*some, "-o", output, "--resume")  # there is no file: all is to be done
    assert (done.count("_learn"), done.count("_score")) == (2, 6)
    done.clear()
    run(*ONE, "-o", output, "--resume")
    assert (done.count("_learn"), done.count("_score")) == (2, PARTS - 6)
    assert output.read_text() == whole


def test_what_a_file_holds_is_taken_for_what_it_is(whole, run, tmp_path, done):
    """A score that was altered stays so: it is not found anew."""
    output, found = tmp_path / "results.json", json.loads(whole)
    found["episodes"][0]["now"], found["episodes"][1]["now"] = 12.5, None
    output.write_text(json.dumps(found))
    run(*ONE, "-o", output, "--resume")
    again = json.loads(output.read_text())["episodes"]
    assert [row["now"] for row in again[:2]] == [12.5, None]
    assert again[2:] == json.loads(whole)["episodes"][2:]
    assert done == []


OTHER = [
    (["--seed", "1"], "cannot go on: expected seed 0 as in the file, got 1"),
    (["--folds", "3"], "cannot go on: expected folds 2 as in the file, got 3"),
    (["--angle", "robot_y"], "cannot go on: it was written for other recordings or channels"),
]


@pytest.mark.parametrize(("words", "expected"), OTHER, ids=[words[0] for words, _ in OTHER])
def test_other_settings_are_refused(words, expected, whole, run, done):
    before = Path("whole.json").read_text()
    code, out, err = run(*ONE, *words, "-o", "whole.json", "--resume")
    assert (code, out) == (2, "")
    assert err == f"inphase: whole.json: {expected}\n"
    assert Path("whole.json").read_text() == before
    assert done == []


@pytest.mark.parametrize("text", ["", "{", "[]", "12", "{}", '{"folds": 2}', "\x00\xff"])
def test_another_file_is_refused(text, run, tmp_path):
    output = tmp_path / "results.json"
    output.write_bytes(text.encode("latin-1"))
    code, _, err = run(*ONE, "-o", output, "--resume")
    assert (code, err.count("\n")) == (2, 1)
    assert "expected the figures of `inphase evaluate --output`, got another file" in err


def test_rows_that_are_none_are_refused(run, whole, tmp_path):
    for harm in ({"now": "far"}, {"fold": None}, {}):
        found = json.loads(whole)
        found["episodes"][3] = {**found["episodes"][3], **harm} if harm else {"task": "reach"}
        output = tmp_path / "results.json"
        output.write_text(json.dumps(found))
        code, _, err = run(*ONE, "-o", output, "--resume")
        assert (code, "got another file" in err) == (2, True)


# ----------------------------------------------------------------------------------------------------------- options


def test_a_cluster_says_what_one_process_says(run, whole):
    from inphase.workers import local_cluster

    with local_cluster(2) as address:
        assert run(*WORDS, "--cluster", address, "--json")[1] == whole


BAD = [
    (["--cluster", "tcp://127.0.0.1:1"], "cluster tcp://127.0.0.1:1: no scheduler of dask answers there"),
    (["--cluster", "here"], "expected an address such as tcp://127.0.0.1:8786, got 'here'"),
    (["--workers", "0"], "--workers: expected at least 1, got 0"),
    (["--workers", "2", "--jobs", "2"], "expected one of --jobs, --workers and --cluster, got --jobs and --workers"),
]


@pytest.mark.parametrize(("words", "expected"), BAD, ids=[" ".join(words) for words, _ in BAD])
@pytest.mark.parametrize("command", ["evaluate", "fit"])
def test_bad_options_give_one_clear_line_before_the_work(command, words, expected, capsys, monkeypatch):
    def never(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("inphase.cli.reading.load", never)
    assert main([command, *WORDS[:5], *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("inphase: ")
    assert expected in captured.err
    assert captured.err.count("\n") == 1


def test_resume_needs_a_file(run):
    assert run(*ONE, "--resume") == (2, "", "inphase: --resume: expected --output, the file to go on with, got none\n")


def test_fit_is_told_who_works(monkeypatch, capsys):
    asked: list[dict[str, object]] = []

    def never(*_: object, **options: object) -> None:
        asked.append(options)
        raise KeyboardInterrupt

    monkeypatch.setattr("inphase.cli.fit.fit_model", never)
    monkeypatch.setattr("inphase.cli.jobs.check_address", lambda address: None)
    assert main(["fit", *WORDS[:5], "--cluster", "tcp://127.0.0.1:8786"]) == 130
    assert asked[0]["cluster"] == "tcp://127.0.0.1:8786"
    assert main(["fit", *WORDS[:5], "--workers", "1"]) == 130
    assert str(asked[1]["cluster"]).startswith("tcp://127.0.0.1:")
    assert main(["fit", *WORDS[:5], "--jobs", "3"]) == 130
    assert asked[2]["jobs"] == 3
