"""What was decided of recordings, kept in a small file beside them: which are left out, and which are cut.

The recordings themselves are never changed. The file reads

    {"version": 1, "episodes": {"episode_007": {"use": false, "reason": "dropped the baton"},
                                "episode_009": {"from": 0.8, "until": 7.2}}}
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inphase.arrays import frozen
from inphase.errors import DataError, listing
from inphase.io.atomic import whole_file
from inphase.io.files import is_episode, natural
from inphase.io.table import Table

NOTES = "inphase-notes.json"
VERSION = 1
KEYS = ("use", "reason", "from", "until")


@dataclass(frozen=True)
class Note:
    """What was decided of one episode: whether it is used, why not, and from when until when [s], in its own clock."""

    use: bool = True
    reason: str = ""
    start: float | None = None
    end: float | None = None

    @property
    def cuts(self) -> bool:
        """Whether anything is to be cut off."""
        return self.start is not None or self.end is not None


def notes_for(paths: Sequence[Path]) -> list[Note]:
    """The note on every file, from the notes in its own folder; raises DataError for notes that cannot be used."""
    known: dict[Path, dict[str, Note]] = {}
    for folder in {path.parent for path in paths}:
        notes = read_notes(folder)
        names = names_in_folder(folder) if notes else {}
        known[folder] = {file: notes[name] for file, name in names.items() if name in notes}
    return [known[path.parent].get(path.name, Note()) for path in paths]


def read_notes(folder: Path) -> dict[str, Note]:
    """The notes in a folder by episode, none where there is no such file.

    Raises DataError for what is no such file, a newer version, or an episode that the folder does not hold.
    """
    path = folder / NOTES
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: expected JSON, got something else: {error}") from None
    if not isinstance(content, dict) or not isinstance(content.get("episodes"), dict):
        raise DataError(f'{path}: expected {{"version": {VERSION}, "episodes": {{…}}}}, got something else')
    version = content.get("version")
    if isinstance(version, int) and version > VERSION:
        raise DataError(f"{path}: written by a newer inphase (version {version}); this one reads version {VERSION}")
    if version != VERSION or isinstance(version, bool) or set(content) != {"version", "episodes"}:
        raise DataError(f"{path}: expected version {VERSION} and episodes, got {listing(content)}, version {version!r}")
    names = list(names_in_folder(folder).values())
    for name in content["episodes"]:
        if name not in names:
            raise DataError(f"{path}: {unknown(name, names)}")
    return {name: _note(path, name, values) for name, values in content["episodes"].items()}


def write_notes(folder: Path, notes: Mapping[str, Note]) -> Path:
    """Write the notes of a folder, whole or not at all, and return the file; without any note there is none.

    Raises OptionError where it cannot be written.
    """
    path = folder / NOTES
    said = {name: notes[name] for name in names_in_folder(folder).values() if notes.get(name, Note()) != Note()}
    if not said:
        path.unlink(missing_ok=True)
        return path
    content = {"version": VERSION, "episodes": {name: _plain(note) for name, note in said.items()}}
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path


def as_noted(table: Table, note: Note) -> Table:
    """The samples of an episode that are to be used; raises DataError where it does not span what is noted."""
    if not note.cuts:
        return table
    first, last = float(table.times.min()), float(table.times.max())
    start = first if note.start is None else note.start
    end = last if note.end is None else note.end
    if not first <= start < end <= last:
        raise DataError(
            f"{table.name}: expected to cut it between {first:.10g} s and {last:.10g} s, its first and last sample, "
            f"got from {start:.10g} s until {end:.10g} s"
        )
    kept = (table.times >= start) & (table.times <= end)
    return Table(table.name, table.columns, frozen(table.times[kept]), frozen(table.values[kept]))


def names_in_folder(folder: Path) -> dict[str, str]:
    """File → the episode's name in the notes, in natural order: its stem, or the file where two have that stem."""
    files = natural(path for path in folder.iterdir() if is_episode(path))
    stems = [path.stem for path in files]
    return {path.name: path.stem if stems.count(path.stem) == 1 else path.name for path in files}


def unknown(name: str, names: Sequence[str]) -> str:
    """'unknown episode …', with the names that are near it."""
    longer = [other for other in names if other.startswith(name)]
    near = list(dict.fromkeys([*longer, *difflib.get_close_matches(name, names, n=5, cutoff=0.6)]))[:5] if name else []
    return f"unknown episode {name!r}; " + (f"near it: {listing(near)}" if near else f"there is {listing(names)}")


def _note(path: Path, name: str, values: Any) -> Note:
    if not isinstance(values, dict) or not set(values) <= set(KEYS):
        got = listing(values) if isinstance(values, dict) else repr(values)
        raise DataError(f"{path}: {name}: expected some of {listing(KEYS)}, got {got}")
    use, reason = values.get("use", True), values.get("reason", "")
    if not isinstance(use, bool) or not isinstance(reason, str):
        raise DataError(f"{path}: {name}: expected use as true or false and a text as reason, got {use!r}, {reason!r}")
    times: list[float | None] = []
    for key in ("from", "until"):
        time = values.get(key)
        if time is not None and (
            isinstance(time, bool) or not isinstance(time, int | float) or not math.isfinite(time)
        ):
            raise DataError(f"{path}: {name}: expected {key} as a time [s], got {time!r}")
        times.append(None if time is None else float(time))
    return Note(use, reason, *times)


def _plain(note: Note) -> dict[str, Any]:
    """What is not as usual."""
    values = zip(KEYS, (note.use, note.reason, note.start, note.end), (True, "", None, None), strict=True)
    return {key: value for key, value, usual in values if value != usual}
