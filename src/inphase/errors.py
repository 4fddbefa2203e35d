"""The exceptions of inphase: every mistake a user can make ends in one of these."""

from __future__ import annotations

from collections.abc import Iterable


class InphaseError(Exception):
    """Anything inphase refuses; its message is one line that names the thing, the expected and the got."""


class DataError(InphaseError, ValueError):
    """A recording or a data set cannot be used as it is."""


class ChannelError(InphaseError, ValueError):
    """A channel name, pattern, role or kind does not fit the channels at hand."""


class OptionError(InphaseError, ValueError):
    """An argument or option has a value that is not allowed."""


class ObservationError(InphaseError, ValueError):
    """A live sample has the wrong shape, an unknown channel or a time that runs backwards."""


class WorkerError(InphaseError):
    """Processes that worked for this one, or a cluster of them, are gone."""


class ModelFileError(InphaseError):
    """A model file is not one, is damaged, or was written by a newer version."""


def listing(names: Iterable[object], most: int = 12) -> str:
    """Names for an error message: 'a, b, c', cut after `most` of them."""
    shown = [str(name) for name in names]
    if not shown:
        return "none"
    rest = len(shown) - most
    return ", ".join(shown[:most]) + (f", … ({rest} more)" if rest > 0 else "")
