"""What is decided of recordings: noted beside them, honoured by all that reads them, and the recordings untouched."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interactions import curves

import inphase
from inphase.io import Note, edit_notes, read_notes
from inphase.io.csv import write_csv
from inphase.io.notes import NOTES, write_notes

NAMES = ("hand_x", "hand_y", "robot_x", "robot_y")
BOTH = ["data/episode_001.csv", "data/episode_002.csv"]
ROLES = ["--observed", "hand_?", "--controlled", "robot_?"]


def write(folder: Path, count: int = 6, first: int = 1) -> None:
    folder.mkdir(parents=True)
    for i in range(first, first + count):
        rng = np.random.default_rng(100 + i)
        times = 10 + np.linspace(0, 2, 41)
        values = curves((times - 10) / 2, rng.standard_normal(2)) + 0.01 * rng.standard_normal((41, 4))
        write_csv(folder / f"episode_{i:03}.csv", NAMES, times, values)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with recordings in `data`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    write(tmp_path / "data")
    return tmp_path


def note(folder: str = "data", **episodes: object) -> Path:
    path = Path(folder) / NOTES
    path.write_text(json.dumps({"version": 1, "episodes": episodes}))
    return path


def names(data: object = "data", **options: object) -> list[str]:
    return [d.name for d in inphase.load(data, **options)]  # type: ignore[arg-type]


def recordings(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*.csv")}


# --------------------------------------------------------------------------------------------------------- what is read


def test_what_is_noted_is_left_out_and_cut(here):
    whole = inphase.load("data")
    note(episode_003={"use": False, "reason": "dropped the baton"}, episode_005={"from": 10.5, "until": 11.6})
    noted = inphase.load("data")
    assert [d.name for d in noted] == [f"episode_00{i}" for i in (1, 2, 4, 5, 6)]
    cut, before = noted[3], whole[4]
    kept = (before.times >= 10.5) & (before.times <= 11.6)
    assert np.array_equal(cut.times, before.times[kept])
    assert np.array_equal(cut.values, before.values[kept])
    assert noted.provenance == {
        "source": "data",
        "episodes": "5",
        "left out": "1: episode_003 (dropped the baton)",
        "cut": "1: episode_005 (from 10.5 s until 11.6 s)",
    }
    again = inphase.load("data", notes=False)
    assert again.provenance == whole.provenance == {"source": "data", "episodes": "6"}
    assert [d.name for d in again] == [d.name for d in whole]


def test_one_end_alone_can_be_cut(here):
    note(episode_001={"from": 11}, episode_002={"until": 11})
    noted = inphase.load("data")
    assert (noted[0].times[0], noted[0].times[-1], noted[1].times[0], noted[1].times[-1]) == (11, 12, 10, 11)


def test_files_are_noted_however_they_are_named(here, monkeypatch):
    note(episode_003={"use": False})
    assert names("data/*.csv") == names(here / "data") == names() == [f"episode_00{i}" for i in (1, 2, 4, 5, 6)]
    assert names(["data/episode_003.csv", "data/episode_001.csv"]) == ["episode_001"]
    monkeypatch.chdir("data")
    assert "episode_003" not in names(".")


def test_every_folder_has_notes_of_its_own(here):
    write(here / "more")
    note("more", episode_001={"use": False})
    assert names(["data", "more"]) == [
        *(f"data/episode_00{i}" for i in range(1, 7)),
        *(f"more/episode_00{i}" for i in range(2, 7)),
    ]
    edit_notes(["data", "more"], drop={"data/episode_002": "late", "more/episode_002": ""})
    assert read_notes(here / "data") == {"episode_002": Note(use=False, reason="late")}
    assert read_notes(here / "more") == {"episode_001": Note(use=False), "episode_002": Note(use=False)}


def test_files_of_one_stem_are_told_apart(here):
    times = np.linspace(0, 1, 9)
    np.savez(
        "data/episode_001.npz", time=times, **dict(zip(NAMES, np.random.default_rng(0).random((4, 9)), strict=True))
    )
    note(**{"episode_001.npz": {"use": False}})
    assert len(names()) == 6
    note(episode_001={"use": False})
    with pytest.raises(inphase.DataError, match=r"unknown episode 'episode_001'; near it: .*episode_001.csv"):
        inphase.load("data")


def test_a_file_that_is_left_out_is_not_even_read(here):
    Path("data/episode_001.csv").write_text("broken")
    note(episode_001={"use": False})
    assert len(names()) == 5


def test_what_is_broken_outside_of_the_cut_is_no_trouble(here):
    path = Path("data/episode_002.csv")
    lines = path.read_text().splitlines()
    cells = lines[-1].split(",")
    path.write_text("\n".join([*lines[:-1], ",".join([cells[0], "inf", *cells[2:]])]) + "\n")
    with pytest.raises(inphase.DataError, match="expected finite values"):
        inphase.load("data")
    note(episode_002={"until": 11.5})
    assert len(names()) == 6


BAD = [
    ("{", ["expected JSON"]),
    ("\x00\xff", ["expected JSON"]),
    ("[]", ['{"version": 1, "episodes": {…}}']),
    ('{"version": 1}', ['{"version": 1, "episodes": {…}}']),
    ('{"version": 2, "episodes": {}, "more": 1}', ["a newer inphase (version 2)", "reads version 1"]),
    ('{"version": true, "episodes": {}}', ["expected version 1"]),
    ('{"version": 1, "episodes": {}, "more": 1}', ["expected version 1 and episodes", "more"]),
    ('{"version": 1, "episodes": {"episode_01": {"use": false}}}', ["unknown episode 'episode_01'", "episode_001"]),
    ('{"version": 1, "episodes": {"x": {}}}', ["unknown episode 'x'; there is episode_001"]),
    ('{"version": 1, "episodes": {"episode_001": {"form": 1}}}', ["episode_001", "use, reason, from, until", "form"]),
    ('{"version": 1, "episodes": {"episode_001": false}}', ["episode_001", "got False"]),
    ('{"version": 1, "episodes": {"episode_001": {"use": "no"}}}', ["use as true or false", "'no'"]),
    ('{"version": 1, "episodes": {"episode_001": {"from": "1"}}}', ["expected from as a time [s], got '1'"]),
    ('{"version": 1, "episodes": {"episode_001": {"until": NaN}}}', ["expected until as a time [s], got nan"]),
    ('{"version": 1, "episodes": {"episode_001": {"from": true}}}', ["expected from as a time [s], got True"]),
    ('{"version": 1, "episodes": {"episode_001": {"from": 1, "until": 11}}}', ["between 10 s and 12 s", "from 1 s"]),
    ('{"version": 1, "episodes": {"episode_001": {"from": 11, "until": 11}}}', ["from 11 s until 11 s"]),
    ('{"version": 1, "episodes": {"episode_001": {"from": 11, "until": 11.05}}}', ["at least 3 samples, got 2"]),
]


@pytest.mark.parametrize(("content", "words"), BAD, ids=[content[:70] for content, _ in BAD])
def test_notes_that_cannot_be_used_are_told_in_one_line(content, words, here, run):
    Path("data", NOTES).write_bytes(content.encode("latin-1"))
    code, out, err = run("inspect", "data")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert [word for word in ["episode_001" if "2 samples" in str(words) else "data", *words] if word not in err] == []
    assert run("inspect", "data", "--ignore-notes")[0] == 0


def test_when_all_are_left_out_that_is_said(here, run):
    note(**{f"episode_00{i}": {"use": False} for i in range(1, 7)})
    for command in ("inspect", "validate"):
        code, out, err = run(command, "data")
        assert (code, out) == (2, "")
        assert "at least one episode to use, but inphase-notes.json leaves out all 6" in err


# ------------------------------------------------------------------------------------------------------ what is written

NOTE = st.builds(
    Note,
    st.booleans(),
    st.text(max_size=10),
    st.none() | st.floats(allow_nan=False, allow_infinity=False),
    st.none() | st.floats(allow_nan=False, allow_infinity=False),
)


@settings(max_examples=30)
@given(st.dictionaries(st.sampled_from(["a", "b 2", "ä=1"]), NOTE))
def test_notes_are_read_as_they_were_written(tmp_path_factory, notes):
    folder = tmp_path_factory.mktemp("notes")
    for name in ("a", "b 2", "ä=1"):
        (folder / f"{name}.csv").touch()
    write_notes(folder, notes)
    assert read_notes(folder) == {name: one for name, one in notes.items() if one != Note()}
    assert (folder / NOTES).exists() == bool(read_notes(folder))


def test_the_file_reads_as_the_page_has_it(here):
    edit_notes("data", drop={"episode_006": "dropped the baton"}, cut={"episode_002": (10.8, 11.2)})
    assert json.loads(Path("data", NOTES).read_text()) == {
        "version": 1,
        "episodes": {
            "episode_002": {"from": 10.8, "until": 11.2},
            "episode_006": {"use": False, "reason": "dropped the baton"},
        },
    }
    edit_notes("data", keep=["episode_002"], cut={"episode_006": (11.0, None)})
    assert read_notes(Path("data")) == {"episode_006": Note(False, "dropped the baton", 11.0, None)}
    edit_notes("data", keep=["episode_006"])
    assert not Path("data", NOTES).exists()


def test_what_the_page_shows_is_read_and_written_back(tmp_path):
    page = (Path(__file__).parents[1] / "docs" / "data.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```json\n(.*?)```", page, flags=re.DOTALL)
    for name in json.loads(shown)["episodes"]:
        (tmp_path / f"{name}.csv").touch()
    (tmp_path / NOTES).write_text(shown)
    write_notes(tmp_path, read_notes(tmp_path))
    assert json.loads((tmp_path / NOTES).read_text()) == json.loads(shown)


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (["--drop", "episode_07"], "--drop: unknown episode 'episode_07'; near it: episode_00"),
        (["--cut", "nobody=1:2"], "--cut: unknown episode 'nobody'; there is episode_001"),
        (["--keep", "nobody"], "unknown episode 'nobody'"),
        (["--cut", "episode_001=0:11"], "between 10 s and 12 s, its first and last sample, got from 0 s until 11 s"),
        (["--cut", "episode_001=12:11"], "got from 12 s until 11 s"),
        (["--cut", "episode_001=:"], "expected episode_001=FROM:UNTIL [s]"),
        (["--cut", "episode_001"], "expected episode_001=FROM:UNTIL [s]"),
        (["--cut", "episode_001=a:b"], "got episode_001=a:b"),
        (["--drop", "episode_002", "--cut", "episode_001=0:1"], "between 10 s and 12 s"),
    ],
    ids=str,
)
def test_an_edit_that_cannot_be_writes_nothing(edit, words, here, run):
    code, out, err = run("inspect", "data", *edit)
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1
    assert not Path("data", NOTES).exists()


def test_the_recordings_are_never_changed(here, run):
    before = recordings(here)
    assert (
        run("inspect", "data", "--drop", "episode_001=why", "--cut", "episode_002=10.1:11", "--picture", "a.png")[0]
        == 0
    )
    assert run("inspect", "data", "--keep", "episode_001", "--json")[0] == 0
    assert recordings(here) == before
    assert {path.name for path in Path("data").iterdir()} == {*(f"episode_00{i}.csv" for i in range(1, 7)), NOTES}
    assert Path("a.png").stat().st_size > 10_000


# --------------------------------------------------------------------------------------------------------- the commands


def test_what_is_noted_on_the_command_line_holds_for_every_command(here, run, monkeypatch):
    monkeypatch.setattr("inphase.training.reflex.MOMENTS", 2)  # what takes longest has no part in this
    code, out, err = run("inspect", "data", "--drop", "episode_001=dropped = the baton", "--cut", "episode_002=10.5:")
    assert code == 0
    assert out.splitlines()[0] == f"wrote data/{NOTES}"
    said = "left out 1: episode_001 (dropped = the baton); cut 1: episode_002 (from 10.5 s)"
    assert err == f"as {NOTES} says: {said} (--ignore-notes: take all as recorded)\n"
    assert "5 episodes of 1.5 … 2 s" in out
    for command in (
        ["inspect", "data"],
        ["fit", "data", *ROLES, "--quick", "-o", "a.inphase"],
        ["replay", "a.inphase", *BOTH, "--filter", "bip"],
    ):
        assert said in run(*command)[2]
    assert inphase.Model.load("a.inphase").provenance["left out"] == "1: episode_001 (dropped = the baton)"
    code, out, err = run("validate", "data")
    assert "5 episodes" in out
    assert "left out 1 episode; cut 1 episode" in err
    for command in (
        ["inspect", "data", "--json"],
        ["validate", "data"],
        ["replay", "a.inphase", *BOTH, "--filter", "bip"],
    ):
        assert run(*command, "--ignore-notes")[2] == ""
    card = json.loads(run("inspect", "data", "--json")[1])
    assert card["provenance"]["cut"] == "1: episode_002 (from 10.5 s)"
    assert [episode["name"] for episode in card["episodes"]] == [f"episode_00{i}" for i in range(2, 7)]
    assert run("inspect", "data", "--keep", "episode_001", "episode_002")[1].startswith("removed data/")


def test_a_model_has_no_episodes_to_decide_of(here, run, monkeypatch):
    monkeypatch.setattr("inphase.training.reflex.MOMENTS", 2)
    assert run("fit", "data", *ROLES, "--quick", "-o", "a.inphase")[0] == 0
    for edit in (["--drop", "x"], ["--cut", "x=1:2"], ["--keep", "x"], ["--picture", "a.png"]):
        code, _, err = run("inspect", "a.inphase", *edit)
        assert code == 2
        assert f"{edit[0]}: expected recordings, got the model file a.inphase" in err


def test_the_worst_is_printed_first_and_marked(here, run):
    path = Path("data/episode_004.csv")
    lines = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text(
        "\n".join(",".join([*c[:2], str(float(c[2]) + 0.9), *c[3:]] if i else c) for i, c in enumerate(lines))
    )
    write(here / "data" / "more", first=7, count=6)
    for extra in Path("data/more").iterdir():
        extra.rename(Path("data") / extra.name)
    out = run("inspect", "data")[1]
    rows = [line for line in out.splitlines() if re.match(r"episode_\d+  ", line)]
    assert len(rows) == 12
    assert rows[0].startswith("episode_004 ")
    assert "unlike the others: hand_y around phase 0." in rows[0]
    assert [row for row in rows[1:] if "unlike" in row] == []
    assert "episode_004 is unlike the others: further off than" in out
    (found,) = [e for e in json.loads(run("inspect", "data", "--json")[1])["episodes"] if e["outlier"]]
    assert (found["name"], found["unlike"][0]["feature"]) == ("episode_004", "hand_y")


def test_one_demonstration_says_that_none_can_be_left_out(here, run):
    code, out, _ = run("inspect", "data/episode_001.csv")
    assert code == 0
    assert "none is held against the others: expected at least 4 demonstrations" in out
