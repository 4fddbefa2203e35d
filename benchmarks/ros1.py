"""ROS 1 at 100 Hz: joint states of one process in, joint trajectories out to another; what is lost, what is added.

Three processes beside a master of their own: one sends; one follows with a session, looks for samples at 500 Hz and
answers what came with a command; one receives. The latency that is added is the time from a joint state's sending to
its command's arrival, less what `observe` and `respond` took of it: two ways over TCP, and the wait for a cycle. A
message is told by its number, which is the position of one joint more.
"""

from __future__ import annotations

import argparse
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import one_thread  # noqa: F401 - before numpy

# isort: split
import numpy as np
from sizes import DURATION, Size, make_model, partner
from timing import spread

from inphase.errors import OptionError
from inphase.runtime import Command, Synchroniser, SystemClock
from inphase.runtime.adapters.ros1_node import find_rospy, message_class
from inphase.runtime.adapters.ros1_robot import STATE, TRAJECTORY, Ros1Robot
from inphase.runtime.adapters.ros1_sensor import Ros1Sensor
from inphase.workers import workers

ROWS = {
    "session": "observe and respond",
    "in": "added: from sending to receipt",
    "cycle": "added: in the follower",
    "out": "added: from command to arrival",
    "added": "added in all",
}
JOINTS, COMMANDS, NUMBER = "/benchmark/joints", "/benchmark/commands", "number"
WANTED = 0.005  # [s] for the p99 of what is added
Taken = dict[int, tuple[float, float, float]]  # by number [s]: received, what the session took, commanded
WARM_UP = 100  # messages before those that count


def node(name: str) -> Any:
    """rospy as a node of a process that does not know inphase's adapters."""
    rospy = find_rospy()
    rospy.init_node(name, anonymous=True, disable_signals=True)
    return rospy


def send(rate: float, count: int, channels: int, observed: int) -> None:
    """Send so many joint states; then say when each was sent."""
    rospy, joint_state = node("send"), message_class(STATE)
    samples = round(DURATION * rate)
    values = partner(make_model(Size(channels, 15, 108), np.random.default_rng(0)), samples, np.random.default_rng(1))
    names = [f"joint_{i}" for i in range(observed)] + [NUMBER]
    publisher = rospy.Publisher(JOINTS, joint_state, queue_size=0, tcp_nodelay=True)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    time.sleep(0.5)
    sent, begun = [], time.perf_counter()
    for k in range(count):
        SystemClock().wait_until(begun + k / rate)
        message = joint_state(name=names, position=[*values[k % samples].tolist(), float(k)])
        message.header.stamp = rospy.Time.now()
        sent.append(time.perf_counter())
        publisher.publish(message)
    print(json.dumps(sent), flush=True)
    sys.stdin.read()


def receive(count: int, seconds: float) -> None:
    """Wait for so many commands, but not for ever; then say which came, and when."""
    rospy, arrived = node("receive"), []

    def take(message: Any) -> None:
        now = time.perf_counter()
        arrived.append((int(message.points[0].positions[-1]), now))

    rospy.Subscriber(COMMANDS, message_class(TRAJECTORY), take, tcp_nodelay=True)
    print("ready", flush=True)
    end = time.perf_counter() + seconds
    while len(arrived) < count and time.perf_counter() < end:
        time.sleep(0.1)
    print(json.dumps(arrived), flush=True)
    sys.stdin.read()


def follow(count: int, channels: int, poll: float, filter: str, seconds: float) -> tuple[Taken, int]:
    """Answer what came with a command, in every cycle in which something did; also says how many samples came."""
    model, clock = make_model(Size(channels, 15, 108), np.random.default_rng(0)), SystemClock()
    session = model.session(filter)
    joints = [f"joint_{i}" for i in range(len(model.observed))]
    fields = {name: f"position[{joint}]" for name, joint in zip(model.observed, joints, strict=True)}
    sensor = Ros1Sensor("partner", JOINTS, STATE, {**fields, NUMBER: f"position[{NUMBER}]"})
    robot = Ros1Robot("robot", [*model.controlled, NUMBER], COMMANDS, JOINTS)
    taken: Taken = {}
    together = Synchroniser({sensor.name: sensor.signals}, staleness=0.5)
    first, seen = 0.0, 0
    robot.start(clock)
    while not robot.listeners:
        time.sleep(0.01)
    sensor.start(clock)
    end, cycle = clock.now() + seconds, clock.now()
    while seen < count and clock.now() < end:
        cycle = max(cycle + 1 / poll, clock.now())
        clock.wait_until(cycle)
        samples = sensor.read()
        if not samples:
            continue
        seen += len(samples)
        together.take(sensor.name, samples)
        *values, number = together.at(clock.now())
        begun = time.perf_counter()
        if session.time is not None and samples[-1].received - first > DURATION:
            session.reset()
        if session.time is None:
            first = samples[-1].received
        session.observe(samples[-1].received, values)
        response = session.respond(samples=2)
        spent = time.perf_counter() - begun
        robot.command(Command(np.array([clock.now() + 0.02]), np.append(response.mean[0], number)[None]))
        taken[int(number)] = samples[-1].received, spent, time.perf_counter()
    time.sleep(0.5)  # for what is on its way
    sensor.stop()
    robot.stop()
    return taken, seen


@contextmanager
def master() -> Iterator[None]:
    """A master for this process and those it starts, on a free port of this machine alone."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as folder:
        os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1", ROS_LOG_DIR=folder)
        with started("rosmaster", "--core", "-p", str(port), stdout=subprocess.DEVNULL):
            while True:
                with socket.socket() as probe:
                    if probe.connect_ex(("127.0.0.1", port)) == 0:
                        break
                time.sleep(0.05)
            yield
            find_rospy().signal_shutdown("the benchmark is over")


@contextmanager
def started(*command: str, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """A process that ends with the block."""
    process = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, **{"stdout": subprocess.PIPE, **options})
    try:
        yield process
    finally:
        process.terminate()
        process.communicate()


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """The figures of one run."""
    count = WARM_UP + round(options.seconds * options.rate)
    longest = 30 + 1.5 * count / options.rate
    part = (sys.executable, __file__, "--channels", str(options.channels), "--rate", str(options.rate))
    with master(), started(*part, "--receive", str(count), "--seconds", str(longest)) as receiver:
        receiver.stdout.readline()
        with started(*part, "--send", str(count)) as sender:
            taken, seen = follow(count, options.channels, options.poll, options.filter, longest)
            sent = json.loads(sender.stdout.readline())
        arrived = json.loads(receiver.stdout.readline())
    come = dict(arrived)
    known = [k for k in range(WARM_UP, count) if k in come and k in taken]
    received, spent, commanded = np.array([taken[k] for k in known]).T
    left, there = np.array([(sent[k], come[k]) for k in known]).T
    return {
        "sent": count,
        "lost_on_the_way_in": count - seen,
        "overtaken": seen - len(taken),
        "commands": len(taken),
        "lost_on_the_way_out": len(taken) - len(come),
        "twice": len(arrived) - len(come),
        "session": spread(spent),
        "in": spread(received - left),
        "cycle": spread(commanded - received - spent),
        "out": spread(there - commanded),
        "added": spread(there - left - spent),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, metavar="S")
    parser.add_argument("--rate", type=float, default=100.0, metavar="HZ", help="of the joint states")
    parser.add_argument("--poll", type=float, default=500.0, metavar="HZ", help="how often the follower looks for them")
    parser.add_argument("--channels", type=int, default=30)
    parser.add_argument("--filter", default="rbpf")
    parser.add_argument("--json", metavar="FILE", help="where to write the figures")
    parser.add_argument("--send", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--receive", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.send is not None:
        send(options.rate, options.send, options.channels, options.channels // 2)
        return 0
    if options.receive is not None:
        receive(options.receive, options.seconds)
        return 0
    try:
        find_rospy()
    except OptionError as error:
        parser.error(str(error))
    with workers(1):
        figures = measure(options)
    print(
        f"ROS 1, {options.filter}, {options.channels} channels, {options.rate:g} Hz for {options.seconds:g} s: "
        f"{figures['sent']} joint states, {figures['lost_on_the_way_in']} lost; {figures['overtaken']} "
        f"came with the next in one cycle; {figures['commands']} commands, {figures['lost_on_the_way_out']} lost"
    )
    for name, what in ROWS.items():
        row = {key: value / 1e3 for key, value in figures[name].items()}
        print(f"  {what:<36} median {row['median']:6.2f}, p99 {row['p99']:6.2f}, max {row['max']:6.2f} ms")
    print(f"  wanted: nothing lost, and a p99 of what is added below {1e3 * WANTED:g} ms")
    if options.json:
        from inphase.io.atomic import whole_file

        with whole_file(options.json) as temporary:
            temporary.write_text(json.dumps(figures, indent=1), encoding="utf-8")
        print(f"wrote {options.json}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
