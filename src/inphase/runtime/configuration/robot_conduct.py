"""What a configuration says of how its robot is led: limits, smoothing, safety."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from inphase.channels import match
from inphase.errors import OptionError, listing
from inphase.runtime.conduct import Conduct
from inphase.runtime.configuration.devices import by_name
from inphase.runtime.configuration.section import Section
from inphase.runtime.limits import Limits
from inphase.runtime.safety import Policy
from inphase.runtime.smoothing import AlphaBeta

UNLIMITED = {"low": -np.inf, "high": np.inf, "velocity": np.inf, "acceleration": np.inf}
GUARDING = ("retreat", "silence", "late_commands", "watchdog")  # what the safety table says besides the policy


def read_policy(root: Section) -> Policy:
    """What is done about troubles."""
    return root.section("safety").call(Policy, GUARDING)


def read_conduct(root: Section, names: Sequence[str]) -> Conduct:
    """Limits, smoothing and safety of a robot with signals of these names."""
    safety = root.section("safety")
    others = [key for key in safety if key not in GUARDING]
    return safety.call(
        Conduct,
        [*others, "retreat"],
        limits=read_limits(root.section("robot").section("limits"), names),
        smoothing=root.section("smoothing").call(AlphaBeta),
        policy=read_policy(root),
        retreat=_retreat(safety, names),
    )


def read_limits(section: Section, names: Sequence[str]) -> Limits:
    """The limits of signals of these names, from a table by name or pattern; a later one overrides an earlier."""
    numbers: dict[str, dict[str, float]] = {key: {} for key in UNLIMITED}
    told: dict[str, str] = {}
    for pattern, table in section.sections().items():
        table.only(*UNLIMITED)
        with section.at(pattern):  # one that fits nothing is a mistake
            told |= dict.fromkeys((names[i] for i in match([pattern], names)), pattern)
        for key in table:
            numbers[key][pattern] = table.get(key, float)
    by_key = {key: by_name(numbers[key], names, free) for key, free in UNLIMITED.items()}
    for i, name in enumerate(names):
        try:
            Limits(**{key: values[i : i + 1] for key, values in by_key.items()})
        except OptionError as error:
            message = str(error).removeprefix("limits: ").replace("channel 0", name)
            raise section.fail(message, told[name]) from None
    return Limits(**by_key)


def no_limits(limits: Limits, names: Sequence[str]) -> tuple[str, ...]:
    """The signals that may move as fast as they like."""
    return tuple(name for name, velocity in zip(names, limits.velocity, strict=True) if velocity == np.inf)


def _retreat(safety: Section, names: Sequence[str]) -> Float[np.ndarray, " D"] | None:
    if "retreat" not in safety:
        return None
    positions = safety.get("retreat", Mapping[str, float])
    with safety.at("retreat"):
        pose = by_name(positions, names, np.nan)
    if missing := [name for name, value in zip(names, pose, strict=True) if np.isnan(value)]:
        raise safety.fail(f"expected a position of every signal, got none of {listing(missing)}", "retreat")
    return pose
