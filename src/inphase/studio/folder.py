"""What is in the studio's folder: recordings, models and runs, with all folders below it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from inphase.io.files import SUFFIXES, natural

DEPTH = 4  # folders below folders: the folder may be somebody's home
MOST = 20_000  # files that are looked at, for the same reason


@dataclass(frozen=True)
class Contents:
    """Names from the folder, in natural order.

    episodes: by the folder that holds them, `.` for the folder itself. models: model files. runs: recordings of runs,
    the newest first. whole: whether all of it was looked through.
    """

    episodes: dict[str, tuple[str, ...]]
    models: tuple[str, ...] = ()
    runs: tuple[str, ...] = ()
    whole: bool = True


def look(folder: Path) -> Contents:
    """Look through it; hidden files, links to folders and what cannot be read are passed over."""
    found: list[Path] = []
    seen, whole = 0, True
    for place, below, files in os.walk(folder):
        here = Path(place).relative_to(folder)
        if len(here.parts) >= DEPTH:
            below.clear()
        below[:] = [name for name in below if not name.startswith(".")]
        seen += len(files)
        if seen > MOST:
            whole = False
            break
        found += [here / name for name in files if not name.startswith(".")]
    episodes: dict[str, list[str]] = {}
    for path in natural(path for path in found if path.suffix.lower() in SUFFIXES and (folder / path).is_file()):
        episodes.setdefault(path.parent.as_posix(), []).append(path.as_posix())
    runs = [path for path in found if path.suffix == ".mcap"]
    return Contents(
        {place: tuple(names) for place, names in episodes.items()},
        tuple(path.as_posix() for path in natural(path for path in found if path.suffix == ".inphase")),
        tuple(path.as_posix() for path in sorted(runs, key=lambda path: -_written(folder / path))),
        whole,
    )


def _written(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:  # it is gone by now
        return 0.0
