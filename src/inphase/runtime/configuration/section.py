"""One table of a configuration: its entries are taken by name and type, and what is wrong is said with its line."""

from __future__ import annotations

import enum
import inspect
import types
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from inphase.errors import InphaseError, OptionError, listing
from inphase.runtime.configuration.toml_lines import line_of

T = TypeVar("T")
WORDS = {float: "a number", int: "a whole number", str: "a text", bool: "true or false", Path: "a path"}


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
            raise self.fail(f"expected a table, got {table!r}", key)
        return Section(self.file, self.text, self.folder, table, (*self.path, key))

    def sections(self) -> dict[str, Section]:
        """All entries, which have to be tables."""
        return {key: self.section(key) for key in self._table}

    def get(self, key: str, kind: Any, default: Any = inspect.Parameter.empty) -> Any:
        """The entry as that type; raises OptionError where it is not there and there is no default."""
        if key not in self._table:
            if default is inspect.Parameter.empty:
                raise self.fail(f"expected {key} = {_words(kind)}, got none")
            return default
        return self._convert(self._table[key], kind, key)

    def call(self, make: Callable[..., T], without: Sequence[str] = (), **given: Any) -> T:
        """What `make` makes of the entries as its keywords; `given` are not in the file, nor are those in `without`.

        Raises OptionError, with its line, for an entry that `make` does not know, a wrong type, one that is missing,
        and whatever `make` says is wrong.
        """
        hints = _hints(make)
        known = {
            name: parameter
            for name, parameter in inspect.signature(make).parameters.items()
            if name not in given and name not in without and parameter.kind is not parameter.VAR_KEYWORD
        }
        entries = [key for key in self._table if key not in without]
        for key in entries:
            if key not in known:
                raise self.fail(f"is not known here; one of {listing(known)}", key)
        for name, parameter in known.items():
            if parameter.default is parameter.empty and name not in entries:
                raise self.fail(f"expected {name} = {_words(hints.get(name, Any))}, got none")
        values = {key: self._convert(self._table[key], hints.get(key, Any), key) for key in entries}
        with self.naming(entries):
            return make(**values, **given)

    @contextmanager
    def naming(self, keys: Sequence[str] = ()) -> Iterator[None]:
        """Say where: what is raised inside gets the line of the first key that it names, or that of the table."""
        try:
            yield
        except InphaseError as error:
            message = str(error)
            if message.startswith(f"{self.file}, line "):
                raise
            if self.path:
                message = message.removeprefix(f"{self.path[-1]}: ")
            named = [key for key in keys if key in message]
            raise self.fail(message, *named[:1]) from None

    def _convert(self, value: Any, kind: Any, *keys: str) -> Any:
        try:
            return _converted(value, kind, self.folder)
        except ValueError as error:
            raise self.fail(f"expected {error}, got {value!r}", *keys) from None


def _hints(make: Callable[..., Any]) -> dict[str, Any]:
    try:
        return typing.get_type_hints(make.__init__ if inspect.isclass(make) else make)
    except NameError:  # a type that is only there for a type checker: what it takes, it has to check itself
        return {}


def _converted(value: Any, kind: Any, folder: Path) -> Any:
    """The value as that type; raises ValueError that says what was expected."""
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return _converted_to_one(value, [part for part in inner if part is not type(None)], folder)
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        if value not in [member.value for member in kind]:
            raise ValueError(f"one of {listing(str(member.value) for member in kind)}")
        return kind(value)
    if kind is Path:
        if not isinstance(value, str) or not value:
            raise ValueError(_words(kind))
        return folder / Path(value).expanduser()
    if kind in WORDS:
        return _plain(value, kind)
    if origin in (dict, Mapping) or kind in (dict, Mapping) or getattr(origin, "__name__", "") == "Mapping":
        if not isinstance(value, Mapping):
            raise ValueError(_words(kind))
        return {key: _converted(part, inner[1], folder) if inner else part for key, part in value.items()}
    if origin in (tuple, list) or getattr(origin, "__name__", "") == "Sequence":
        if not isinstance(value, list):
            raise ValueError(_words(kind))
        if origin is tuple and inner and inner[-1] is not Ellipsis:
            if len(value) != len(inner):
                raise ValueError(_words(kind))
            return tuple(_converted(part, k, folder) for part, k in zip(value, inner, strict=True))
        return tuple(_converted(part, inner[0], folder) if inner else part for part in value)
    if _is_array(kind):
        return _array(value)
    return value


def _converted_to_one(value: Any, kinds: Sequence[Any], folder: Path) -> Any:
    expected = []
    for kind in kinds:
        try:
            return _converted(value, kind, folder)
        except ValueError as error:
            expected.append(str(error))
    raise ValueError(" or ".join(dict.fromkeys(expected)))


def _plain(value: Any, kind: Any) -> Any:
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise ValueError(WORDS[kind])
    return value


def _is_array(kind: Any) -> bool:
    return isinstance(kind, type) and getattr(kind, "array_type", None) is np.ndarray  # of jaxtyping


def _array(value: Any) -> Any:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError("numbers") from None


def _words(kind: Any) -> str:
    """What a message calls a type."""
    inner = [part for part in typing.get_args(kind) if part is not type(None)]
    name = getattr(typing.get_origin(kind), "__name__", "")
    if kind in WORDS:
        return WORDS[kind]
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return f"one of {listing(str(member.value) for member in kind)}"
    if name == "Mapping" and len(inner) == 2:
        return f"a table of {_words(inner[1])} by name"
    if name in ("tuple", "list", "Sequence") and inner:
        return f"a list: {_words(inner[0])} each"
    return " or ".join(dict.fromkeys(map(_words, inner))) if inner else "numbers"
