"""A process that leads a robot is killed at any time: what it recorded is readable, and replays to the last bit."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from interactions import dataset, shapes_unchecked, taught
from rigs import simulated

import inphase
from inphase.io import read_recorded_model, read_recording
from inphase.replay import identical, replay

KILLS = 20
AT_ONCE = 5
FORKED = """
import os, signal, sys
import mcap.writer, threadpoolctl  # with what is read on the way
import inphase.cli.live
from inphase.cli import main
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
for line in sys.stdin:  # one process for each, all from this one that has read the library
    pid = os.fork()
    if pid == 0:
        os.chdir(line.strip())
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        os._exit(main(["live", "run.toml"]))
    print(pid, flush=True)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork a process")
def test_killed_at_any_time(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    model = taught(dataset(np.random.default_rng(0)))
    folders = [tmp_path / f"{i}" for i in range(KILLS)]
    for folder in folders:
        folder.mkdir()
        (folder / "run.toml").write_text(simulated("model.inphase", tempo=0.3, samples=10))
        model.save(folder / "model.inphase")
    program = [sys.executable, "-c", FORKED]
    single = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=single) as parent:
        for first in range(0, KILLS, AT_ONCE):
            _kill(parent, folders[first : first + AT_ONCE], rng)
    with shapes_unchecked():
        counts = [_check(folder, model) for folder in folders]
    assert len(counts) == KILLS
    assert sum(count > 0 for count in counts) > KILLS / 2  # they did come to something


def _kill(parent: subprocess.Popen[str], folders: list[Path], rng: np.random.Generator) -> None:
    """Start a run in each folder, and kill each at some time after its recording has begun."""
    assert parent.stdin is not None
    assert parent.stdout is not None
    runs = {}
    for folder in folders:
        parent.stdin.write(f"{folder}\n")
        parent.stdin.flush()
        runs[folder] = int(parent.stdout.readline())
    for folder, process in runs.items():
        latest = time.monotonic() + 60
        while not _begun(folder) and time.monotonic() < latest:
            time.sleep(0.005)
        time.sleep(rng.uniform(0.0, 0.7))
        os.kill(process, signal.SIGKILL)


def _begun(folder: Path) -> bool:
    return any(path.stat().st_size for path in folder.glob("runs/*.mcap"))


def _check(folder: Path, model: inphase.Model) -> int:
    """How many estimates the recording in it holds, all of which are made again."""
    (file,) = folder.glob("runs/*.mcap")
    recording, held = read_recording(file), read_recorded_model(file)
    assert held is not None
    made = list(replay(recording, held))
    assert len(recording.estimates) <= len(made) <= len(recording.estimates) + 1  # an estimate follows its sample
    assert all(identical(one, other) for one, other in zip(made, recording.estimates, strict=False))
    assert recording.events == () or recording.events[0].kind == "start"
    assert not any(event.kind == "end" for event in recording.events)  # it was killed on the way
    return len(recording.estimates)
