"""What an entry of a TOML file is made into, by the annotation of the parameter that it is for."""

from __future__ import annotations

import enum
import inspect
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from inphase.errors import listing

WORDS = {float: "a number", int: "a whole number", str: "a text", bool: "true or false", Path: "a path"}
ABSENT = type(None)


def hints_of(make: Callable[..., Any]) -> dict[str, Any]:
    """The types of its parameters; one that is only there for a type checker counts as any."""
    function = make.func if isinstance(make, partial) else make
    if inspect.isclass(function):
        function = function.__init__
    elif not inspect.isroutine(function):
        function = type(function).__call__
    names = getattr(inspect.unwrap(function), "__globals__", {})
    hints = {}
    for name, parameter in inspect.signature(make).parameters.items():
        if parameter.annotation is not parameter.empty:
            alone = types.SimpleNamespace(__annotations__={name: parameter.annotation})
            try:
                hints[name] = typing.get_type_hints(alone, names)[name]
            except (NameError, TypeError, AttributeError, SyntaxError):  # what it takes, it has to check itself
                continue
    return hints


def converted(value: Any, kind: Any, folder: Path) -> Any:
    """The value as that type, a path relative to the folder; raises ValueError that says what was expected.

    A type that TOML knows nothing of is left to whoever asked for it: the value comes as it is.
    """
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return _converted_to_one(value, [part for part in inner if part is not ABSENT], folder)
    if _is_enum(kind) or origin is Literal:
        options = {member.value: member for member in kind} if origin is None else {option: option for option in inner}
        found = [option for known, option in options.items() if known == value and type(known) is type(value)]
        if not found:
            raise ValueError(words(kind))
        return found[0]
    if _is_path(kind):
        return _path(value, folder)
    if kind in WORDS:
        return _plain(value, kind)
    if _is_array(kind):
        return _array(value)
    what = origin or kind
    if _is_a(what, Mapping):
        if not isinstance(value, Mapping):
            raise ValueError(words(kind))
        return {key: converted(part, inner[1], folder) if inner else part for key, part in value.items()}
    if _is_a(what, Iterable) and what is not Any:
        if not isinstance(value, list):
            raise ValueError(words(kind))
        return _collected(value, kind, folder)
    return value


def words(kind: Any) -> str:
    """What a message calls a type."""
    origin = typing.get_origin(kind)
    inner = [part for part in typing.get_args(kind) if part not in (ABSENT, Ellipsis)]
    if _is_enum(kind):
        return f"one of {listing(str(member.value) for member in kind)}"
    if origin is Literal:
        return f"one of {listing(inner)}"
    if _is_path(kind):
        return WORDS[Path]
    if origin not in (typing.Union, types.UnionType):
        if kind in WORDS:
            return WORDS[kind]
        if _is_array(kind):
            return "a list of numbers"
        if _is_a(origin or kind, Mapping):
            return f"a table of {words(inner[1])} by name" if inner else "a table"
        if _is_a(origin or kind, tuple) and inner and Ellipsis not in typing.get_args(kind):
            return f"a list of {len(inner)}: {', '.join(map(words, inner))}"
        if _is_a(origin or kind, Iterable):
            return f"a list: {words(inner[0])} each" if inner else "a list"
        return "a value"
    return " or ".join(dict.fromkeys(map(words, inner)))


def _converted_to_one(value: Any, kinds: Sequence[Any], folder: Path) -> Any:
    expected = []
    for kind in sorted(kinds, key=lambda kind: not _is_path(kind)):  # what may be a path is one
        try:
            return converted(value, kind, folder)
        except ValueError as error:
            expected.append(str(error))
    raise ValueError(" or ".join(dict.fromkeys(expected)))


def _collected(value: list[Any], kind: Any, folder: Path) -> Any:
    what, inner = typing.get_origin(kind) or kind, typing.get_args(kind)
    if what is tuple and inner and inner[-1] is not Ellipsis:
        if len(value) != len(inner):
            raise ValueError(words(kind))
        return tuple(converted(part, k, folder) for part, k in zip(value, inner, strict=True))
    parts = [converted(part, inner[0], folder) if inner else part for part in value]
    return what(parts) if what in (list, set, frozenset) else tuple(parts)


def _plain(value: Any, kind: Any) -> Any:
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            raise ValueError("a number that is not so large") from None
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise ValueError(WORDS[kind])
    return value


def _path(value: Any, folder: Path) -> Path:
    if not isinstance(value, str) or not value or "\0" in value:
        raise ValueError(WORDS[Path])
    try:
        return folder / Path(value).expanduser()
    except RuntimeError:  # as ~nobody/here
        raise ValueError("a path in a home that is there") from None


def _array(value: Any) -> Any:
    def numbers(part: Any) -> Any:
        return [numbers(inner) for inner in part] if isinstance(part, list) else _plain(part, float)

    try:
        return np.array(numbers(value), dtype=np.float64)
    except ValueError:
        raise ValueError("a list of numbers") from None


def _is_array(kind: Any) -> bool:
    return (
        kind is np.ndarray or typing.get_origin(kind) is np.ndarray or getattr(kind, "array_type", None) is np.ndarray
    )


def _is_path(kind: Any) -> bool:
    return kind is Path or PathLike in (kind, typing.get_origin(kind))


def _is_enum(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, enum.Enum)


def _is_a(kind: Any, base: type) -> bool:
    return isinstance(kind, type) and issubclass(kind, base)
