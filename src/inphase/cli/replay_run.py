"""`inphase replay RUN.mcap`: a recorded run once more, every estimate compared with the one that was recorded."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict, fields
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.status import Status as Line
from rich.table import Table

from inphase.cli.console import Output, counted
from inphase.cli.reading import AsJson
from inphase.errors import DataError, OptionError
from inphase.io import read_recorded_model, read_recording
from inphase.model import Model
from inphase.recording import RecordedEvent, Recording
from inphase.replay import identical, replay
from inphase.result import Estimate
from inphase.runtime.clock import SystemClock
from inphase.runtime.recorder import TELLS
from inphase.runtime.run_report import REPORT

DIFFERS = 1  # exit code
EVENTS = 40  # that are printed
REFRESHED = 10  # times a second, the line of progress
ONLY_OTHERS = (
    "--filter",
    "--seed",
    "--members",
    "--particles",
    "--picture",
    "--time",
    "--delimiter",
    "--ignore-notes",
)


def is_of_run(arguments: Sequence[str]) -> bool:
    """Whether the arguments of `inphase replay` ask for a recorded run (MCAP).

    Raises OptionError for the options that only other recordings take.
    """
    runs = [text for text in arguments if text.lower().endswith(".mcap") and not text.startswith("-")]
    if not runs:
        return False
    others = [text for text in arguments if text.split("=")[0].replace("_", "-") in ONLY_OTHERS]
    if others:
        raise OptionError(f"{runs[0]}: a recorded run is replayed as it was, expected no {others[0]}")
    first = arguments[0]
    if first not in runs and not first.startswith("-"):
        raise OptionError(f"a recorded run is played to the model in it, or: inphase replay {runs[0]} --model {first}")
    return True


def replay_run(
    run: tyro.conf.Positional[Path],
    *,
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None,
    speed: Annotated[float | None, tyro.conf.arg(help_behavior_hint="")] = None,
    json_: AsJson = False,
) -> int:
    """Compute every estimate of a recorded run once more. Exit code 1 if one differs from the recorded in any bit.

    Args:
        run: a recording of a live run (.mcap)
        model: the model it was made with; otherwise the one that it holds
        speed: play it in its time (1), or so many times as fast; otherwise as fast as can be
        json_: print what was found as JSON
    """
    if speed is not None and not 0 < speed < math.inf:
        raise OptionError(f"expected a finite speed > 0, got {speed}")
    recording = read_recording(run)
    known = read_recorded_model(run) if model is None else Model.load(model)
    if known is None:
        raise OptionError(f"{run}: holds no model; name the one it was made with: --model FILE")
    console = Output(quiet=json_)
    _print_head(console, recording, "in the recording" if model is None else str(model))
    made = _played(recording, known, speed)
    same = [identical(one, other) for one, other in zip(made, recording.estimates, strict=True)]
    first = same.index(False) if False in same else None
    _print_verdict(console, recording, made, same)
    if json_:
        found = {
            **_provenance(recording),
            "samples": len(recording.times),
            "estimates": len(same),
            "equal": sum(same),
            "first_difference": None
            if first is None
            else {
                "sample": first,
                "recorded": _plain(recording.estimates[first]),
                "recomputed": _plain(made[first]),
            },
            "damage": recording.provenance.get("damage"),
            "lost": [_plain(event) for event in _losses(recording)],
            "events": [_plain(event) for event in recording.events],
        }
        json.dump(found, sys.stdout, indent=1)
        print()
    return 0 if first is None else DIFFERS


def _played(recording: Recording, model: Model, speed: float | None) -> list[Estimate]:
    """The estimates of the samples that have a recorded one, each at its time."""
    if len(recording.estimates) > len(recording.times):
        raise DataError(
            f"{recording.name}: expected an estimate of each of {counted(len(recording.times), 'sample')}, "
            f"got {len(recording.estimates)}"
        )
    console = Output(stderr=True)
    line = console.status("replaying …", refresh_per_second=REFRESHED) if console.is_terminal else None
    made = []
    with line or nullcontext():
        for i, estimate in enumerate(islice(_paced(recording, model, speed), len(recording.estimates))):
            made.append(estimate)
            if line is not None and (speed is not None or i % 50 == 0):
                _tell(line, recording, estimate)
    return made


def _paced(recording: Recording, model: Model, speed: float | None) -> Iterator[Estimate]:
    clock = SystemClock()
    begun = clock.now()
    for time, estimate in zip(recording.times, replay(recording, model), strict=True):
        if speed is not None:
            clock.wait_until(begun + float(time - recording.times[0]) / speed)
        yield estimate


def _tell(line: Line, recording: Recording, estimate: Estimate) -> None:
    since, length = (time - recording.times[0] for time in (estimate.time, recording.times[-1]))
    line.update(
        f"{since:.1f} of {length:.1f} s   phase {estimate.phase:.3f} ± {estimate.phase_std:.3f}   "
        f"{estimate.status.value}"
    )


# ------------------------------------------------------------------------------------------------------- what it says


def _print_head(console: Console, recording: Recording, source: str) -> None:
    told, events = recording.provenance, recording.events
    length = recording.times[-1] - recording.times[0] if len(recording.times) else 0.0
    console.print(f"{recording.name}: {counted(len(recording.times), 'sample')}, {length:.2f} s")
    if "filter" in told:
        console.print(f"{told['filter']}, seed {told.get('seed', '?')}, options {told.get('options', '?')}")
        console.print(f"model {told.get('model', '?')[:12]}…, {source}")
    if "damage" in told:
        console.print(f"the recording is damaged: {told['damage']}", style="red")
    for loss in _losses(recording):
        console.print(f"{_since(recording, loss)}  {loss.reason}", style="red")
    rest = [event for event in events if event.kind not in (TELLS, REPORT)]
    for event in rest[:EVENTS]:
        states = f"{event.before} → {event.after}: " if event.before or event.after else ""
        console.print(f"{_since(recording, event)}  {event.kind}: {states}{event.reason}", style="dim")
    if len(rest) > EVENTS:
        console.print(f"… {len(rest) - EVENTS} events more (--json: all)", style="dim")


def _print_verdict(console: Console, recording: Recording, made: Sequence[Estimate], same: Sequence[bool]) -> None:
    console.print(f"{sum(same)} of {counted(len(same), 'estimate')} equal to the last bit")
    if all(same):
        return
    first = same.index(False)
    recorded, again = recording.estimates[first], made[first]
    console.print(
        f"the first that differs is that of sample {first + 1}, at {recorded.time - recording.times[0]:.3f} s:"
    )
    table = Table(box=None, pad_edge=False)
    for title in ("", "recorded", "recomputed"):
        table.add_column(title, overflow="fold")
    for field in fields(Estimate):
        one, other = (_shown(getattr(estimate, field.name)) for estimate in (recorded, again))
        table.add_row(field.name, one, other, style="" if one == other else "red")
    console.print(table, soft_wrap=False)
    if any(loss.time <= recorded.time for loss in _losses(recording)):
        console.print("samples were lost before it, and a session goes by all it has seen")


def _losses(recording: Recording) -> list[RecordedEvent]:
    return [event for event in recording.events if event.kind == TELLS]


def _since(recording: Recording, event: RecordedEvent) -> str:
    first = recording.times[0] if len(recording.times) else 0.0
    return f"{event.time - first:9.3f} s"


def _provenance(recording: Recording) -> dict[str, str | None]:
    return {
        "name": recording.name,
        **{key: recording.provenance.get(key) for key in ("model", "filter", "seed", "options")},
    }


def _shown(value: Any) -> str:
    return repr(value) if isinstance(value, float) else value.name.lower().replace("_", " ")


def _plain(made: Estimate | RecordedEvent) -> dict[str, Any]:
    """As JSON knows it: neither NaN nor infinity, and a status by its name."""
    values = asdict(made)
    if isinstance(made, Estimate):
        values["status"] = made.status.name
    return {key: None if isinstance(v, float) and not math.isfinite(v) else v for key, v in values.items()}
