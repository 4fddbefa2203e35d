"""`inphase fit`: recordings in, model file out."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import tyro

from inphase.cli.basis_text import parse_basis
from inphase.cli.card import describe_model, print_model
from inphase.cli.console import Output, waiting
from inphase.cli.reading import AsJson, Columns, Recordings
from inphase.errors import OptionError, listing
from inphase.io import find_episodes, read_episode
from inphase.io.atomic import check_target
from inphase.training import fit as fit_model
from inphase.training import learn_phase


def fit(
    data: Recordings,
    columns: tyro.conf.OmitArgPrefixes[Columns],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("model.inphase"),
    basis: Annotated[str | None, tyro.conf.arg(metavar="FAMILY:SIZE", help_behavior_hint="")] = None,
    order: int = 1,
    periodic: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    json_: AsJson = False,
) -> int:
    """Learn a model from recordings.

    Args:
        data: files, folders or globs of CSV or npz recordings, one episode a file
        columns: what the columns are
        output: the model file to write
        basis: basis functions of every channel, such as gaussian:15; otherwise the library's choice
        order: of the phase: 0 alone, 1 with tempo, 2 with a tempo that accelerates
        periodic: an episode is one cycle of an interaction that goes on and on
        json_: print the model's card as JSON
    """
    check_target(output)
    chosen = parse_basis(basis) if basis is not None else None
    if not (columns.observed and columns.controlled):
        first = read_episode(find_episodes(data)[0], time=columns.time, delimiter=columns.separator)
        raise OptionError(
            f"expected --observed and --controlled, the channels of either partner; "
            f"{first.name} has the channels {listing(first.columns)}"
        )
    dataset = columns.load(data)
    with waiting(f"learning from {len(dataset)} demonstrations"):
        model = fit_model(dataset, basis=chosen, phase=learn_phase(dataset, order, periodic))
    model.save(output)
    if json_:
        json.dump({"model": str(output), **describe_model(model)}, sys.stdout, indent=1)
        print()
        return 0
    console = Output()
    print_model(console, model)
    console.print(f"wrote {output} ({output.stat().st_size / 1e3:.0f} kB)")
    return 0
