"""`inphase fit`: recordings in, model file out."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from inphase.cli.basis_text import parse_basis
from inphase.cli.card import describe_model, print_model
from inphase.cli.console import Output, counted, working
from inphase.cli.evidence import print_evidence
from inphase.cli.jobs import Jobs
from inphase.cli.reading import AsJson, Columns, Recordings
from inphase.errors import OptionError, listing
from inphase.io import find_episodes, read_episode
from inphase.io.atomic import check_target
from inphase.training import fit as fit_model
from inphase.training import learn_phase

Flag = Annotated[bool, tyro.conf.arg(help_behavior_hint="")]


def fit(
    data: Recordings,
    columns: tyro.conf.OmitArgPrefixes[Columns],
    jobs: tyro.conf.OmitArgPrefixes[Jobs],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("model.inphase"),
    basis: Annotated[str | None, tyro.conf.arg(metavar="FAMILY:SIZE", help_behavior_hint="")] = None,
    noise_bias: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=STD...", help_behavior_hint="")] = (),
    order: int = 1,
    periodic: Flag = False,
    quick: Flag = False,
    report: Flag = False,
    json_: AsJson = False,
) -> int:
    """Learn a model from recordings.

    Noise, tempo, uncertainty and more are chosen by playing held-out recordings.

    Args:
        data: files, folders or globs of CSV or npz recordings, one episode a file
        columns: what the columns are
        jobs: who plays held-out recordings
        output: the model file to write
        basis: basis functions of every channel, such as gaussian:15; otherwise the library's choice
        noise_bias: standard deviations added to the noise of channels, in their unit, such as head_x=0.05
        order: of the phase: 0 alone, 1 with tempo, 2 with a tempo that accelerates
        periodic: an episode is one cycle of an interaction that goes on and on
        quick: hold nothing out: a second instead of a minute or more, but a model that nobody tested
        report: print all that was tried, and how well each followed the held-out recordings
        json_: print the model's card, and the report, as JSON
    """
    check_target(output)
    jobs.check()
    chosen = parse_basis(basis) if basis is not None else None
    if not (columns.observed and columns.controlled):
        first = read_episode(find_episodes(data)[0], time=columns.time, delimiter=columns.separator)
        raise OptionError(
            f"expected --observed and --controlled, the channels of either partner; "
            f"{first.name} has the channels {listing(first.columns)}"
        )
    dataset = columns.load(data)
    # The usual phase is learned anew for every model that some demonstrations are held out from.
    phase = None if order == 1 and not periodic else learn_phase(dataset, order, periodic)
    doing = f"learning from {counted(len(dataset), 'demonstration')}"
    with jobs.opened() as workers, working(doing) as progress:
        model = fit_model(
            dataset,
            basis=chosen,
            noise_bias=_biases(noise_bias),
            phase=phase,
            calibrate=not quick,
            progress=progress,
            **workers,
        )
    model.save(output)
    if json_:
        json.dump({"model": str(output), **describe_model(model)}, sys.stdout, indent=1)
        print()
        return 0
    console = Output()
    print_model(console, model)
    if report:
        print_evidence(console, model)
    console.print(f"wrote {output} ({output.stat().st_size / 1e3:.0f} kB)")
    return 0


def _biases(given: Sequence[str]) -> dict[str, float]:
    """Name or pattern → standard deviation; raises OptionError for what is no NAME=STD."""
    biases = {}
    for text in given:
        name, _, std = text.rpartition("=")
        try:
            biases[name] = float(std)
        except ValueError:
            raise OptionError(f"--noise-bias: expected NAME=STD, got {text!r}") from None
        if not name:
            raise OptionError(f"--noise-bias: expected NAME=STD, got {text!r}")
    return biases
