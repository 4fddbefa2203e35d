"""Find the files of a data set: a file, a folder, a glob pattern, or several of them."""

from __future__ import annotations

import difflib
import glob
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeAlias

from inphase.errors import DataError, listing

SUFFIXES = (".csv", ".npz")  # what an episode may be written as
Source: TypeAlias = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


def find_episodes(source: Source) -> list[Path]:
    """The files of episodes in `source`, in natural order: episode_10 follows episode_9.

    A folder stands for the .csv and .npz files in it (not below it), a pattern (`*`, `?`, `[ab]`, `**`) for those that
    fit; parts of a sequence keep their order, and a file that is met twice counts once. Raises DataError where a part
    gives no file.
    """
    parts = [source] if isinstance(source, (str, os.PathLike)) else list(source)
    if not parts:
        raise DataError("expected at least one file, folder or pattern, got none")
    found: dict[Path, Path] = {}
    for part in parts:
        for path in _expand(str(Path(part).expanduser())):
            found.setdefault(path.resolve(), path)
    return list(found.values())


def episode_names(paths: Sequence[Path]) -> list[str]:
    """The stem of every file, led by as many parent folders as it takes to tell equal stems apart."""
    names = [path.stem for path in paths]
    for depth in range(2, 1 + max((len(path.parts) for path in paths), default=0)):
        twice = {name for name in names if names.count(name) > 1}
        for i, path in enumerate(paths):
            if names[i] in twice:
                names[i] = "/".join([*path.parts[-depth:-1], path.stem])
    return [path.as_posix() if names.count(name) > 1 else name for name, path in zip(names, paths, strict=True)]


def is_episode(path: Path) -> bool:
    """Whether it is a visible file of a known suffix."""
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file()


def _expand(part: str) -> list[Path]:
    path = Path(part)
    if path.is_dir():
        return _in_folder(path)
    if path.exists():
        return [path]
    if glob.has_magic(part):
        return _that_fit(part)
    raise DataError(f"{part}: no such file or folder{_near(path)}")


def _in_folder(folder: Path) -> list[Path]:
    try:
        inside = natural(folder.iterdir())
    except OSError as error:
        raise DataError(f"{folder}: cannot be read: {error.strerror}") from None
    files = [path for path in inside if is_episode(path)]
    if files:
        return files
    expected = f"{folder}: expected {' or '.join(SUFFIXES)} files in the folder, found "
    for depth in ("*", "*/*"):  # no deeper: the folder may be somebody's home
        below = natural(path for path in folder.glob(f"{depth}/*") if is_episode(path))
        if below:
            folders = dict.fromkeys(path.parent.relative_to(folder).as_posix() for path in below)
            pattern = (folder / depth / f"*{below[0].suffix}").as_posix()
            raise DataError(f"{expected}them only below it, in {listing(folders)}: try {pattern!r}")
    raise DataError(f"{expected}{listing(path.name for path in inside)}")


def _that_fit(pattern: str) -> list[Path]:
    fitting = [Path(name) for name in glob.glob(pattern, recursive=True)]
    files = natural(path for path in fitting if is_episode(path))
    if files:
        return files
    if not fitting:
        raise DataError(f"{pattern}: nothing fits the pattern")
    folders = all(path.is_dir() for path in fitting)
    hint = ": try " + repr(f"{pattern.rstrip('/')}/*.csv") if folders else ""
    raise DataError(
        f"{pattern}: expected {' or '.join(SUFFIXES)} files to fit the pattern, "
        f"got {'folders ' if folders else ''}{listing(natural(fitting))}{hint}"
    )


def natural(paths: Iterable[Path]) -> list[Path]:
    """Paths sorted by name, the numbers in a name compared as numbers."""
    # Splitting at the digits gives text and number in turn, so equal positions always hold the same type.
    return sorted(
        paths,
        key=lambda path: [
            [int(piece) if i % 2 else piece.lower() for i, piece in enumerate(re.split(r"([0-9]+)", part))]
            for part in path.parts
        ],
    )


def _near(path: Path) -> str:
    """What else is in the folder that the path should be in, the most similar names first."""
    folder = path.parent
    if not folder.is_dir():
        missing = next((p for p in reversed(path.parents) if not p.exists()), folder)
        return f": there is no folder {missing}"
    try:
        names = sorted(entry.name for entry in folder.iterdir())
    except OSError as error:
        return f"; {folder} cannot be read: {error.strerror}"
    near = difflib.get_close_matches(path.name, names, n=5, cutoff=0.6)
    return f"; near it: {listing(near)}" if near else f"; in {folder} there is {listing(names)}"
