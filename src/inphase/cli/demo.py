"""`inphase demo`: the main job on real data, from nothing to a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from inphase.cli.replay import figures, panel, play, print_summary
from inphase.errors import OptionError
from inphase.io import load
from inphase.io.handwriting import export_handwriting
from inphase.report.replay_picture import draw_replays
from inphase.training import fit

SHAPES = ("Angle", "GShape", "Sine", "Sshape")


def demo(
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("inphase-demo"),
    shapes: tuple[str, ...] = SHAPES,
    filter: str = "ebip",
    seed: int = 0,
) -> int:
    """Learn from real human handwriting, and follow a hand that was never seen.

    The pen's x is taken for the partner and its y for the robot. For every shape a model is trained on all
    demonstrations but the last; the last is then played sample by sample, x alone, and y is answered.

    Args:
        output: the folder for recordings, models and the picture
        shapes: of the LASA handwriting data set
        filter: how phase and weights are inferred: bip or ebip
        seed: of the filter's random numbers
    """
    console = Console(highlight=False)
    if output.exists() and not output.is_dir():
        raise OptionError(f"cannot write into {output}: expected a folder, got a file")
    results, panels = [], []
    for shape in shapes:
        export_handwriting(shape, output / shape)
        dataset = load(str(output / shape), observed=["x"], controlled=["y"], units={"*": "mm"})
        last = dataset[len(dataset) - 1]
        model = fit(dataset.without(len(dataset) - 1))
        model.save(output / f"{shape}.inphase")
        console.rule(f"{shape}: trained on {len(dataset) - 1} demonstrations, following the one left out", align="left")
        played, update = play(console, model, last, filter, seed)
        results.append({"episode": shape, **figures(model, last, played), "update": update})
        panels.append(panel(shape, model, last, played))
    console.rule("how well y was answered, x alone being seen", align="left")
    print_summary(console, results, filter)
    picture = output / "demo.png"
    draw_replays(picture, panels)
    shape = shapes[-1]
    console.print(f"\nwrote the picture {picture}, models and recordings into {output}", soft_wrap=True)
    console.print("next, try:", style="bold")
    for command in (
        f"inphase inspect {output / shape}.inphase",
        f"inphase replay {output / shape}.inphase {output / shape / last.name}.csv --filter bip",
        f"inphase fit {output / shape} --observed x --controlled y --basis gaussian:20 -o {shape}.inphase",
    ):
        console.print(f"  {command}", soft_wrap=True)
    return 0
