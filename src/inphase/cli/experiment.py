"""`inphase experiment`: the dissertation's studies, made again."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Annotated

import tyro

import inphase
from inphase.cli.console import Output, working
from inphase.cli.jobs import Jobs
from inphase.errors import OptionError, listing
from inphase.report.look import check_matplotlib
from inphase.workers import workers

Name = Annotated[str, tyro.conf.arg(metavar="NAME")]
Names = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...", help_behavior_hint="")]
Place = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")]


def experiment(
    name: tyro.conf.Positional[Name],
    jobs: tyro.conf.OmitArgPrefixes[Jobs],
    quick: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    part: Names = (),
    seed: int = 0,
    output: Annotated[Place, tyro.conf.arg(aliases=["-o"])] = None,
    again: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    keep: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    page: Place = None,
) -> int:
    """Make a study of the dissertation again: its tables and figures, with the dissertation's numbers beside ours.

    What was done when it was stopped is not done again: the same command goes on. Studies are in the folder
    experiments/ of a clone of inphase.

    Args:
        name: of the study
        jobs: who works
        quick: a taste of it, in a minute or two
        part: only these tables or figures, by name
        seed: of all that is drawn
        output: the folder for results, pictures and the page; otherwise inphase-studies/NAME or NAME-quick
        again: do all of it anew
        keep: take results of this seed that are there also where the code has changed since
        page: put what is told into this page of Markdown, where the study has its place; other parts stay
    """
    root = _root()
    studies = sorted(path.parent.name for path in (root / "experiments").glob("*/study.py"))
    if name not in studies:
        raise OptionError(f"unknown study {name!r}; valid: {listing(studies)}")
    if page is not None and quick:
        raise OptionError("--page: expected the whole study or parts of it, got --quick")
    jobs.check()
    check_matplotlib()
    sys.path.insert(0, str(root))  # processes that work find the studies as this one does
    studying = importlib.import_module("experiments.study.conduct")
    study = studying.load(name)
    if page is not None:
        importlib.import_module("experiments.study.page").place(page, name)  # told before the long work
    folder = (output or Path("inphase-studies") / (f"{name}-quick" if quick else name)).resolve()
    settings = studying.Settings(quick=quick, seed=seed, folder=folder)
    console = Output()
    with jobs.opened() as options, workers(**options, modules=root) as team, working(study.title) as progress:
        found = studying.conduct(
            name, study, settings, team, parts=part, again=again, keep=keep, progress=progress, say=console.print
        )
    console.print(found.text())
    console.print(f"\nwrote {folder / name}.md, {len(found.pictures)} pictures beside it")
    if page is not None:
        found.into(page)
        console.print(f"wrote {page}")
    return 0


def _root() -> Path:
    """The folder that holds experiments/: here or above, or where this library is installed from."""
    here = Path.cwd()
    for folder in (here, *here.parents, Path(inphase.__file__).parents[2]):
        if (folder / "experiments" / "study" / "conduct.py").is_file():
            return folder
    raise OptionError(f"expected the folder experiments/ of a clone of inphase here or above, got none in {here}")
