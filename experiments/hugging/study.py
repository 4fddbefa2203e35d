"""Whole-body hugging (3.3.2, 3.4.2): Table 4, Figs. 32, 33 and 35, and 66 hugs online."""

from __future__ import annotations

import numpy as np

from experiments.hugging import pictures
from experiments.hugging.demonstrations import KEPT, MADE, TRAINED, some
from experiments.hugging.learned import learn
from experiments.hugging.online import CASES, NAMES, PARTNERS, filmed, online
from experiments.hugging.showing import WAYS
from experiments.hugging.table4 import LOOKAHEADS, METHODS, PARTS, cross_validated
from experiments.study import Cell, Found, Page, Part, Settings, Study, Table, Task, task

THEIRS = {  # Table 4, by look-ahead and part: All, MIFS, Group, Group + OLS
    "dimension": ("664", "446", "392", "378"),
    (0.0, "Joints"): ("0.191", "0.180", "0.183", "0.180"),
    (0.0, "Left"): ("7.224", "7.580", "8.011", "7.937"),
    (0.0, "Right"): ("3.760", "4.163", "3.936", "3.868"),
    (0.05, "Joints"): ("0.213", "0.201", "0.209", "0.205"),
    (0.05, "Left"): ("7.992", "7.965", "8.257", "8.077"),
    (0.05, "Right"): ("4.058", "4.110", "3.897", "3.850"),
    (0.10, "Joints"): ("0.250", "0.238", "0.247", "0.243"),
    (0.10, "Left"): ("9.03", "8.378", "8.257", "8.180"),
    (0.10, "Right"): ("4.355", "4.061", "3.921", "3.867"),
}
HEADINGS = {
    "as written": "**ebip, the model as the dissertation writes it**, as many members as hugs that were learned",
    "ebip": "**ebip on what `inphase.fit` learns**, not calibrated",
    "rbpf": "**rbpf on what `inphase.fit` learns**, not calibrated",
}
FPS = 12
FILTERS = ("rbpf", "ebip")  # online
QUICK_HUGS, QUICK_FOLDS, QUICK_PLAYED, QUICK_EVERY = 20, 2, 1, 5
QUICK_CASES = {"long": 1, "nothing": 1}


def _taught(settings: Settings) -> dict[str, Task]:
    count, many = (QUICK_HUGS, 6) if settings.quick else (MADE, 10)
    return {
        f"{first:03}": task(some, list(range(first, min(first + many, count))), settings.seed)
        for first in range(0, count, many)
    }


def _tell_taught(settings: Settings, found: Found, page: Page) -> None:
    arrays = {name: value for part in found.values() for name, value in part.items()}
    numbers = [int(name.split("_")[1]) for name in arrays if name.startswith("kept_")]
    kept = [n for n in numbers if arrays[f"kept_{n}"]][:KEPT]
    long = np.array([arrays[f"times_{n}"][-1] for n in kept])
    held = np.array([arrays[f"hold_{n}"] for n in kept])
    page.say(
        f"{TRAINED} people, {len(numbers)} hugs, {len(kept)} of them kept for their contact on chest and back (150 and "
        f"121). They last {long.mean():.1f} ± {long.std():.1f} s; while held, the robot's left arm presses with "
        f"{held[:, 0].mean():.0f} ± {held[:, 0].std():.0f} N, the right one with {held[:, 1].mean():.0f} ± "
        f"{held[:, 1].std():.0f} N."
    )


def _table4(settings: Settings) -> dict[str, Task]:
    folds = QUICK_FOLDS if settings.quick else 10
    methods = {name: METHODS[name] for name in ("as written", "rbpf")} if settings.quick else METHODS
    return {
        f"{way.replace(' + ', '-')}/{fold}": task(
            cross_validated,
            settings.of("taught"),
            way,
            methods,
            folds,
            fold,
            QUICK_PLAYED if settings.quick else KEPT,
            QUICK_EVERY if settings.quick else 2,
        )
        for fold in range(folds)
        for way in WAYS
    }


def _tell_table4(settings: Settings, found: Found, page: Page) -> None:
    by_way = {way: [f for label, f in found.items() if label.split("/")[0] == way.replace(" + ", "-")] for way in WAYS}
    for name in METHODS:
        if f"error {name}" not in by_way["All"][0]:
            continue
        table, theirs = Table("", list(WAYS)), name == "as written"

        def beside(key: object, theirs: bool = theirs) -> dict[str, str]:
            return dict(zip(WAYS, THEIRS[key], strict=False)) if theirs else {}  # type: ignore[index]

        sizes = {way: f"{np.mean([f[f'dimension {name}'] for f in parts]):.0f}" for way, parts in by_way.items()}
        table.add("Dimension", sizes, beside("dimension"))
        errors = {way: np.concatenate([f[f"error {name}"] for f in parts]) for way, parts in by_way.items()}
        for k, ahead in enumerate(LOOKAHEADS):
            for j, part in enumerate(PARTS):
                cells = {way: Cell(error[:, k, j]) for way, error in errors.items()}
                table.add(f"{ahead:.2f} {part}", cells, beside((ahead, part)))
        page.say(HEADINGS[name] + ":")
        page.table(table)
    page.say(
        "Mean absolute error, joints [rad], forces of the left and the right arm [raw]; **bold** the best of a row, ≈ "
        "not significantly worse (Mann and Whitney's U, p < 0.05); in brackets the dissertation's. Every second row is "
        "seen, 15 a second. The last column shows sensors of the back alone, in logarithms: it is what goes online, "
        "with the bases that `inphase.fit` chooses where it fits."
    )
    chosen = [str(f["says"]) for f in by_way["MIFS"]]
    page.say("MIFS, by fold: " + "; ".join(chosen) + ".")
    method = "rbpf" if "said rbpf" in by_way["Group + OLS"][0] else "as written"
    page.picture(
        pictures.looking_ahead(by_way["Group + OLS"][0], method), "fig32", "What is predicted, at three look-aheads"
    )


def _learned(settings: Settings) -> dict[str, Task]:
    return {"model": task(learn, settings.of("taught"), not settings.quick)}


def _tell_learned(settings: Settings, found: Found, page: Page) -> None:
    page.say(f"One model of all hugs that are kept, {len(found['model']['saved']) / 1e6:.1f} MB.")


def _online(settings: Settings) -> dict[str, Task]:
    cases = QUICK_CASES if settings.quick else CASES
    partners = {"novel 2": PARTNERS["novel 2"]} if settings.quick else PARTNERS
    filters = FILTERS[:1] if settings.quick else FILTERS
    return {
        f"{filter}/{name.replace(' ', '-')}/{kind}/{number}": task(
            online, settings.of("learned"), partner, kind, number, filter, settings.seed
        )
        for filter in filters
        for name, partner in partners.items()
        for kind, count in cases.items()
        for number in range(count)
    }


def _tell_online(settings: Settings, found: Found, page: Page) -> None:
    played = {filter: {k: v for k, v in found.items() if k.startswith(f"{filter}/")} for filter in FILTERS}
    for filter in (filter for filter in FILTERS if played[filter]):
        page.say(f"**{filter}**" + (", not calibrated:" if settings.quick else ":"))
        page.table(_successes(played[filter], not settings.quick))
    page.say(
        "In brackets the dissertation's, where novel partners were hugged well 35 of 44 times. What is asked of a hug "
        "is in `experiments/hugging/success.py`: *gentle*: no arm presses with more than 150 N for a quarter of a "
        "second; *holds*: both arms press on the partner for 70 % of the time they hold, from one second after their "
        "arms are around the robot; *lets go*: nothing holds them 1.5 s after they begin to withdraw; *waits*: arms "
        "stay down, or open, until the partner comes; *does not hug*, *does not close*: nothing is done to who stays "
        "away."
    )
    shown = played[FILTERS[0]]
    page.picture(pictures.edge_cases(shown), "fig33", "Phase and its velocity in edge cases")
    page.picture(pictures.forces(shown), "fig35", "Contact forces, wanted and felt")


def _successes(played: Found, whole: bool) -> Table:
    """How many hugs of each case succeeded with each partner, and what was missing of the others."""
    of = {label: tuple(label.split("/")[1:3]) for label in played}
    well = {label: bool(np.all(found["so"])) for label, found in played.items()}
    people = [name for name in PARTNERS if any(who == name.replace(" ", "-") for who, _ in of.values())]
    table = Table("", [*people, "all", "what was missing"])

    def count(who: str | None, kind: str | None) -> str:
        chosen = [
            well[label]
            for label, (person, case) in of.items()
            if who in (None, person.replace("-", " ")) and kind in (None, case)
        ]
        return f"{sum(chosen)} of {len(chosen)}"

    for kind in (kind for kind in CASES if any(case == kind for _, case in of.values())):
        missing = [
            str(asked)
            for label, found in played.items()
            if of[label][1] == kind
            for asked, so in zip(found["asked"], found["so"], strict=True)
            if not so
        ]
        cells = {name: count(name, kind) for name in people} | {"all": count(None, kind)}
        cells["what was missing"] = ", ".join(f"{what} {missing.count(what)}" for what in dict.fromkeys(missing))
        table.add(NAMES[kind], cells)
    theirs = {"all": "54 of 66", "trained": "19 of 22"} if whole else {}
    table.add("**together**", {name: count(name, None) for name in people} | {"all": count(None, None)}, theirs)
    return table


def _film(settings: Settings) -> dict[str, Task]:
    if settings.quick:
        return {}
    stored = settings.of("learned")
    return {"long": task(filmed, stored, PARTNERS["novel 2"], "long", 1, settings.seed, FPS, 60)}


def _tell_film(settings: Settings, found: Found, page: Page) -> None:
    if "long" not in found:
        page.say("The whole study has a film here.")
        return
    film = found["long"]
    page.film(list(film["frames"]), "film", "A long hug of somebody whom the robot has never met", FPS)
    page.picture(pictures.strip(film["frames"], film["times"], film["marks"]), "strip", "Key frames of that hug")


STUDY = Study(
    title="Whole-body hugging (3.3.2, 3.4.2)",
    says=(
        "Two padded arms of seven joints with 61 force sensors hug a person, in MuJoCo. Four people teach it with the "
        "help of a scripted teleoperator; online, what the model says of 12 joints and 8 contact forces goes to a "
        "retargeting controller (3.2.1), which changes the joints until contact is as strong as it is "
        "wanted. People, camera, and operator are made up: `experiments/hugging/README.md` says how."
    ),
    parts={
        "taught": Part("Hugs that are taught", _taught, _tell_taught),
        "table4": Part("Table 4 and Fig. 32: four ways of showing force sensors", _table4, _tell_table4, ("taught",)),
        "learned": Part("The model that goes online", _learned, _tell_learned, ("taught",)),
        "online": Part("66 hugs online, Figs. 33 and 35", _online, _tell_online, ("taught", "learned")),
        "film": Part("Fig. 31: a hug", _film, _tell_film, ("taught", "learned")),
    },
    modules=("mujoco", "matplotlib"),
)
