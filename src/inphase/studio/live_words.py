"""What the live tab says in words: how the run fares, how old the picture is, and what happened."""

from __future__ import annotations

import math
import time
from html import escape

from inphase.io import Follower
from inphase.runtime.recorder import FLUSH_EVERY
from inphase.runtime.safety import State
from inphase.studio.live_window import LiveWindow
from inphase.studio.runs import Run

SILENT = 2.0  # [s] without a byte after which a run that has not ended is worth a warning
SHOWN = 50  # events
CELL = "padding:2px 12px 2px 0;vertical-align:top"
WHO = "min-width:4em;max-width:12em;overflow-wrap:anywhere"


def state(follower: Follower, window: LiveWindow, written: float) -> tuple[str, str]:
    """Whether the run goes on, in words, and how that looks; written: how long ago its file was [s]."""
    if follower.trouble:
        return follower.trouble, "error"
    if not follower.there:
        return f"{follower.path}: no such file; it is waited for", "quiet"
    if follower.ended:
        return "The run has ended.", "fine"
    if written > SILENT:
        return (
            f"Nothing was written for {_long(written)}, and the recording has no end: the run was stopped by force, "
            "or waits.",
            "error",
        )
    if window.estimate is None:
        return "Running now; nothing was observed yet.", "fine"
    return "Running now.", "fine"


def figures(window: LiveWindow) -> str:
    """The newest estimate and what the robot does, in words."""
    made = window.estimate
    parts = []
    if made is not None:
        parts.append(
            f"Phase {made.phase:.2f} ± {made.phase_std:.2f}, tempo {made.phase_velocity:.2f} ± "
            f"{made.phase_velocity_std:.2f} 1/s: {made.status.value}"
            f"{'' if made.status.trustworthy else ' (the response is not to be trusted)'}."
        )
    if window.state:
        known = window.state in State.__members__
        parts.append(f"The robot {State[window.state].value if known else window.state}.")
    return " ".join(parts)


def age(follower: Follower, window: LiveWindow, written: float) -> str:
    """How old the picture is, by the time the file was written."""
    if not follower.there:
        return ""
    newest = f"Newest sample: {window.now:.2f} s into the run" if window.estimate is not None else "No sample yet"
    behind = ""
    if follower.waiting > 1_000_000:
        behind = f"; {follower.waiting / 1e6:.0f} MB more are there and are being read"
    if follower.ended:
        return f"{newest}; its file was written {_long(written)} ago, and is whole{behind}."
    return (
        f"{newest}; its file was written {_long(written)} ago, with what had come in the {FLUSH_EVERY:g} s before: "
        f"the picture is up to {_long(written + FLUSH_EVERY)} old{behind}."
    )


def events(window: LiveWindow) -> str:
    """HTML: what happened, the newest first; nothing in it is taken for markup."""
    if not window.events:
        return "<p>nothing was told yet</p>"
    begin = window.begin or 0.0
    rows = []
    for event in list(window.events)[:SHOWN]:
        changed = f"{event.before} → {event.after}: ".lower() if event.after else ""
        at = event.time - begin
        when = f"{at:.2f}" if math.isfinite(at) else "?"
        rows.append(
            f"<tr><td style='{CELL};text-align:right;white-space:nowrap'>{when}</td>"
            f"<td style='{CELL}'><div style='{WHO}'>{escape(event.kind)}</div></td>"
            f"<td style='{CELL};overflow-wrap:anywhere'>{escape(changed + event.reason)}</td></tr>"
        )
    more = window.told - len(rows)
    rest = f"<p>… and {more} before</p>" if more else ""
    head = "".join(
        f"<th style='{CELL};text-align:left;white-space:nowrap'>{title}</th>"
        for title in ("time [s]", "who", "what, and why")
    )
    return f"<table style='border-spacing:0'><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>{rest}"


def summary(window: LiveWindow) -> str:
    """HTML: the figures of the whole run; empty until it has ended."""
    if window.report is None:
        return ""
    return f"<pre style='overflow-x:auto'>{escape(chr(10).join(window.report.lines))}</pre>"


def run_label(run: Run) -> str:
    """A recording in the list of those that can be attached to; it does not change while nothing happens."""
    if run.running:
        return f"{run.name} · running now"
    when = time.strftime("%Y-%m-%d %H:%M", time.localtime(time.time() - run.written))
    return f"{run.name} · {when}" if run.ended else f"{run.name} · {when}, without an end"


def _long(seconds: float) -> str:
    seconds = max(seconds, 0.0)
    for most, unit, one in ((90, "s", 1), (90 * 60, "min", 60), (36 * 3600, "h", 3600), (math.inf, "days", 86400)):
        if seconds < most:
            return f"{seconds / one:.{1 if one == 1 and seconds < 10 else 0}f} {unit}"
    return "long"
