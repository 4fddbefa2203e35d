"""Bags of all formats, written by `rosbags`: what a test says was published when."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

FORMATS = ("bag", "db3", "mcap")
START = 1_700_000_000 * 10**9  # [ns] when all bags begin
OWN = "float64 grip\nbool closed\n"  # a message of nobody else's

Published = tuple[float, str, str, Callable[["Made"], Any]]  # when [s since START], topic, type, message


class Made:
    """Messages of one of the two worlds."""

    def __init__(self, format: str) -> None:
        self.ros1 = format == "bag"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.LATEST)
        self.store.register(get_types_from_msg(OWN, "my_msgs/msg/Gripper"))

    def of(self, kind: str, *parts: Any) -> Any:
        return self.store.types[kind](*parts)

    def header(self, stamp: float | None) -> Any:
        nanoseconds = 0 if stamp is None else round(stamp * 1e9)
        time = self.of("builtin_interfaces/msg/Time", *divmod(nanoseconds, 10**9))
        return self.of("std_msgs/msg/Header", *((0,) if self.ros1 else ()), time, "base")

    def joints(self, stamp: float | None, **positions: float) -> Any:
        values = np.array(list(positions.values()), dtype=float)
        header = self.header(stamp)
        return self.of("sensor_msgs/msg/JointState", header, list(positions), values, np.zeros(0), np.zeros(0))

    def pose(self, stamp: float | None, x: float, y: float, z: float) -> Any:
        point = self.of("geometry_msgs/msg/Point", x, y, z)
        pose = self.of("geometry_msgs/msg/Pose", point, self.of("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0))
        return self.of("geometry_msgs/msg/PoseStamped", self.header(stamp), pose)

    def numbers(self, *values: float) -> Any:
        layout = self.of("std_msgs/msg/MultiArrayLayout", [], 0)
        return self.of("std_msgs/msg/Float64MultiArray", layout, np.array(values, dtype=float))

    def gripper(self, grip: float, closed: bool) -> Any:
        return self.of("my_msgs/msg/Gripper", grip, closed)


def joints(time: float, stamp: float | None, topic: str = "/joint_states", **positions: float) -> Published:
    return time, topic, "sensor_msgs/msg/JointState", lambda made: made.joints(stamp, **positions)


def pose(time: float, stamp: float | None, x: float, y: float, z: float, topic: str = "/hand/pose") -> Published:
    return time, topic, "geometry_msgs/msg/PoseStamped", lambda made: made.pose(stamp, x, y, z)


def numbers(time: float, *values: float, topic: str = "/forces") -> Published:
    return time, topic, "std_msgs/msg/Float64MultiArray", lambda made: made.numbers(*values)


def gripper(time: float, grip: float, closed: bool = True, topic: str = "/gripper") -> Published:
    return time, topic, "my_msgs/msg/Gripper", lambda made: made.gripper(grip, closed)


def write_bag(
    folder: Path,
    format: str,
    published: Iterable[Published],
    *,
    name: str = "walk",
    compression: str = "",
    topics: Iterable[tuple[str, str]] = (),
) -> Path:
    """A bag of the messages in the order given, and of more topics that stay empty.

    compression: bz2 or lz4 of ROS 1; file, message or storage of ROS 2. Returns the .bag, or the folder.
    """
    path, made = folder / (f"{name}.bag" if format == "bag" else name), Made(format)
    serialise = made.store.serialize_ros1 if made.ros1 else made.store.serialize_cdr
    if made.ros1:
        writer: Any = Writer1(path)
        if compression:
            writer.set_compression(Writer1.CompressionFormat[compression.upper()])
    else:
        plugin = StoragePlugin.SQLITE3 if format == "db3" else StoragePlugin.MCAP
        writer = Writer2(path, version=9, storage_plugin=plugin)
        if compression:
            writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        connections: dict[tuple[str, str], Any] = {}
        for topic, kind in topics:
            connections[topic, kind] = writer.add_connection(topic, kind, typestore=made.store)
        for time, topic, kind, message in published:
            if (topic, kind) not in connections:
                connections[topic, kind] = writer.add_connection(topic, kind, typestore=made.store)
            stamp = START + round(time * 1e9)
            writer.write(connections[topic, kind], stamp, serialise(message(made), kind))
    return path


def data_file(path: Path) -> Path:
    """The file with the messages of a bag."""
    return path if path.is_file() else next(file for file in path.iterdir() if file.suffix in (".db3", ".mcap"))
