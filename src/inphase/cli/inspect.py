"""`inphase inspect`: what a model file or a data set holds."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from inphase.cli.card import describe_dataset, describe_model, print_dataset, print_model
from inphase.cli.reading import Columns
from inphase.model import Model


def inspect(
    source: tyro.conf.Positional[tuple[str, ...]],
    columns: tyro.conf.OmitArgPrefixes[Columns],
    json_: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> int:
    """Show what a model file or a data set holds.

    Args:
        source: a model file (.inphase), or files, folders or globs of episodes
        columns: what the columns of a data set are
        json_: print as JSON
    """
    console = Console(highlight=False)
    if len(source) == 1 and Path(source[0]).suffix == ".inphase":
        model = Model.load(source[0])
        if not json_:
            print_model(console, model)
            for key, value in model.provenance.items():
                console.print(f"{key}: {value}", soft_wrap=True)
            return 0
        card = describe_model(model)
    else:
        dataset = columns.load(source)
        if not json_:
            print_dataset(console, dataset)
            return 0
        card = describe_dataset(dataset)
    json.dump(card, sys.stdout, indent=1)
    print()
    return 0
