"""What the tests tell in tables: Table 1, and whether hands were shaken at all."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from experiments.handshake.demonstrations import familiar
from experiments.handshake.measures import MET, at_end, met_at
from experiments.handshake.measures import completion as time_to_completion
from experiments.handshake.trajectories import TESTING
from experiments.study import Found, Page, Settings, Table
from experiments.study.stored import Stored
from experiments.study.table import SIGNIFICANT, marked

LED = ("fast", "normal", "slow", "still", "paused")
NAMES = {"bip": "bip (dissertation)", "ebip": "ebip, inphase", "rbpf": "rbpf, inphase"}
THEIRS = {  # Table 1: mean and variance of all, of those who trained the model, and of those who did not
    "fast": ("0.264 / 0.0013", "0.248 / 0.0001", "0.275 / 0.0019"),
    "normal": ("0.309 / 0.0064", "0.315 / 0.0089", "0.306 / 0.0049"),
    "slow": ("0.382 / 0.0138", "0.405 / 0.0164", "0.369 / 0.0117"),
    "static1": ("0.327 / 0.0055", "0.295 / 0.0012", "0.347 / 0.0070"),
    "static2": ("0.301 / 0.0109", "0.245 / 0.0018", "0.335 / 0.0134"),
    "static3": ("0.339 / 0.0057", "0.343 / 0.0060", "0.337 / 0.0056"),
    "static4": ("0.291 / 0.0017", "0.264 / 0.0030", "0.308 / 0.0002"),
}


def ends_apart(truth: np.ndarray) -> np.ndarray:
    """(N,) [m] between the hands at the end of each of (N, T, 6)."""
    return np.array([at_end(t) for t in truth])


def persons(stored: Stored) -> list[int]:
    """Who is in the results."""
    return sorted({int(label.rsplit("person", 1)[1]) for label in stored})


def trials(stored: Stored, which: int, kinds: int, name: str, method: str = "") -> tuple[np.ndarray, np.ndarray]:
    """Of all persons, (K, ...) that array of the trials of one of so many kinds, and (K,) who it was."""
    prefix, values, who = f"{method}/" if method else "", [], []
    for person in persons(stored):
        found = stored[f"{prefix}person{person}"][name]
        part = found.reshape(kinds, -1, *found.shape[1:])[which]
        values.append(part)
        who += [person] * len(part)
    return np.concatenate(values), np.array(who)


def played(leading: Found) -> dict[str, str]:
    """The methods that led, with what they are called in tables."""
    return {method: name for method, name in NAMES.items() if any(label.startswith(f"{method}/") for label in leading)}


def met(settings: Settings, found: Found, page: Page) -> None:
    """Distances, which the dissertation could not measure."""
    static, leading = settings.of("static"), settings.of("leading")
    methods = played(leading)
    table = Table(f"share of hands within {100 * MET:.0f} cm at the end; median distance [cm]", list(methods.values()))
    times = Table("time until they first were [s], of those that ever were", list(methods.values()))
    shares: dict[str, list[np.ndarray]] = {method: [] for method in methods}
    for i, speed in enumerate(LED):
        cells, soon = {}, {}
        for method, column in methods.items():
            truth, _ = trials(leading, i, len(LED), "truth", method)
            distance = ends_apart(truth)
            if speed == "still":
                moved = np.linalg.norm(truth[:, :, :3] - truth[:, :1, :3], axis=2).max(1)
                cells[column] = f"stays: moves {100 * np.median(moved):.0f} cm"
                continue
            shares[method].append(distance)
            cells[column] = f"{np.mean(distance < MET):.0%}; {100 * np.median(distance):.1f}"
            at = np.array([met_at(t) for t in truth])
            soon[column] = f"{np.median(at[np.isfinite(at)]):.1f}" if np.isfinite(at).any() else "–"
        table.add(speed, cells)
        if soon:
            times.add(speed, soon)
    every = {method: np.concatenate(d) for method, d in shares.items()}
    table.add(
        "all who moved",
        {methods[m]: f"{np.mean(d < MET):.0%}; {100 * np.median(d):.1f}" for m, d in every.items()},
    )
    page.table(table)
    page.table(times)
    followed = np.concatenate([ends_apart(trials(static, i, len(TESTING), "truth")[0]) for i in range(len(TESTING))])
    page.say(
        f"Against static trajectories, where the person does all the work: {np.mean(followed < MET):.0%}; "
        f"{100 * np.median(followed):.1f} cm. Who leads waits at the place of their own choice and does not help."
    )
    held = {m: int(sum(leading[f"{m}/person{p}"]["held"].sum() for p in persons(leading))) for m in methods}
    ours = [m for m in methods if m != "bip"]
    page.say("The live loop held the robot back " + ", ".join(f"{held[m]} times with {m}" for m in ours) + ".")


def completion(settings: Settings, found: Found, page: Page) -> None:
    """Table 1, for all methods."""
    static, leading = settings.of("static"), settings.of("leading")
    methods = played(leading)
    read = {f"{m}, {s}": trials(leading, i, len(LED), "read", m) for m in methods for i, s in enumerate(LED[:3])}
    read |= {f"static {i + 1}": trials(static, i, len(TESTING), "read") for i in range(len(TESTING))}
    scored = {name: (np.array([time_to_completion(r) for r in values]), who) for name, (values, who) in read.items()}
    columns = ["mean / variance (All)", "(T)", "(NT)"]
    rows: dict[str, list[str]] = {name: [] for name in scored}
    for chosen in (lambda p: True, familiar, lambda p: not familiar(p)):
        values = {name: s[np.array([chosen(p) for p in who])] for name, (s, who) in scored.items()}
        for method in methods:  # each method is compared with the static scenarios, as the dissertation's was
            rivals = {n: v for n, v in values.items() if n.startswith((method, "static")) and len(v)}
            marks = marked(rivals)
            for name, v in rivals.items():
                if name.startswith("static") and method != "bip":
                    continue
                rows[name].append(marks[name].format(f"{v.mean():.3f}") + f" / {v.var():.4f}")
    table = Table("Time-to-Completion", columns)
    for name, cells in rows.items():
        method, _, speed = name.rpartition(", ")
        theirs = dict(zip(columns, THEIRS[speed.replace(" ", "")], strict=True)) if method in ("bip", "") else None
        table.add(name, dict(zip(columns, cells, strict=True)), theirs)
    page.table(table)
    page.say(
        "Shares of the 10 s, beside the dissertation's numbers. **Bold**: the smallest of a column among one method "
        f"and the static scenarios (theirs as compared with bip); ≈: not significantly larger (U test, {SIGNIFICANT})."
    )
    _compared(scored, methods, page)


def _compared(scored: dict[str, tuple[np.ndarray, np.ndarray]], methods: Iterable[str], page: Page) -> None:
    """All led tests at normal and fast speed against all static ones, for those who have met the robot or have not."""
    from scipy.stats import mannwhitneyu

    said = []
    for group, chosen in (("trained it", familiar), ("had not", lambda p: not familiar(p))):
        values = {name: s[np.array([chosen(p) for p in who])] for name, (s, who) in scored.items()}
        static = np.concatenate([v for name, v in values.items() if name.startswith("static")])
        for method in methods:
            led = np.concatenate([values[f"{method}, {speed}"] for speed in LED[:2]])
            p = mannwhitneyu(led, static).pvalue
            said.append(f"{method} {led.mean():.3f} against {static.mean():.3f} (p = {p:.2g}) for those who {group}")
    page.say("Fast and normal together against all static: " + "; ".join(said) + ".")
