"""A program that sends a stream: `lsl_outlet.py NAME TYPE SOURCE FORMAT COUNT LABELS`, 100 samples a second.

Sample i is [i, 2 i, …]; the last of LABELS is NaN at every tenth. It says `ready` and waits for a line before it sends.
"""

from __future__ import annotations

import sys
import time

import pylsl

name, kind, source, form, count, labels = sys.argv[1:]
info = pylsl.StreamInfo(name, kind, len(labels.split(",")), 100.0, form, source)
channels = info.desc().append_child("channels")
for label in labels.split(","):
    channel = channels.append_child("channel")
    channel.append_child_value("label", label)
    channel.append_child_value("unit", "m")
outlet = pylsl.StreamOutlet(info)
print("ready", flush=True)
sys.stdin.readline()
outlet.wait_for_consumers(10.0)
begun = pylsl.local_clock()
for i in range(int(count)):
    time.sleep(max(begun + i / 100 - pylsl.local_clock(), 0.0))
    if form == "string":
        outlet.push_sample([str(i)] * len(labels.split(",")))
        continue
    values = [i * (k + 1) for k in range(len(labels.split(",")))]
    if i % 10 == 9 and form != "int32":
        values[-1] = float("nan")
    outlet.push_sample(values, begun + i / 100)
print("sent", flush=True)
sys.stdin.readline()
