"""The figures of a run in small tables: errors, coverage, timing of the loop, where it came from, the model's card."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from inphase.channels import Role
from inphase.metrics import MARKS, Scores, difference
from inphase.model import Model
from inphase.report.account import Account
from inphase.report.lateness import lateness
from inphase.report.spells import REPORT

MOST_ROWS = 60
Table = dict[str, Any]  # title, head, rows: all text; note: what stands below


def summarise(account: Account) -> list[Table]:
    """The tables in the order of the page."""
    tables = [*_errors(account), *_loop(account), _source(account)]
    if account.model is not None:
        tables += model_card(account.model)
    return tables


def _errors(account: Account) -> Iterator[Table]:
    """Of the response now, by channel and over all; of the final pose as it was foreseen."""
    channels = [c for c in account.recording.channels if c.role is Role.CONTROLLED]
    if not channels or not np.isfinite(account.truth).any():
        yield _table("Errors", [], [], "What the controlled channels truly did is not in this run.")
        return
    error = difference(channels, account.now, account.truth)
    spread = _spread(account)
    rows = []
    for k, channel in enumerate(channels):
        scores = Scores.of(error[:, k : k + 1], account.now_std[:, k : k + 1], spread[k : k + 1])
        rms = np.sqrt(np.nanmean(error[:, k] ** 2)) if np.isfinite(error[:, k]).any() else np.nan
        rows.append([channel.name, _number(rms), channel.unit, _number(scores.nmse), _percent(scores.coverage)])
    over_all = Scores.of(error, account.now_std, spread)
    rows = [["all", "", "", _number(over_all.nmse), _percent(over_all.coverage)], *rows[:MOST_ROWS]]
    note = "error: squared, over the variance of the channel; 1 is what always answering the mean would score"
    yield _table("Response now", ["channel", "root mean square", "unit", "error", "inside 90 %"], rows, note)
    late = lateness(account)
    final = [
        [f"final pose, foreseen after {100 * mark:.0f} %", _number(_final(account, mark, spread))] for mark in MARKS
    ]
    timing = [["late by [s]", f"{late.seconds:+.2f}" if late.explains else "not as a whole"]] if late else []
    yield _table("Foresight and timing", ["", ""], [*final, *timing])


def _final(account: Account, mark: float, spread: np.ndarray) -> float:
    steps = len(account.estimates)
    frame = min(account.frames, key=lambda frame: abs(frame.step - mark * steps), default=None)
    if frame is None or frame.response is None or not steps:
        return float("nan")
    channels = [c for c in account.recording.channels if c.role is Role.CONTROLLED]
    if frame.response.channels != account.names:
        return float("nan")
    error = difference(channels, frame.response.mean[-1], account.truth[-1]) / spread
    seen = np.isfinite(error)
    return float(np.mean(error[seen] ** 2)) if seen.any() else float("nan")


def _spread(account: Account) -> np.ndarray:
    if account.model is not None:
        return account.model.spread[len(account.model.observed) :]
    known = np.isfinite(account.truth)
    spread = np.array([t[seen].std() if seen.any() else 1.0 for t, seen in zip(account.truth.T, known.T, strict=True)])
    return np.where(spread > 0, spread, 1.0)


def _loop(account: Account) -> Iterator[Table]:
    """What the loop told of its timing at the end of a live run."""
    told = next((event.reason for event in account.recording.events if event.kind == REPORT), None)
    if told is None:
        return
    try:
        report = json.loads(told)
        timings = [
            [stage, *(f"{1e3 * float(spread[key]):.2f}" for key in ("p50", "p99", "max"))]
            for stage, spread in report["timings"].items()
            if spread["count"]
        ]
        known = {"duration": "duration [s]", "cycles": "cycles", "overruns": "overruns", "commands": "commands"}
        known |= {"missed": "commands left out", "lag": "robot behind [s]", "ended": "ended"}
        figures = [[label, _text(report[key])] for key, label in known.items()]
        samples = [
            [sensor, ", ".join(f"{count} {fate}" for fate, count in fates.items())]
            for sensor, fates in report["samples"].items()
        ]
    except (ValueError, LookupError, TypeError, AttributeError):
        yield _table("Loop", [], [], "The figures of the loop in this recording cannot be read.")
        return
    yield _table("Latency of the loop", ["stage", "p50 [ms]", "p99 [ms]", "max [ms]"], timings)
    yield _table("Loop", ["", ""], [*figures, *samples])


def _source(account: Account) -> Table:
    told, recording = account.recording.provenance, account.recording
    rows = [
        ["recording", recording.name],
        ["samples", str(len(recording.times))],
        ["steps", str(len(account.estimates))],
        ["told in full", f"{len(account.frames)} steps"],
        *[[key, told[key]] for key in ("filter", "seed", "options", "damage") if told.get(key)],
        ["model", told.get("model", "")[:12] or "not named"],
    ]
    return _table("Source", ["", ""], rows)


def model_card(model: Model) -> list[Table]:
    """A model's channels with their bases, ranges and noise, and how it was calibrated."""
    noise = np.sqrt(model.scaling.unscale_var(model.noise.var))
    rows = [
        [
            name,
            model.channels[positions[0]].role.value,
            model.channels[positions[0]].unit,
            f"{type(basis).__name__.lower()} × {basis.size}",
            f"{low:.3g} … {high:.3g}",
            f"{std:.2g}",
            f"{lasts:.2g}",
        ]
        for name, positions, basis, low, high, std, lasts in zip(
            model.coordinates.names,
            model.coordinates.channel_of,
            model.layout.bases,
            model.scaling.low,
            model.scaling.high,
            noise,
            model.noise.correlation_time,
            strict=True,
        )
    ]
    more = f"and {len(rows) - MOST_ROWS} more" if len(rows) > MOST_ROWS else ""
    head = ["channel", "role", "unit", "basis", "range", "noise ±", "lasts [s]"]
    facts = [
        ["demonstrations", str(len(model.prior.samples))],
        ["typical duration [s]", f"{1 / model.phase.nominal_velocity:.2f}"],
        ["phase", f"order {model.phase.order}{', periodic' if model.phase.periodic else ''}"],
        ["trust in what the partner's movement tells", f"{100 * model.prior.trust:.0f} %"],
        ["shrinkage", f"{model.prior.shrinkage:.2g}"],
        ["band × ", f"{model.band:.2f}"],
    ]
    return [
        _table("Model", ["", ""], facts),
        _table("Channels of the model", head, rows[:MOST_ROWS], more),
        _calibration(model),
    ]


def _calibration(model: Model) -> Table:
    evidence = model.evidence
    if evidence is None:
        return _table("Calibration", [], [], "Not calibrated: no demonstrations were held out.")
    rows = [
        [label, trial.value if label not in ("before", "after") else "", *_scores(trial)]
        for label, trial in [
            ("before", evidence.before),
            *[(trial.choice, trial) for trial in evidence.trials[1:] if trial.chosen],
            ("after", evidence.after),
        ]
    ]
    note = f"{evidence.held_out} demonstrations held out, played {', '.join(evidence.conditions)}"
    return _table("Calibration", ["choice", "taken", "error", "inside 90 %", "nll"], rows, note)


def _scores(trial: Any) -> list[str]:
    return [_number(trial.error), _percent(trial.coverage), _number(trial.nll)]


def _table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> Table:
    return {"title": title, "head": list(head), "rows": [list(row) for row in rows], "note": note}


def _number(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "–"


def _percent(value: float) -> str:
    return f"{100 * value:.0f} %" if np.isfinite(value) else "–"


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return "not known" if value is None else str(value)
