"""Cooperation (2.5.2, 2.6.2): what is out of reach is handed over, and a large box lifted, with six modalities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.cooperation import live, tasks
from experiments.cooperation.demonstrations import AT_ONCE, DEMONSTRATIONS, PLACES, record
from experiments.cooperation.figures import TITLES, draw_costs, draw_errors, strip
from experiments.cooperation.methods import METHODS
from experiments.study import Cell, Found, Page, Part, Settings, Study, Table, Task, task
from experiments.study.follower import MARKS, OURS, WRITTEN

RATIOS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0)
TIMED = (0.25, 0.5, 1.0, 2.0, 4.0)
SHARES = tuple(range(1, MARKS, 2))  # of the marks: 0.1, 0.2 … of an interaction
COMPARED = ("mean", "BIP", "eBIP, calibrated", "rbpf")  # for what is worn
LIVE = ("led", "mean", "BIP", "eBIP, calibrated", "rbpf")
ARM, GRIPPER, PHASE = 0, 1, 2
THEIRS = {"handover": "0.34", "lift": "0.32"}  # the phase error of IP with all of an interaction seen (2.6.2)


def _ratios(settings: Settings) -> tuple[float, ...]:
    return (0.5, 1.0) if settings.quick else RATIOS


def _count(settings: Settings) -> int:
    return 5 if settings.quick else DEMONSTRATIONS


def _folds(settings: Settings) -> range:
    return range(1 if settings.quick else DEMONSTRATIONS)


def _trials(settings: Settings) -> int:
    return 1 if settings.quick else 40


def _labels(settings: Settings, place: str, fold: int | None) -> dict[str, str]:
    """Of the models that do not know a demonstration, by their kind; of those that know all where none is named.

    Ours is calibrated, which takes minutes: it is made five times, each without five demonstrations.
    """
    group = fold if settings.quick or fold is None else fold // AT_ONCE
    which = {WRITTEN: fold, OURS: group}
    return {kind: f"{kind}/{place}/{'all' if i is None else i}" for kind, i in which.items()}


# ------------------------------------------------------------------------------------------------------------- tasks


def _slug(method: str) -> str:
    """A method's name as a part of a label."""
    return method.replace(", ", "-")


def _demonstrations(settings: Settings) -> Mapping[str, Task]:
    at_once = 3 if settings.quick else AT_ONCE
    return {
        f"{place}/{first}": task(record, settings, place, range(first, min(first + at_once, _count(settings))))
        for place in PLACES
        for first in range(0, _count(settings), at_once)
    }


def _models(settings: Settings) -> Mapping[str, Task]:
    stored = settings.of("demonstrations")
    found: dict[str, Task] = {}
    for place in PLACES:
        for fold in (*_folds(settings), None):
            for kind, label in _labels(settings, place, fold).items():
                if fold is None:
                    out: Sequence[int] = ()
                elif settings.quick or kind == WRITTEN:
                    out = (fold,)
                else:
                    out = range(AT_ONCE * (fold // AT_ONCE), AT_ONCE * (fold // AT_ONCE + 1))
                found[label] = task(tasks.learn, settings, stored, place, kind, tuple(out))
    ours_first = sorted(found, key=lambda label: not label.startswith(OURS))  # what takes long begins first
    return {label: found[label] for label in ours_first}


def _played(
    settings: Settings, worn: Sequence[str], ratios: Sequence[float], methods: Sequence[str]
) -> dict[str, Task]:
    stored, models = settings.of("demonstrations"), settings.of("models")
    return {
        f"{place}/{what}/{fold}": task(
            tasks.play,
            settings,
            stored,
            models,
            _labels(settings, place, fold),
            place,
            what,
            fold,
            tuple(ratios),
            tuple(methods),
        )
        for place in PLACES
        for what in worn
        for fold in _folds(settings)
    }


def _temporal(settings: Settings) -> Mapping[str, Task]:
    return _played(settings, ("all",), _ratios(settings), tuple(METHODS))


def _worn(settings: Settings) -> Mapping[str, Task]:
    return _played(settings, [name for name in tasks.WORN if name != "all"], (1.0,), COMPARED)


def _time(settings: Settings) -> Mapping[str, Task]:
    stored, models = settings.of("demonstrations"), settings.of("models")
    ratios = TIMED[:2] if settings.quick else TIMED
    return {
        place: task(tasks.take_time, settings, stored, models, _labels(settings, place, 0), place, ratios)
        for place in PLACES
    }


def _live(settings: Settings) -> Mapping[str, Task]:
    models, count = settings.of("models"), _trials(settings)
    at_once = min(10, count)
    methods = ("rbpf",) if settings.quick else LIVE
    return {
        f"{place}/{_slug(method)}/{first}": task(
            live.answer,
            settings,
            models,
            _labels(settings, place, None),
            place,
            method,
            range(first, first + at_once),
            film=method == "rbpf" and first == 0 and not settings.quick,
        )
        for place in PLACES
        for method in methods
        for first in range(0, count, at_once)
    }


# --------------------------------------------------------------------------------------------------------------- told


def _errors(found: Found, place: str, worn: str, ratio: int, which: int) -> dict[str, np.ndarray]:
    """By method: (folds, MARKS)."""
    folds = [found[label] for label in found if label.startswith(f"{place}/{worn}/")]
    names = [name for name in METHODS if name in folds[0]]
    return {name: np.array([fold[name][ratio, :, which] for fold in folds]) for name in names}


def _tell_demonstrations(settings: Settings, found: Found, page: Page) -> None:
    for place in PLACES:
        runs = [found[label] for label in found if label.startswith(f"{place}/")]
        times = [run[name][-1] for run in runs for name in run if name.startswith("times")]
        done = [bool(run[name]) for run in runs for name in run if name.startswith("done")]
        hid = np.mean([run[name].mean() for run in runs for name in run if name.startswith("hid")])
        page.say(
            f"{TITLES[place]}: {sum(done)} of {len(done)} demonstrations ended as they were to, {np.min(times):.1f} to "
            f"{np.max(times):.1f} s long; {100 * hid:.0f} % of the skeleton's joints were hidden from the camera."
        )


def _tell_models(settings: Settings, found: Found, page: Page) -> None:
    if settings.quick:
        page.say("A taste: four demonstrations, and ours is not calibrated, so that nothing below is to be believed.")
        return
    page.say(
        f"{len(found)} of them: the dissertation's without each demonstration, and ours without each five, as it is "
        "calibrated, which takes minutes: it knows 20 demonstrations where the dissertation's knows 24."
    )


def _tell_temporal(settings: Settings, found: Found, page: Page) -> None:
    ratios = _ratios(settings)
    page.say(
        "Samples are deleted or duplicated, drawn uniformly, until there are so many times as many: 0.25 is four times "
        "as fast as it was shown. The mean of 20 even moments of an interaction."
    )
    for which, what in ((ARM, "Error of the arm [rad]"), (PHASE, "Error of the phase")):
        for place in PLACES:
            table = Table(f"{what}, {TITLES[place]}: length", list(METHODS))
            for i, ratio in enumerate(ratios):
                errors = _errors(found, place, "all", i, which)
                table.add(f"{ratio:g}", {name: Cell(values.mean(1)) for name, values in errors.items()})
            page.table(table)

    def by_ratio(which: int) -> dict[str, dict[str, np.ndarray]]:
        drawn: dict[str, dict[str, np.ndarray]] = {}
        for place in PLACES:
            each = [_errors(found, place, "all", i, which) for i in range(len(ratios))]
            drawn[place] = {name: np.array([errors[name].mean(1) for errors in each]) for name in METHODS}
        return drawn

    page.picture(
        draw_errors(by_ratio(ARM), by_ratio(PHASE), ratios, "length over that of the demonstration"),
        "temporal",
        "Errors by length, mean and standard deviation",
    )


def _tell_partial(settings: Settings, _: Found, page: Page) -> None:
    stored = settings.of("temporal")
    found = {label: stored[label] for label in _temporal(settings)}
    usual = _ratios(settings).index(1.0)
    page.say("After the first part of an interaction at its own pace: the error of the rest as foretold there.")
    for which, what in (
        (ARM, "Error of the arm [rad]"),
        (GRIPPER, "Error of the gripper"),
        (PHASE, "Error of the phase"),
    ):
        for place in PLACES:
            errors = _errors(found, place, "all", usual, which)
            table = Table(f"{what}, {TITLES[place]}: seen", list(METHODS))
            for mark in SHARES:
                theirs = {"IP, DTW": THEIRS[place]} if which == PHASE and mark == MARKS - 1 else None
                table.add(f"{(mark + 1) / MARKS:.1f}", {n: Cell(v[:, mark]) for n, v in errors.items()}, theirs)
            page.table(table)

    def by_share(which: int) -> dict[str, dict[str, np.ndarray]]:
        return {
            place: {name: v[:, SHARES].T for name, v in _errors(found, place, "all", usual, which).items()}
            for place in PLACES
        }

    shares = [(mark + 1) / MARKS for mark in SHARES]
    page.picture(
        draw_errors(by_share(ARM), by_share(PHASE), shares, "share of the interaction that is seen"),
        "partial",
        "Errors by what is seen, mean and standard deviation",
    )


def _tell_worn(settings: Settings, found: Found, page: Page) -> None:
    stored = settings.of("temporal")
    usual = _ratios(settings).index(1.0)
    whole = {label: {n: stored[label][n][[usual]] for n in COMPARED} for label in _temporal(settings)}
    page.say(
        "Models that know all modalities, of which the others are not read: the skeleton alone is what a camera sees, "
        "the box before the person or not; wearables are both forearms' IMU and EMG, and the shoes. The mean of 20 "
        "even moments at the interaction's own pace."
    )
    for which, what in ((ARM, "Error of the arm [rad]"), (PHASE, "Error of the phase")):
        table = Table(f"{what}: worn", list(COMPARED))
        for place in PLACES:
            for worn in tasks.WORN:
                source = whole if worn == "all" else found
                errors = _errors(source, place, worn, 0, which)
                table.add(f"{TITLES[place]}, {worn}", {name: Cell(errors[name].mean(1)) for name in COMPARED})
        page.table(table)


def _tell_time(settings: Settings, found: Found, page: Page) -> None:
    samples = {place: found[place]["samples"] for place in PLACES}
    for place in PLACES:
        table = Table(f"Milliseconds a sample, {TITLES[place]}", list(METHODS))
        for i, count in enumerate(samples[place]):
            cells = {name: f"{1000 * found[place][name][i] / count:.2f}" for name in METHODS}
            table.add(f"{count} samples", cells)
        page.table(table)
        whole = 1 - found[place]["BIP"][-1] / found[place]["IP, DTW"][-1]
        page.say(
            f"Of the longest BIP takes {100 * abs(whole):.0f} % {'less' if whole > 0 else 'more'} than IP with time "
            "warping (the dissertation: 66 % less)."
        )
    seconds = {place: {name: found[place][name] for name in METHODS if name != "mean"} for place in PLACES}
    page.picture(draw_costs(samples, seconds), "time", "Time to take in a whole interaction, by its length")


def _tell_live(settings: Settings, found: Found, page: Page) -> None:
    page.say(
        "Trials that nobody demonstrated: what the filter foretells for now leads the arm's servos, 30 times a second, "
        "and the person waits for the robot, up to four seconds. A hand-over is done when the person holds the can and "
        "the robot does not; a lift, when the box stands on the table. *led* is who demonstrates."
    )
    methods = [name for name in LIVE if any(f"/{_slug(name)}/" in label for label in found)]
    rows = (("done", "done", 100.0, "{:.0f} %"), ("the person waited [s]", "waited", 1.0, "{:.1f}"))
    rows = (*rows, ("off where it was needed [cm]", "nearest", 100.0, "{:.1f}"))
    for place in PLACES:
        table = Table(TITLES[place], methods)
        runs = {
            name: [found[label] for label in found if label.startswith(f"{place}/{_slug(name)}/")] for name in methods
        }
        for what, key, unit, form in rows:
            values = {name: np.concatenate([run[key] for run in runs[name]]) for name in methods}
            table.add(what, {name: form.format(unit * np.mean(v)) for name, v in values.items()})
        page.table(table)
        frames = next((run["frames"] for run in runs["rbpf"] if "frames" in run), None)
        if frames is not None:
            page.picture(
                strip(frames[np.linspace(0, len(frames) - 1, 8).astype(int)]),
                f"{place}-strip",
                f"{TITLES[place]}, the robot answered by rbpf: eight moments",
            )
            page.film(list(frames), place, f"{TITLES[place]}, the robot answered by rbpf", 40 / 3)


STUDY = Study(
    title="Cooperation (2.5.2, Figs. 9 to 11)",
    says=(
        "A person and a UR5 with three fingers, in MuJoCo: it reaches for what they cannot reach and hands it over; "
        "both lift a large box from a stand onto a table. 74 channels at 30 Hz: a camera's skeleton, IMU and EMG of "
        "both forearms, shoes, the arm and the gripper. Where the thing is, only the person's movement tells. "
        "One demonstration is left out and followed; errors are of what the robot is going to do from now to the end, "
        "against what it did. *mean* plays the demonstrations' mean at their usual pace and sees nothing. *IP, DTW* (a "
        "search every fifth update), *BIP*, *eBIP* and *particle* have the dissertation's model: 15 functions a "
        "channel, the demonstrations' sample covariance, noise of the regression (Eq. 2.15). *Calibrated* and *rbpf* "
        "have what `inphase.fit` makes with nothing set."
    ),
    parts={
        "demonstrations": Part("Demonstrations", _demonstrations, _tell_demonstrations),
        "models": Part("Models", _models, _tell_models, needs=("demonstrations",)),
        "temporal": Part("Other tempos (Fig. 9)", _temporal, _tell_temporal, needs=("demonstrations", "models")),
        "partial": Part("A part of it (Fig. 10)", lambda _: {}, _tell_partial, needs=("temporal",)),
        "worn": Part("What the modalities are worth", _worn, _tell_worn, needs=("temporal", "models")),
        "live": Part("Done together", _live, _tell_live, needs=("models",)),
        "time": Part("What it costs (Fig. 11)", _time, _tell_time, needs=("demonstrations", "models")),
    },
    modules=("matplotlib", "mujoco", "mink"),
)
