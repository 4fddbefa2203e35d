"""A recorded run once more: the same samples through a new session give the same estimates, to the last bit."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import fields
from math import isfinite
from typing import Any

from inphase.errors import DataError, OptionError
from inphase.filters import RECOMMENDED
from inphase.io.model_file import model_hash
from inphase.model import Model
from inphase.recording import Recording
from inphase.result import Estimate
from inphase.session import Session

RESET = "reset"  # the kind of event after which a new interaction begins


def provenance_of(
    model: Model, filter: str | None = None, seed: int = 0, options: Mapping[str, Any] | None = None, **more: str
) -> dict[str, str]:
    """What it takes to make the session of a run once more: the model's hash, its filter, seed and options (as JSON).

    more: other texts, as the configuration. Raises OptionError for options that JSON cannot hold.
    """
    try:
        written = json.dumps(dict(options or {}), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise OptionError(f"expected filter options that can be written as JSON, got {options}: {error}") from None
    named = RECOMMENDED if filter is None else filter
    return {"model": model_hash(model), "filter": named, "seed": str(seed), "options": written, **more}


def session_of(recording: Recording, model: Model) -> Session:
    """A new session like the one that was recorded.

    Raises DataError where the recording does not say which it was, or was made with another model.
    """
    told = recording.provenance
    missing = [key for key in ("model", "filter", "seed", "options") if key not in told]
    if missing:
        raise DataError(f"{recording.name}: expected it to name its {', '.join(missing)}; it was not recorded live")
    if told["model"] != model_hash(model):
        raise DataError(
            f"{recording.name}: expected the model it was recorded with, {told['model'][:12]}…, "
            f"got {model_hash(model)[:12]}…"
        )
    try:
        seed, options = int(told["seed"]), dict(json.loads(told["options"]))
    except (TypeError, ValueError, RecursionError):
        raise DataError(f"{recording.name}: expected a whole number as seed and options as JSON") from None
    return model.session(told["filter"], seed, **options)


def identical(one: Estimate, other: Estimate) -> bool:
    """Whether two estimates are the same to the last bit in all they say; what is no number is that in any bits."""
    return _bits(one) == _bits(other)


def _bits(estimate: Estimate) -> list[object]:
    values = (getattr(estimate, field.name) for field in fields(estimate))
    return [float(value).hex() if isinstance(value, float) else value for value in values]


def replay(recording: Recording, model: Model) -> Iterator[Estimate]:
    """The estimate of every sample: the recorded ones, as long as none before was lost; raises as `session_of`.

    A new interaction begins with the first sample after the time of an event of the kind "reset".
    """
    for _, estimate in steps(recording, session_of(recording, model)):
        yield estimate


def steps(recording: Recording, session: Session) -> Iterator[tuple[Session, Estimate]]:
    """The session after every sample, which can be asked for what it believes then, and its estimate."""
    names = [channel.name for channel in recording.channels]
    resets = deque(sorted(event.time for event in recording.events if event.kind == RESET and isfinite(event.time)))
    for time, values in zip(recording.times, recording.values, strict=True):
        while resets and resets[0] < time:
            resets.popleft()
            session.reset()
        yield session, session.observe(float(time), dict(zip(names, values.tolist(), strict=True)))
