"""What the study tells: tables and pictures."""

from __future__ import annotations

import numpy as np

from experiments.cooperation import scope, tasks
from experiments.cooperation.demonstrations import PLACES
from experiments.cooperation.figures import TITLES, draw_costs, draw_errors, strip
from experiments.cooperation.methods import METHODS
from experiments.study import Cell, Found, Page, Settings, Table
from experiments.study.follower import MARKS, cheaper

SAYS = (
    "A person and a UR5 with three fingers, in MuJoCo: it reaches for what they cannot reach and hands it over; "
    "both lift a large box from a stand onto a table. 74 channels at 30 Hz: a camera's skeleton, IMU and EMG of "
    "both forearms, shoes, the arm and the gripper. Where the thing is, only the person's movement tells. "
    "One demonstration is left out and followed; errors are of what the robot is going to do from now to the end, "
    "against what it did. *mean* plays the demonstrations' mean at their usual pace and sees nothing. *IP, DTW* (a "
    "search every fifth update), *BIP*, *eBIP* (100 members) and *particle* (1000) have the dissertation's model: 15 "
    "functions a channel, the demonstrations' sample covariance, noise of the regression (Eq. 2.15). *Calibrated* and "
    "*rbpf* have what `inphase.fit` makes with nothing set."
)
ARM, GRIPPER, PHASE = 0, 1, 2
THEIRS = {"handover": "0.34", "lift": "0.32"}  # the phase error of IP with all of an interaction seen (2.6.2)


def _errors(found: Found, place: str, worn: str, ratio: int, which: int) -> dict[str, np.ndarray]:
    """By method: (folds, MARKS)."""
    folds = [found[label] for label in found if label.startswith(f"{place}/{worn}/")]
    names = [name for name in METHODS if name in folds[0]]
    return {name: np.array([fold[name][ratio, :, which] for fold in folds]) for name in names}


def demonstrations(settings: Settings, found: Found, page: Page) -> None:
    """How many, how long, and how much the camera could not see."""
    for place in PLACES:
        runs = [found[label] for label in found if label.startswith(f"{place}/")]
        times = [run[name][-1] for run in runs for name in run if name.startswith("times")]
        failed = sum(int(run[name]) for run in runs for name in run if name.startswith("tried"))
        hid = np.mean([run[name].mean() for run in runs for name in run if name.startswith("hid")])
        page.say(
            f"{TITLES[place]}: {len(times)} demonstrations, {np.min(times):.1f} to {np.max(times):.1f} s long; {failed}"
            f" that did not end as they were to were made anew. {100 * hid:.0f} % of the skeleton's joints were hidden "
            "from the camera."
        )


def models(settings: Settings, found: Found, page: Page) -> None:
    """Which there are."""
    if settings.quick:
        page.say("A taste: four demonstrations, and ours is not calibrated, so that nothing below is to be believed.")
        return
    page.say(
        f"{len(found)} of them: the dissertation's without each demonstration, and ours without each five, as it is "
        "calibrated, which takes minutes: it knows 20 demonstrations where the dissertation's knows 24."
    )


def temporal(settings: Settings, found: Found, page: Page) -> None:
    """Fig. 9."""
    ratios = scope.ratios(settings)
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


def _whole(settings: Settings) -> list[str]:
    """Where all is worn: the labels of what was played at every tempo."""
    return ["/".join(map(str, names)) for names in scope.played(settings, ("all",))]


def partial(settings: Settings, _: Found, page: Page) -> None:
    """Fig. 10."""
    stored = settings.of("temporal")
    found = {label: stored[label] for label in _whole(settings)}
    usual = scope.ratios(settings).index(1.0)
    page.say("After the first part of an interaction at its own pace: the error of the rest as foretold there.")
    for which, what in (
        (ARM, "Error of the arm [rad]"),
        (GRIPPER, "Error of the gripper"),
        (PHASE, "Error of the phase"),
    ):
        for place in PLACES:
            errors = _errors(found, place, "all", usual, which)
            table = Table(f"{what}, {TITLES[place]}: seen", list(METHODS))
            for mark in scope.SHARES:
                theirs = {"IP, DTW": THEIRS[place]} if which == PHASE and mark == MARKS - 1 else None
                table.add(f"{(mark + 1) / MARKS:.1f}", {n: Cell(v[:, mark]) for n, v in errors.items()}, theirs)
            page.table(table)

    def by_share(which: int) -> dict[str, dict[str, np.ndarray]]:
        return {
            place: {name: v[:, scope.SHARES].T for name, v in _errors(found, place, "all", usual, which).items()}
            for place in PLACES
        }

    shares = [(mark + 1) / MARKS for mark in scope.SHARES]
    page.picture(
        draw_errors(by_share(ARM), by_share(PHASE), shares, "share of the interaction that is seen"),
        "partial",
        "Errors by what is seen, mean and standard deviation",
    )


def worn(settings: Settings, found: Found, page: Page) -> None:
    """With sensors left out."""
    stored = settings.of("temporal")
    usual = scope.ratios(settings).index(1.0)
    whole = {label: {n: stored[label][n][[usual]] for n in scope.COMPARED} for label in _whole(settings)}
    page.say(
        "Models that know all modalities, of which the others are not read: the skeleton alone is what a camera sees, "
        "the box before the person or not; wearables are both forearms' IMU and EMG, and the shoes. The mean of 20 "
        "even moments at the interaction's own pace."
    )
    for which, what in ((ARM, "Error of the arm [rad]"), (PHASE, "Error of the phase")):
        table = Table(f"{what}: worn", list(scope.COMPARED))
        for place in PLACES:
            for worn in tasks.WORN:
                source = whole if worn == "all" else found
                errors = _errors(source, place, worn, 0, which)
                table.add(f"{TITLES[place]}, {worn}", {name: Cell(errors[name].mean(1)) for name in scope.COMPARED})
        page.table(table)


def time(settings: Settings, found: Found, page: Page) -> None:
    """Fig. 11."""
    samples = {place: found[place]["samples"] for place in PLACES}
    for place in PLACES:
        table = Table(f"Milliseconds a sample, {TITLES[place]}", list(METHODS))
        for i, count in enumerate(samples[place]):
            cells = {name: f"{1000 * found[place][name][i] / count:.2f}" for name in METHODS}
            table.add(f"{count} samples", cells)
        page.table(table)
        whole = 1 - found[place]["BIP"][-1] / found[place]["IP, DTW"][-1]
        longer = cheaper(samples[place], found[place]["IP, DTW"], found[place]["BIP"])
        page.say(
            f"Of the longest BIP takes {100 * abs(whole):.0f} % {'less' if whole > 0 else 'more'} than IP with time "
            f"warping (the dissertation: 66 % less){longer}."
        )
    seconds = {place: {name: found[place][name] for name in METHODS if name != "mean"} for place in PLACES}
    page.picture(draw_costs(samples, seconds), "time", "Time to take in a whole interaction, by its length")


def live(settings: Settings, found: Found, page: Page) -> None:
    """How many were done, with a film of each place."""
    page.say(
        "Trials that nobody demonstrated: what the filter foretells for now leads the arm's servos, 30 times a second, "
        "and the person waits for the robot, up to four seconds. A hand-over is done when the person holds the can and "
        "the robot does not; a lift, when the box stands on the table. *led* is who demonstrates."
    )
    methods = [name for name in scope.LIVE if any(f"/{scope.slug(name)}/" in label for label in found)]
    rows = (("done", "done", 100.0, "{:.0f} %"), ("the person waited [s]", "waited", 1.0, "{:.1f}"))
    for place in PLACES:
        table = Table(TITLES[place], methods)
        runs = {
            name: [found[label] for label in found if label.startswith(f"{place}/{scope.slug(name)}/")]
            for name in methods
        }
        for what, key, unit, form in rows:
            values = {name: np.concatenate([run[key] for run in runs[name]]) for name in methods}
            table.add(what, {name: form.format(unit * np.mean(v)) for name, v in values.items()})
        off = {name: np.concatenate([run["nearest"][run["done"] > 0] for run in runs[name]]) for name in methods}
        table.add(
            "of those done, off where it was needed [cm]",
            {name: f"{100 * np.mean(v):.1f}" if len(v) else "–" for name, v in off.items()},
        )
        page.table(table)
        frames = next((run["frames"] for run in runs["rbpf"] if "frames" in run), None)
        if frames is not None:
            page.picture(
                strip(frames[np.linspace(0, len(frames) - 1, 8).astype(int)]),
                f"{place}-strip",
                f"{TITLES[place]}, the robot answered by rbpf: eight moments",
            )
            page.film(list(frames), place, f"{TITLES[place]}, the robot answered by rbpf", 40 / 3)
