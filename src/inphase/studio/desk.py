"""What the tabs of one page share: the folder, what is chosen, and who runs commands."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from inphase.errors import DataError
from inphase.io import Table, read_episode
from inphase.io.files import episode_names
from inphase.studio.command import Value
from inphase.studio.folder import Contents, look
from inphase.studio.memory import Memory
from inphase.studio.worker import Worker

KEPT = 3  # recordings that are read stay so
PARTS = ("episodes", "models", "runs")
READ = 5  # files that are tried for the names of channels


@dataclass(frozen=True)
class Choice:
    """What is chosen; files are named from the studio's folder.

    recordings: files and folders of recordings, as every command takes them. observed, controlled: channels of either
    partner. angle, quaternion, linear: channels whose kind was said. model: a model file.
    """

    recordings: tuple[str, ...] = ()
    observed: tuple[str, ...] = ()
    controlled: tuple[str, ...] = ()
    angle: tuple[str, ...] = ()
    quaternion: tuple[str, ...] = ()
    linear: tuple[str, ...] = ()
    model: str = ""

    @property
    def columns(self) -> dict[str, Value]:
        """The roles and kinds of channels, as options of a command."""
        return {name: getattr(self, name) for name in ("observed", "controlled", "angle", "quaternion", "linear")}


class Desk:
    """What the tabs of one page share.

    folder: the studio's, absolute. choice: what is chosen, replaced by `choose`. contents: what is in the folder,
    looked through by `look`. worker: runs commands. pages: a folder whose files the page can show, at their
    `address_of`. memory: what was found out of recordings, for when the page is loaded again.
    every: has a function called every so many milliseconds, for as long as the page is there.
    """

    def __init__(
        self,
        folder: Path,
        worker: Worker,
        pages: Path,
        address: str,
        choice: Choice | None = None,
        memory: Memory | None = None,
        every: Callable[[Callable[[], None], int], object] = lambda call, milliseconds: None,
    ) -> None:
        self.folder, self.worker, self.pages, self.every = folder, worker, pages, every
        self.choice = choice or Choice()
        self.memory = memory if memory is not None else Memory()
        self.contents: Contents = look(folder)
        self._address = address.rstrip("/")
        self._listeners: list[tuple[frozenset[str], Callable[[], None]]] = []
        self._tables: dict[tuple[str, float], Table] = {}
        if not set(self.choice.recordings) <= set(self.contents.episodes):
            self.choice = replace(self.choice, recordings=())
        if not self.choice.recordings:
            self.choice = replace(self.choice, recordings=tuple(self.contents.episodes)[:1])
        if self.choice.model not in self.contents.models:
            self.choice = replace(self.choice, model=self.contents.models[0] if self.contents.models else "")

    @property
    def episodes(self) -> dict[str, str]:
        """The files of the chosen recordings, by the names that every command has for them."""
        files = [name for place in self.choice.recordings for name in self.contents.episodes.get(place, ())]
        return dict(zip(episode_names([Path(name) for name in files]), files, strict=True))

    def table(self, file: str) -> Table:
        """What stands in a file of recordings; raises DataError. The last few are kept."""
        path = self.folder / file
        try:
            key = (file, path.stat().st_mtime)
        except OSError as error:
            raise DataError(f"{file}: cannot be read: {error.strerror}") from None
        if key not in self._tables:
            while len(self._tables) >= KEPT:
                del self._tables[next(iter(self._tables))]
            self._tables[key] = read_episode(path)
        return self._tables[key]

    def names(self) -> tuple[str, ...]:
        """The channels of the chosen recordings, as the first that can be read has them; none where none can."""
        for file in list(self.episodes.values())[:READ]:
            with suppress(DataError):
                return self.table(file).columns
        return ()

    def listen(self, what: str, told: Callable[[], None]) -> None:
        """Have it called when one of these is another: fields of the choice or of the contents, spaces between."""
        self._listeners.append((frozenset(what.split()), told))

    def choose(self, **changed: object) -> None:
        """Choose something else, and tell those who listen."""
        before, self.choice = self.choice, replace(self.choice, **changed)  # type: ignore[arg-type]
        self._tell({name for name in changed if getattr(before, name) != getattr(self.choice, name)})

    def look(self) -> None:
        """Look through the folder once more, and tell those who listen where it holds something else."""
        before, self.contents = self.contents, look(self.folder)
        self._tell({name for name in PARTS if getattr(before, name) != getattr(self.contents, name)})

    def path(self, name: str) -> Path:
        """The file of that name, as the choice and the contents name it."""
        return self.folder / name

    def address_of(self, page: Path) -> str:
        """Where the page is served, a file in `pages`."""
        return f"{self._address}/{page.relative_to(self.pages).as_posix()}"

    def _tell(self, changed: set[str]) -> None:
        for what, told in list(self._listeners):
            if what & changed:
                told()
