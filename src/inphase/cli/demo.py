"""`inphase demo`: the main job on real data, from nothing to a picture."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import tyro

from inphase.cli.console import Output, working
from inphase.cli.demo_live import demo_live
from inphase.cli.evidence import summary
from inphase.cli.follow import follow
from inphase.cli.jobs import processes
from inphase.cli.picture import panel
from inphase.cli.program import program
from inphase.cli.reading import FilterName
from inphase.cli.scores import LEGEND, ScoreTable, figures
from inphase.errors import OptionError, listing
from inphase.filters import FILTERS, RECOMMENDED
from inphase.io import load
from inphase.io.handwriting import check_shapes, export_handwriting
from inphase.report.look import check_picture
from inphase.report.replay_picture import draw_replays
from inphase.training import fit

SHAPES = ("Angle", "GShape", "Sine", "Sshape")
LIVE = ("Sine",)


def demo(
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("inphase-demo"),
    shapes: Annotated[tuple[str, ...], tyro.conf.arg(metavar="SHAPE...")] = SHAPES,
    filter: FilterName = RECOMMENDED,
    seed: int = 0,
    calibrate: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    live: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    duration: Annotated[float | None, tyro.conf.arg(metavar="SECONDS", help_behavior_hint="")] = None,
) -> int:
    """Learn from real human handwriting, and follow a hand that was never seen; or, live, one that is simulated.

    Args:
        output: the folder for recordings, models and the picture
        shapes: of the LASA handwriting data set
        filter: how phase and weights are inferred
        seed: of the filter's random numbers
        calibrate: choose noise, tempo and more by held-out demonstrations, as `inphase fit` does: some minutes
        live: lead a simulated robot in real time, as OUTPUT/live.toml says, which is written to be copied
        duration: of the live run, at most
    """
    if live:
        return demo_live(output, LIVE if shapes == SHAPES else shapes, filter, seed, calibrate, duration)
    if duration is not None:
        raise OptionError("a duration is that of a live run: expected --live too")
    picture = output / "demo.png"
    _check(output, picture, shapes, filter)
    console = Output()
    console.print("Handwriting: the pen's x is the partner who is seen, its y the robot's answer.")
    if not calibrate:
        console.print("To be short, nothing is calibrated by held-out demonstrations: --calibrate does.")
    console.print()
    table, results, panels = ScoreTable(console, shapes), [], []
    for shape in shapes:
        export_handwriting(shape, output / shape)
        dataset = load(output / shape, observed=["x"], controlled=["y"], units={"*": "mm"})
        last = dataset[-1]
        with working(f"{shape}: learning from {len(dataset) - 1} demonstrations") as progress:
            model = fit(dataset.without(-1), calibrate=calibrate, jobs=processes(), progress=progress)
        model.save(output / f"{shape}.inphase")
        console.print(f"{shape}: learned from {len(dataset) - 1} demonstrations, following the one left out")
        if calibrate:
            console.print(summary(model), style="dim")
        played, _ = follow(console, model.session(filter, seed), last)
        console.print()
        results.append(figures(model, last, played))
        panels.append(panel(shape, model, last, played))
    table.print_head()
    for shape, found in zip(shapes, results, strict=True):
        table.print_row(shape, found)
    console.print(LEGEND, style="dim")
    draw_replays(picture, panels)
    console.print(f"\nwrote the picture {picture}, and models and recordings beside it")
    console.print("next, try:", style="bold")
    model_file, recordings = output / f"{shapes[-1]}.inphase", output / shapes[-1]
    for words in (
        ["inspect", model_file],
        ["replay", model_file, recordings / f"{last.name}.csv", "--filter", "bip"],
        ["report", model_file, recordings / f"{last.name}.csv", "-o", "report.html"],
        ["fit", recordings, "--observed", "x", "--controlled", "y", "--report", "-o", "my.inphase"],
    ):
        console.print(f"  {program()} {shlex.join(map(str, words))}")
    return 0


def _check(output: Path, picture: Path, shapes: tuple[str, ...], filter: str) -> None:
    """Refuse what cannot end well, before anything is written."""
    if output.exists() and not output.is_dir():
        raise OptionError(f"cannot write into {output}: expected a folder, got a file")
    if not shapes:
        raise OptionError(f"expected at least one shape, such as {listing(SHAPES)}, got none")
    check_shapes(shapes)
    if filter not in FILTERS:
        raise OptionError(f"unknown filter {filter!r}; one of {listing(FILTERS)}")
    check_picture(picture)
