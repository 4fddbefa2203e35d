"""A configured interaction from beginning to end: recorder, loop, and what listens to it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from inphase.errors import OptionError
from inphase.runtime.clock import Clock, SystemClock
from inphase.runtime.configuration.devices import OUTPUTS, Maker, make_device
from inphase.runtime.configuration.interaction import Configuration
from inphase.runtime.journal import Journal, Listener
from inphase.runtime.loop import Loop
from inphase.runtime.recorder import Recorder


@runtime_checkable
class Output(Protocol):
    """What else a run offers to others, such as services; one that can be called is told every event."""

    def start(self) -> None:
        """Begin."""
        ...

    def stop(self) -> None:
        """End."""
        ...


@dataclass(frozen=True, eq=False)
class Run:
    """A loop that is ready to run. recording: the file that is written; None where nothing is recorded."""

    loop: Loop
    recording: Path | None


@contextmanager
def prepared(
    configuration: Configuration, clock: Clock | None = None, listeners: Sequence[Listener] = ()
) -> Iterator[Run]:
    """A run of that configuration, with its recorder and outputs, which end with the block.

    Nothing moves before `run.loop.run()`. Raises OptionError for whatever is wrong with devices, model, folder or
    outputs, before a device is started.
    """
    journal = Journal(listeners=listeners)
    loop = configuration.loop(clock or SystemClock(), journal)
    outputs = _outputs(configuration, loop)
    journal.listeners.extend(output for output in outputs if callable(output))
    target, capacity = _target(configuration)
    with ExitStack() as ends:  # in reverse: the recording is closed first, and all are, whatever one of them says
        for output in outputs:
            output.start()
            ends.callback(output.stop)
        if target is not None:
            model = configuration.needed_model()
            journal.recorder = Recorder(
                target,
                model.channels,
                configuration.provenance(),
                model=model,
                name=target.stem,
                capacity=capacity,
            )
            ends.callback(journal.recorder.close)
        yield Run(loop, target)


def _outputs(configuration: Configuration, loop: Loop) -> list[Any]:
    tables = configuration.section("outputs").sections()
    makers: Mapping[str, Maker] = {**OUTPUTS, **configuration.makers}
    return [make_device(table, makers, name=name, loop=loop) for name, table in tables.items()]


def _target(configuration: Configuration) -> tuple[Path | None, int]:
    """Where to record, a file that is new, and how much may wait."""
    if "recording" not in configuration.root:
        return None, 0
    section = configuration.section("recording")
    section.only("folder", "capacity")
    folder: Path = section.get("folder", Path, configuration.path.parent / "runs")
    with section.naming(["folder"]):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OptionError(f"cannot make the folder {folder}: {error.strerror}") from None
    stem = f"{configuration.path.stem}-{time.strftime('%Y%m%d-%H%M%S')}"
    taken = (folder / f"{stem}{'' if i == 1 else f'-{i}'}.mcap" for i in range(1, 1000))
    return next(path for path in taken if not path.exists()), section.get("capacity", int, 4096)
