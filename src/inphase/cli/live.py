"""`inphase live`: lead a robot through an interaction, as a configuration file says."""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import tyro

from inphase.cli.console import Output
from inphase.cli.reading import AsJson
from inphase.recording import RecordedEvent
from inphase.runtime.clock import SystemClock
from inphase.runtime.configuration import Configuration, no_limits, read_configuration
from inphase.runtime.live import prepared
from inphase.runtime.loop import Loop
from inphase.runtime.run_report import REPORT, RunReport

STOPPED_BY_TROUBLE = 1  # exit code
REFRESHED = 0.2  # [s]


def live(
    config: tyro.conf.Positional[Path],
    duration: Annotated[float | None, tyro.conf.arg(metavar="SECONDS", help_behavior_hint="")] = None,
    check: Annotated[bool, tyro.conf.arg(help_behavior_hint="")] = False,
    json_: AsJson = False,
) -> int:
    """Lead a robot through an interaction. Exit code 1 where it stopped for a trouble.

    Ctrl-C does what the configuration says of an interrupt; a second one comes to rest and ends.

    Args:
        config: what the interaction is made of, a TOML file: docs/live.md
        duration: end after so long, if the interaction has not ended by itself
        check: only say whether the configuration is right; no device is started
        json_: print the figures of the run as JSON
    """
    configuration = read_configuration(config)
    console = Output(quiet=json_)
    if check:
        _check(console, configuration)
        return 0
    code, report, recording = lead(console, configuration, duration)
    if recording is not None:
        console.print(f"next, try: inphase replay {recording}", style="bold")
    if json_:
        json.dump(json.loads(report.as_json), sys.stdout, indent=1)
        print()
    return code


def lead(console: Output, configuration: Configuration, duration: float | None) -> tuple[int, RunReport, Path | None]:
    """Run it, with what happens printed on the way: exit code, figures, and the recording if there is one."""
    begun: list[float] = []

    def tell(event: RecordedEvent) -> None:
        begun[:] = begun or [event.time]
        if event.kind != REPORT:  # it is printed as lines
            console.print(f"{event.time - begun[0]:8.2f} s  {_sentence(event)}")

    with prepared(configuration, listeners=[tell]) as run:
        _warn(console, run.loop)
        with _shown(run.loop):
            report = run.loop.run(duration)
    for line in report.lines:
        console.print(line)
    if run.recording is not None:
        console.print(f"wrote {run.recording}")
    return (STOPPED_BY_TROUBLE if report.stopped else 0), report, run.recording


def _check(console: Output, configuration: Configuration) -> None:
    loop = configuration.loop(SystemClock())
    _warn(console, loop)
    console.print(f"{configuration.path} is right: {loop}")


def _warn(console: Output, loop: Loop) -> None:
    names = [signal.name for signal in loop.actuation.robot.signals]
    if free := no_limits(loop.actuation.conduct.limits, names):
        console.print(f"no limit of velocity is set for {', '.join(free)}: see [robot.limits]", style="yellow")


def _sentence(event: RecordedEvent) -> str:
    changed = f"{event.before} → {event.after}: " if event.after else f"{event.kind}: "
    return changed.lower() + event.reason


@contextmanager
def _shown(loop: Loop) -> Iterator[None]:
    """A line on standard error that says where the interaction is, if that is a terminal."""
    console = Output(stderr=True)
    if not console.is_terminal:
        yield
        return
    over = threading.Event()
    with console.status("") as line:

        def show() -> None:
            while not over.wait(REFRESHED):
                line.update(status(loop))

        thread = threading.Thread(target=show, name="inphase display", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


def status(loop: Loop) -> str:
    """Phase, tempo and state, in one line."""
    estimate = loop.estimate
    if estimate is None:
        return f"{loop.state.name.lower()}: nothing was observed yet"
    pace = estimate.phase_velocity / loop.perception.session.model.phase.nominal_velocity
    return (
        f"{loop.state.name.lower()}  phase {estimate.phase:.2f} ± {estimate.phase_std:.2f}  pace {pace:.2f}  "
        f"{estimate.status.name.lower().replace('_', ' ')}"
    )
