"""A study: parts in their order, each of them independent tasks, and what is told of their results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from experiments.study.page import Page
from experiments.study.stored import Found, Stored
from inphase.errors import OptionError, listing

Task: TypeAlias = Callable[[], Mapping[str, Any]]
task = partial  # so that a table of tasks reads well: task(play, fold=3)


@dataclass(frozen=True)
class Settings:
    """How a study is conducted. folder: where its results are. labels: of the tasks of the parts so far."""

    quick: bool
    seed: int
    folder: Path
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def of(self, part: str) -> Stored:
        """The results of another part, which a task may be given: they are read when asked for."""
        return Stored(self.folder / part, self.labels.get(part))


@dataclass(frozen=True)
class Part:
    """One table or figure of a study, or what others need.

    what: its heading, which names the table or figure of the dissertation. tasks: by label; each returns numbers and
    arrays by name, drawn from the seed and its label alone. tell: writes what was found, by label. needs: parts whose
    results are read.
    """

    what: str
    tasks: Callable[[Settings], Mapping[str, Task]]
    tell: Callable[[Settings, Found, Page], None]
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Study:
    """A study of the dissertation. title: with its section. says: what it is, in a paragraph. modules: its needs."""

    title: str
    says: str
    parts: Mapping[str, Part]
    modules: tuple[str, ...] = ("matplotlib",)

    def chosen(self, names: tuple[str, ...]) -> dict[str, bool]:
        """The parts to run, in order: whether they are told, too, or only needed by others. None named: all."""
        unknown = [name for name in names if name not in self.parts]
        if unknown:
            raise OptionError(f"unknown part {unknown[0]!r}; valid: {listing(self.parts)}")
        wanted = set(names or self.parts)
        needed = set(wanted)
        for name in reversed(list(self.parts)):  # what a part needs stands before it
            if name in needed:
                needed.update(self.parts[name].needs)
        return {name: name in wanted for name in self.parts if name in needed}
