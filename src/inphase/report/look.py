"""How all pictures look, and whether one can be drawn at all."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from inphase.errors import OptionError, listing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES = (".png", ".svg", ".pdf")
NINETY = 1.6449  # standard deviations on either side that hold 90 % of a Gaussian
INK, NOW, PAST, LINE = "#22272e", "#0b6e99", "#9aa3ad", "#e6e9ed"
COLOURS = ("#0b6e99", "#d1603d", "#e9a23b", "#3f8f5f", "#8e3b46", "#6d5aa8")
BAND = 0.22  # the opacity of a 90 % band


def check_matplotlib() -> None:
    """Raise OptionError where matplotlib is not installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise OptionError("pictures need matplotlib: pip install 'inphase[plot]'") from None


def check_picture(path: str | PathLike[str]) -> None:
    """Raise OptionError where no such picture can be drawn: before the work of which it is to tell."""
    check_matplotlib()
    if Path(path).suffix.lower() not in SUFFIXES:
        raise OptionError(f"unknown kind of picture {str(path)!r}; its name must end in {listing(SUFFIXES)}")


def plain(axes: Axes, grid: str = "both") -> None:
    """Nothing but what tells something. grid: the lines that are kept, "x", "y" or "both"."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis=grid, color=LINE, lw=0.7)  # type: ignore[arg-type]
    axes.set_axisbelow(True)


def with_unit(name: str, unit: str) -> str:
    """A name as a label, with its unit where it has one."""
    return verbatim(f"{name} [{unit}]" if unit else name)


def verbatim(text: str) -> str:
    """The text as it stands: matplotlib takes what is between dollar signs for mathematics."""
    return text.replace("$", r"\$")
