"""ROS 1 at 100 Hz: joint states of one process in, joint trajectories out to another; what is lost, what is added.

Three processes beside a master of their own: one sends; one is the live loop, which looks for samples and commands at
500 Hz; one receives. The latency that is added is the time from a joint state's sending to the arrival of the first
command that knows of it, less what `observe` and `respond` took of it: two ways over TCP, and the wait for a cycle. A
joint state is told by its number, which is the position of one joint more, and a command by the one in its header.
"""

from __future__ import annotations

import argparse
import json
import os
import select
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
from inphase.result import Estimate, Response
from inphase.runtime import Command, Conduct, Limits, Loop, Play, Rates, Sample, SystemClock
from inphase.runtime.adapters.ros1_node import find_rospy, message_class
from inphase.runtime.adapters.ros1_robot import STATE, TRAJECTORY, Ros1Robot
from inphase.runtime.adapters.ros1_sensor import Ros1Sensor
from inphase.session import Session
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
WARM_UP = 100  # messages before those that count; the first are heard by the robot, before the sensor begins


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


def receive(seconds: float) -> None:
    """Take commands until a line comes, or it takes too long; then say when each arrived."""
    rospy, arrived = node("receive"), {}

    def take(message: Any) -> None:
        arrived[message.header.seq] = time.perf_counter()

    rospy.Subscriber(COMMANDS, message_class(TRAJECTORY), take, tcp_nodelay=True)
    print("ready", flush=True)
    select.select([sys.stdin], [], [], seconds)
    print(json.dumps(arrived), flush=True)
    sys.stdin.read()


class Numbered(Ros1Sensor):
    """Remembers when the message of every number came."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.came: dict[int, float] = {}

    def read(self) -> list[Sample]:
        """All that came since the last call."""
        samples = super().read()
        self.came.update({int(sample.values[-1]): sample.received for sample in samples})
        return samples


class Counted(Ros1Robot):
    """Remembers when it was commanded, and by what was known then."""

    def __init__(self, *args: Any, sensor: Numbered, timed: Timed, **options: Any) -> None:
        super().__init__(*args, **options)
        self.sent: list[tuple[int, float, float]] = []  # newest number, what the session took for it, when
        self._sensor, self._timed = sensor, timed

    def command(self, command: Command) -> None:
        """Publish it."""
        newest = next(reversed(self._sensor.came), -1)
        self.sent.append((newest, self._timed.spent.pop(newest, 0.0), time.perf_counter()))
        super().command(command)


class Timed:
    """A session that says how long it took over every sample."""

    def __init__(self, session: Session, sensor: Numbered) -> None:
        self.spent: dict[int, float] = {}
        self._session, self._sensor = session, sensor
        self.reset = session.reset

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)

    def observe(self, *args: Any) -> Estimate:
        """As the session."""
        return self._measured(self._session.observe, *args)

    def respond(self, *args: Any, **options: Any) -> Response:
        """As the session."""
        return self._measured(self._session.respond, *args, **options)

    def _measured(self, call: Any, *args: Any, **options: Any) -> Any:
        begun = time.perf_counter()
        answer = call(*args, **options)
        newest = next(reversed(self._sensor.came), -1)
        self.spent[newest] = self.spent.get(newest, 0.0) + time.perf_counter() - begun
        return answer


def follow(
    count: int, channels: int, look: float, filter: str, seconds: float
) -> tuple[dict[int, float], list[tuple[int, float, float]]]:
    """The live loop between the two topics: when every number came, and when each command left."""
    model, clock = make_model(Size(channels, 15, 108), np.random.default_rng(0)), SystemClock()
    joints = [f"joint_{i}" for i in range(len(model.observed))]
    fields = {name: f"position[{joint}]" for name, joint in zip(model.observed, joints, strict=True)}
    sensor = Numbered("partner", JOINTS, STATE, {**fields, NUMBER: f"position[{NUMBER}]"})
    timed = Timed(model.session(filter), sensor)
    answering = dict(zip(model.controlled, joints, strict=True))
    robot = Counted("robot", answering, COMMANDS, JOINTS, sensor=sensor, timed=timed)
    wide = np.full(len(robot.signals), 1e3)
    loop = Loop(
        timed,  # type: ignore[arg-type]
        [sensor],
        robot,
        clock,
        Conduct(Limits(-wide, wide, wide, wide)),
        rates=Rates(sense=look, respond=look, command=look),
        play=Play(samples=2),
    )
    begun = clock.now()
    loop.begin()
    loop.actuation.watchdog.start()
    following = clock.now() + DURATION
    while count - 1 not in sensor.came and clock.now() < begun + seconds:
        clock.wait_until(loop.due)
        if clock.now() >= following:
            loop.reset()
            following += DURATION
        loop.cycle()
    loop.end()
    time.sleep(0.5)  # for what is on its way
    return sensor.came, robot.sent


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
    with master(), started(*part, "--receive", str(longest)) as receiver:
        receiver.stdout.readline()
        with started(*part, "--send", str(count)) as sender:
            came, commands = follow(count, options.channels, options.look, options.filter, longest)
            sent = json.loads(sender.stdout.readline())
        receiver.stdin.write("\n")
        receiver.stdin.flush()
        arrived = {int(seq) - 1: then for seq, then in json.loads(receiver.stdout.readline()).items()}
    first: dict[int, int] = {}  # by number, the command that answered it first
    for place, (number, spent, _) in enumerate(commands):
        if spent and number >= WARM_UP and place in arrived:
            first.setdefault(number, place)
    received = np.array([came[k] for k in first])
    spent, commanded = np.array([commands[place][1:] for place in first.values()]).T
    left, there = np.array([(sent[k], arrived[place]) for k, place in first.items()]).T
    return {
        "sent": count - WARM_UP,
        "lost_on_the_way_in": sum(k not in came for k in range(WARM_UP, count)),
        "answered": len(first),
        "commands": len(commands),
        "lost_on_the_way_out": len(commands) - len(arrived),
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
    parser.add_argument("--look", type=float, default=500.0, metavar="HZ", help="how often the loop looks for them")
    parser.add_argument("--channels", type=int, default=30)
    parser.add_argument("--filter", default="rbpf")
    parser.add_argument("--json", metavar="FILE", help="where to write the figures")
    parser.add_argument("--send", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--receive", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.send is not None:
        send(options.rate, options.send, options.channels, options.channels // 2)
        return 0
    if options.receive is not None:
        receive(options.receive)
        return 0
    try:
        find_rospy()
    except OptionError as error:
        parser.error(str(error))
    with workers(1):
        figures = measure(options)
    print(
        f"ROS 1, {options.filter}, {options.channels} channels, {options.rate:g} Hz for {options.seconds:g} s: "
        f"{figures['sent']} joint states, {figures['lost_on_the_way_in']} lost; "
        f"{figures['commands']} commands, {figures['lost_on_the_way_out']} lost"
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
