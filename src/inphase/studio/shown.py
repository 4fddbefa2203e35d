"""Which few of many channels are shown: those that are named, or the busiest."""

from __future__ import annotations

import numpy as np

from inphase.channels import match
from inphase.model import Model
from inphase.studio.roles import words

PHASES = 50


def picked(model: Model, line: str, most: int) -> tuple[list[int], str]:
    """Channels by such a line of names or patterns, or the busiest where it is empty; and what was left out, in words.

    Raises ChannelError for a pattern that fits nothing, OptionError for a quotation without an end.
    """
    found = match(words(line), model.names) if line.strip() else busiest(model, most)
    there = len(found) if line.strip() else len(model.names)
    if there <= most:
        return found, ""
    which = "first" if line.strip() else "busiest"
    return found[:most], f"the {most} {which} of {there} channels; name others, or a pattern, to see them"


def busiest(model: Model, most: int) -> list[int]:
    """The channels whose mean moves most, in units of their spread: as many of either partner if there are."""
    mean = model.predict(np.linspace(0, 1, PHASES))
    movement = np.ptp(mean, axis=0) / model.spread
    count = len(model.observed)
    parts = np.arange(count), np.arange(count, len(model.names))
    ranked = [part[np.argsort(-movement[part], kind="stable")].tolist() for part in parts]
    half = most // 2
    shares = max(most - half, most - len(ranked[1])), max(half, most - len(ranked[0]))
    return sorted(ranked[0][: shares[0]] + ranked[1][: shares[1]])
