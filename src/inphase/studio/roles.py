"""Which channels belong to which partner: said in as few patterns as do, and guessed where a model knows."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence

from inphase.channels import match
from inphase.errors import ChannelError, InphaseError, OptionError
from inphase.model import Model
from inphase.studio.desk import Choice, Desk


def patterns(chosen: Iterable[str], names: Sequence[str]) -> tuple[str, ...]:
    """Names or patterns that fit these channels and no other, in their order: `hand_*` for all that begin so."""
    rest = [name for name in names if name in set(chosen)]
    wanted, found = set(rest), []
    while rest:
        name = rest[0]
        for pattern in [*_stems(name), name]:
            fitting = {names[i] for i in match([pattern], names)}
            if fitting <= wanted and (pattern == name or len(fitting) > 1):
                break
        found.append(pattern)
        rest = [other for other in rest if other not in fitting]
    return tuple(found)


def _stems(name: str) -> list[str]:
    """`a_*`, `a_b_*` for a_b_c; none where the name would be a pattern itself."""
    parts = name.split("_")
    if any(mark in name for mark in "*?["):
        return []
    return ["_".join(parts[:i]) + "_*" for i in range(1, len(parts)) if any(parts[:i])]


def words(text: str) -> tuple[str, ...]:
    """Names and patterns as they are typed in a shell: those with spaces in quotes; raises OptionError."""
    try:
        return tuple(shlex.split(text))
    except ValueError as error:
        raise OptionError(f"names of channels: {text!r} cannot be taken apart: {str(error).lower()}") from None


def fitting(given: Sequence[str], names: Sequence[str]) -> set[str]:
    """The channels that fit these names and patterns; raises ChannelError for one that fits none."""
    return {names[i] for i in match(given, names)}


def check(choice: Choice, names: Sequence[str]) -> None:
    """Raise ChannelError where a pattern fits no channel, or a channel is of both partners."""
    both = fitting(choice.observed, names) & fitting(choice.controlled, names)
    if both:
        raise ChannelError(f"expected every channel to be observed or controlled, got as both: {sorted(both)[0]}")
    for patterns_of_kind in (choice.angle, choice.quaternion, choice.linear):
        fitting(patterns_of_kind, names)


def guess(desk: Desk) -> dict[str, tuple[str, ...]]:
    """The roles in the first model of the folder that has these channels; none where there is no such model."""
    names = desk.names()
    nothing: dict[str, tuple[str, ...]] = dict.fromkeys(("observed", "controlled", "angle", "quaternion", "linear"), ())
    for file in [desk.choice.model, *desk.contents.models]:
        if not file:
            continue
        try:
            model = Model.load(desk.path(file))
        except (InphaseError, OSError):
            continue
        if set(model.observed) | set(model.controlled) <= set(names):
            return {
                **nothing,
                "observed": patterns(model.observed, names),
                "controlled": patterns(model.controlled, names),
            }
    return nothing
