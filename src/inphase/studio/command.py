"""Command lines of inphase: what the studio does is what they do, typed in a shell in its folder."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath

Value = str | int | float | bool | PurePath | Sequence[str] | None


@dataclass(frozen=True)
class Command:
    """A command line, to be run in the studio's folder.

    arguments: what follows `inphase`.
    """

    arguments: tuple[str, ...]

    @classmethod
    def of(cls, name: str, *positional: str, options: Mapping[str, Value] | None = None) -> Command:
        """`inphase name positional… --option value…`.

        options: by their names, without the dashes before them. None, False and no values leave one out; True is a
        flag.
        """
        arguments = [name, *(as_path(part) for part in positional)]
        for option, value in (options or {}).items():
            if value is None or value is False or (isinstance(value, Sequence) and not len(value)):
                continue
            arguments.append(f"--{option}" if len(option) > 1 else f"-{option}")
            if value is not True:
                several = not isinstance(value, str) and isinstance(value, Sequence)
                arguments += map(str, value) if several else [str(value)]  # type: ignore[arg-type]
        return cls(tuple(arguments))

    @property
    def shown(self) -> str:
        """As it is typed in a shell."""
        return shlex.join(["inphase", *self.arguments])

    @property
    def run_as(self) -> list[str]:
        """As it is run: the inphase of this very Python."""
        return [sys.executable, "-m", "inphase.cli", *self.arguments]


def as_path(name: str) -> str:
    """A file's name that is not taken for an option."""
    return f"./{name}" if name.startswith("-") else name
