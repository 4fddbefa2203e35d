"""The live loop with 0 and with 3 followers of its recording: how long its cycles take, as a ratio of one run.

A follower is a process of its own, as the studio is: it looks at the file five times a second and reads all that was
appended. Runs alternate; that alone is run twice says how far the ratio is the machine's. The loop is that of
`loop.py`, whose sensors come at 500 Hz. All that a follower shares with the loop is the processor.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

import one_thread  # noqa: F401 - before numpy

# isort: split
import numpy as np
from loop import COMMAND, FEW, SENSE, SHARE, measure

CYCLES, KEYS = {"look": SENSE, "command": COMMAND}, ("p50", "p99")
RUNS = {"alone": 0, "alone once more": 0, "followed": 3}  # and by how many
FOLLOW = """
import sys, time
from inphase.io import follow_recording
follower, told, looks = follow_recording(sys.argv[1]), 0, []
print("ready", flush=True)
while not follower.ended:
    begun = time.perf_counter()
    told += len(follower.news().estimates)
    looks.append(time.perf_counter() - begun)
    time.sleep(0.2)
print(told, max(looks), flush=True)
"""


def run(followers: int, seconds: float, filter: str, observe: float) -> dict[str, object]:
    """The figures of one run that so many follow."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as ends:
        command = [
            sys.executable,
            "-c",
            FOLLOW,
            str(Path(folder) / f"{filter}.mcap"),
        ]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        following = [
            ends.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment))
            for _ in range(followers)
        ]
        try:
            for process in following:
                process.stdout.readline()
            found = measure(filter, observe, FEW, seconds, Path(folder), True)
            told = [process.communicate(timeout=60)[0].split() for process in following]
        finally:
            for process in following:
                process.kill()
    estimates = {int(words[0]) for words in told}
    if len(estimates) > 1:
        raise SystemExit(f"the followers were told of different numbers of estimates: {sorted(estimates)}")
    return {**found, "followers": followers, "told": max(estimates, default=0), "looks": [float(w[1]) for w in told]}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one short run of each: no evidence of anything")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each run")
    parser.add_argument("--runs", type=int, default=6, help="of each kind, by turns")
    parser.add_argument("--filter", default="bip")
    parser.add_argument("--observe", type=float, default=COMMAND, help="[1/s]")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    seconds, runs = (2.0, 1) if options.quick else (options.seconds, options.runs)
    found: dict[str, list[dict[str, object]]] = {kind: [] for kind in RUNS}
    for _ in range(runs):
        for kind, followers in RUNS.items():
            found[kind].append(run(followers, seconds, options.filter, options.observe))
    # The median over the runs: one pause of the machine is not the followers'.
    middle = {
        (kind, cycle, key): float(np.median([one[cycle][key] for one in made]))
        for kind, made in found.items()
        for cycle in CYCLES
        for key in KEYS
    }
    ratios = {
        kind: {
            f"{cycle} {key}": middle[kind, cycle, key] / middle["alone", cycle, key] for cycle in CYCLES for key in KEYS
        }
        for kind in RUNS
    }
    if options.json:
        json.dump({"runs": found, "ratios": ratios}, sys.stdout)
        print()
        return 0
    print(f"{options.filter}, {options.observe:g} observations a second, {runs} × {seconds:g} s of each, medians")
    print(f"{'':24s}{'[ms]':>14s}{'':18s}ratio to alone")
    print(f"{'':24s}{'p50':>9s}{'p99':>9s}{'':9s}{'p50':>9s}{'p99':>9s}")
    for cycle, rate in CYCLES.items():
        print(f"{cycle} cycle, p99 wanted below {1e3 * SHARE / rate:g} ms")
        for kind in RUNS:
            times = "".join(f"{1e3 * middle[kind, cycle, key]:9.3f}" for key in KEYS)
            print(f"  {kind:22s}{times}{'':9s}" + "".join(f"{ratios[kind][f'{cycle} {key}']:9.2f}" for key in KEYS))
    for kind, made in found.items():
        sums = [sum(one[what] for one in made) for what in ("unrecorded", "lost_samples", "missed", "commands")]
        print("{}: {} not recorded, {} samples lost, {} of {} commands missed".format(kind, *sums))
    looks = [look for one in found["followed"] for look in one["looks"]]
    print(f"the slowest look of a follower: {1e3 * max(looks):.0f} ms; each was told all there was")
    return 0


if __name__ == "__main__":
    sys.exit(main())
