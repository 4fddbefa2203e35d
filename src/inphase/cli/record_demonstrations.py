"""Demonstrations recorded by hand: keys, signals or a pedal start and stop, and what came of each is told."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Protocol, runtime_checkable

from rich.console import Console
from rich.status import Status as Line

from inphase.channels import Channel, Kind, Role
from inphase.cli.console import counted
from inphase.cli.keys import Key
from inphase.errors import InphaseError
from inphase.runtime.clock import Clock
from inphase.runtime.demonstrations import Demonstrations, State
from inphase.runtime.episode import Episode

PACE = 50.0  # [1/s] looks at sensors and keys
USAGE = "space or enter: start and stop    d: discard the last    r: discard it and begin again    q: quit"


@runtime_checkable
class Asking(Protocol):
    """Whatever says what is asked for, as `inphase.cli.keys.Keys` does."""

    def read(self) -> list[Key]:
        """All since the last call."""
        ...


def record_demonstrations(session: Demonstrations, clock: Clock, keys: Asking, console: Console) -> tuple[Episode, ...]:
    """Record until asked to quit; returns the episodes that were kept. The session is open, and so are the keys.

    To quit in mid-episode keeps it. An interrupt discards it, says so, and is raised as KeyboardInterrupt once all is
    told; what was kept before stays.
    """
    console.print(USAGE)
    console.print(f"into {session.folder}, the next is {session.number:03d}.csv", style="dim")
    line = console.status("", spinner="dots") if console.is_terminal else None
    pressed = session.pressed
    due = clock.now()
    with line or nullcontext():
        while True:
            for told in session.step():
                console.print(told, style="red")
            asked = keys.read()
            before, pressed = pressed, session.pressed
            if before is not None and before != pressed:  # a pedal that is down from the beginning says nothing
                asked.append(Key.START if pressed else Key.STOP)
            for key in asked:
                if _quits(key, session, console):
                    _print_end(session, console)
                    if key is Key.INTERRUPT:
                        raise KeyboardInterrupt
                    return session.kept
            if line is not None:
                _tell(line, session)
            due = max(due + 1 / PACE, clock.now())
            clock.wait_until(due)


def _quits(key: Key, session: Demonstrations, console: Console) -> bool:
    """Do what is asked for; returns whether that is to quit."""
    recording = session.state is not State.IDLE
    try:
        if key is Key.HELP:
            console.print(USAGE)
        elif key is Key.DISCARD:
            console.print(f"discarded {session.discard()}")
        elif key is Key.REDO:
            was = session.redo()
            console.print(f"{f'discarded {was}; ' if was else ''}recording {session.number:03d}")
        elif key is Key.INTERRUPT:
            if recording:
                console.print(f"interrupted: discarded {session.discard()}", style="red")
            return True
        elif key in (Key.TOGGLE, Key.STOP, Key.QUIT, Key.END) and recording:
            _print_episode(session.stop(), console)
            return key in (Key.QUIT, Key.END)
        elif key in (Key.QUIT, Key.END):
            return True
        elif key is Key.TOGGLE or (key is Key.START and session.state is not State.RECORDING):
            session.start()
            console.print(f"recording {session.number:03d}")
        return False
    except InphaseError as error:
        console.print(str(error), style="red")
        if session.state is State.UNWRITTEN:
            if key is Key.END:  # nobody is left to try again
                console.print(f"discarded {session.discard()}", style="red")
                return True
            console.print("it is still held: space tries again, d discards it", style="red")
        return key is Key.END


# ------------------------------------------------------------------------------------------------------- what it says


def _tell(line: Line, session: Demonstrations) -> None:
    counts = "   ".join(f"{name} {count}" for name, count in session.counts.items())
    if session.state is State.RECORDING:
        said = f"recording {session.number:03d}   {session.elapsed:.1f} s   {counts}"
    else:
        said = f"{session.number:03d} {session.state.value}"
    silent = ", ".join(session.silent)
    line.update(f"{said}   silent: {silent}" if silent else said)


def _print_episode(episode: Episode, console: Console) -> None:
    sensors = [f"{name} {s.samples} ({s.rate:.1f}/s)" for name, s in episode.sensors.items()]
    console.print(f"kept {episode.path.name}: {episode.duration:.2f} s   {'   '.join(sensors)}", style="bold")
    for name, sensor in episode.sensors.items():
        for fate, number in sensor.dropped.items():
            console.print(f"  {name}: {counted(number, 'sample')} {fate.value}")
    for name, gap in episode.gaps.items():
        console.print(f"  {name}: not seen for up to {gap:.2f} s", style="yellow")
    for finding in episode.findings:
        if finding.channel in episode.gaps and finding.kind.value == "not-a-number":
            continue  # told above
        where = "" if finding.channel is None else f"{finding.channel}: "
        at = "" if finding.time is None else f" at {finding.time:.2f} s"
        console.print(f"  {where}{finding.kind.value}{at}: {finding.message}", style="yellow")


def _print_end(session: Demonstrations, console: Console) -> None:
    kept = [episode.path.stem for episode in session.kept]
    console.print(
        f"{counted(len(kept), 'episode')} kept in {session.folder}" + (f": {', '.join(kept)}" if kept else "")
    )
    if kept:
        console.print(f"learn from all that is there: {fit_command(str(session.folder), session.channels)}")


def fit_command(folder: str, channels: Sequence[Channel]) -> str:
    """What to type to learn from a folder of recordings of these channels: CSV files tell no roles and kinds."""
    words = ["inphase", "fit", folder]
    for option, names in (
        ("--observed", [c.name for c in channels if c.role is Role.OBSERVED]),
        ("--controlled", [c.name for c in channels if c.role is Role.CONTROLLED]),
        ("--angle", [c.name for c in channels if c.kind is Kind.ANGLE]),
        ("--quaternion", [c.name for c in channels if c.kind is Kind.QUATERNION]),
    ):
        words += [option, *names] if names else []
    return shlex.join(words)
