"""`inphase inspect`: what a model file or a data set holds."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import tyro

from inphase.cli.card import describe_dataset, describe_model, print_dataset, print_model
from inphase.cli.console import Output
from inphase.cli.evidence import print_evidence
from inphase.cli.reading import AsJson, Columns, Recordings
from inphase.errors import OptionError, listing
from inphase.model import Model


def inspect(
    source: Recordings,
    columns: tyro.conf.OmitArgPrefixes[Columns],
    report: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    json_: AsJson = False,
) -> int:
    """Show what a model file or a data set holds.

    Args:
        source: a model file (.inphase); or files, folders or globs of recordings
        columns: what the columns of recordings are
        report: of a model, show what was chosen by held-out demonstrations, and all that was tried
        json_: print as JSON
    """
    console = Output(quiet=json_)
    is_model = len(source) == 1 and Path(source[0]).suffix == ".inphase"
    if report and not is_model:
        raise OptionError(f"--report: expected a model file (.inphase), got {listing(source)}")
    if is_model:
        model = Model.load(source[0])
        card = describe_model(model)
        print_model(console, model)
        console.print(*(f"{key}: {value}" for key, value in model.provenance.items()), sep="\n")
        if report:
            print_evidence(console, model)
    else:
        dataset = columns.load(source)
        card = describe_dataset(dataset)
        print_dataset(console, dataset)
    if json_:
        json.dump(card, sys.stdout, indent=1)
        print()
    return 0
