"""`inphase bags` says what there is, and what it writes is what `inphase.load` reads."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bag_files import FORMATS, joints, numbers, write_bag

import inphase
from inphase.cli import main

MAP = 'rate = 50\n[observed]\npush = "/forces data[0]"\n[controlled]\nelbow = "/joint_states position[elbow]"\n'


@pytest.fixture
def bags(tmp_path) -> list[str]:
    """One bag of each format, of lines in time."""
    times = np.arange(101) / 100
    published = [m for t in times.tolist() for m in (joints(t, t + 5, elbow=3 * t), numbers(t, 2 * t))]
    (tmp_path / "map.toml").write_text(MAP)
    return [str(write_bag(tmp_path, format, published, name=f"walk_{format}")) for format in FORMATS]


def test_recordings_are_written_that_can_be_loaded(bags, tmp_path, capsys):
    folder = tmp_path / "made" / "of bags"
    assert main(["bags", *bags, "--map", str(tmp_path / "map.toml"), "-o", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert printed.count("wrote ") == 3
    assert f"inphase validate {folder} --observed push --controlled elbow" in printed
    demos = inphase.load(str(folder / "*.csv"), observed=["push"], controlled=["elbow"])
    assert [demo.name for demo in demos] == [f"walk_{format}" for format in sorted(FORMATS)]
    for demo in demos:
        np.testing.assert_allclose(demo.values, demo.times[:, None] * [2, 3], atol=1e-6)


def test_a_listing_names_topics_rates_and_places(bags, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["bags", *bags]) == 0
    printed = capsys.readouterr().out
    assert printed.count(": 2 topics") == 3
    row = next(" ".join(line.split()) for line in printed.splitlines() if line.startswith("/joint_states"))
    assert row == "/joint_states sensor_msgs/JointState 101 100.0 0.000 1.000 own position[elbow]"
    assert main(["bags", *bags, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [bag["path"] for bag in told] == bags
    assert [topic["rate"] for topic in told[0]["topics"]] == [pytest.approx(100)] * 2
    assert told[0]["topics"][0]["places"] == ["layout.data_offset", "data[0]"]


def test_what_was_left_out_is_said(bags, tmp_path, capsys):
    empty, folder, map_ = str(write_bag(tmp_path, "bag", [], name="empty")), tmp_path / "out", tmp_path / "map.toml"
    map_.write_text(MAP + 'wrist = "/joint_states position[wrist]"\n')
    options = ["--map", str(map_), "-o", str(folder)]
    assert main(["bags", bags[0], empty, *options]) == 1
    printed = capsys.readouterr().out
    assert f"left out: {bags[0]}: wrist: never a number at position[wrist] of /joint_states; there are" in printed
    assert f"left out: {empty}: expected numbers on a topic of the map, got none: the bag: it holds no topic" in printed
    assert [path.name for path in folder.iterdir()] == ["walk_bag.csv"]
    assert main(["bags", bags[0], empty, *options, "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["written"] == [str(folder / "walk_bag.csv")]
    assert [(one["bag"], one["what"]) for one in told["left_out"]] == [(bags[0], "wrist"), (empty, "")]


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line that is said of bad input."""
    assert main(["bags", *arguments]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err


def test_bad_input_is_refused_in_one_line_and_nothing_is_written(bags, tmp_path, capsys):
    map_, folder = str(tmp_path / "map.toml"), tmp_path / "out"
    empty = str(write_bag(tmp_path, "mcap", [], name="empty"))
    assert "no recording was made" in refused([empty, "--map", map_, "-o", str(folder)], capsys)
    assert "expected --map and --output together" in refused([bags[0], "-o", str(folder)], capsys)
    assert "no such bag" in refused([str(tmp_path / "none.bag")], capsys)
    assert "File exists" in refused([bags[0], "--map", map_, "-o", map_], capsys)
    Path(map_).write_text("rate = \n")
    assert "map.toml, line 1: expected TOML" in refused([bags[0], "--map", map_, "-o", str(folder)], capsys)
    assert not list(folder.glob("*"))
