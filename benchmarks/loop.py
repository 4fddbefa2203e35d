"""The whole live loop by the clock: sensors at 500 Hz, commands at 100 Hz, a model of 30 channels, recorded to disk.

A replayed partner (drawn from the model, its readings made before) and a simulated robot stand for the devices; what
they cost is in the cycles. A cycle that only looks at the sensors has a five-hundredth of a second, one that commands
a hundredth. Interactions follow one another with `reset`. Memory is that of the process, after the first tenth and at
the end.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

import one_thread  # noqa: F401 - before numpy

# isort: split
import numpy as np
from sizes import DURATION, Size, make_model

from inphase.channels import Channel
from inphase.model import Model
from inphase.replay import provenance_of
from inphase.runtime import Signal, SystemClock
from inphase.runtime.conduct import Conduct
from inphase.runtime.devices import ReplaySensor, SimulatedRobot
from inphase.runtime.journal import Journal
from inphase.runtime.limits import Limits
from inphase.runtime.loop import Loop
from inphase.runtime.playing import Play
from inphase.runtime.rates import Rates
from inphase.runtime.recorder import Recorder
from inphase.runtime.timing import Timing
from inphase.trajectory import Demonstration

SENSE, COMMAND, RESPOND = 500.0, 100.0, 25.0  # [1/s]
CHANNELS, BASIS = 30, 15  # of the handshake (2.5.3)
FEW, MANY = 24, 108  # demonstrations: what is usual, and those of the handshake
PATIENT = DURATION + 0.05  # [s] from one interaction to the next
SHARE = 0.2  # of its period, that a cycle may take: the wish of the issue


def readings(model: Model, seconds: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and (T, observed) what a partner reads, one interaction after the other."""
    observed = len(model.observed)
    times = np.arange(int(seconds * SENSE)) / SENSE
    values = np.empty((len(times), observed))
    number = (times // PATIENT).astype(int)
    for i in range(number[-1] + 1):
        rows = np.flatnonzero(number == i)
        phases = np.minimum((times[rows] - i * PATIENT) / DURATION, 1.0)
        values[rows] = model.predict(phases, model.prior.draw(1, rng)[0])[:, :observed]
    return times, values + 0.02 * rng.standard_normal(values.shape)


def memory() -> float:
    """What the process holds [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def measure(
    filter: str, observe: float | None, demonstrations: int, seconds: float, folder: Path, record: bool
) -> dict[str, object]:
    """The figures of one run."""
    rng = np.random.default_rng(0)
    model = make_model(Size(CHANNELS, BASIS, demonstrations), rng)
    times, values = readings(model, seconds, rng)
    channels: tuple[Channel, ...] = model.channels[: len(model.observed)]
    sensor = ReplaySensor(Demonstration(times, values, "partner"), channels, name="partner")
    controlled = [Signal(channel.name, channel.unit) for channel in model.channels[len(model.observed) :]]
    robot = SimulatedRobot(controlled, np.full(len(controlled), 0.5), step=0.005)
    wide = np.ones(len(controlled))
    recorder = None
    if record:
        provenance = provenance_of(model, filter)
        recorder = Recorder(folder / f"{filter}.mcap", model.channels, provenance, model=model)
    loop = Loop(
        model.session(filter, 0),
        [sensor],
        robot,
        SystemClock(),
        Conduct(Limits(-9 * wide, 9 * wide, 5 * wide, 100 * wide)),
        rates=Rates(SENSE, observe, RESPOND, COMMAND),
        play=Play(samples=20),
        journal=Journal(recorder),
    )
    kinds = {"look": Timing(), "command": Timing()}
    loop.begin()
    loop.actuation.watchdog.start()
    begun, following, early = loop.clock.now(), PATIENT, 0.0
    while (since := loop.clock.now() - begun) < seconds:
        if since >= following:
            loop.reset()
            following += PATIENT
            if not early and since > seconds / 10:
                early = memory()
        loop.clock.wait_until(loop.due)
        commands, before = loop.actuation.commands, loop.clock.now()
        loop.cycle()
        kinds["command" if loop.actuation.commands > commands else "look"].add(loop.clock.now() - before)
    late = memory()
    loop.end()
    if recorder is not None:
        recorder.close(60.0)
    report = loop.report
    taken = sum(report.samples["partner"].values())
    due = int(np.searchsorted(times, report.duration - 0.1))
    return {
        "filter": filter,
        "observe": observe or SENSE,
        "demonstrations": demonstrations,
        "seconds": seconds,
        "recorded": record,
        "samples": taken,
        "lost_samples": max(due - taken, 0) + report.skipped,
        "unrecorded": report.unrecorded,
        "commands": report.commands,
        "missed": report.missed,
        "look": vars(kinds["look"].spread),
        "command": vars(kinds["command"].spread),
        "late": vars(report.timings["late"]),
        "stages": {stage: vars(spread) for stage, spread in report.timings.items()},
        "memory": [early, late],
        "events": [event.reason for event in loop.journal.events if event.kind == "safety"][:5],
    }


def show(found: dict[str, object]) -> None:
    """One run, for a person."""
    print(
        f"\n{found['filter']}, {found['demonstrations']} demonstrations, {found['observe']:g} observations a second, "
        f"{found['seconds']:g} s"
        f"{'' if found['recorded'] else ', not recorded'}: {found['samples']} samples, {found['lost_samples']} lost; "
        f"{found['commands']} commands, {found['missed']} missed; {found['unrecorded']} not recorded; "
        f"memory {found['memory'][0]:.0f} → {found['memory'][1]:.0f} MB"
    )
    print("[ms]              p50      p99      max")
    for kind, rate in (("look", SENSE), ("command", COMMAND)):
        spread = found[kind]
        wanted = 1e3 * SHARE / rate
        numbers = "".join(f"{1e3 * spread[key]:9.3f}" for key in ("p50", "p99", "max"))
        print(f"{kind + ' cycle':13s}{numbers}   p99 wanted below {wanted:g}")
    for stage in ("sense", "observe", "respond", "command", "late"):
        spread = found["stages"][stage]
        print(f"  {stage:11s}" + "".join(f"{1e3 * spread[key]:9.3f}" for key in ("p50", "p99", "max")))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0, help="of the first row; the others have a tenth")
    parser.add_argument("--filter", default="", help="one filter alone, at --observe")
    parser.add_argument("--observe", type=float, default=None, help="[1/s]; every reading by itself unless told")
    parser.add_argument("--demonstrations", type=int, default=FEW, help="that the model of --filter was learned from")
    parser.add_argument("--unrecorded", action="store_true")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = [("bip", COMMAND, FEW, 1.0), ("bip", None, FEW, 0.1), ("ebip", COMMAND, MANY, 0.1), ("rbpf", 25.0, FEW, 0.1)]
    if options.filter:
        rows = [(options.filter, options.observe, options.demonstrations, 1.0)]
    with tempfile.TemporaryDirectory() as folder:
        for number, (filter, observe, demonstrations, share) in enumerate(rows):
            target = Path(folder) / str(number)
            target.mkdir()
            found = measure(filter, observe, demonstrations, share * options.seconds, target, not options.unrecorded)
            if options.json:
                json.dump(found, sys.stdout)
                print()
            else:
                show(found)
            for file in target.iterdir():
                file.unlink()
    return 0


if __name__ == "__main__":
    sys.exit(main())
