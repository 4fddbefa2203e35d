"""One process as a ROS 1 node: rospy where it is installed, a master that answers, message types by their name.

rospy is no package of PyPI. It comes with ROS, or on Debian and Ubuntu as `python3-rospy`, and is found at run time.
A process is one node for as long as it lives: rospy neither leaves a master nor registers again with one that was
restarted. What is subscribed afterwards is registered anew, so a device that is stopped and started is seen again.

rospy sets up Python's logging as for all nodes (`~/.ros/log`, ROS_LOG_DIR); signals are left alone.
"""

from __future__ import annotations

import atexit
import re
import sys
import threading
import time
import xmlrpc.client
from collections.abc import Callable
from concurrent.futures import Future, wait
from http.client import HTTPConnection
from importlib import import_module
from typing import Any, TypeVar

from inphase.errors import OptionError, listing

T = TypeVar("T")

WAIT = 3.0  # [s] that a master may take to answer
DEBIAN = "/usr/lib/python3/dist-packages"
SEEN_FROM_VENV = (
    f"a virtual environment sees it with: echo {DEBIAN} > "
    '"$(python -c \'import sysconfig; print(sysconfig.get_path("purelib"))\')/debian.pth"'
)

_JOINING = threading.Lock()


def find_rospy() -> Any:
    """The library; raises OptionError that says what to install where it is missing."""
    try:
        return import_module("rospy")
    except ImportError as error:
        raise OptionError(
            f"expected ROS 1, got none ({error}); on Debian and Ubuntu: apt-get install python3-rospy; {SEEN_FROM_VENV}"
        ) from None


def message_class(type: str) -> Any:
    """The class of a type such as sensor_msgs/JointState; raises OptionError where it is not installed."""
    return _class_of(type, "msg", "sensor_msgs/JointState")


def service_class(type: str) -> Any:
    """The class of a type such as std_srvs/Trigger; raises OptionError where it is not installed."""
    return _class_of(type, "srv", "std_srvs/Trigger")


def _class_of(type: str, kind: str, example: str) -> Any:
    find_rospy()
    if not re.fullmatch(r"[A-Za-z]\w*/[A-Za-z]\w*", type):
        raise OptionError(f"expected a ROS type such as {example}, got {type!r}")
    genpy = import_module("genpy.message")
    found = genpy.get_message_class(type) if kind == "msg" else genpy.get_service_class(type)
    if found is not None:
        return found
    package, name = type.split("/")
    module = sys.modules.get(f"{package}.{kind}")
    if module is not None:
        there = [n for n, value in vars(module).items() if getattr(value, "_type", "") == f"{package}/{n}"]
        raise OptionError(f"{package} has no {name}; it has {listing(there)}")
    debian = f"python3-{package.replace('_', '-')}"
    raise OptionError(
        f"expected the ROS package {package} (for {type}), got none; on Debian and Ubuntu: apt-get install {debian}; "
        f"{SEEN_FROM_VENV}; a package of your own is seen once its workspace is sourced"
    )


def within(what: str, call: Callable[[], T], seconds: float = WAIT) -> T:
    """What a call to ROS answers, which may have no time limit of its own.

    Raises OptionError where the call fails, or takes longer and is left behind on its thread.
    """
    answer: Future[T] = Future()

    def run() -> None:
        try:
            answer.set_result(call())
        except Exception as error:  # noqa: BLE001 - rospy raises what it likes, and all of it is told to the caller
            answer.set_exception(error)

    threading.Thread(target=run, name=f"inphase ROS: {what}", daemon=True).start()
    wait([answer], seconds)
    if not answer.done():
        raise OptionError(f"{what}: no answer within {seconds:g} s")
    error = answer.exception()
    if error is not None:
        raise OptionError(f"{what}: {error}") from error
    return answer.result()


class Master:
    """The master at ROS_MASTER_URI, asked with a time limit; rospy's own proxy has none."""

    def __init__(self) -> None:
        self.uri: str = import_module("rosgraph").get_master_uri()

    def check(self) -> None:
        """Raise OptionError unless it answers."""
        self._ask("getPid")

    def published(self) -> dict[str, str]:
        """The type of every topic that somebody publishes now."""
        return {topic: type for topic, type in self._ask("getPublishedTopics", "")}  # noqa: C416 - pairs are lists

    def subscribed(self, topic: str) -> bool:
        """Whether somebody has subscribed to that topic."""
        return any(name == topic and nodes for name, nodes in self._ask("getSystemState")[1])

    def _ask(self, method: str, *arguments: str) -> Any:
        def ask() -> Any:
            with xmlrpc.client.ServerProxy(self.uri, transport=_Brief()) as proxy:
                _, _, value = getattr(proxy, method)("/inphase", *arguments)
            return value

        # Twice the limit: where a name is looked up in vain, connecting alone may take longer than that of the socket.
        advice = "start one with `roscore`, or set ROS_MASTER_URI to where it runs"
        try:
            return within(method, ask, 2 * WAIT)
        except OptionError as error:
            reason = error.__cause__ or error
            raise OptionError(f"no ROS master answers at {self.uri} ({reason}); {advice}") from None


class _Brief(xmlrpc.client.Transport):
    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = WAIT
        return connection


def join_ros() -> Any:
    """rospy, with this process as a node (`inphase_…`, or the one that it already is).

    Raises OptionError where there is no rospy, no master answers, or the node was shut down.
    """
    ros = find_rospy()
    with _JOINING:
        Master().check()
        if not ros.core.is_initialized():
            within("ROS node", lambda: ros.init_node("inphase", anonymous=True, disable_signals=True), 2 * WAIT)
            _end_in_time(ros)
        if ros.is_shutdown() or not ros.core.is_initialized():
            raise OptionError("the ROS node of this process was shut down, and rospy begins no other: start it again")
    return ros


def _end_in_time(ros: Any) -> None:
    """End the node with the process: what rospy does then waits for a frozen master without a limit."""
    over = threading.Event()

    def end() -> None:
        over.wait()
        ros.signal_shutdown("the program ends")

    # Begun now: a process that ends may begin no thread any more.
    thread = threading.Thread(target=end, name="inphase ROS: end", daemon=True)
    thread.start()

    @atexit.register
    def ending() -> None:
        over.set()
        thread.join(WAIT)


def subscribe(name: str, topic: str, type: str, take: Callable[[Any], None]) -> Any:
    """A subscriber that gives each message to `take`, on a thread of rospy; raises as `join_ros`.

    Also raises OptionError where somebody publishes another type there.
    """
    message, ros = message_class(type), join_ros()
    there = Master().published().get(ros.resolve_name(topic), type)
    if there not in (type, "*"):
        raise OptionError(f"{name}: expected {type} on {topic}, got {there}")
    return within(name, lambda: ros.Subscriber(topic, message, take, tcp_nodelay=True))


def leave(*endings: Callable[[], object]) -> None:
    """Unregister what these do; a master that does not answer is not waited for."""
    threads = [threading.Thread(target=ending, name="inphase ROS: leaving", daemon=True) for ending in endings]
    for thread in threads:
        thread.start()
    end = time.monotonic() + WAIT
    for thread in threads:
        thread.join(max(end - time.monotonic(), 0.0))
