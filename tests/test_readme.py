"""What readers run: the README from top to bottom, as it is written, and the targets and links that pages name."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from interactions import shapes_unchecked
from pages import blocks, commands, leading_code, rows

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent
CONSOLE = ("bash", "sh", "console")


def targets() -> set[str]:
    """What the Makefile can make."""
    return set(re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))


def test_readme_names_the_test_command_and_real_targets():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    console = [c for language, _, block in blocks(text) if language in CONSOLE for c in commands(block)]
    made = [command.split("#")[0].split() for command in console if command.startswith("make ")]
    assert ["make", "test"] in made
    named = {word for words in made for word in words[1:] if "=" not in word and not word.startswith("-")}
    assert named <= targets()


def test_readme_runs(tmp_path, monkeypatch):
    """From top to bottom in a folder where `make demo` was: Python in one namespace, `inphase …` as installed."""
    monkeypatch.chdir(tmp_path)
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    subprocess.run([BIN / "inphase", "demo"], env=environment, check=True, capture_output=True)
    names: dict[str, object] = {"__name__": "readme"}
    ran = {"python": 0, "inphase": 0}
    for language, line, block in blocks((ROOT / "README.md").read_text(encoding="utf-8")):
        if language == "python":
            # Blank lines before it, so that a traceback names the line of the page. Its fit is calibrated, which takes
            # six times as long where shapes are checked.
            with shapes_unchecked():
                exec(compile("\n" * (line - 1) + block, ROOT / "README.md", "exec"), names)
            ran["python"] += 1
        elif language in CONSOLE:
            for command in commands(block):
                if command.startswith("inphase "):
                    result = subprocess.run(command, shell=True, env=environment, capture_output=True, text=True)
                    assert result.returncode == 0, f"README.md:{line}: {command}\n{result.stdout}{result.stderr}"
                    ran["inphase"] += 1
    assert min(ran.values()) > 0, ran


def test_links_of_every_page_lead_somewhere():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))]
    here = [(page, link) for page, link in links if "://" not in link]
    assert [f"{page.name}: {link}" for page, link in here if not (page.parent / link).exists()] == []
    assert here


def test_blocks_and_commands_of_a_page():
    page = (
        "text\n```python\na = 1\n```\n<!-- not run: needs a robot -->\n\n```bash\ninphase live\n```\n\n```console\n"
        "$ inphase fit \\\n   x.csv  # learn\n# a comment\n\nmake test\n```\n"
    )
    assert [(language, line) for language, line, _ in blocks(page)] == [("python", 3), ("console", 12)]
    assert commands(list(blocks(page))[1][2]) == ["inphase fit     x.csv  # learn", "make test"]


def test_rows_and_code_of_a_table():
    page = "| | new |\n|---|---|\n| old | `a = 1` `b = a`, of `c` |\n"
    assert list(rows(page)) == [(1, ["", "new"]), (3, ["old", "`a = 1` `b = a`, of `c`"])]
    assert leading_code("`a = 1` `b = a`, of `c`") == ["a = 1", "b = a"]
    assert leading_code("none: `c`") == []
