"""Results of tasks on the disk, a file each, so that a study that was stopped goes on where it was."""

from __future__ import annotations

import hashlib
import re
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from inphase.io.atomic import whole_file

Arrays: TypeAlias = Mapping[str, np.ndarray]
Found: TypeAlias = Mapping[str, Arrays]  # by label
MADE_BY, SECONDS = "made_by", "seconds"
LABEL = re.compile(r"\w[\w.+-]*(/\w[\w.+-]*)*")


@dataclass(frozen=True)
class Stored(Mapping[str, Arrays]):
    """The results of one part by label, read from its folder when asked for.

    labels: of its tasks, where these are known: other files in the folder, as an earlier or a quicker study left them,
    are not among its results.
    """

    folder: Path
    labels: tuple[str, ...] | None = None

    def __getitem__(self, label: str) -> Arrays:
        path = self.path(label)
        if not path.is_file() or (self.labels is not None and label not in self.labels):
            raise KeyError(label)
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}

    def __iter__(self) -> Iterator[str]:
        there = (str(p.relative_to(self.folder))[: -len(".npz")] for p in sorted(self.folder.rglob("[!.]*.npz")))
        return (label for label in there if self.labels is None or label in self.labels)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def path(self, label: str) -> Path:
        """The file of a result."""
        if not LABEL.fullmatch(label):
            raise ValueError(f"expected a label of letters, digits and . + - _ between slashes, got {label!r}")
        return self.folder / f"{label}.npz"

    def keep(self, label: str, result: Mapping[str, Any], made_by: str, seconds: float) -> None:
        """Write a result whole, with the digest of what made it and how long that took [s]."""
        path = self.path(label)
        if taken := {MADE_BY, SECONDS, "file", "allow_pickle"} & set(result):
            raise ValueError(f"{min(taken)} names something else here: call the result otherwise")
        path.parent.mkdir(parents=True, exist_ok=True)
        arrays = {name: np.asarray(value) for name, value in result.items()}
        arrays |= {MADE_BY: np.asarray(made_by), SECONDS: np.asarray(seconds)}
        with whole_file(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)

    def made_by(self, label: str) -> str | None:
        """The digest of what made a result; None where it is not there, or cannot be read whole."""
        try:
            with zipfile.ZipFile(self.path(label)) as archive:
                if archive.testzip() is not None:
                    return None
            with np.load(self.path(label), allow_pickle=False) as file:
                return str(file[MADE_BY])
        except (OSError, KeyError, ValueError, EOFError, zlib.error, zipfile.BadZipFile):
            return None


def digest(folders: Iterable[Path], *more: object) -> str:
    """Of all that results depend on: the source files of these folders, and settings."""
    made = hashlib.sha256(repr(more).encode())
    for folder in folders:
        for path in sorted(p for p in folder.rglob("*") if p.suffix in {".py", ".xml"}):
            made.update(str(path.relative_to(folder)).encode() + path.read_bytes())
    return made.hexdigest()[:16]
