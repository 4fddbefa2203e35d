"""Programs beside a test of ROS 1, each a process and a node of its own: `python ros_programs.py NAME ARGUMENTS`.

All but `live` know rospy alone. They say what they do in lines on stdout, and end when their stdin does.
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time

JOINTS = ["shoulder", "elbow", "wrist"]
FIRST_STAMP = 1000.0  # [s]: a clock unlike that of this machine


def elbow(k: int, rate: float) -> float:
    """The position of the elbow in message k."""
    return math.sin(k / rate)


def say(*words: object) -> None:
    print(*words, flush=True)


def node(name: str):
    import rospy

    rospy.init_node(name, anonymous=True, disable_signals=True)
    return rospy


def publish(topic: str, count: str, rate: str) -> None:
    """JointStates at a rate, as soon as somebody listens; each says its number."""
    from sensor_msgs.msg import JointState

    rospy = node("publish")
    publisher = rospy.Publisher(topic, JointState, queue_size=0, tcp_nodelay=True)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    begun = time.perf_counter()
    for k in range(int(count)):
        time.sleep(max(begun + k / float(rate) - time.perf_counter(), 0.0))
        message = JointState(name=JOINTS, position=[float(k), elbow(k, float(rate)), math.nan])
        message.header.stamp = rospy.Time.from_sec(FIRST_STAMP + k / float(rate))
        publisher.publish(message)
    say("published", count)
    sys.stdin.read()


def other_checksum(topic: str) -> None:
    """A publisher whose JointState is defined otherwise."""
    from sensor_msgs.msg import JointState

    class Changed(JointState):
        _md5sum = "0" * 32
        __slots__ = JointState.__slots__

    rospy = node("other_checksum")
    publisher = rospy.Publisher(topic, Changed, queue_size=1)
    say("ready")
    while threading.active_count():
        publisher.publish(Changed(name=["elbow"], position=[666.0]))
        time.sleep(0.02)


def collect(topic: str) -> None:
    """Every JointTrajectory as a line."""
    from trajectory_msgs.msg import JointTrajectory

    rospy = node("collect")

    def take(message: JointTrajectory) -> None:
        points = [[p.time_from_start.to_sec(), list(p.positions)] for p in message.points]
        say(json.dumps({"stamp": message.header.stamp.to_sec(), "names": message.joint_names, "points": points}))

    subscriber = rospy.Subscriber(topic, JointTrajectory, take, tcp_nodelay=True)
    while not subscriber.get_num_connections():
        time.sleep(0.01)
    say("connected")
    sys.stdin.read()


def live(topic: str) -> None:
    """A sensor and a robot of inphase, told by lines on stdin what to do; answers each with a line."""
    import numpy as np

    from inphase.errors import OptionError
    from inphase.runtime import Command, SystemClock
    from inphase.runtime.adapters.ros1_node import find_rospy
    from inphase.runtime.adapters.ros1_robot import Ros1Robot
    from inphase.runtime.adapters.ros1_sensor import Ros1Sensor

    clock = SystemClock()
    sensor = Ros1Sensor("arm", topic, "sensor_msgs/JointState", {"elbow": "position[elbow]"})
    robot = Ros1Robot("robot", ["elbow"], "/live/command", topic, silent_after=0.3)
    for line in sys.stdin:
        try:
            if line == "start\n":
                sensor.start(clock)
                robot.start(clock)
                say("started")
            elif line == "read\n":
                say(len(sensor.read()), robot.state() is not None)
            elif line == "listeners\n":
                say(robot.listeners)
            elif line == "command\n":
                robot.command(Command(np.array([clock.now() + 1]), np.zeros((1, 1))))
                say("commanded")
            elif line == "stop\n":
                sensor.stop()
                robot.stop()
                say("stopped")
            elif line == "shut down\n":
                find_rospy().signal_shutdown("as asked")
                say("down")
            elif line == "leave\n":  # without a stop
                return
        except OptionError as error:
            say(error)


if __name__ == "__main__":
    {f.__name__: f for f in (publish, other_checksum, collect, live)}[sys.argv[1]](*sys.argv[2:])
