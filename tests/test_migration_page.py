"""docs/migrating-from-intprim.md: its code runs, in order and in one namespace, and prints what it says."""

from __future__ import annotations

import contextlib
import io
import pickle
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from interactions import shapes_unchecked
from pages import blocks, leading_code, rows

import inphase

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "migrating-from-intprim.md"
TEXT = PAGE.read_text(encoding="utf-8")
NUMBER = r"\d+\.\d+"
TOLERANCE = 0.05  # of what is printed: other versions of numpy and BLAS round otherwise


def code_of_page() -> list[tuple[int, str]]:
    """All Python of the page as (line, code), blocks and cells of the table in their order."""
    found = [(line, block) for language, line, block in blocks(TEXT) if language == "python"]
    found += [(line, code) for line, cells in rows(TEXT) for cell in cells for code in leading_code(cell)]
    return sorted(found, key=lambda piece: piece[0])


@pytest.fixture(scope="module")
def handover(shared_data: Path) -> Path:
    folder = shared_data / "handover"
    if not folder.is_dir():
        pytest.skip("the recorded hand-overs of ../shared/data/handover are not beside the repository")
    return folder


def test_the_page_runs_and_prints_what_it_says(handover, tmp_path, monkeypatch):
    from matplotlib import pyplot as plt

    plt.switch_backend("agg")
    monkeypatch.setattr(plt, "show", lambda **_: None)  # with a display, it warns that there is no window
    monkeypatch.setattr(inphase, "fit", partial(inphase.fit, calibrate=False))
    (tmp_path / "shared").symlink_to(handover.parents[1])
    (tmp_path / "project").mkdir()
    monkeypatch.chdir(tmp_path / "project")
    old = {"basis_weights": np.arange(32.0).reshape(2, 16), "scaling_groups": None, "scalers": []}
    Path("written_by_python_2.bip").write_bytes(pickle.dumps(old, protocol=2))
    random_state = np.random.get_state()  # noqa: NPY002 - the page seeds these numbers
    names: dict[str, object] = {"__name__": "page"}
    try:
        with shapes_unchecked(), contextlib.redirect_stdout(io.StringIO()) as printed:
            for line, code in code_of_page():
                # Blank lines before it, so that a traceback names the line of the page.
                exec(compile("\n" * (line - 1) + code, PAGE, "exec"), names)
    finally:
        plt.close("all")
        np.random.set_state(random_state)  # noqa: NPY002
    said = re.findall(rf"# (now {NUMBER} m off.*)", TEXT)
    shown = re.findall(rf"^(now {NUMBER} m off.*)", printed.getvalue(), re.MULTILINE)
    assert len(said) == 3
    for wanted, got in zip(said, shown, strict=True):
        assert re.split(NUMBER, wanted) == re.split(NUMBER, got)
        numbers = [[float(number) for number in re.findall(NUMBER, line)] for line in (wanted, got)]
        assert numbers[1] == pytest.approx(numbers[0], rel=TOLERANCE, abs=0.001), got


def test_every_row_of_the_table_has_code_that_runs():
    table = [cells for _, cells in rows(TEXT) if len(cells) == 3 and cells[1:] != ["IntPrim", "inphase"]]
    assert len(table) > 30
    assert [cells[0] for cells in table if not leading_code(cells[1])] == []
    assert [cells[0] for cells in table if not leading_code(cells[2])] == [
        "noise (4.2.4)",
        "pictures",
    ]


def test_every_difference_is_shown_both_ways():
    changes = TEXT.split("## What was a bug")[1].split("## Left out")[0]
    sections = re.split(r"^### (.+)$", changes, flags=re.MULTILINE)[1:]
    assert len(sections) // 2 > 25
    for heading, section in zip(sections[::2], sections[1::2], strict=True):
        assert section.count("```python") == 1, heading
        assert section.index("# IntPrim\n") < section.index("# inphase\n"), heading


def test_the_table_of_the_recordings_can_be_made(handover, monkeypatch, capsys):
    monkeypatch.syspath_prepend(ROOT / "experiments" / "migration")
    import hand_over

    monkeypatch.setattr(hand_over, "QUICK_EPISODES", 6)  # three to learn from: too few to calibrate, which takes long
    with shapes_unchecked():
        assert hand_over.main([str(handover), "--quick"]) == 0
    head, _, *lines = capsys.readouterr().out.strip().splitlines()
    assert head.split(" | ")[1:] == ["as recorded", "slow x2 |"]
    labels = {line.split(" | ")[0].removeprefix("| ") for line in lines}
    assert labels == {"inphase, `rbpf`", *hand_over.LEARNERS}
    for line in lines:
        assert len(re.findall(rf"{NUMBER} \(\d+ %\), {NUMBER}", line)) == 2, line
