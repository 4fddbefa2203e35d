"""What a TOML file says is what is read, and a mistake in it is named with its line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from inphase.errors import DataError
from inphase.io.toml import read_toml


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "map.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_tables_numbers_and_lists_come_as_they_stand(tmp_path):
    path = written(tmp_path, 'rate = 60.0\n[channels]\nhand_x = "/hand pose.x"\n[a.b]\nc = [1, 2]\n"größe" = true\n')
    assert read_toml(path) == {
        "rate": 60.0,
        "channels": {"hand_x": "/hand pose.x"},
        "a": {"b": {"c": [1, 2], "größe": True}},
    }
    assert read_toml(written(tmp_path, b"\xef\xbb\xbfa = 1\r\nb = 2\r\n")) == {"a": 1, "b": 2}  # as Windows writes it
    assert read_toml(str(written(tmp_path, ""))) == {}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("a = 1\nb = \n", r", line 2: expected TOML: .*\(column 5\)"),
        ("a = 1\n[a]\n", r", line 2: expected TOML: "),
        ("a = 1\n\n\na = 2\n", r", line 4: expected TOML: "),
        ("a = 1\nb = [1,\n", r", line 2: expected TOML: .*\(at its end\)"),
        (b"a = 1\nb = '\xff'\n", ", line 2: expected text in UTF-8, got the byte 0xff"),
        ("a = " + "[" * 5000, ": expected TOML, got lists or tables nested too deeply|, line 1: expected TOML"),
        ("a = " + "9" * 5000, ": expected TOML: "),
    ],
)
def test_a_mistake_is_named_with_file_and_line(tmp_path, content, said):
    path = written(tmp_path, content)
    with pytest.raises(DataError, match=f"^{re.escape(str(path))}(?:{said})") as caught:
        read_toml(path)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_a_folder_is_told(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(DataError, match=f"^{re.escape(str(path))}: cannot be read: "):
            read_toml(path)
