"""What commands printed of files that have not changed since."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from inphase.studio.command import Command

KEPT = 8  # outputs
Key = tuple[Command, tuple[tuple[str, int, int], ...]]


class Memory:
    """The outputs of a few commands, by the command and the state of the files it read."""

    def __init__(self) -> None:
        self._kept: dict[Key, str] = {}

    def key(self, command: Command, files: Iterable[Path]) -> Key:
        """By which the output of this command is known, as the files are now."""
        return command, tuple(_state(path) for path in files)

    def get(self, key: Key) -> str | None:
        """What it printed; None where that is not known."""
        return self._kept.get(key)

    def keep(self, key: Key, output: str) -> None:
        """What it printed."""
        while len(self._kept) >= KEPT:
            del self._kept[next(iter(self._kept))]
        self._kept[key] = output


def _state(path: Path) -> tuple[str, int, int]:
    try:
        found = path.stat()
    except OSError:
        return str(path), 0, 0
    return str(path), found.st_mtime_ns, found.st_size
