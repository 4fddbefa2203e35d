"""`inphase fit`: recordings in, model file out."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from inphase import basis as families
from inphase.basis import Basis
from inphase.cli.card import describe_model, print_model
from inphase.cli.reading import Columns
from inphase.errors import OptionError
from inphase.training import fit as fit_model
from inphase.training import learn_phase


def fit(
    data: tyro.conf.Positional[tuple[str, ...]],
    columns: tyro.conf.OmitArgPrefixes[Columns],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("model.inphase"),
    basis: str = "",
    order: int = 1,
    periodic: bool = False,
    json_: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> int:
    """Learn a model from recordings.

    Args:
        data: files, folders or globs of CSV or npz episodes
        columns: what the columns are
        output: the model file to write
        basis: basis functions of every channel, as family:size (gaussian:15); by default the library's choice
        order: 0 phase alone, 1 with tempo, 2 with a tempo that accelerates
        periodic: an episode is one cycle of an interaction that goes on and on
        json_: print the model's card as JSON
    """
    dataset = columns.load(data)
    phase = learn_phase(dataset, order, periodic)
    model = fit_model(dataset, basis=_basis(basis) if basis else None, phase=phase)
    model.save(output)
    if json_:
        json.dump({"model": str(output), **describe_model(model)}, sys.stdout, indent=1)
        print()
        return 0
    console = Console(highlight=False)
    print_model(console, model)
    console.print(f"wrote {output} ({output.stat().st_size / 1e3:.0f} kB)", soft_wrap=True)
    return 0


def _basis(text: str) -> Basis:
    """The basis of `family:size`, or `family:size:width`."""
    family, *numbers = text.split(":")
    try:
        size = int(numbers[0])
        width = [float(number) for number in numbers[1:]]
    except (IndexError, ValueError):
        raise OptionError(f"basis: expected family:size or family:size:width, got {text!r}") from None
    if family == "polynomial":
        return families.make(family, degree=size)
    return families.make(family, size=size, **({"width": width[0]} if width else {}))
