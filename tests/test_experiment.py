"""Every study's quick variant, as a reader runs it: all tables are there, and all pictures."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
STUDIES = sorted(path.parent.name for path in (ROOT / "experiments").glob("*/study.py"))


def test_there_is_a_study_for_each_of_the_dissertation():
    assert set(STUDIES) == {"handwriting", "catching", "hugging", "handshake", "cooperation"}


def quickly(name: str, folder: Path) -> str:
    """As users run it, without the checks of shapes that tests have."""
    command = [sys.executable, "-m", "inphase.cli", "experiment", name, "--quick", "--jobs", "1", "-o", str(folder)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, encoding="utf-8")
    assert (result.returncode, result.stderr) == (0, "")
    return result.stdout


@pytest.mark.parametrize("name", STUDIES)
def test_the_quick_study_tells_everything(name, tmp_path):
    if name != "handwriting":
        pytest.importorskip("mujoco", reason="mujoco 4 needs Python 3.11")
    folder = tmp_path / "results"
    out = quickly(name, folder)
    study = importlib.import_module(f"experiments.{name}.study").STUDY
    text = (folder / f"{name}.md").read_text(encoding="utf-8")
    for part in study.parts.values():
        assert f"### {part.what}" in text
    for picture in re.findall(r"!\[.+?\]\((.+?)\)", text):
        assert (folder / picture).stat().st_size > 1000
    assert not re.search(r"\bnan\b|\binf\b", text)
    assert f"wrote {folder / name}.md" in out
    if name == "handwriting":
        assert quickly(name, folder) == out  # at once, and the same


def test_a_page_without_a_place_for_the_study_is_told_before_the_work(tmp_path):
    page, folder = tmp_path / "page.md", tmp_path / "results"
    page.write_text("# Another page\n", encoding="utf-8")
    command = [sys.executable, "-m", "inphase.cli", "experiment", "handwriting", "--page", str(page), "-o", str(folder)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, encoding="utf-8")
    assert (result.returncode, folder.exists()) == (2, False)
    assert "expected the lines '<!-- begin handwriting -->'" in result.stderr
