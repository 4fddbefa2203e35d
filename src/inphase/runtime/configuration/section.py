"""One table of a configuration: its entries are taken by name and type, and what is wrong is said with its line."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from inphase.errors import InphaseError, OptionError, listing
from inphase.runtime.configuration.entry_types import converted, hints_of, words
from inphase.runtime.configuration.toml_lines import line_of

T = TypeVar("T")
EXPECTED = re.compile(r", got |; ")  # what a message says before is about entries, behind it are values
LONGEST = 80  # of a value in a message
NEEDED = object()  # in place of a default


class Section:
    """A table of a TOML file and where it stands.

    file: what messages call it. folder: that paths in it are relative to.
    """

    def __init__(
        self, file: str, text: str, folder: Path, table: Mapping[str, Any], path: tuple[str, ...] = ()
    ) -> None:
        self.file, self.text, self.folder = file, text, folder
        self.path = path
        self._table = dict(table)

    def __contains__(self, key: str) -> bool:
        return key in self._table

    def __iter__(self) -> Iterator[str]:
        return iter(self._table)

    def fail(self, message: str, *keys: str) -> OptionError:
        """The error to raise: the message with the file, the line of that key, and its name."""
        path = (*self.path, *keys)
        where = f"{self.file}, line {line_of(self.text, path)}"
        return OptionError(f"{where}: {'.'.join(path)}: {message}" if path else f"{where}: {message}")

    def only(self, *names: str) -> None:
        """Raise OptionError for an entry of another name."""
        for key in self._table:
            if key not in names:
                raise self.fail(f"is not known here; one of {listing(names)}", key)

    def section(self, key: str) -> Section:
        """The table of that name, empty where there is none."""
        table = self._table.get(key, {})
        if not isinstance(table, Mapping):
            raise self.fail(f"expected a table, got {_shown(table)}", key)
        return Section(self.file, self.text, self.folder, table, (*self.path, key))

    def sections(self) -> dict[str, Section]:
        """All entries, which have to be tables."""
        return {key: self.section(key) for key in self._table}

    def without(self, *names: str) -> Section:
        """The same table, less these entries."""
        rest = {key: value for key, value in self._table.items() if key not in names}
        return Section(self.file, self.text, self.folder, rest, self.path)

    def get(self, key: str, kind: Any, default: Any = NEEDED) -> Any:
        """The entry as that type; raises OptionError where it is not there and there is no default."""
        if key not in self._table:
            if default is NEEDED:
                raise self.fail(f"expected {key} = {words(kind)}, got none")
            return default
        return self._convert(key, kind)

    def call(self, make: Callable[..., T], without: Sequence[str] = (), **given: Any) -> T:
        """What `make` makes of the entries as its keywords; `given` are not in the file, nor are those in `without`.

        Raises OptionError, with its line, for an entry that `make` does not know, a wrong type, one that is missing,
        and whatever `make` says is wrong.
        """
        hints, parameters = hints_of(make), inspect.signature(make).parameters
        known = {
            name: parameter
            for name, parameter in parameters.items()
            if name not in (*given, *without)
            and parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
        }
        takes_all = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
        entries = [key for key in self._table if key not in without]
        for key in entries:
            if key in given or not (key in known or takes_all):
                raise self.fail(f"is not known here; one of {listing(known)}", key)
        for name, parameter in known.items():
            if parameter.default is parameter.empty and name not in entries:
                raise self.fail(f"expected {name} = {words(hints.get(name, Any))}, got none")
        values = {key: self._convert(key, hints.get(key, Any) if key in known else Any) for key in entries}
        with self.naming([*self._table]):
            return make(**values, **given)

    @contextmanager
    def naming(self, keys: Sequence[str] = ()) -> Iterator[None]:
        """Say where: what is raised inside gets the line of the first key that it names, or that of the table."""
        try:
            yield
        except InphaseError as error:
            raise self._placed(error, *self._named(str(error), keys)) from None

    @contextmanager
    def at(self, *keys: str) -> Iterator[None]:
        """Say where: what is raised inside gets the line of that key, whatever it names."""
        try:
            yield
        except InphaseError as error:
            raise self._placed(error, *keys) from None

    def _placed(self, error: InphaseError, *keys: str) -> InphaseError:
        message = str(error)
        if message.startswith(f"{self.file}, line "):
            return error
        return self.fail(message.removeprefix(f"{self.path[-1]}: ") if self.path else message, *keys)

    def _named(self, message: str, keys: Sequence[str]) -> tuple[str, ...]:
        """Which of these entries a message is about; or which name in one that is a table or a list."""
        about = EXPECTED.split(message)[0]
        for key in keys:
            inside = self._table.get(key)
            for name in inside if isinstance(inside, (Mapping, list)) else ():
                if isinstance(name, str) and repr(name) in about:
                    return (key, name) if isinstance(inside, Mapping) else (key,)
        found = ((re.search(rf"(?<!\w){re.escape(key)}(?!\w)", about), key) for key in keys)
        return tuple(key for _, key in sorted((at.start(), key) for at, key in found if at)[:1])

    def _convert(self, key: str, kind: Any) -> Any:
        value = self._table[key]
        try:
            return converted(value, kind, self.folder)
        except ValueError as error:
            place, got = self._narrowed(key, kind)
            raise self.fail(f"expected {error}, got {_shown(got)}", *place) from None

    def _narrowed(self, key: str, kind: Any) -> tuple[tuple[str, ...], Any]:
        """What does not convert: the entry, or the first name in it where it is a table as it should be."""
        value = self._table[key]
        for name in value if isinstance(value, Mapping) else ():
            with suppress(ValueError):
                converted({}, kind, self.folder)  # else no table is wanted at all
                try:
                    converted({name: value[name]}, kind, self.folder)
                except ValueError:
                    return (key, name), value[name]
        return (key,), value


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
