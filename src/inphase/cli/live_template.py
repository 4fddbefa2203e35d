"""The file of an interaction to copy: every table with its entries, as `inphase demo --live` writes it."""

from __future__ import annotations

import json
from math import floor, log10

import numpy as np

from inphase.filters import FILTERS
from inphase.model import Model

ROOM = 0.5  # of the range of a movement, beyond it, before a limit of position
QUICK, BRISK = 3.0, 10.0  # times the fastest of the mean movement; and that velocity, times a second, as acceleration
TEXT = """\
# An interaction, as `inphase live` runs it. Paths are relative to this file; times are in seconds.
# What stands behind a # may be left out, or is the default. docs/live.md tells of every entry.

model = {model}

[filter]
name = {filter}  # how phase and response are inferred: {filters}
seed = {seed}  # of its random numbers
# particles = 200  # and whatever else that filter can be told

[rates]  # how often, in a second,
sense = 60  # sensors are looked at,
# observe = 30  # what came since is observed as one, averaged; without it, every reading by itself,
respond = 30  # the response is made anew,
command = 60  # the robot is sent where to be

[sensing]
staleness = 0.25  # how long a reading stands for; by channel: {{ x = 0.1, "hand_*" = 0.5 }}
delay = 0.0  # how long to wait for sensors that are slow
needed = []  # channels without any of which nothing is seen; without these, all have to be gone

[sensors.hand]  # a table for each sensor, by a name of one's own
device = "simulated_partner"  # or "replay", with file = "recording.csv"; or a device of your own
clock = "shared"  # its times are of this computer's clock; "own" for one that has another
rate = 60
tempo = 1.3  # of the demonstrations'
pauses = [[2.0, 1.0]]  # [begin, length] each
noise = 0.01  # of a channel's spread
seed = 0

[robot]
device = "simulated_robot"  # or a device of your own
home = {home}
time_constant = 0.05  # how slowly it follows

[robot.limits]  # by channel or pattern, a later one overrides an earlier; nothing that is sent goes beyond
{limits}

[response]
samples = 50  # of a response
control_lag = 0.05  # how far the robot is behind what it is sent, which a run tells at its end
# lookahead = 0.0  # in its place: so much of phase, 0 … 1, ahead of the partner
start = 0.0  # the phase before which the robot waits,
stop = 1.0  # and the one up to which it goes
# horizon = 0.5  # send trajectories of that length; otherwise single points

[smoothing]
alpha = 0.5  # share of a new response in what is sent; 1 for none of what was sent before
# beta = 0.1  # the same of its velocity; found from alpha

[safety]  # what is answered to which trouble: hold, retreat or stop
stale_sensors = "hold"  # nothing is read of the partner
collapsed_filter = "hold"  # the filter has lost the interaction
unlike_partner = "hold"  # the partner moves unlike any demonstration
missed_deadlines = "hold"  # the loop is too slow
lost_robot = "stop"  # it does not answer; no retreat
interrupt = "stop"  # Ctrl-C
crash = "stop"  # the program failed
good_cycles = 10  # without trouble, after a hold, before it goes on
retreat = {home}  # where retreats end
longest_retreat = 10.0  # and after which they are a stop
silence = 0.2  # after which a robot that does not answer is lost
late_commands = 3  # left out in a row, the loop is too slow
# watchdog = 0.1  # the loop may stand still before the robot is braked

[recording]  # without this table nothing is recorded
folder = "runs"
capacity = 4096  # samples, responses and commands that may wait for the disk

# [outputs.services]  # what else is offered to others, such as ROS services or LSL markers
# device = "ros1"

# [demonstrations]  # `inphase record` takes them with these sensors
# folder = "demonstrations"
"""


def live_toml(model: Model, file: str, filter: str, seed: int) -> str:
    """The text of a configuration in which a simulated robot is led by a model that is in a file."""
    count = len(model.observed)
    phases = np.linspace(0, 1, 101)
    mean = model.predict(phases)[:, count:]
    home = [f"{json.dumps(name)} = {_short(mean[0, i], 2)}" for i, name in enumerate(model.controlled)]
    limits = []
    for name, course in zip(model.controlled, mean.T, strict=True):
        room = ROOM * np.ptp(course)
        velocity = QUICK * float(np.abs(np.diff(course)).max()) * 100 * model.phase.nominal_velocity
        low, high = _short(course.min() - room, 2), _short(course.max() + room, 2)
        steps = f"velocity = {_short(velocity, 1)}, acceleration = {_short(BRISK * velocity, 1)}"
        limits.append(f"{json.dumps(name)} = {{ low = {low}, high = {high}, {steps} }}")
    return TEXT.format(
        model=json.dumps(file),
        filter=json.dumps(filter),
        filters=", ".join(FILTERS),
        seed=seed,
        home=f"{{ {', '.join(home)} }}",
        limits="\n".join(limits),
    )


def _short(value: float, digits: int) -> str:
    """As few digits as are meaningful."""
    if value == 0 or not np.isfinite(value):
        return "0.0"
    places = max(digits - 1 - floor(log10(abs(value))), 0)
    return f"{round(float(value), digits - 1 - floor(log10(abs(value)))):.{max(places, 1)}f}"
