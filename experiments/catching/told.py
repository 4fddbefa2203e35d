"""What the study tells: tables in the dissertation's form, with its numbers in brackets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.catching import figures
from experiments.catching.demonstrations import PERSONS, gathered
from experiments.catching.prediction import COLUMNS, COURSE, MARKS, joined, trained_on
from experiments.catching.trial import CONDITIONS
from experiments.study import Cell, Found, Page, Settings, Table
from inphase import Dataset

SAYS = """
A person throws a ball underhand at an arm of the UR5 class, 3.7 m away, that holds a box, 32 cm wide. Hands and feet,
an IMU on the throwing forearm, eight pressures in the shoes, the head and, once it is in the air, the ball are seen,
each at its own rate, late and with noise. The robot knows nothing of balls: it learned from demonstrations of throws
that an expert caught. In brackets are the dissertation's numbers, of real throws.
"""
ENSEMBLES = ("PF", "eBIP-", "eBIP")
METHODS = ("BIP", "PF", "eBIP-", "eBIP", "eBIP, calibrated", "rbpf")
JOINTS_TOLD = {
    (0, "BIP"): ["–", "3.91·10^15", "1.48·10^14", "9.56·10^14", "3.97·10^16"],
    (0, "PF"): ["–", "0.37", "0.28", "0.28", "0.26"],
    (0, "eBIP-"): ["–", "5.62·10^6", "9.98·10^6", "1.08·10^7", "6.00·10^7"],
    (0, "eBIP"): ["–", "0.18", "0.19", "0.18", "0.14"],
    (1, "BIP"): ["1.04·10^15", "1.59·10^17", "4.22·10^15", "3.66·10^15", "6.52·10^17"],
    (1, "PF"): ["0.11", "0.37", "0.28", "0.28", "0.26"],
    (1, "eBIP-"): ["10.52", "9.46·10^6", "1.36·10^7", "1.68·10^7", "7.66·10^7"],
    (1, "eBIP"): ["0.05", "0.20", "0.19", "0.11", "0.09"],
}
COLUMNS_OF = {"joints": tuple(COLUMNS), "ball": ("Ball", "Shoe, IMU, Head, Ball", "All")}
HEADS = {"joints": "Mean squared error of three joints [rad²]", "ball": "Mean absolute error of the ball [m]"}
BALL_TOLD = {
    (0, "BIP"): ["–", "116.93", "1.35·10^3"],
    (0, "PF"): ["–", "0.61", "0.61"],
    (0, "eBIP-"): ["–", "7.11·10^3", "8.91·10^3"],
    (0, "eBIP"): ["–", "0.61", "0.59"],
    (1, "BIP"): ["6.67", "205.04", "2.74·10^3"],
    (1, "PF"): ["0.20", "0.26", "0.28"],
    (1, "eBIP-"): ["5.38", "8.44·10^3", "9.46·10^3"],
    (1, "eBIP"): ["0.13", "0.23", "0.24"],
}


def demonstrations(settings: Settings, found: Found, page: Page) -> None:
    """How many, and how many throws were left out."""
    lengths = joined(found, "lengths")
    left_out = sum(int(part["left_out"]) for part in found.values())
    page.say(
        f"{len(lengths)} throws of {PERSONS} persons that the expert caught, {left_out} more that went out of reach; "
        f"{lengths.min() / 60:.2f} to {lengths.max() / 60:.2f} s long, at 60 samples a second."
    )


def prediction(settings: Settings, found: Found, page: Page) -> None:
    """Tables 2 and 3, and the middle of Fig. 28."""
    learned, weights = trained_on(found, "demonstrations"), trained_on(found, "weights")
    page.say(
        f"{len(found)} folds, learned from {learned} demonstrations each: {weights} weights (559), every basis by BIC. "
        "BIP, PF, eBIP⁻ and eBIP are on the model as the dissertation writes it, ensembles and particles as many as "
        "demonstrations; the two columns at the right are on what `inphase.fit` gives with nothing set; `rbpf` is what "
        "a session takes when no filter is named. One model of all modalities serves all rows: what a row does not "
        "name is not observed."
    )
    demonstrated = gathered(settings.of("demonstrations"))
    early, late = (_seen_by(mark, demonstrated) for mark in MARKS)
    page.say(
        f"At {MARKS[0]:.0%} the ball has been seen in {early} of {len(demonstrated)} throws, at {MARKS[1]:.0%} in "
        f"{late}."
    )
    told = {"joints": JOINTS_TOLD, "ball": BALL_TOLD}
    for what in COLUMNS_OF:
        _errors(page, found, what, METHODS, told[what])
    course = {name: joined(found, f"course/{name}") for name in METHODS}
    page.picture(figures.course(COURSE, course), "ball", "Error of the ball at the catch, foreseen over the phase")
    theirs = joined(found, "joints/All/rbpf")[:, 1].mean() / joined(found, "joints/All/eBIP")[:, 1].mean()
    page.say(f"At 82 % with all modalities, `rbpf` has {theirs:.2f} times the joint error of eBIP as written.")


def _seen_by(mark: float, dataset: Dataset) -> int:
    """In how many demonstrations the ball was seen before that phase."""
    ball = dataset.names.index("ball_x")
    return sum(bool(np.isfinite(d.values[d.phases < mark, ball]).any()) for d in dataset)


def noise(settings: Settings, found: Found, page: Page) -> None:
    """Tables 2 and 3 of ensembles and particles that know how sure a reading makes."""
    page.say(
        "What white noise does: model, ensembles and particles as the dissertation writes them, but instead of the "
        "noise of the regression (Eq. 2.15) there is what `inphase.fit` learns of demonstrations that are left out."
    )
    for what in COLUMNS_OF:
        _errors(page, found, what, ENSEMBLES)


def _rows(what: str) -> list[tuple[int, str]]:
    """Moments and modalities of a table: before the throw the ball alone says nothing."""
    return [(i, name) for i in range(len(MARKS)) for name in COLUMNS_OF[what] if i or name != "Ball"]


def _errors(
    page: Page, found: Found, what: str, methods: Sequence[str], told: Mapping[tuple[int, str], Sequence[str]] = {}
) -> None:
    table = Table(HEADS[what], list(methods))
    for i, name in _rows(what):
        cells = {method: Cell(joined(found, f"{what}/{name}/{method}")[:, i]) for method in methods}
        column = list(COLUMNS_OF[what]).index(name)
        theirs = {method: told[i, method][column] for method in methods if (i, method) in told}
        table.add(f"{MARKS[i]:.0%} {name}", cells, theirs)
    page.table(table)


def trade_off(settings: Settings, found: Found, page: Page) -> None:
    """Fig. 29."""
    table = Table("Members", ["eBIP-: step", "joints at 82 %", "ball at 82 %", "eBIP: joints", "eBIP: ball"])
    for part in found.values():
        row = {"eBIP-: step": f"{1000 * float(part['step/eBIP-']):.2f} ms"}
        for name, head in (("eBIP-", ("joints at 82 %", "ball at 82 %")), ("eBIP", ("eBIP: joints", "eBIP: ball"))):
            row |= {head[i]: f"{part[f'errors/{name}'][:, 1, i].mean():.3f}" for i in (0, 1)}
        table.add(str(int(part["members"])), row)
    page.table(table)
    page.say("The first fold, all modalities, in processes that may share the computer with others.")
    page.picture(
        figures.trade_off(found), "members", "Time and error by members; time of a whole observation by length"
    )


def model(settings: Settings, found: Found, page: Page) -> None:
    """What calibration chose."""
    chosen = str(found["all"]["chosen"]) or "nothing else than what was learned"
    page.say(
        f"Of all demonstrations, with nothing set: {int(found['all']['weights'])} weights; calibration chose {chosen}."
    )


def catching(settings: Settings, found: Found, page: Page) -> None:
    """How many were caught."""
    table = Table("", ["throws", "caught", "of those in reach", "box off [cm]", "held on the way"])
    rows = {name: f"{i}/" for i, name in enumerate(CONDITIONS)} | {"all modalities, strangers": "strangers/"}
    for name, label in rows.items():
        parts = {key: part for key, part in found.items() if key.startswith(label)}
        if not parts:
            continue
        caught, reach = (joined(parts, key).astype(bool) for key in ("caught", "reachable"))
        table.add(
            name,
            {
                "throws": str(len(caught)),
                "caught": f"{caught.mean():.0%} ± {np.sqrt(caught.mean() * (1 - caught.mean()) / len(caught)):.0%}",
                "of those in reach": f"{caught[reach].mean():.0%} of {reach.sum()}" if reach.any() else "–",
                "box off [cm]": f"{100 * np.median(joined(parts, 'missed')):.0f}",
                "held on the way": f"{(joined(parts, 'held') > 0).mean():.0%}",
            },
        )
    page.table(table)
    still = joined({label: part for label, part in found.items() if label.startswith("unmoved/")}, "caught")
    page.say(f"A robot that never moves catches {still.mean():.0%} of {len(still)}, in the box where it waits.")
    page.say(
        "New throws, the robot led by the live loop at 60 Hz with the loop's own devices, safety and limits, by the "
        "simulator's clock. In reach: whoever knows the throw beforehand catches it. Box off: the median of how near "
        "the ball's middle came to the middle of the opening. The dissertation: 12 of 20 from a blindfolded thrower."
    )


def film(settings: Settings, found: Found, page: Page) -> None:
    """A film, key frames, and the belief of a joint."""
    for label, part in found.items():
        caught = "caught" if part["caught"] else "missed"
        if label == next(iter(found)):
            fps = 6 if settings.quick else 15
            page.film(list(part["frames"]), "film", f"A throw that was {caught}, at half its speed", fps=fps)
            page.picture(figures.belief(part), "belief", "The third joint, as foreseen on the way, and where it went")
    page.picture(figures.strip(found), "frames", "Key frames: wind-up, release, flight, catch")
