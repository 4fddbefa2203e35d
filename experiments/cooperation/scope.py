"""What the study plays: at which tempos, of which demonstrations, by whom."""

from __future__ import annotations

from collections.abc import Sequence

from experiments.cooperation.demonstrations import DEMONSTRATIONS, PLACES
from experiments.study import Settings
from experiments.study.follower import MARKS

RATIOS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0)
TIMED = (0.25, 0.5, 1.0, 2.0, 4.0)
SHARES = tuple(range(1, MARKS, 2))  # of the marks: 0.1, 0.2 … of an interaction
COMPARED = ("mean", "BIP", "eBIP, calibrated", "rbpf")  # for what is worn
LIVE = ("led", "mean", "BIP", "eBIP, calibrated", "rbpf")


def ratios(settings: Settings) -> tuple[float, ...]:
    """Of lengths: so many times as many samples as were demonstrated."""
    return (0.5, 1.0) if settings.quick else RATIOS


def count(settings: Settings) -> int:
    """Of demonstrations, in each place."""
    return 5 if settings.quick else DEMONSTRATIONS


def folds(settings: Settings) -> range:
    """The demonstrations that are left out and played."""
    return range(1 if settings.quick else DEMONSTRATIONS)


def trials(settings: Settings) -> int:
    """Done together, by each method in each place."""
    return 1 if settings.quick else 40


def played(settings: Settings, worn: Sequence[str]) -> list[tuple[str, str, int]]:
    """Place, what is worn and the demonstration that is left out, of all that is played."""
    return [(place, what, fold) for place in PLACES for what in worn for fold in folds(settings)]


def slug(method: str) -> str:
    """A method's name as a part of a label."""
    return method.replace(", ", "-")
