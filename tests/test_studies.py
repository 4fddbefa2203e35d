"""How studies are conducted: kept as they are done, resumed, told; with tables that mark what they should."""

from __future__ import annotations

import json
import zipfile
from concurrent.futures import Future
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import inphase
from experiments.study import Cell, Page, Part, Settings, Stored, Study, Table
from experiments.study.as_written import as_written
from experiments.study.compared import pairs
from experiments.study.conduct import conduct, load
from experiments.study.follower import cheaper
from experiments.study.interaction_primitive import warped
from experiments.study.stored import digest
from experiments.study.table import marked
from inphase.basis import Gaussian
from inphase.errors import DataError, OptionError
from inphase.workers import Team, workers

ROOT = Path(__file__).parents[1]


def draw(label: str, diary: Path, fails: str = "") -> dict[str, object]:
    """A task that writes down that it was done."""
    if label == fails:
        raise KeyboardInterrupt
    with diary.open("a") as file:
        file.write(label + "\n")
    return {"numbers": np.arange(3) + len(label), "name": label}


def study(diary: Path, labels: tuple[str, ...] = ("a", "b/1", "b/2"), fails: str = "") -> Study:
    """Two parts, the second of which reads the first."""

    def tell(settings, found, page):
        page.say(json.dumps({label: int(result["numbers"].sum()) for label, result in found.items()}))

    def later(settings):
        return {"of": partial(count, settings.of("first"))}

    return Study(
        "A study",
        "What it is.",
        {
            "first": Part("First", lambda settings: {of: partial(draw, of, diary, fails) for of in labels}, tell),
            "second": Part(
                "Second", later, lambda settings, found, page: page.say(str(found["of"]["count"])), ("first",)
            ),
            "third": Part("Third", lambda settings: {}, lambda settings, found, page: page.say("nothing")),
        },
        modules=(),
    )


def count(stored: Stored) -> dict[str, object]:
    return {"count": len(stored), "names": [str(result["name"]) for result in stored.values()]}


@pytest.fixture
def settings(tmp_path):
    return Settings(quick=False, seed=0, folder=tmp_path / "results")


@pytest.fixture
def diary(tmp_path):
    (tmp_path / "diary").touch()
    return tmp_path / "diary"


def done(diary: Path) -> list[str]:
    return diary.read_text().split()


def conducted(made: Study, settings: Settings, **options) -> tuple[str, list[str]]:
    said: list[str] = []
    with workers(1) as team:
        page = conduct("handwriting", made, settings, team, say=said.append, **options)
    return page.text(), said


def test_what_is_done_is_not_done_again(settings, diary):
    text, _ = conducted(study(diary), settings)
    assert done(diary) == ["a", "b/1", "b/2"]
    assert '{"a": 6, "b/1": 12, "b/2": 12}' in text
    again, said = conducted(study(diary), settings)
    assert (again, said, len(done(diary))) == (text, [], 3)
    conducted(study(diary), settings, again=True)
    assert len(done(diary)) == 6


def test_a_study_that_was_stopped_goes_on(settings, diary):
    with pytest.raises(KeyboardInterrupt):
        conducted(study(diary, fails="b/2"), settings)
    assert done(diary) == ["a", "b/1"]
    _, said = conducted(study(diary), settings)
    assert done(diary) == ["a", "b/1", "b/2"]
    assert said == ["first: 2 of 3 results are there"]


def test_a_result_that_is_broken_or_of_other_settings_is_made_anew(settings, diary):
    conducted(study(diary), settings)
    path = settings.of("first").path("a")
    path.write_bytes(path.read_bytes()[:40])
    conducted(study(diary), settings)
    assert done(diary)[3:] == ["a"]
    other = Settings(quick=False, seed=1, folder=settings.folder)
    _, said = conducted(study(diary), other, parts=("first",))
    assert done(diary)[4:] == ["a", "b/1", "b/2"]
    assert "3 results are of other code or settings" in said[0]
    conducted(study(diary), settings, parts=("first",), keep=True)  # of another seed, whatever the code
    assert len(done(diary)) == 10


def test_results_of_other_code_are_kept_if_that_is_wanted(settings, diary, monkeypatch, tmp_path):
    conducted(study(diary), settings)
    monkeypatch.setattr("experiments.study.conduct.BESIDE", tmp_path)
    _, said = conducted(study(diary), settings, keep=True)
    assert (len(done(diary)), said) == (3, [])
    conducted(study(diary), settings)
    assert len(done(diary)) == 6


def test_what_an_earlier_study_left_is_not_among_the_results(settings, diary):
    """Else a demonstration of fewer, larger tasks would be learned twice, and tested on what was learned."""
    conducted(study(diary, labels=("a", "b/1", "b/2", "b/3")), settings, parts=("first",))
    text, _ = conducted(study(diary), settings, parts=("first", "second"))
    assert '"b/3"' not in text
    assert text.endswith("\n\n3")
    stored = Stored(settings.folder / "first", ("a", "b/1"))
    assert list(stored) == ["a", "b/1"]
    with pytest.raises(KeyError):
        stored["b/3"]


def test_a_result_in_which_a_bit_is_turned_is_made_anew(settings, diary):
    conducted(study(diary), settings)
    path = settings.of("first").path("a")
    content = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as file:
        begins = file.getinfo("numbers.npy").header_offset
    name, extra = (int.from_bytes(content[begins + i : begins + i + 2], "little") for i in (26, 28))
    content[begins + 30 + name + extra + 20] ^= 0x10  # in the middle of what is packed there
    path.write_bytes(bytes(content))
    conducted(study(diary), settings)
    assert done(diary)[3:] == ["a"]


def test_what_was_done_beside_a_task_that_fails_is_kept(settings, diary):
    def fail() -> dict[str, object]:
        raise ValueError("a task that fails")

    good = tuple("abcdefghijkl")
    made = study(diary, labels=good)
    tasks = {"fails": fail} | dict(made.parts["first"].tasks(settings))
    made = Study("A study", "", {"first": Part("First", lambda settings: tasks, made.parts["first"].tell)}, modules=())

    def start(task):
        future: Future[object] = Future()
        try:
            future.set_result(task())
        except ValueError as error:
            future.set_exception(error)
        return future

    with pytest.raises(ValueError, match="a task that fails"):
        conduct("handwriting", made, settings, Team(start, lambda: 20), say=lambda text: None)
    assert tuple(settings.of("first")) == good


def test_commands_on_a_page_name_the_seed_that_makes_it(settings, diary):
    text, _ = conducted(study(diary), Settings(quick=False, seed=3, folder=settings.folder))
    assert text.count("--part first --seed 3`") == 1
    assert "--seed" not in conducted(study(diary), settings)[0]


def test_a_study_says_what_has_to_be_installed(monkeypatch, tmp_path):
    """Whether it says so itself, or cannot even be read."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("experiments.__path__", [str(tmp_path)])
    (tmp_path / "absent").mkdir()
    (tmp_path / "absent" / "study.py").write_text("import no_such_physics\n")
    with pytest.raises(OptionError, match=r"absent needs no_such_physics: pip install 'inphase\[sim,demo\]'"):
        load("absent")


@pytest.mark.parametrize("folder", ["handwriting", "study", "bodies"])
def test_what_other_code_has_made_is_made_anew_wherever_that_code_is(settings, diary, monkeypatch, tmp_path, folder):
    """A study's own, or what studies share; of another study it says nothing."""
    monkeypatch.setattr("experiments.study.conduct.BESIDE", tmp_path)
    for each in ("handwriting", "study", "bodies", "catching"):
        (tmp_path / each).mkdir()
        (tmp_path / each / "model.py").write_text("1")
    conducted(study(diary), settings, parts=("first",))
    (tmp_path / "catching" / "model.py").write_text("2")
    conducted(study(diary), settings, parts=("first",))
    assert len(done(diary)) == 3
    (tmp_path / folder / "model.py").write_text("2")
    conducted(study(diary), settings, parts=("first",))
    assert len(done(diary)) == 6


def test_a_part_alone_has_what_it_needs_done_and_is_told_alone(settings, diary):
    text, _ = conducted(study(diary), settings, parts=("second",))
    assert (settings.folder / "handwriting.md").read_text().count("### ") == 1
    assert "### Second" in text
    assert text.endswith("\n\n3")
    assert "--part second" in text
    assert conducted(study(diary), settings, parts=("third",))[0].endswith("nothing")
    with pytest.raises(OptionError, match=r"unknown part 'forth'; valid: first, second, third"):
        conducted(study(diary), settings, parts=("forth",))


def test_progress_goes_from_nothing_to_all(settings, diary):
    shares: list[float] = []
    conducted(study(diary), settings, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[0] == pytest.approx(1 / 9)
    assert shares[-1] <= 1.0


def test_results_come_back_as_they_were(tmp_path):
    stored = Stored(tmp_path)
    given = {"x": np.array([[1.0, np.nan]]), "words": ["a", "é"], "n": 3}
    stored.keep("deep/er", given, "me", 2.0)
    assert list(stored) == ["deep/er"]
    np.testing.assert_array_equal(stored["deep/er"]["x"], given["x"])
    assert stored["deep/er"]["words"].tolist() == ["a", "é"]
    assert stored.made_by("deep/er") == "me"
    with pytest.raises(KeyError):
        stored["other"]
    for label in ("../up", "a//b", "/root", "a b", ""):
        with pytest.raises(ValueError, match="expected a label"):
            stored.path(label)


def test_the_digest_tells_other_code_and_other_settings_apart(tmp_path):
    (tmp_path / "a.py").write_text("1")
    before = digest([tmp_path], True, 0)
    assert digest([tmp_path], True, 0) == before
    assert digest([tmp_path], False, 0) != before
    (tmp_path / "b.txt").write_text("not code")
    assert digest([tmp_path], True, 0) == before
    (tmp_path / "a.py").write_text("2")
    assert digest([tmp_path], True, 0) != before


def test_a_table_marks_the_best_and_what_is_not_worse(rng):
    good = rng.normal(1.0, 0.1, 40)
    marks = marked({"good": good, "same": good[::-1] + 0.001, "bad": good + 1.0, "none": np.array([])})
    assert marks == {"good": "**{}**", "same": "{} ≈", "bad": "{}", "none": "{}"}
    table = Table("what", ["one", "two", "three"])
    table.add("row", {"one": Cell(np.array([3.97e16])), "two": Cell(np.array([0.5])), "three": "text"}, {"two": "0.14"})
    assert table.markdown().splitlines()[-1] == "| row | 3.97·10^16 ≈ | **0.500** (0.14) | text |"
    with pytest.raises(ValueError, match="unknown column 'four'"):
        table.add("row", {"four": "x"})


def test_a_study_takes_its_place_in_a_page_and_leaves_the_rest(tmp_path):
    page = Page("mine", tmp_path / "results")
    page.say("new")
    page.film([np.full((8, 8, 3), shade, np.uint8) for shade in (0, 120, 255)], "film", "a film", 10)
    target = tmp_path / "studies.md"
    target.write_text("before\n<!-- begin mine -->\nold\n<!-- end mine -->\nafter\n")
    page.into(target)
    text = target.read_text()
    assert text == "before\n<!-- begin mine -->\nnew\n\n![a film](studies/mine-film.gif)\n<!-- end mine -->\nafter\n"
    assert (tmp_path / "studies" / "mine-film.gif").read_bytes()[:4] == b"GIF8"
    page.into(target)
    assert target.read_text() == text
    target.write_text("nothing")
    with pytest.raises(DataError, match="<!-- begin mine -->"):
        page.into(target)


def test_parts_of_a_study_take_their_places_and_leave_the_others(tmp_path):
    heads = ["First", "Second (Fig. 2)", "Third"]

    def made(*parts, said):
        page = Page("mine", tmp_path / "results", heads)
        page.say("of the study")
        for part in parts:
            page.head(part, "command", 1.0)
            page.say(f"{said} {part}\n\nmore")
        return page

    (target := tmp_path / "studies.md").write_text("x\n<!-- begin mine -->\nnot run\n<!-- end mine -->\ny\n")
    made("Third", "First", said="old").into(target)
    made("Second (Fig. 2)", "First", said="new").into(target)
    text = target.read_text()
    assert [line for line in text.splitlines() if line.startswith(("new", "old"))] == [
        "new First",
        "new Second (Fig. 2)",
        "old Third",
    ]
    assert text.count("of the study") == 1
    assert "not run" not in text
    made(*heads, said="whole").into(target)
    whole = target.read_text()
    made(*heads, said="whole").into(target)
    assert whole == target.read_text()
    assert "old" not in whole + text.split("old Third")[0]


def test_time_warping_finds_where_each_sample_is(rng):
    """Against the plain double loop over all paths' costs, and a pace that is known."""
    reference = np.cumsum(rng.normal(size=(30, 2)), axis=0)
    truth = np.cumsum(rng.integers(0, 2, 25))  # it stands, or moves on by one
    truth -= truth[0]
    np.testing.assert_array_equal(reference[warped(reference[truth], reference)], reference[truth])
    rows = reference[truth] + 0.3 * rng.normal(size=(25, 2))
    cost = ((rows[:, None] - reference[None]) ** 2).sum(2)
    total = np.full_like(cost, np.inf)
    for i in range(25):
        for j in range(30):
            ways = [total[a, b] for a, b in ((i - 1, j), (i - 1, j - 1), (i, j - 1)) if min(a, b) >= 0]
            total[i, j] = cost[i, j] + (min(ways) if ways else 0.0)
    path = warped(rows, reference)
    assert path[-1] == np.argmin(total[-1])
    assert (np.diff(path) >= 0).all()


def test_bad_input_is_one_line(run, tmp_path):
    code, _, error = run("experiment", "nothing")
    assert (code, error.count("\n")) == (2, 1)
    assert "unknown study 'nothing'; valid: " in error
    assert "handwriting" in error
    for more, told in (
        (["--part", "nothing", "-o", tmp_path / "o"], "unknown part 'nothing'; valid: models, temporal"),
        (["--quick", "--page", tmp_path / "p.md"], "expected the whole study or parts of it, got --quick"),
        (["--jobs", "0"], "--jobs: expected at least 1, got 0"),
    ):
        code, _, error = run("experiment", "handwriting", *more)
        assert (code, error.count("\n")) == (2, 1)
        assert told in error


@pytest.mark.parametrize("name", ["catching", "cooperation", "handshake", "handwriting", "hugging"])
@pytest.mark.parametrize("quick", [True, False])
def test_every_task_of_every_study_can_be_kept(name, quick, tmp_path):
    """A whole study takes hours: that its last part cannot be written is not to be found out then."""
    pytest.importorskip("mujoco", reason="the extra [sim] needs Python 3.11")
    settings = Settings(quick, 0, tmp_path)
    for part, of in load(name).parts.items():
        files = [settings.of(part).path(label) for label in of.tasks(settings)]
        assert len(set(files)) == len(files)


def test_errors_are_compared_as_they_are_printed():
    """Columns of one table, or one table a method; what is no error, or has not both filters, is left out."""
    told = """
| Error of the arm | IP | eBIP | rbpf |
|---|---:|---:|---:|
| 0.5 | 0.1 | 0.300 ≈ (0.34) | **0.100** |
| 1 | 0.1 | 0.020 | 0.040 |

| Milliseconds a sample | eBIP | rbpf |
|---|---:|---:|
| 70 | 1.0 | 3.0 |

| Error of another | IP | rbpf |
|---|---:|---:|
| 1 | 1.0 | 3.0 |

**ebip, the model as the dissertation writes it**:

|  | All | Group |
|---|---:|---:|
| Dimension | 700 (664) | 400 |
| 0.05 Joints | **0.090** (0.191) | 0.5 |

**rbpf on what is learned**:

|  | All | Group |
|---|---:|---:|
| Dimension | 700 | 400 |
| 0.05 Joints | 0.03 | **0.1** |
"""
    np.testing.assert_allclose(pairs(told), [[0.1, 0.3], [0.04, 0.02], [0.03, 0.09], [0.1, 0.5]])
    np.testing.assert_allclose(pairs(told, "eBIP", "IP"), [[0.3, 0.1], [0.02, 0.1]])
    assert len(pairs(told, "BIP", "IP")) == 0


def test_the_model_as_written_has_white_noise_of_the_regression_and_else_what_was_demonstrated() -> None:
    """Eq. 2.15 by a least-squares fit of its own; the noise that is learned, asked for, is all that differs."""
    rng, times = np.random.default_rng(0), np.arange(200) / 100
    phases = np.linspace(0, 1, 200)
    curves = [
        rng.normal(1, 0.2) * np.column_stack([np.sin(5 * phases), np.cos(5 * phases)])
        + 0.2 * np.cumsum(rng.normal(0, 0.05, (200, 2)), 0)
        for _ in range(6)
    ]
    dataset = inphase.Dataset.from_arrays([times] * 6, curves, ["person"], ["robot"])
    basis = Gaussian(6)
    model, learned = as_written(dataset, basis), as_written(dataset, basis, white=False)
    functions = basis(phases)
    left = [curve - functions @ np.linalg.lstsq(functions, curve, rcond=None)[0] for curve in curves]
    var = np.mean([(r**2).mean(0) for r in left], axis=0)
    np.testing.assert_allclose(model.scaling.unscale_var(model.noise.var), var, rtol=0.02)
    assert not model.noise.correlation_time.any()
    assert (learned.noise.correlation_time > 0).all()
    assert (learned.noise.var > 2 * model.noise.var).all()  # of what others explain, more is left
    for each in (model, learned):
        assert (each.prior.trust, each.prior.shrinkage, each.reflex) == (1.0, 0.0, None)
        np.testing.assert_array_equal(each.prior.samples, model.prior.samples)


def test_up_to_which_length_the_first_takes_less_time():
    assert cheaper([10, 20, 40], np.array([1.0, 2.0, 9.0]), np.array([2.0, 3.0, 4.0])) == (
        "; of 20 samples and less it takes more"
    )
    assert cheaper([10, 20], np.array([3.0, 4.0]), np.array([2.0, 3.0])) == ""
