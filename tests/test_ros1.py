"""ROS 1 against a real master: what is sent is received, what is wrong is named, and nothing waits for the dead."""

from __future__ import annotations

import json
import logging
import math
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from xmlrpc.client import ServerProxy

import numpy as np
import pytest
from interactions import dataset, recording, shapes_unchecked, taught
from ros_programs import FIRST_STAMP, elbow
from system_packages import need

from inphase.errors import OptionError
from inphase.result import Estimate, Status
from inphase.runtime import Command, FakeClock, Fate, Robot, Sensor, Signal, Synchroniser, SystemClock
from inphase.runtime.adapters import ros1_node
from inphase.runtime.adapters.ros1_robot import Ros1Robot
from inphase.runtime.adapters.ros1_sensor import Ros1Sensor
from inphase.runtime.adapters.ros1_services import Ros1Services
from inphase.runtime.configuration.devices import make_device
from inphase.runtime.configuration.section import Section
from inphase.runtime.live import Output

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

try:
    import rospy
except ImportError:
    rospy = None

PROGRAMS = Path(__file__).with_name("ros_programs.py")
JOINTS = {"giver_s": "position[shoulder]", "giver_e": "position[elbow]"}
# rospy's own: it uses old names of threading, and leaves its sockets to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning:(rospy|rosgraph|rosmaster|genpy|roslib)"),
    pytest.mark.filterwarnings("ignore:unclosed <socket:ResourceWarning"),
]


# ---------------------------------------------------------------------------------------------------- around the tests


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(condition: Callable[[], object], seconds: float = 20.0) -> None:
    """Wait for something that other processes do."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.01)


def answers(uri: str) -> bool:
    try:
        with ServerProxy(uri) as proxy:
            return bool(proxy.getPid("/test"))
    except OSError:
        return False


@contextmanager
def running(*command: object, **options: object) -> Iterator[subprocess.Popen[str]]:
    """A process for as long as the test wants it, and not longer."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    process = subprocess.Popen([str(word) for word in command], **{**pipes, **options})  # type: ignore[call-overload]
    try:
        yield process
    finally:
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def program(*words: object, **options: object):
    """One of ros_programs.py."""
    return running(sys.executable, PROGRAMS, *words, **options)


def told(process: subprocess.Popen[str], word: str) -> str:
    """What a program answers to a line."""
    process.stdin.write(word + "\n")
    process.stdin.flush()
    return process.stdout.readline().strip()


@pytest.fixture(scope="module")
def master(tmp_path_factory) -> Iterator[str]:
    """A roscore of the tests' own, and this process as a node of it until the module ends."""
    need(rospy, "ROS 1 (.ci/run says which packages of Debian)")
    need(shutil.which("roscore"), "roscore: apt-get install python3-roslaunch rosout")
    port, root = free_port(), logging.getLogger()
    before = root.handlers[:], root.level
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
        patch.setenv("ROS_IP", "127.0.0.1")
        patch.setenv("ROS_HOME", str(tmp_path_factory.mktemp("ros")))
        with running("roscore", "-p", port, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL):
            until(lambda: answers(os.environ["ROS_MASTER_URI"]))
            yield os.environ["ROS_MASTER_URI"]
            rospy.signal_shutdown("the tests are over")
    for handler in {*root.handlers, *logging.getLogger("rosout").handlers} - {*before[0]}:
        handler.close()
    root.handlers[:], root.level = before
    logging.getLogger("rosout").handlers.clear()


@pytest.fixture
def topic(master) -> str:
    """A topic of this test alone."""
    return f"/t{uuid.uuid4().hex[:12]}"


@contextmanager
def started(*devices):
    """Devices that are stopped in any case; with a clock that stands still unless the test moves it."""
    clock = FakeClock(100.0)
    try:
        for device in devices:
            device.start(clock)
        yield clock
    finally:
        for device in devices:
            device.stop()


@pytest.fixture
def publisher(master) -> Iterator[Callable]:
    """Makes publishers beside the devices, in the same node: over TCP all the same, and somebody listens already."""
    made = []

    def make(topic: str, type: str):
        made.append(rospy.Publisher(topic, ros1_node.message_class(type), queue_size=0))
        until(made[-1].get_num_connections)
        return made[-1]

    yield make
    for one in made:
        one.unregister()


def joint_state(names, positions, stamp: float = 0.0):
    message = ros1_node.message_class("sensor_msgs/JointState")(name=names, position=positions)
    message.header.stamp = rospy.Time.from_sec(stamp)
    return message


def collected(sensor: Ros1Sensor, count: int):
    samples = []
    until(lambda: samples.extend(sensor.read()) or len(samples) >= count)
    return samples


def registered(uri: str) -> list[str]:
    """The topics and services of this process, as the master knows them; less what all nodes of rospy have."""
    with ServerProxy(uri) as proxy:
        state = proxy.getSystemState("/test")[2]
    mine = [name for part in state for name, nodes in part if rospy.get_name() in nodes]
    return sorted(n for n in mine if n != "/rosout" and not n.startswith(rospy.get_name()))


# ---------------------------------------------------------------------------------------------------- without a master


def test_without_ros_the_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "rospy", None)
    for make in (
        lambda: Ros1Sensor("arm", "/joint_states", "sensor_msgs/JointState", JOINTS),
        lambda: Ros1Robot("robot", ["elbow"], "/command"),
        lambda: Ros1Services(Loop()),
    ):
        with pytest.raises(OptionError, match=r"apt-get install python3-rospy; .*\.pth"):
            make()


def test_a_package_of_messages_that_is_missing_is_named(master, monkeypatch):
    import genpy.message

    monkeypatch.setattr(genpy.message, "_message_class_cache", {})
    for module in ("sensor_msgs", "sensor_msgs.msg"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(OptionError, match=r"apt-get install python3-sensor-msgs; .*\.pth"):
        Ros1Sensor("arm", "/joint_states", "sensor_msgs/JointState", JOINTS)


@pytest.mark.parametrize(
    ("type", "place", "expected"),
    [
        ("JointState", "position[elbow]", "expected a ROS type such as sensor_msgs/JointState, got 'JointState'"),
        ("sensor_msgs/Joint", "position[elbow]", "sensor_msgs has no Joint; it has .*JointState"),
        ("sensor_msgs/JointState", "pose.x", "expected one of header, name, position, velocity, effort, got 'pose'"),
        ("sensor_msgs/JointState", "position", "is a list"),
        ("sensor_msgs/JointState", "position.x", "got 'x'"),
        ("sensor_msgs/JointState", "header.frame_id", "expected a number .* got text"),
        ("geometry_msgs/PoseStamped", "pose.position", "expected a number .* got geometry_msgs/Point"),
        ("geometry_msgs/PoseStamped", "pose.position.x[0]", "is a number"),
        ("geometry_msgs/PoseStamped", "pose..x", "expected a place in a message"),
    ],
)
def test_a_type_or_a_place_that_is_none_is_named(master, type, place, expected):
    with pytest.raises(OptionError, match=expected):
        Ros1Sensor("arm", "/joint_states", type, {"giver_e": place})


def test_other_values_that_do_not_fit_are_named(master):
    with pytest.raises(OptionError, match="arm: expected fields"):
        Ros1Sensor("arm", "/a", "sensor_msgs/JointState", {})
    with pytest.raises(OptionError, match="capacity of at least 1"):
        Ros1Sensor("arm", "/a", "sensor_msgs/JointState", JOINTS, capacity=0)
    for joints in ([], ["elbow", "elbow"]):
        with pytest.raises(OptionError, match="joints of different names"):
            Ros1Robot("robot", joints, "/c")
    for silent_after in (0.0, math.inf, math.nan):
        with pytest.raises(OptionError, match="silent_after"):
            Ros1Robot("robot", ["elbow"], "/c", silent_after=silent_after)
    with pytest.raises(OptionError, match="shortest"):
        Ros1Robot("robot", ["elbow"], "/c", shortest=-1.0)


def test_tables_of_a_configuration_make_them(master, tmp_path):
    """The keywords are what TOML can say, and what is wrong is told with its line."""
    text = """
[sensors.partner]
device = "ros1"
topic = "/partner/joint_states"
type = "sensor_msgs/JointState"
fields = { reach = "position[0]", lift = "position[lift_joint]" }
units = { "*" = "m" }

[robot]
device = "ros1"
joints = { grip = "finger", turn = "wrist" }
command = "/arm/command"
state = "/arm/joint_states"
silent_after = 0.2

[outputs.services]
device = "ros1"
namespace = "handover"
"""
    makers = [{"ros1": make} for make in (Ros1Sensor, Ros1Robot, Ros1Services)]

    def devices():
        root = Section("live.toml", text, tmp_path, tomllib.loads(text))
        tables = (("sensors", "partner"), ("robot",), ("outputs", "services"))
        for path, known in zip(tables, makers, strict=True):
            section = root
            for part in path:
                section = section.section(part)
            with shapes_unchecked():  # as for users: the checks of shapes do not know what a default may be
                made = make_device(section, known, name=path[-1], loop=Loop())
            yield made

    sensor, robot, services = devices()
    assert sensor.signals == (Signal("reach", "m"), Signal("lift", "m"))
    assert (robot.name, robot.joints) == ("robot", ("finger", "wrist"))
    assert isinstance(services, Output)
    text = text.replace("position[0]", "positions[0]")
    with pytest.raises(
        OptionError, match=r"line \d+: .*has no 'positions\[0\]': expected one of header, name, position"
    ):
        next(devices())


def test_signals_are_known_before_the_start(master):
    sensor = Ros1Sensor("arm", "/a", "sensor_msgs/JointState", JOINTS, units={"giver_?": "rad"})
    robot = Ros1Robot("robot", {"grip": "finger"}, "/c", units={"grip": "m"})
    assert isinstance(sensor, Sensor)
    assert isinstance(robot, Robot)
    assert sensor.signals == (Signal("giver_s", "rad"), Signal("giver_e", "rad"))
    assert robot.signals == (Signal("grip", "m"),)
    assert (sensor.read(), robot.state()) == ([], None)
    robot.command(Command(np.zeros(1), np.zeros((1, 1))))  # which goes nowhere
    sensor.stop()
    robot.stop()


def test_no_master_is_one_clear_error(master, monkeypatch):
    uri = f"http://127.0.0.1:{free_port()}"
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    for device in (
        Ros1Sensor("arm", "/a", "sensor_msgs/JointState", JOINTS),
        Ros1Robot("robot", ["elbow"], "/c"),
    ):
        with pytest.raises(OptionError, match=f"no ROS master answers at {uri} .*refused.*roscore.*ROS_MASTER_URI"):
            device.start(SystemClock())
    with pytest.raises(OptionError, match="no ROS master answers"):
        Ros1Services(Loop()).start()


def test_a_master_that_listens_and_says_nothing_is_not_waited_for(master, monkeypatch):
    monkeypatch.setattr(ros1_node, "WAIT", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as mute:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{mute.getsockname()[1]}")
        with pytest.raises(OptionError, match=r"no ROS master answers .*timed out"):
            Ros1Sensor("arm", "/a", "sensor_msgs/JointState", JOINTS).start(SystemClock())


@pytest.mark.parametrize("uri", ["nonsense", "http://127.0.0.1:x", "ftp://127.0.0.1:1", ""])
def test_an_address_that_is_none_is_named(master, monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(OptionError, match="no ROS master answers at"):
        Ros1Sensor("arm", "/a", "sensor_msgs/JointState", JOINTS).start(SystemClock())


# ------------------------------------------------------------------------------------------------------------ sensors


def test_every_message_of_another_process_is_received_as_it_was_sent(topic):
    sensor, count, rate = Ros1Sensor("arm", topic, "sensor_msgs/JointState", JOINTS), 100, 100.0
    clock = SystemClock()
    begun = clock.now()
    sensor.start(clock)
    try:
        with program("publish", topic, count, rate):
            samples = collected(sensor, count)
    finally:
        sensor.stop()
    k = np.arange(count)
    np.testing.assert_array_equal([s.values for s in samples], [[i, elbow(i, rate)] for i in k])
    np.testing.assert_allclose([s.stamp for s in samples], FIRST_STAMP + k / rate, atol=2e-9)  # ROS counts [ns]
    received = np.array([begun, *(s.received for s in samples), clock.now()])
    assert (np.diff(received) >= 0).all()
    assert sensor.dropped == 0


def test_places_of_several_types_and_stamps(topic, publisher):
    pose = Ros1Sensor(
        "hand", topic + "/pose", "geometry_msgs/PoseStamped", {"x": "pose.position.x", "qw": "pose.orientation.w"}
    )
    array = Ros1Sensor("glove", topic + "/array", "std_msgs/Float64MultiArray", {"a": "data[0]", "b": "data[2]"})
    with started(pose, array) as clock:
        message = ros1_node.message_class("geometry_msgs/PoseStamped")()
        message.header.stamp = rospy.Time(12, 500_000_000)
        message.pose.position.x, message.pose.orientation.w = 1.5, -0.5
        publisher(topic + "/pose", "geometry_msgs/PoseStamped").publish(message)
        (sample,) = collected(pose, 1)
        assert (sample.values.tolist(), sample.stamp, sample.received) == ([1.5, -0.5], 12.5, 100.0)
        clock.advance(1.0)
        publisher(topic + "/array", "std_msgs/Float64MultiArray").publish(data=[7.0, 8.0, 9.0])
        (sample,) = collected(array, 1)  # it has no header: stamped by its receipt
        assert (sample.values.tolist(), sample.stamp, sample.received) == ([7.0, 9.0], 101.0, 101.0)


def test_what_a_message_has_not_is_nan_and_named(topic, publisher):
    sensor = Ros1Sensor("arm", topic, "sensor_msgs/JointState", {**JOINTS, "typo": "position[ellbow]"})
    with started(sensor):
        assert sensor.unseen == ("giver_s", "giver_e", "typo")
        made = publisher(topic, "sensor_msgs/JointState")
        made.publish(joint_state(["elbow", "shoulder"], [math.nan, 1.0]))
        made.publish(joint_state(["elbow"], [2.0]))
        made.publish(joint_state(["elbow", "shoulder"], [3.0]))  # whose?
        samples = collected(sensor, 3)
        np.testing.assert_array_equal(
            [s.values for s in samples], [[1.0, np.nan, np.nan], [np.nan, 2.0, np.nan], [np.nan] * 3]
        )
        assert [s.stamp for s in samples] == [100.0] * 3  # a header that was not set is no stamp
        assert sensor.unseen == ("typo",)


def test_of_more_than_may_wait_the_newest_are_kept_and_the_others_counted(topic, publisher):
    sensor = Ros1Sensor("arm", topic, "sensor_msgs/JointState", JOINTS, capacity=5)
    with started(sensor):
        made = publisher(topic, "sensor_msgs/JointState")
        for k in range(50):
            made.publish(joint_state(["shoulder", "elbow"], [k, k]))
        until(lambda: sensor.dropped == 45)
        assert [s.values[0] for s in sensor.read()] == [45, 46, 47, 48, 49]


def test_a_topic_of_another_type_is_refused_by_name(topic):
    other = rospy.Publisher(topic, ros1_node.message_class("std_msgs/Float64MultiArray"), queue_size=1)
    try:
        with pytest.raises(
            OptionError, match=f"arm: expected sensor_msgs/JointState on {topic}, got std_msgs/Float64MultiArray"
        ):
            Ros1Sensor("arm", topic, "sensor_msgs/JointState", JOINTS).start(SystemClock())
    finally:
        other.unregister()


def test_a_type_defined_otherwise_is_not_read_and_disturbs_no_other(topic):
    sensor = Ros1Sensor("arm", topic, "sensor_msgs/JointState", JOINTS)
    with program("other_checksum", topic) as other, started(sensor):
        assert other.stdout.readline() == "ready\n"
        with program("publish", topic, 20, 100.0):
            samples = collected(sensor, 20)
        assert [s.values[0] for s in samples] == list(range(20))
        assert sensor.read() == []


# -------------------------------------------------------------------------------------------------------------- robot


def test_a_state_is_put_together_and_is_none_once_a_joint_is_silent(topic, publisher):
    robot = Ros1Robot("robot", {"a": "elbow", "b": "finger"}, topic + "/command", topic, silent_after=0.5)
    with started(robot) as clock:
        made = publisher(topic, "sensor_msgs/JointState")

        def publish(joints: list[str], positions: list[float], stamp: float) -> None:
            before = robot._latest
            made.publish(joint_state(joints, positions, stamp))
            until(lambda: robot._latest is not before)

        publish(["shoulder", "elbow"], [9.0, 1.0], 50.0)
        assert robot.state() is None  # the finger is not known
        clock.advance(0.2)
        publish(["finger"], [2.0], 50.2)
        state = robot.state()
        assert (state.values.tolist(), state.stamp, state.received) == ([1.0, 2.0], 50.0, 100.0)
        clock.advance(0.3)
        assert robot.state() is not None
        clock.advance(0.01)
        assert robot.state() is None  # the elbow is silent for 0.51 s
        publish(["elbow", "finger"], [3.0, math.nan], 50.5)
        assert robot.state().values.tolist() == [3.0, 2.0]  # NaN is no position
    assert robot.state() is None


@contextmanager
def wire(robot: Ros1Robot, topic: str):
    """The trajectories that come over the wire."""
    come: list = []
    subscriber = rospy.Subscriber(topic, ros1_node.message_class("trajectory_msgs/JointTrajectory"), come.append)
    until(lambda: subscriber.get_num_connections() and robot.listeners)
    yield come
    subscriber.unregister()


@pytest.mark.parametrize(
    ("after", "sent"),  # [s] from the time of sending
    [
        ([0.1, 0.2, 0.35], [0.1, 0.2, 0.35]),
        ([0.25], [0.25]),  # a single point
        ([-0.2, -0.1, 0.0, 0.1], [0.1]),  # what has passed is left out
        ([0.005, 0.02], [0.02]),
        ([0.0], [0.01]),  # but for the last point
        ([-2.0, -1.0], [0.01]),
    ],
)
def test_a_command_on_the_wire_is_due_when_the_loop_says(topic, after, sent):
    robot = Ros1Robot("robot", {"grip": "finger", "turn": "wrist"}, topic)
    with started(robot) as clock, wire(robot, topic) as come:
        positions = np.arange(2.0 * len(after)).reshape(-1, 2)
        before = rospy.Time.now()
        robot.command(Command(clock.now() + np.array(after), positions))
        until(lambda: come)
        (message,) = come
    assert message.joint_names == ["finger", "wrist"]
    np.testing.assert_array_equal([p.positions for p in message.points], positions[-len(sent) :])
    np.testing.assert_allclose([p.time_from_start.to_sec() for p in message.points], sent, atol=2e-9)
    assert before <= message.header.stamp <= rospy.Time.now()


def test_who_listens_before_the_start_gets_the_first_command_and_the_last(topic):
    for i in range(3):
        come: list = []
        listener = rospy.Subscriber(topic, ros1_node.message_class("trajectory_msgs/JointTrajectory"), come.append)
        robot = Ros1Robot("robot", ["elbow"], topic)
        with started(robot) as clock:
            for k in range(3):
                robot.command(Command(np.array([clock.now() + 1.0]), np.full((1, 1), 10.0 * i + k)))
        until(lambda come=come: len(come) == 3)
        assert [m.points[0].positions[0] for m in come] == [10.0 * i, 10.0 * i + 1, 10.0 * i + 2]
        listener.unregister()


def test_without_a_stamp_a_command_begins_when_it_arrives(topic):
    robot = Ros1Robot("robot", ["elbow"], topic, stamped=False)
    with started(robot) as clock, wire(robot, topic) as come:
        robot.command(Command(np.array([clock.now() + 1.0]), np.zeros((1, 1))))
        until(lambda: come)
    assert come[0].header.stamp == rospy.Time()


def test_another_number_of_positions_is_refused(topic):
    robot = Ros1Robot("robot", ["elbow", "wrist"], topic)
    with started(robot), pytest.raises(OptionError, match=r"robot: expected 2 positions \(elbow, wrist\), got 3"):
        robot.command(Command(np.ones(1), np.zeros((1, 3))))


# ----------------------------------------------------------------------------------------------------------- services


class Loop:
    """What a loop offers."""

    def __init__(self) -> None:
        self.estimate: Estimate | None = None
        self.resets = 0

    def reset(self) -> None:
        self.resets += 1


def test_services_tell_the_phase_and_begin_anew(master):
    loop = Loop()
    services, clock = Ros1Services(loop, "/handover/"), SystemClock()
    services.start()
    try:
        call = {
            name: rospy.ServiceProxy(f"/handover/{name}", ros1_node.service_class("std_srvs/Trigger"))
            for name in ("reset", "phase")
        }
        assert not call["phase"]().success
        loop.estimate = Estimate(clock.now(), 0.25, 0.01, 0.5, math.nan, -1.5, Status.UNLIKE)
        answer = call["phase"]()
        assert answer.success
        assert json.loads(answer.message) == {
            "time": loop.estimate.time,
            "phase": 0.25,
            "phase_std": 0.01,
            "phase_velocity": 0.5,
            "phase_velocity_std": None,  # NaN is no JSON
            "log_likelihood": -1.5,
            "status": "UNLIKE",
        }
        assert loop.resets == 0
        assert call["reset"]().success
        assert loop.resets == 1
        with pytest.raises(OptionError, match="/handover/reset"):
            Ros1Services(loop, "/handover").start()
        assert call["reset"]().success  # the first goes on
        assert registered(master) == ["/handover/phase", "/handover/reset"]
    finally:
        services.stop()
    assert registered(master) == []


# ------------------------------------------------------------------------------------------------------------ together


def test_two_sensors_and_a_robot_share_a_topic_and_a_stop_unregisters(master, topic, publisher):
    first, second = (Ros1Sensor(name, topic, "sensor_msgs/JointState", JOINTS) for name in ("first", "second"))
    robot = Ros1Robot("robot", ["elbow"], topic + "/command", topic)
    with started(first, second, robot):
        made = publisher(topic, "sensor_msgs/JointState")
        made.publish(joint_state(["shoulder", "elbow"], [1.0, 2.0]))
        assert len(collected(first, 1)) == len(collected(second, 1)) == 1
        until(robot.state)
        assert registered(master) == sorted([topic, topic, topic + "/command"])  # published and subscribed to
        first.stop()
        made.publish(joint_state(["shoulder", "elbow"], [3.0, 4.0]))
        collected(second, 1)
        assert first.read() == []
        made.unregister()
    assert registered(master) == []
    with started(first), program("publish", topic, 3, 100.0):  # and may be started once more
        assert len(collected(first, 3)) == 3
    assert registered(master) == []


def test_from_joint_states_to_joint_trajectories(topic, rng, publisher):
    """A partner in another process, whom a session follows, and what the robot is sent arrives in a third."""
    model = taught(dataset(rng))
    session, clock = model.session(seed=0), SystemClock()
    times, values = recording(rng)
    fields = {"reach": "position[0]", "lift": "position[1]"}
    sensor = Ros1Sensor("partner", topic, "sensor_msgs/JointState", fields)
    robot = Ros1Robot("robot", {"grip": "finger", "turn": "wrist"}, topic + "/command", topic + "/none")
    together = Synchroniser({"partner": sensor.signals}, 0.2, model.channels)
    sensor.start(clock)
    robot.start(clock)
    sent, estimate = [], None
    try:
        with program("collect", topic + "/command") as receiver:
            assert receiver.stdout.readline() == "connected\n"
            until(lambda: robot.listeners == 1)
            made = publisher(topic, "sensor_msgs/JointState")
            for time_, row in zip(times, values, strict=True):
                made.publish(joint_state(["a", "b"], row[:2].tolist(), stamp=FIRST_STAMP + time_))
                samples = collected(sensor, 1)
                together.take("partner", samples)
                np.testing.assert_array_equal(samples[0].values, row[:2])
                estimate = session.observe(time_, dict(zip(together.names, samples[0].values, strict=True)))
                response = session.respond(samples=5)
                # On the wire a command is due by the clock, on which this fast forward of a test has no claim.
                ahead = clock.now() + 1.0 + np.arange(5) / 10
                sent.append(Command(ahead, response.mean))
                robot.command(sent[-1])
            come = [json.loads(receiver.stdout.readline()) for _ in sent]
    finally:
        robot.stop()
        sensor.stop()
    assert estimate.phase > 0.9
    assert together.counts["partner"][Fate.TAKEN] == len(times)
    for command, message in zip(sent, come, strict=True):
        assert message["names"] == ["finger", "wrist"]
        np.testing.assert_array_equal([p for _, p in message["points"]], command.positions)
        np.testing.assert_allclose(np.diff([t for t, _ in message["points"]]), 0.1, atol=1e-6)


# --------------------------------------------------------------------------------------------------------- what dies


@contextmanager
def own_master(uri: str):
    port = uri.rsplit(":")[-1]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with running("rosmaster", "--core", "-p", port, **silent) as process:
        until(lambda: answers(uri))
        yield process


@pytest.fixture
def another(master, tmp_path) -> dict[str, str]:
    """The environment of programs with a master that may die."""
    return {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}", "ROS_LOG_DIR": str(tmp_path)}


def test_when_the_master_dies_nothing_hangs_and_a_new_start_finds_the_next(another):
    uri, options = another["ROS_MASTER_URI"], {"env": another, "stderr": subprocess.DEVNULL}
    with program("live", "/joints", **options) as live:
        assert "no ROS master answers" in told(live, "start")
        with own_master(uri), program("publish", "/joints", 100_000, 100.0, **options):
            assert told(live, "start") == "started"
            until(lambda: told(live, "read").endswith("True"))
        # Both are gone, and with them what was read.
        until(lambda: told(live, "read") == "0 False")
        assert told(live, "command") == "commanded"
        assert "no ROS master answers" in told(live, "start")
        assert told(live, "stop") == "stopped"
        with own_master(uri), program("publish", "/joints", 100_000, 100.0, **options):
            assert told(live, "start") == "started"
            until(lambda: told(live, "read").endswith("True"))


def test_what_is_connected_needs_no_master(another):
    options = {"env": another, "stderr": subprocess.DEVNULL}
    with (
        own_master(another["ROS_MASTER_URI"]) as dying,
        program("live", "/joints", **options) as live,
        program("publish", "/joints", 100_000, 100.0, **options),
    ):
        assert told(live, "start") == "started"
        until(lambda: told(live, "read").endswith("True"))
        dying.kill()
        dying.wait()
        told(live, "read")
        until(lambda: told(live, "read") != "0 True", 10.0)
        assert told(live, "read").endswith("True")


def test_a_master_that_freezes_on_the_way_holds_nobody_up(another):
    options = {"env": another, "stderr": subprocess.DEVNULL}
    with (
        own_master(another["ROS_MASTER_URI"]) as freezing,
        program("live", "/joints", **options) as live,
        program("publish", "/joints", 100_000, 100.0, **options),
    ):
        assert told(live, "start") == "started"
        until(lambda: told(live, "read").endswith("True"))
        freezing.send_signal(signal.SIGSTOP)
        try:
            told(live, "read")
            until(lambda: told(live, "read") != "0 True")
            assert told(live, "command") == "commanded"
            assert told(live, "stop") == "stopped"
            assert told(live, "read") == "0 False"
            assert "no ROS master answers" in told(live, "start")
            live.stdin.close()
            assert live.wait(20) == 0
        finally:
            freezing.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("ending", ["leave", "stop", "shut down"])
def test_a_program_ends_however_it_left_ros(another, ending):
    options = {"env": another, "stderr": subprocess.DEVNULL}
    with (
        own_master(another["ROS_MASTER_URI"]),
        program("collect", "/live/command", **options) as receiver,
        program("live", "/joints", **options) as live,
    ):
        assert told(live, "start") == "started"
        assert receiver.stdout.readline() == "connected\n"
        until(lambda: told(live, "listeners") == "1")
        assert told(live, "command") == "commanded"
        receiver.stdout.readline()
        told(live, ending)
        if ending == "shut down":
            assert told(live, "command") == "commanded"
            assert told(live, "read") == "0 False"
            assert "was shut down" in told(live, "start")
        live.stdin.close()
        assert live.wait(20) == 0
