"""`inphase select`: which basis functions suit recordings, by three criteria."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from inphase.cli.basis_text import show_basis
from inphase.cli.console import Output, counted, waiting
from inphase.cli.reading import AsJson, Columns, Patterns, Recordings
from inphase.errors import OptionError, listing
from inphase.io.atomic import check_target
from inphase.report.look import check_picture
from inphase.report.selection_picture import draw_selection
from inphase.training.channel_selection import select_channels
from inphase.training.information import ESTIMATORS
from inphase.training.selection import CRITERIA, FAMILIES, PER, SIZES, BasisSelection, select_basis
from inphase.trajectory import Dataset

SHOWN = 6  # candidates of a unit in the table
LEGEND = """\
aic, bic, held out: of a reading, lower is better; * is what the criterion chooses
held out: how likely a demonstration is, given the others; the fewest functions that
are no worse than the best within a standard error. aic and bic count each reading as
news, which those of real sensors are not, and ask for too many functions
error: of the fit, in shares of the channels' spread"""

Names = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...")]
Sizes = Annotated[tuple[int, ...], tyro.conf.arg(metavar="INT...", help_behavior_hint="")]


def select(
    data: Recordings,
    columns: tyro.conf.OmitArgPrefixes[Columns],
    per: Annotated[str, tyro.conf.arg(metavar="|".join(PER))] = "all",
    criterion: Annotated[str, tyro.conf.arg(metavar="|".join(CRITERIA))] = "held-out",
    families: Names = FAMILIES,
    sizes: Sizes = SIZES,
    periodic: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    channels: Patterns = (),
    threshold: float = 0.07,
    estimator: Annotated[str, tyro.conf.arg(metavar="|".join(ESTIMATORS))] = "binned",
    picture: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")] = None,
    json_: AsJson = False,
) -> int:
    """Compare basis functions on recordings, or choose channels (--channels).

    Args:
        data: files, folders or globs of CSV or npz recordings, one episode a file
        columns: what the columns are
        per: what has basis functions of its own
        criterion: what the candidates are ranked by
        families: of basis functions
        sizes: numbers of functions; otherwise a range from few to many
        periodic: an episode is one cycle of an interaction that goes on and on
        channels: choose among these observed channels, names or patterns, those that say most of the controlled ones
        threshold: of the mutual information that a channel has to add [nat]
        estimator: of mutual information
        picture: draw criteria and fitted curves into this file (.png, .svg or .pdf)
        json_: print all figures as JSON
    """
    if picture is not None:
        check_picture(picture)
        check_target(picture)
    if criterion not in CRITERIA:
        raise OptionError(f"--criterion: expected one of {listing(CRITERIA)}, got {criterion!r}")
    dataset = columns.load(data)
    if channels:
        return _select_channels(dataset, channels, threshold, estimator, json_)
    with waiting("comparing basis functions"):
        selection = select_basis(dataset, families=families, sizes=sizes, per=per, periodic=periodic)
    if json_:
        json.dump(describe_selection(selection), sys.stdout, indent=1, allow_nan=False)
        print()
    console = Output(quiet=json_)
    print_selection(console, selection, criterion)
    if picture is not None:
        draw_selection(picture, dataset, selection, criterion)
        console.print(f"wrote {picture}")
    return 0


def _select_channels(dataset: Dataset, channels: Sequence[str], threshold: float, estimator: str, as_json: bool) -> int:
    with waiting("comparing channels"):
        found = select_channels(dataset, threshold, estimator, channels=channels)
    if as_json:
        json.dump({**asdict(found), "chosen": found.chosen, "names": found.names}, sys.stdout, indent=1)
        print()
        return 0
    console = Output()
    console.print(str(found))
    console.print(
        f"\ninformation: mutual information with the controlled channels, given those above [nat]; chosen are\n"
        f"those that add more than {threshold:g}, and than chance would ({found.chance:.2f} before any was chosen)",
        style="dim",
    )
    console.print(f"keep: --observed {' '.join(found.names)}" if found.names else "none says anything")
    return 0


def print_selection(console: Output, selection: BasisSelection, criterion: str) -> None:
    """For every unit the best candidates by a criterion, and those that the other criteria would choose."""
    console.print(f"{counted(len(selection.candidates), 'candidate')}, the best by {criterion} first")
    tables = {name: selection.values(name) for name in CRITERIA}
    for u, unit in enumerate(selection.units):
        console.print(f"\n{unit}", style="bold")
        console.print(f"{'':24}" + "".join(f"{name:>12}" for name in (*CRITERIA, "error")))
        order = np.argsort(tables[criterion][u], kind="stable")[:SHOWN].tolist()
        best = {name: selection.chosen(name)[u] for name in CRITERIA}
        for i in [*order, *(at for at in dict.fromkeys(best.values()) if at not in order)]:
            cells = [f"{tables[name][u, i]:11.3f}" + (" ", "*")[best[name] == i] for name in CRITERIA]
            error = f"{100 * selection.error_std[u, i]:10.2f} %"
            console.print(f"{show_basis(selection.candidates[i]):24}" + "".join(cells) + error)
    console.print(f"\n{LEGEND}", style="dim")
    if len(selection.units) == 1:
        chosen = selection.candidates[selection.chosen(criterion)[0]]
        console.print(f"take it: inphase fit … --basis {show_basis(chosen)}")


def describe_selection(selection: BasisSelection) -> dict[str, Any]:
    """All figures as plain values; None where a candidate has too many functions."""
    tables = {name: selection.values(name) for name in CRITERIA} | {"error": selection.error_std}
    return {
        "units": [{"name": n, "channels": list(of)} for n, of in zip(selection.units, selection.members, strict=True)],
        "candidates": [
            {"family": type(basis).__name__.lower(), **basis.parameters()}
            | {
                name: [float(v) if np.isfinite(v) else None for v in values[:, i].tolist()]
                for name, values in tables.items()
            }
            for i, basis in enumerate(selection.candidates)
        ],
        "best": {name: {c: show_basis(b) for c, b in selection.best(name).items()} for name in CRITERIA},
    }
