"""What the study tells: tables in the dissertation's form, with its numbers in brackets."""

from __future__ import annotations

import numpy as np

from experiments.hugging import pictures
from experiments.hugging.demonstrations import KEPT, TRAINED
from experiments.hugging.online import CASES, FILTERS, NAMES, PARTNERS
from experiments.hugging.showing import WAYS
from experiments.hugging.table4 import LOOKAHEADS, METHODS, PARTS
from experiments.study import Cell, Found, Page, Settings, Table

SAYS = (
    "Two padded arms of seven joints with 61 force sensors hug a person, in MuJoCo. Four people teach it with the "
    "help of a scripted teleoperator; online, what the model says of 12 joints and 8 contact forces goes to a "
    "retargeting controller (3.2.1), which changes the joints until contact is as strong as it is "
    "wanted. People, camera, and operator are made up: `experiments/hugging/README.md` says how."
)
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
FPS = 12  # of the film


def taught(settings: Settings, found: Found, page: Page) -> None:
    """How many, how long, how strong."""
    arrays = {name: value for part in found.values() for name, value in part.items()}
    numbers = [int(name.split("_")[1]) for name in arrays if name.startswith("kept_")]
    touched = [n for n in numbers if arrays[f"kept_{n}"]]
    kept = touched[:KEPT]
    long = np.array([arrays[f"times_{n}"][-1] for n in kept])
    held = np.array([arrays[f"hold_{n}"] for n in kept])
    page.say(
        f"{TRAINED} people, {len(numbers)} hugs, {len(touched)} of which touch chest and back; the first {len(kept)} "
        f"of these are learned (the dissertation: 121 of 150). They last {long.mean():.1f} ± {long.std():.1f} s; while "
        "held, the robot's left arm presses with "
        f"{held[:, 0].mean():.0f} ± {held[:, 0].std():.0f} N, the right one with {held[:, 1].mean():.0f} ± "
        f"{held[:, 1].std():.0f} N."
    )


def table4(settings: Settings, found: Found, page: Page) -> None:
    """Table 4 and Fig. 32."""
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


def learned(settings: Settings, found: Found, page: Page) -> None:
    """How large it is."""
    page.say(f"One model of all hugs that are kept, {len(found['model']['saved']) / 1e6:.1f} MB.")


def online(settings: Settings, found: Found, page: Page) -> None:
    """How many succeeded, Figs. 33 and 35."""
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


def film(settings: Settings, found: Found, page: Page) -> None:
    """Fig. 31."""
    if "long" not in found:
        page.say("The whole study has a film here.")
        return
    film = found["long"]
    page.film(list(film["frames"]), "film", "A long hug of somebody whom the robot has never met", FPS)
    page.picture(pictures.strip(film["frames"], film["times"], film["marks"]), "strip", "Key frames of that hug")
