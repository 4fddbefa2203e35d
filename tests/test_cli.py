"""The command line: what it says, what it refuses in one line, and that it never leaves half of anything."""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interactions import curves, taught
from numpy.testing import assert_allclose
from rich.status import Status

import inphase
from inphase.basis import FAMILIES, Gaussian, Periodic, Polynomial, Sigmoid
from inphase.channels import Kind
from inphase.cli import console
from inphase.cli.basis_text import parse_basis, show_basis
from inphase.cli.card import describe_model, print_model
from inphase.cli.evidence import print_evidence
from inphase.evaluation import replay
from inphase.evidence import Evidence, Trial
from inphase.io.csv import write_csv
from inphase.preprocess.checks import FindingKind
from inphase.tempo import Tempo

NAMES = ("hand_x", "hand_y", "robot_x", "robot_y")
ROLES = ["--observed", "hand_?", "--controlled", "robot_?"]


# --------------------------------------------------------------------------------------------------------- recordings


def episode(seed: int, samples: int = 30) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values of one interaction in a style of its own."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0, 2 + 0.1 * rng.standard_normal(), samples)
    values = curves(times / times[-1], rng.standard_normal(2))
    return times, values + 0.005 * rng.standard_normal(values.shape)


def write(folder: Path, count: int = 4, names: tuple[str, ...] = NAMES, **options: Any) -> list[Path]:
    folder.mkdir()
    paths = []
    for i in range(count):
        paths.append(folder / f"episode_{i}.csv")
        times, values = episode(i, **options)
        write_csv(paths[-1], names, times, values[:, : len(names)])
    return paths


def edit(path: Path, change: Callable[[list[str]], list[str]]) -> None:
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Good recordings, and a model of them."""
    folder = tmp_path_factory.mktemp("template")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write(folder / "good")
        taught(inphase.load("good", "hand_?", "robot_?")).save("good.inphase")
    return folder


@pytest.fixture
def here(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with good recordings, a model of them, and no terminal that is as wide as mine."""
    shutil.copytree(template, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    return tmp_path


def tree(folder: Path) -> dict[str, bytes | None]:
    """All that is in a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


# ---------------------------------------------------------------------------------------------------------- bad input


def empty(folder: Path) -> None:
    (folder / "empty").mkdir()


def missing_column(folder: Path) -> None:
    paths = write(folder / "missing_column")
    write_csv(paths[2], NAMES[:3], *(part[:, :3] if part.ndim == 2 else part for part in episode(2)))


def wrong_delimiter(folder: Path) -> None:
    for path in write(folder / "wrong_delimiter"):
        path.write_text(path.read_text().replace(",", ";"))


def text_in_a_number(folder: Path) -> None:
    path = write(folder / "text_in_a_number")[1]
    edit(path, lambda lines: [*lines[:6], "0.2,0.1,oops,0.3,0.4", *lines[7:]])


def one_demonstration(folder: Path) -> None:
    write(folder / "one_demonstration", count=1)


def two_samples(folder: Path) -> None:
    write(folder / "two_samples", samples=2)


def never_moves(folder: Path) -> None:
    for path in write(folder / "never_moves"):
        edit(path, lambda lines: [lines[0], *(",".join([*line.split(",")[:4], "7.5"]) for line in lines[1:])])


def backwards(folder: Path) -> None:
    edit(write(folder / "backwards")[3], lambda lines: [*lines[:10], lines[11], lines[10], *lines[12:]])


def another_data_set(folder: Path) -> None:
    write(folder / "another_data_set", names=("paw_x", "paw_y", "tail"))


def not_a_model(folder: Path) -> None:
    (folder / "not_a_model.inphase").write_text("time,hand_x\n0,1\n")


def damaged_model(folder: Path) -> None:
    content = (folder / "good.inphase").read_bytes()
    (folder / "damaged_model.inphase").write_bytes(content[:-100])


def nothing(folder: Path) -> None:
    """All that is needed is that something is not there."""


FIT = ["-o", "new.inphase", *ROLES, "--quick"]

BAD = [
    # what makes it, the command, what its line says: file, channel, expected, got
    (empty, ["fit", "empty", *FIT], ["empty: expected .csv or .npz files", "found none"]),
    (empty, ["validate", "empty"], ["empty: expected .csv or .npz files"]),
    (empty, ["inspect", "empty"], ["empty: expected .csv or .npz files"]),
    (empty, ["replay", "good.inphase", "empty"], ["empty: expected .csv or .npz files"]),
    (missing_column, ["fit", "missing_column", *FIT], ["missing_column/episode_2.csv", "'robot_y'", "hand_x, hand_y"]),
    (wrong_delimiter, ["fit", "wrong_delimiter", *FIT], ["episode_0.csv: expected ','", "found ';'", "--delimiter"]),
    (wrong_delimiter, ["validate", "wrong_delimiter"], ["episode_0.csv: expected ','", "found ';'"]),
    (
        text_in_a_number,
        ["fit", "text_in_a_number", *FIT],
        ["text_in_a_number/episode_1.csv, line 7, channel 'hand_y': expected a number, got 'oops'"],
    ),
    (
        text_in_a_number,
        ["replay", "good.inphase", "text_in_a_number/episode_1.csv"],
        ["episode_1.csv, line 7, channel 'hand_y': expected a number, got 'oops'"],
    ),
    (one_demonstration, ["fit", "one_demonstration", *FIT], ["at least 2 demonstrations", "got 1 (episode_0)"]),
    (two_samples, ["fit", "two_samples", *FIT], ["two_samples/episode_0.csv: expected at least 3 samples, got 2"]),
    (two_samples, ["replay", "good.inphase", "two_samples"], ["episode_0.csv: expected at least 3 samples, got 2"]),
    (never_moves, ["fit", "never_moves", *FIT], ["channel 'robot_y': expected a channel that moves, got 7.5"]),
    (backwards, ["fit", "backwards", *FIT], ["backwards/episode_3.csv: expected times that increase, got", "after"]),
    (backwards, ["inspect", "backwards"], ["backwards/episode_3.csv: expected times that increase, got", "sample 10"]),
    (
        another_data_set,
        ["replay", "good.inphase", "another_data_set"],
        ["episode_0: not what the model was trained on: expected channels hand_x, hand_y; got paw_x, paw_y, tail"],
    ),
    (another_data_set, ["fit", "another_data_set", *FIT], ["episode_0.csv: no channel fits 'hand_?'", "paw_x, paw_y"]),
    (nothing, ["fit", "nowhere", *FIT], ["nowhere: no such file or folder"]),
    (nothing, ["fit", "nowhere/*.csv", *FIT], ["nowhere/*.csv: nothing fits the pattern"]),
    (nothing, ["validate", "good/episode_9.csv"], ["good/episode_9.csv: no such file or folder", "episode_0.csv"]),
    (nothing, ["replay", "nowhere.inphase", "good"], ["nowhere.inphase: cannot be read: No such file"]),
    (nothing, ["inspect", "nowhere.inphase"], ["nowhere.inphase: cannot be read: No such file"]),
    (not_a_model, ["inspect", "not_a_model.inphase"], ["not_a_model.inphase: not an inphase model", "got b'time,han'"]),
    (not_a_model, ["replay", "not_a_model.inphase", "good"], ["not_a_model.inphase: not an inphase model"]),
    (nothing, ["replay", "good/episode_0.csv", "good.inphase"], ["episode_0.csv: not an inphase model"]),
    (damaged_model, ["replay", "damaged_model.inphase", "good"], ["damaged_model.inphase: cut short or damaged"]),
    (nothing, ["replay", "good.inphase", "good", "--filter", "oracle"], ["filter 'oracle'", "bip, ebip"]),
    (nothing, ["replay", "good.inphase", "good", "--filter", "ebip", "--members", "1"], ["at least 2 members, got 1"]),
    (nothing, ["replay", "good.inphase", "good", "--filter", "bip", "--members", "9"], ["'bip' has no option members"]),
    (nothing, ["replay", "good.inphase", "good", "--filter", "bip", "--particles", "99"], ["has no option particles"]),
    (nothing, ["replay", "good.inphase", "good", "--particles", "9"], ["at least 10 particles, got 9"]),
    (nothing, ["replay", "good.inphase", "good", "--picture", "a.docx"], ["'a.docx'", ".png, .svg, .pdf"]),
    (nothing, ["replay", "good.inphase", "good", "--picture", "no/a.png"], ["no/a.png", "folder no to exist"]),
    (nothing, ["fit", "good", *ROLES, "-o", "no/a.inphase"], ["no/a.inphase: expected the folder no to exist"]),
    (nothing, ["fit", "good", *ROLES, "-o", "good"], ["good: expected a file name, got a folder"]),
    (nothing, ["fit", "good", *FIT, "--basis", "wavelet:9"], ["'wavelet'", "gaussian, sigmoid, polynomial, periodic"]),
    (
        nothing,
        ["fit", "good", *FIT, "--basis", "gaussian"],
        ["--basis: expected gaussian:size[:width]", "got 'gaussian'"],
    ),
    (
        nothing,
        ["fit", "good", *FIT, "--basis", "gaussian:many"],
        ["--basis: expected gaussian:size", "'gaussian:many'"],
    ),
    (nothing, ["fit", "good", *FIT, "--basis", "sigmoid:9:1:1"], ["--basis: expected sigmoid:size[:width], got"]),
    (nothing, ["fit", "good", *FIT, "--basis", "polynomial:5:0.1"], ["--basis: expected polynomial:degree, got"]),
    (nothing, ["fit", "good", *FIT, "--basis", "gaussian:9", "--periodic"], ["both periodic or both not"]),
    (nothing, ["fit", "good", *FIT, "--order", "3"], ["order 0, 1 or 2, got 3"]),
    (nothing, ["fit", "good", *FIT, "--jobs", "0"], ["--jobs: expected at least 1, got 0"]),
    (nothing, ["inspect", "good", "--report"], ["--report: expected a model file (.inphase), got good"]),
    (nothing, ["fit", "good", "--observed", "paw_?", "--controlled", "robot_?"], ["no channel fits 'paw_?'", "hand_x"]),
    (nothing, ["fit", "good", "--observed", "hand_?", "*_x", "--controlled", "robot_?"], ["as both: robot_x"]),
    (nothing, ["fit", "good", "--observed", "hand_?"], ["--observed and --controlled", "hand_x, hand_y, robot_x"]),
    (nothing, ["fit", "good"], ["--observed and --controlled", "good/episode_0.csv", "hand_x, hand_y, robot_x"]),
    (nothing, ["fit", *FIT], ["expected at least one file, folder or pattern, got none"]),
    (nothing, ["validate"], ["expected at least one file, folder or pattern, got none"]),
    (nothing, ["replay", "good.inphase"], ["expected at least one file, folder or pattern, got none"]),
    (nothing, ["fit", "good", *FIT, "--time", "clock"], ["no column 'clock'", "time, hand_x"]),
    (nothing, ["fit", "good", *FIT, "--delimiter", "::"], ["a delimiter of one character", "got '::'"]),
    (nothing, ["fit", "good", *FIT, "--quaternion", "hand_x"], ["quaternion 'hand'", "got hand_x"]),
    (nothing, ["fit", "good", *FIT, "--angle", "elbow"], ["no channel fits 'elbow'", "hand_x"]),
    (nothing, ["demo", "--shapes", "Sine", "Rhombus"], ["shape Rhombus; the shapes are", "Sine"]),
    (nothing, ["demo", "--shapes"], ["at least one shape", "got none"]),
    (nothing, ["demo", "--filter", "oracle"], ["filter 'oracle'", "bip, ebip"]),
    (nothing, ["demo", "-o", "good.inphase"], ["good.inphase: expected a folder, got a file"]),
]


@pytest.mark.parametrize(("make", "command", "words"), BAD, ids=[" ".join(command)[:60] for _, command, _ in BAD])
def test_bad_input_gives_one_clear_line_and_nothing_else(make, command, words, here, run):
    make(here)
    before = tree(here)
    code, out, err = run(*command)
    assert code == 2
    assert out == ""
    assert err.startswith("inphase: ")
    assert err.count("\n") == 1
    assert [word for word in words if word not in err] == []
    assert tree(here) == before


@pytest.mark.parametrize("command", [[], ["dance"], ["fit", "good", "--observe"], ["replay"], ["demo", "--seed", "x"]])
def test_wrong_arguments_are_refused(command, here, run):
    before = tree(here)
    code, out, err = run(*command)
    assert code == 2
    assert out == ""
    assert "help" in err
    assert "Traceback" not in err
    assert tree(here) == before


def test_an_error_of_many_lines_is_told_in_one(here, run, monkeypatch):
    def fail(*_: object) -> None:
        raise inphase.DataError("one\ntwo\n   three")

    monkeypatch.setattr("inphase.cli.validate.find_episodes", fail)
    assert run("validate", "good") == (2, "", "inphase: one two three\n")


def test_a_disk_that_is_full_is_told_in_one_line(here, run, monkeypatch):
    def fail(self: Path, content: bytes) -> None:
        raise OSError(28, "No space left on device", str(self))

    monkeypatch.setattr(Path, "write_bytes", fail)
    before = tree(here)
    code, out, err = run("fit", "good", *FIT)
    assert (code, out) == (2, "")
    assert "No space left on device" in err
    assert err.count("\n") == 1
    assert tree(here) == before


@pytest.mark.parametrize("at", ["inphase.cli.fit.fit_model", "inphase.cli.reading.load", "pathlib.Path.write_bytes"])
def test_an_interrupt_leaves_nothing(at, here, run, monkeypatch):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    before = tree(here)
    monkeypatch.setattr(at, interrupted)
    assert run("fit", "good", *FIT) == (130, "", "inphase: stopped\n")
    assert tree(here) == before


# --------------------------------------------------------------------------------------------------------- fit, inspect


def test_fit_learns_what_the_library_learns(here, run):
    code, out, err = run("fit", "good", *FIT)
    assert (code, err) == (0, "")
    model = inphase.Model.load("new.inphase")
    expected = taught(inphase.load("good", "hand_?", "robot_?"))
    assert (model.observed, model.controlled) == (("hand_x", "hand_y"), ("robot_x", "robot_y"))
    assert_allclose(model.prior.samples, expected.prior.samples)
    assert "2 observed and 2 controlled channels, 4 demonstrations" in out
    assert f"{model.layout.size} basis weights" in out
    assert re.search(r"wrote new\.inphase \(\d+ kB\)", out)
    assert [name for name in NAMES if name not in out] == []


def test_fit_is_told_what_to_do(here, run):
    assert run("fit", "good", *FIT, "--basis", "sigmoid:7:0.1", "--order", "2")[0] == 0
    model = inphase.Model.load("new.inphase")
    assert set(model.layout.bases) == {Sigmoid(7, 0.1)}
    assert model.phase.order == 2
    assert run("fit", "good", *FIT, "--periodic", "--angle", "robot_x", "--trim")[0] == 0
    model = inphase.Model.load("new.inphase")
    assert model.phase.periodic
    assert [c.kind.value for c in model.channels] == ["linear", "linear", "angle", "linear"]


def test_columns_are_separated_as_told(here, run):
    for path in (here / "good").iterdir():
        path.write_text(path.read_text().replace(",", "\t").replace("time", "clock"))
    for delimiter in ("tab", "\\t", "\t"):
        assert run("fit", "good", *FIT, "--time", "clock", "--delimiter", delimiter)[0] == 0
    assert run("replay", "new.inphase", "good/episode_1.csv", "--time", "clock", "--delimiter", "tab")[0] == 0
    assert run("validate", "good", "--time", "clock", "--delimiter", "tab")[0] == 0


def test_the_card_of_a_model_holds_its_figures(here, run):
    code, out, err = run("inspect", "good.inphase", "--json")
    assert (code, err) == (0, "")
    card, model = json.loads(out), inphase.Model.load("good.inphase")
    assert card["observed"] == ["hand_x", "hand_y"]
    assert card["typical_duration"] == 1 / model.phase.nominal_velocity
    assert [row["feature"] for row in card["features"]] == list(NAMES)
    spans = model.scaling.high - model.scaling.low
    assert_allclose([row["noise_std"] for row in card["features"]], spans * np.sqrt(model.noise.var))
    assert {parse_basis(row["basis"]) for row in card["features"]} == set(model.layout.bases)
    # `fit` says the same of the model that it writes.
    fitted = json.loads(run("fit", "good", *FIT, "--json")[1])
    assert fitted.pop("model") == "new.inphase"
    assert fitted == card


def test_the_card_of_recordings_holds_their_figures(here, run):
    card = json.loads(run("inspect", "good", *ROLES, "--json")[1])
    times, _ = episode(2)
    found = {key: card["episodes"][2][key] for key in ("name", "samples", "duration", "rate", "missing")}
    assert found == {
        "name": "episode_2",
        "samples": 30,
        "duration": pytest.approx(times[-1]),
        "rate": pytest.approx(29 / times[-1]),
        "missing": {},
    }
    everything = np.concatenate([episode(i)[1] for i in range(4)])
    assert [c["low"] for c in card["channels"]] == everything.min(axis=0).tolist()
    assert [c["role"] for c in card["channels"]] == ["observed"] * 2 + ["controlled"] * 2
    assert [c["missing"] for c in card["channels"]] == [0.0] * 4
    hand, robot = card["groups"]
    assert (hand["group"], hand["channels"], robot["channels"]) == ("hand", list(NAMES[:2]), list(NAMES[2:]))
    assert (hand["low"], hand["high"]) == (everything[:, :2].min(), everything[:, :2].max())
    assert hand["span"] == pytest.approx(np.ptp(everything[:, :2], axis=0).max())


def test_a_channel_that_was_never_seen_is_shown_as_such(here, run):
    for i in range(4):
        times, values = episode(i)
        write_csv(Path(f"good/episode_{i}.csv"), NAMES, times, np.column_stack([values[:, :3], np.full(30, np.nan)]))
    assert json.loads(run("inspect", "good", "--json")[1])["channels"][3]["low"] is None
    row = next(line for line in run("inspect", "good")[1].splitlines() if line.startswith("robot_y"))
    assert "100.0 %" in row


@pytest.mark.parametrize(
    "basis",
    [Gaussian(9), Gaussian(9, 0.25), Gaussian(9, 0.25, 0.5), Sigmoid(5), Polynomial(4), Periodic(7), Periodic(6, 0.2)],
)
def test_a_basis_is_read_as_it_is_shown(basis):
    assert parse_basis(show_basis(basis)) == basis


def test_every_family_can_be_named():
    assert {type(parse_basis(f"{family}:5")) for family in FAMILIES} == set(FAMILIES.values())


# ----------------------------------------------------------------------------------------------------------- evidence


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[inphase.Model, Path, str]:
    """A model whose choices were made by held-out recordings, its file, and what `fit --report` said."""
    folder = tmp_path_factory.mktemp("calibrated")
    write(folder / "few", samples=25)
    roles, file = [*ROLES, "--jobs", "1"], folder / "calibrated.inphase"
    result = command("fit", "few", *roles, "--report", "-o", str(file), cwd=folder, capture_output=True)
    assert (result.returncode, result.stderr) == (0, "")
    return inphase.Model.load(file), file, result.stdout


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+\.?\d*", text)]


def said_of(trial: Trial) -> list[float]:
    """What a row of the table ends with: error, its standard error, inside [%], nll."""
    return pytest.approx([trial.error, trial.error_std, round(100 * trial.coverage), trial.nll], abs=6e-4)


def test_the_report_tells_of_every_trial_and_marks_what_was_chosen(calibrated):
    model, _, out = calibrated
    assert model.evidence is not None
    trials = model.evidence.trials[1:]
    rows = [line for line in out.splitlines() if re.match(r" [ *] \S", line)]
    assert len(rows) == len(trials)
    for row, trial in zip(rows, trials, strict=True):
        assert numbers(row)[-4:] == said_of(trial)
        assert (row[1] == "*") == trial.chosen
    for before, after in itertools.pairwise(dict.fromkeys(trial.choice for trial in trials)):
        assert 0 < out.index(f"\n{before}: ") < out.index(f"\n{after}: ")
    lines = {line.split("  ")[0]: line for line in out.splitlines()}
    assert numbers(lines["before"]) == said_of(model.evidence.before)
    assert numbers(lines["after"]) == said_of(model.evidence.after)
    assert numbers(lines["by the clock"]) == pytest.approx([model.evidence.by_the_clock], abs=6e-4)
    # Every number of a kind stands under the others.
    (title,) = [line for line in out.splitlines() if line.split() == ["error", "inside", "nll"]]
    ends = {line.index(" ±") for line in [*rows, lines["before"], lines["after"]]}
    assert ends == {len(lines["by the clock"])}
    assert {len(line) for line in [*rows, lines["before"], lines["after"]]} == {len(title)}
    assert "4 demonstrations held out" in out
    assert [condition for condition in model.evidence.conditions if condition not in " ".join(out.split())] == []


def test_the_card_tells_what_the_model_has(calibrated):
    """The choices by the parts of the model that they made, and not by the evidence."""
    model, _, out = calibrated
    usual = Tempo().usual
    lines = out.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("calibrated: "))
    end = next(i for i, line in enumerate(lines) if "held out: error" in line)
    assert "as it is" not in out
    chosen = dict(re.findall(r"(usual tempo|reflex|band) ([\d.]+)", " ".join(lines[at:end])))
    assert model.reflex is not None
    assert float(chosen["band"]) == pytest.approx(model.band, abs=6e-3)
    assert float(chosen.get("reflex", 1)) == pytest.approx(model.reflex.weight)
    assert float(chosen.get("usual tempo", 100 * usual)) == pytest.approx(100 * model.tempo.usual)
    evidence = model.evidence
    assert evidence is not None
    _, before, after, _, *inside = numbers(lines[end])
    assert [before, after] == pytest.approx([evidence.before.error, evidence.after.error], abs=6e-4)
    assert inside == pytest.approx([round(100 * t.coverage) for t in (evidence.before, evidence.after)])


def test_inspect_tells_the_same_from_the_file(calibrated, run):
    model, file, out = calibrated
    shown = run("inspect", file, "--report")[1]
    report = out[out.index("4 demonstrations held out, ") : out.index("wrote ")]
    assert shown.endswith(report)
    assert out.startswith(run("inspect", file)[1].split("source: ")[0])
    assert report not in run("inspect", file)[1]
    evidence = json.loads(run("inspect", file, "--json")[1])["evidence"]
    assert evidence == json.loads(json.dumps(asdict(model.evidence)))


def test_what_could_not_be_scored_is_no_number(calibrated):
    model, nan = calibrated[0], float("nan")
    blank = Trial("before", "as learned", nan, nan, nan, nan, True)
    unscored = replace(model, evidence=Evidence(4, ("as recorded",), (blank, blank), nan))
    text = json.dumps(describe_model(unscored), allow_nan=False)
    assert json.loads(text)["evidence"]["trials"][0]["error"] is None


@pytest.mark.parametrize("size", [1e-9, 12.3456, 1.23e9, float("nan"), float("inf")])
@pytest.mark.parametrize("width", [80, 120])
def test_no_figure_breaks_the_report(size, width, calibrated, capsys, monkeypatch):
    """Nor a choice that is not known here, or all of them at once on the card."""
    monkeypatch.setenv("COLUMNS", str(width))
    model = calibrated[0]
    assert model.evidence is not None
    figures = {"error": size, "error_std": size, "nll": -size}
    trials = [replace(trial, chosen=i % 2 == 1, **figures) for i, trial in enumerate(model.evidence.trials)]
    trials += [Trial("another", value, size, size, 0.0, size, value == "what is new") for value in ("", "what is new")]
    odd = replace(model, evidence=replace(model.evidence, trials=tuple(trials), by_the_clock=size))
    output = console.Output()
    print_model(output, odd)
    print_evidence(output, odd)
    out = capsys.readouterr().out
    assert [line for line in out.splitlines() if len(line) > 80] == []
    assert "another what is new" in out
    assert " * what is new" in out
    (title,) = [line for line in out.splitlines() if line.split() == ["error", "inside", "nll"]]
    assert {len(line) for line in out.splitlines() if re.match(r"( [ *] |before |after )", line)} == {len(title)}


def test_what_is_not_calibrated_says_so_in_one_line(here, run):
    learned = taught(inphase.load("good", "hand_?", "robot_?"))
    out = run("fit", "good", *FIT, "--report")[1]
    model = inphase.Model.load("new.inphase")
    assert model.evidence is None
    assert (model.band, model.tempo) == (learned.band, learned.tempo)
    assert [line for line in out.splitlines() if "held out" in line] == [
        "not calibrated: no demonstrations were held out"
    ]
    write(here / "few", count=3)
    out = run("fit", "few", *ROLES, "--report")[1]
    assert [line for line in out.splitlines() if "held out" in line] == [
        "not calibrated: no demonstrations were held out, since there are fewer than 4"
    ]
    assert json.loads(run("inspect", "new.inphase", "--json")[1])["evidence"] is None


def test_all_processors_calibrate_unless_told_otherwise(here, run, monkeypatch):
    from joblib import cpu_count

    asked: dict[str, Any] = {}

    def fit(dataset: inphase.Dataset, **options: Any) -> inphase.Model:
        asked.clear()
        asked.update(options)
        return inphase.Model.load("good.inphase")

    monkeypatch.setattr("inphase.cli.fit.fit_model", fit)
    for words, calibrate, jobs in (
        ([], True, cpu_count()),
        (["--jobs", 3], True, 3),
        (["--quick"], False, cpu_count()),
    ):
        assert run("fit", "good", *ROLES, *words)[0] == 0
        assert (asked["calibrate"], asked["jobs"]) == (calibrate, jobs)
        assert asked["progress"] is None  # nobody looks


# ------------------------------------------------------------------------------------------------------------- replay


def test_replay_says_what_the_library_says(here, run):
    code, out, err = run("replay", "good.inphase", "good/episode_1.csv", "--filter", "bip", "--json")
    assert (code, err) == (0, "")
    (found,) = json.loads(out)
    model = inphase.Model.load("good.inphase")
    played = replay(model, inphase.Demonstration(*episode(1)), filter="bip")
    assert (found["episode"], found["filter"]) == ("episode_1", "bip")
    assert found["nmse"] == pytest.approx(played.now.nmse)
    assert found["coverage"] == pytest.approx(played.now.coverage)
    assert found["nll"] == pytest.approx(played.now.nll)
    assert found["final_pose_50"] == pytest.approx(played.final_pose(0.5))
    assert found["log_likelihood"] == pytest.approx(played.log_likelihood)
    assert 0 < found["step_time"] < 10
    assert {"clock_nmse", "clock_coverage", "clock_nll"} <= set(found)


@pytest.mark.parametrize(("filter", "option"), [("rbpf", "particles"), ("ebip", "members")])
def test_a_filter_is_as_large_as_told(filter, option, here, run):
    model, demonstration = inphase.Model.load("good.inphase"), inphase.Demonstration(*episode(1))
    out = run("replay", "good.inphase", "good/episode_1.csv", "--filter", filter, f"--{option}", 20, "--json")[1]
    played = replay(model, demonstration, filter=filter, **{option: 20})
    assert json.loads(out)[0]["nmse"] == pytest.approx(played.now.nmse)
    assert played.now.nmse != replay(model, demonstration, filter=filter).now.nmse


def test_replay_prints_as_it_goes_and_what_came_of_it(here, run):
    out = run("replay", "good.inphase", "good/episode_1.csv", "--seed", 3)[1].splitlines()
    assert out[0].startswith("episode_1: 30 samples")
    assert out[1].split() == ["time", "[s]", "phase", "pace", "error", "inside", "status"]
    rows = [line.split() for line in out[2:12]]
    assert len(rows) == 10
    times = [float(row[0]) for row in rows]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(episode(1)[0][-1], abs=0.01)
    (found,) = json.loads(run("replay", "good.inphase", "good/episode_1.csv", "--seed", 3, "--json")[1])
    (line,) = [line for line in out if line.startswith("episode_1 ")]
    assert float(line.split()[1]) == pytest.approx(found["nmse"], abs=6e-4)
    assert line.split()[2] == f"{100 * found['coverage']:.0f}"
    assert rows[-1][6] == line.split()[2]  # the share inside so far, at the end


def test_replay_of_many_is_a_row_each_and_their_mean(here, run):
    arguments = ["replay", "good.inphase", "good/episode_2.csv", "good/episode_[01].csv", "--filter", "bip"]
    out = run(*arguments)[1]
    results = json.loads(run(*arguments, "--json")[1])
    assert [found["episode"] for found in results] == ["episode_2", "episode_0", "episode_1"]
    assert "time [s]" not in out
    (mean,) = [line.split() for line in out.splitlines() if line.startswith("mean ")]
    assert float(mean[1]) == pytest.approx(np.mean([found["nmse"] for found in results]), abs=6e-4)


def test_trouble_is_named_in_the_table_and_told_below(here, run):
    times, values = episode(1, samples=60)
    values[20:40, :2] = np.nan
    values[45:, :2] += 3.0
    write_csv(Path("odd.csv"), NAMES, times, values)
    out = run("replay", "good.inphase", "odd.csv")[1]
    rows = [line for line in out.splitlines()[2:12] if "±" in line]
    assert any(line.endswith("  blind") for line in rows)
    assert any(line.endswith("  unlike") for line in rows)
    assert "blind, " in out
    assert inphase.Status.BLIND.value in out
    assert "unlike, " in out
    assert inphase.Status.UNLIKE.value in out


def test_what_was_not_recorded_is_answered_and_not_scored(here, run):
    times, values = episode(1)
    write_csv(Path("alone.csv"), NAMES[:2], times, values[:, :2])
    (found,) = json.loads(run("replay", "good.inphase", "alone.csv", "--json")[1])
    assert found["nmse"] is None
    assert found["clock_nmse"] is None
    code, out, err = run("replay", "good.inphase", "alone.csv", "--picture", "alone.png")
    assert (code, err) == (0, "")
    assert "–" in out
    assert Path("alone.png").exists()


def test_names_are_shown_as_they_are(here, run):
    names = ("force[x]", ":smile:", "[bold]a", "b[/]")
    write(here / "odd", names=names)
    roles = ["--observed", *names[:2], "--controlled", *names[2:]]
    for command in (
        ["fit", "odd", *roles, "-o", "odd.inphase", "--quick"],
        ["inspect", "odd.inphase"],
        ["inspect", "odd"],
    ):
        code, out, _ = run(*command)
        assert code == 0
        assert [name for name in names if name not in out] == []


# ----------------------------------------------------------------------------------------------------------- validate


def test_validate_names_episode_channel_and_time_and_rejects_nothing(here, run):
    write(here / "faulty", count=6)
    times, values = episode(1)
    values[15, 1] += 4.0
    write_csv(Path("faulty/episode_1.csv"), NAMES, times, values)
    edit(here / "faulty" / "episode_3.csv", lambda lines: [*lines[:20], lines[19], *lines[20:]])
    (here / "faulty" / "episode_4.csv").write_text("time;hand_x\n")
    edit(here / "faulty" / "episode_5.csv", lambda lines: [line.rsplit(",", 1)[0] for line in lines])
    before = tree(here)
    code, out, err = run("validate", "faulty", "--json")
    assert (code, err) == (1, "")
    found = {(f["episode"], f["channel"], f["kind"]): f for f in json.loads(out)}
    assert found[("episode_1", "hand_y", "jump")]["time"] == pytest.approx(times[15])
    assert found[("episode_1", "hand_y", "jump")]["severity"] == "warning"
    assert found[("episode_3", None, "backwards")]["severity"] == "error"
    assert found[("episode_3", None, "backwards")]["time"] == pytest.approx(episode(3)[0][18], abs=1e-3)
    assert "faulty/episode_4.csv" in found[("episode_4", None, "unreadable")]["message"]
    assert "'robot_y'" in found[("episode_5", None, "unreadable")]["message"]
    assert {episode for episode, _, _ in found} == {"episode_1", "episode_3", "episode_4", "episode_5"}
    table = run("validate", "faulty")[1]
    (row,) = [line.split() for line in table.splitlines() if " jump  " in line]
    assert row[:4] == ["episode_1", "hand_y", f"{times[15]:.3f}", "jump"]
    assert "6 episodes, 4 channels: 4 with findings" in table
    assert tree(here) == before


def test_the_odd_one_out_is_told_of_even_if_it_is_the_first(here, run):
    edit(here / "good" / "episode_0.csv", lambda lines: [line.rsplit(",", 1)[0] for line in lines])
    for roles in ([], ROLES):
        code, out, _ = run("validate", "good", *roles)
        assert code == 1
        assert "no channel 'robot_y'" in out
        assert "4 episodes, 4 channels: 1 with findings" in out


def test_nothing_found_is_said(here, run):
    assert run("validate", "good") == (0, "4 episodes, 4 channels: nothing found\n", "")
    assert run("validate", "good", "--json") == (0, "[]\n", "")
    assert run("validate", "good/episode_1.csv", "--observed", "hand_x")[1].startswith("1 episode, 1 channel: ")


def test_a_channel_that_never_moves_is_a_warning(here, run):
    never_moves(here)
    code, out, _ = run("validate", "never_moves")
    assert code == 0
    assert "robot_y" in out
    assert "always 7.5" in out


# ------------------------------------------------------------------------------------------------------ where it prints

SHOWN = [
    ["fit", "long", "-o", "long.inphase", "--observed", "left_*", "--controlled", "robot_*", "--quick"],
    ["inspect", "good.inphase"],
    ["inspect", "long"],
    ["replay", "good.inphase", "good/episode_1.csv"],
    ["replay", "good.inphase", "good", "--filter", "bip"],
    ["replay", "good.inphase", "odd/an_episode_with_a_rather_long_name.csv"],
    ["validate", "odd"],
]


@pytest.fixture
def shown(here: Path) -> None:
    write(
        here / "long",
        names=("left_shoulder_of_a_person_who_reaches_out_x", "left_x", "robot_gripper_opening", "robot_joint_7"),
    )
    (here / "odd").mkdir()
    times, values = episode(1)
    values[15, 1] += 4.0
    values[10:14, 0] = np.nan
    write_csv(here / "odd" / "an_episode_with_a_rather_long_name.csv", NAMES, times, values)


@pytest.mark.parametrize("command", SHOWN, ids=" ".join)
def test_eighty_columns_are_enough(command, shown, run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    out = run(*command)[1]
    assert out
    assert [line for line in out.splitlines() if len(line) > 80] == []
    assert re.findall(r"\S+\w…", out) == []  # no cell is cut


def test_in_a_pipe_a_finding_stays_on_its_line(shown, run):
    out = run("validate", "odd")[1]
    (row,) = [line for line in out.splitlines() if " jump  " in line]
    assert row.split()[0] == "an_episode_with_a_rather_long_name"
    assert "all of its movement spans" in row


def test_what_is_required_and_what_is_not_is_told(run):
    out = run("fit", "--help")[1]
    assert "(required)" in out
    for clutter in ("default: )", "''", "None", "--no-"):
        assert clutter not in out
    assert "(required)" in run("replay", "--help")[1]


def command(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(Path(inphase.__file__).parents[1]), "PYTHONUNBUFFERED": ""}
    program = [sys.executable, "-W", "error", "-m", "inphase.cli"]
    return subprocess.run([*program, *arguments], text=True, env=environment, **options)


def test_a_process_of_its_own(here):
    result = command("inspect", "good.inphase", "--json", capture_output=True)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["controlled"] == ["robot_x", "robot_y"]
    result = command("inspect", "bad.inphase", capture_output=True)
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr == "inphase: bad.inphase: cannot be read: No such file or directory\n"


@pytest.mark.parametrize("arguments", [["inspect", "good.inphase"], ["validate", "good", "--json"], ["--help"]])
def test_a_reader_that_has_gone_is_no_trouble(arguments, here):
    reader, writer = os.pipe()
    os.close(reader)
    try:
        result = command(*arguments, stdout=writer, stderr=subprocess.PIPE)
    finally:
        os.close(writer)
    assert (result.returncode, result.stderr) == (0, "")


# ----------------------------------------------------------------------------------------------------- a sign of life


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Set once a sign of life is given; the terminal is a pretence."""
    event = threading.Event()
    monkeypatch.setattr(console.Output, "is_terminal", property(lambda self: True))
    monkeypatch.setattr(Status, "start", lambda self: event.set())
    return event


def test_a_long_wait_is_explained(started, monkeypatch):
    monkeypatch.setattr(console, "PATIENCE", 0.0)
    with console.waiting("reading"):
        assert started.wait(timeout=60)


def test_a_short_wait_is_not(started, monkeypatch):
    monkeypatch.setattr(console, "PATIENCE", 1e6)
    threads = threading.active_count()
    with console.waiting("reading"):
        assert threading.active_count() == threads + 1
    assert not started.is_set()
    assert threading.active_count() == threads


def test_the_share_that_is_done_moves_a_bar(started, capsys):
    with console.working("learning") as tell:
        assert tell is not None
        tell(0.5)
        tell(1.0)
    shown = re.sub(r"\x1b\[[\d;?]*[a-zA-Z]", "", capsys.readouterr().err)
    assert "learning ━" in shown
    assert "0:00:00 left" in shown


def test_without_a_terminal_there_is_no_bar(capsys):
    with console.working("learning") as tell:
        assert tell is None
    assert capsys.readouterr().err == ""


def test_without_a_terminal_nothing_is_explained(started, monkeypatch):
    monkeypatch.setattr(console, "PATIENCE", 0.0)
    monkeypatch.setattr(console.Output, "is_terminal", property(lambda self: False))
    threads = threading.active_count()
    with console.waiting("reading"):
        assert threading.active_count() == threads
    assert not started.is_set()


# -------------------------------------------------------------------------------------------------- real recordings


def test_a_hand_over_is_learned_and_followed(shared_data, tmp_path, monkeypatch, run):
    """The commands of the README, on recordings of people."""
    monkeypatch.chdir(tmp_path)
    data = shared_data / "handover"
    code, out, _ = run(
        "fit", data, "--observed", "taker_?", "--controlled", "giver_?", "-o", "handover.inphase", "--quick"
    )
    assert code == 0
    assert "3 observed and 3 controlled channels, 72 demonstrations" in out
    assert run("inspect", "handover.inphase")[0] == 0
    code, out, _ = run("replay", "handover.inphase", data / "episode_001.csv", "--filter", "ebip", "--json")
    assert code == 0
    (found,) = json.loads(out)
    assert found["nmse"] < 1
    assert 0.3 < found["coverage"] <= 1
    assert found["final_pose_50"] < 0.5


@pytest.mark.parametrize("folder", ["handover", "nuisi/*/*.csv", "yumi/*/*.csv"])
def test_nothing_in_the_recordings_is_worse_than_a_warning(folder, shared_data, run):
    code, out, err = run("validate", shared_data / folder)
    assert (code, err) == (0, "")
    assert "cannot be used" not in out
    assert "findings" in out or "nothing found" in out


# --------------------------------------------------------------------------------------------------- the page on data

PAGE = Path(__file__).parents[1] / "docs" / "data.md"


def test_the_page_on_data_is_true(tmp_path, monkeypatch, run):
    """Its snippets run, on recordings with the columns that it shows; its tables name every kind and finding."""
    text = PAGE.read_text(encoding="utf-8")
    blocks = dict.fromkeys(("csv", "python", "console", "json"), "")
    for language, block in re.findall(r"```(\w+)\n(.*?)```", text, flags=re.DOTALL):
        blocks[language] += block
    example = tmp_path / "example.csv"
    example.write_text(blocks["csv"])
    shown = inphase.load(example, kinds={"arm": "angle"})
    assert np.isnan(shown[0].values[1, 1])
    assert {channel.kind.value for channel in shown.channels[3:]} == {"quaternion"}

    (tmp_path / "handover").mkdir()
    times = np.linspace(0, 2, 80)
    for i in range(4):
        angle = (0.9 + 0.1 * i) * times
        turn = np.column_stack([0 * angle, 0.1 * angle, np.sin(angle / 2), np.cos(angle / 2)])
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
        columns = np.column_stack([np.sin(angle), np.cos(angle), np.angle(np.exp(1j * (2 + angle))), turn])
        write_csv(tmp_path / "handover" / f"episode_{i}.csv", shown.names, times, columns)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(inphase, "fit", partial(inphase.fit, calibrate=False))
    names: dict[str, Any] = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(compile(blocks["python"], PAGE, "exec"), names)
    assert names["demos"].observed == ("hand_x", "hand_y", "arm")
    assert names["demos"].channels[0].unit == "m"
    assert len(names["demos_of_arrays"]) == 3
    for command in re.findall(r"`inphase (fit .*?)`", text):
        assert run(*shlex.split(command), "--quick")[0] == 0

    rows = set(re.findall(r"^\| `([\w-]+)` \|", text, flags=re.MULTILINE))
    assert rows == {kind.value for kind in (*FindingKind, *Kind)}
