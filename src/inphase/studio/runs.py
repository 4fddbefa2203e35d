"""The recordings of runs in the folder: which of them are being written now."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from inphase.io.mcap_follow import has_end

FRESH = 3.0  # [s] since it was written in which a run without an end is taken to go on
MOST = 100  # that are listed


@dataclass(frozen=True)
class Run:
    """A recording, as its file stands: written so long ago [s], with its end or without."""

    name: str
    written: float
    ended: bool

    @property
    def running(self) -> bool:
        """Whether it seems to go on."""
        return not self.ended and self.written < FRESH


def runs(folder: Path, names: tuple[str, ...]) -> list[Run]:
    """Those of these names that are there, the newest first."""
    found = []
    for name in names[:MOST]:
        path = folder / name
        try:
            found.append(Run(name, time.time() - path.stat().st_mtime, has_end(path)))
        except OSError:  # it is gone by now
            continue
    return sorted(found, key=lambda run: run.written)
