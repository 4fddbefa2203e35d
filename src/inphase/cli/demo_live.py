"""`inphase demo --live`: a simulated partner and robot, in real time, as a file says that is there to be copied."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

from inphase.cli.console import Output, working
from inphase.cli.jobs import processes
from inphase.cli.live import lead
from inphase.cli.live_template import live_toml
from inphase.cli.program import program
from inphase.errors import OptionError, listing
from inphase.filters import FILTERS
from inphase.io import load, read_recording
from inphase.io.atomic import whole_file
from inphase.io.handwriting import check_shapes, export_handwriting
from inphase.model import Model
from inphase.recording import Recording
from inphase.report.live_picture import Track, Truth, draw_run
from inphase.report.look import check_picture
from inphase.runtime.configuration import devices, read_configuration
from inphase.runtime.configuration.devices import Maker
from inphase.runtime.device import Robot, Sample, Sensor
from inphase.runtime.devices import SimulatedPartner
from inphase.training import fit

POINTS = 1000  # of the curve of what truly was


class Watched:
    """A robot whose positions are remembered."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.name, self.signals = robot.name, robot.signals
        self.start, self.command, self.stop = robot.start, robot.command, robot.stop
        self.seen: list[Sample] = []

    def state(self) -> Sample | None:
        """What the robot answers."""
        sample = self._robot.state()
        if sample is not None:
            self.seen.append(sample)
        return sample

    @property
    def track(self) -> Track:
        """What it did."""
        times, values = (np.array([getattr(sample, part) for sample in self.seen]) for part in ("stamp", "values"))
        return Track(times, values, tuple(signal.name for signal in self.signals))


def demo_live(
    output: Path, shapes: Sequence[str], filter: str, seed: int, calibrate: bool, duration: float | None
) -> int:
    """Learn one shape, unless its model is there, and lead a simulated robot beside a simulated hand."""
    picture, file = output / "live.png", output / "live.toml"
    if output.exists() and not output.is_dir():
        raise OptionError(f"cannot write into {output}: expected a folder, got a file")
    if len(shapes) != 1:
        raise OptionError(f"expected one shape for a live run, got {listing(shapes)}")
    if filter not in FILTERS:
        raise OptionError(f"unknown filter {filter!r}; one of {listing(FILTERS)}")
    check_picture(picture)
    known = output / f"{shapes[0]}.inphase"
    if not known.exists():
        check_shapes(tuple(shapes))
    console = Output()
    console.print("Live: a simulated hand moves along x, in real time; a simulated robot answers along y.")
    model = _model(console, known, shapes[0], calibrate)
    if file.exists():
        console.print(f"{file} is there already and is run as it is; without it, a new one is written")
    else:
        with whole_file(file) as temporary:
            temporary.write_text(live_toml(model, known.name, filter, seed), encoding="utf-8")
        console.print(f"wrote {file}, which says all that follows: copy it for an interaction of your own")
    partners, robots = list[SimulatedPartner](), list[Watched]()
    configuration = read_configuration(file, _remembering(partners, robots))
    console.print()
    code, _, path = lead(console, configuration, duration)
    console.print()
    if path is not None:
        recording = read_recording(path)
        truth = _truth(partners[-1], recording) if partners else None
        draw_run(picture, recording, truth=truth, robot=robots[-1].track if robots else None)
        console.print(f"wrote the picture {picture}: what the hand asked for, what was sent, and what the robot did")
    console.print("next, try:", style="bold")
    for words in ([["replay", path]] if path else []) + [["live", file, "--check"], ["live", file]]:
        console.print(f"  {program()} {shlex.join(map(str, words))}")
    console.print(f"and change {file}: the hand's tempo and pauses, the robot's limits, the rates, the filter")
    return code


def _model(console: Output, file: Path, shape: str, calibrate: bool) -> Model:
    """The model that is there, or a new one."""
    if file.exists():
        console.print(f"took the model {file}, which is there already")
        return Model.load(file)
    export_handwriting(shape, file.with_suffix(""))
    dataset = load(file.with_suffix(""), observed=["x"], controlled=["y"], units={"*": "mm"})
    dataset = dataset.without(-1)  # as the other demo does, which plays it afterwards
    with working(f"{shape}: learning from {len(dataset)} demonstrations") as progress:
        model = fit(dataset, calibrate=calibrate, jobs=processes(), progress=progress)
    model.save(file)
    console.print(f"{shape}: learned from {len(dataset)} demonstrations, wrote {file}")
    return model


def _remembering(partners: list[SimulatedPartner], robots: list[Watched]) -> dict[str, Maker]:
    """The simulated devices, each of which is kept when it is made."""

    @wraps(devices.simulated_partner)
    def partner(*given: Any, **entries: Any) -> Sensor:
        made = devices.simulated_partner(*given, **entries)
        partners.extend([made] if isinstance(made, SimulatedPartner) else [])
        return made

    @wraps(devices.simulated_robot)
    def robot(*given: Any, **entries: Any) -> Robot:
        robots.append(Watched(devices.simulated_robot(*given, **entries)))
        return robots[-1]

    return {"simulated_partner": partner, "simulated_robot": robot}


def _truth(partner: SimulatedPartner, recording: Recording) -> Truth | None:
    """How the interaction truly went, as that partner moved."""
    names = [channel.name for channel in recording.channels]
    if not len(recording.times):
        return None
    times = np.linspace(recording.times[0], recording.times[-1], POINTS)
    phases = np.array([partner.phase(time) for time in times.tolist()])
    return Truth(times, partner.truth(times.tolist()), tuple(names), phases)
