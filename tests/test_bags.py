"""What was published is what is read, from bags of every format, whole or broken; and all that is not is told."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_files import FORMATS, START, Published, data_file, gripper, joints, numbers, pose, write_bag
from interactions import shapes_unchecked

import inphase
from inphase.channels import make_channels
from inphase.errors import DataError, OptionError
from inphase.io import read_recording
from inphase.runtime import FakeClock, Sensor, Signal
from inphase.runtime.adapters import bag_messages
from inphase.runtime.adapters.bags import TopicMap, bag_sensor, list_bag, read_bag, read_bags, read_topic_map
from inphase.runtime.configuration.section import Section
from inphase.runtime.recorder import Recorder

OFFSETS = {"pose": -123.25, "joints": 5e4}  # [s] of the clocks that stamp, against that of the bag
MAP = TopicMap(
    observed={
        "hand_x": "/hand/pose pose.position.x",
        "push": "/forces data[1]",
        "hand_z": "/hand/pose pose.position.z",
    },
    controlled={"elbow": "/joint_states position[arm.elbow]", "grip": "/gripper grip"},
    rate=90.0,
    units={"hand_?": "m"},
)


def truth(times: np.ndarray) -> np.ndarray:
    """(T, 5) what the channels of MAP are; no second derivative is above 4."""
    return np.stack([np.sin(times), times - 1, np.cos(2 * times), np.sin(2 * times), 0.5 * times], axis=1)


def walk(seconds: float = 2.0, *, rates: tuple[int, int] = (1000, 800), padding: int = 0) -> list[Published]:
    """What two sensors of other rates and clocks publish, and two without stamps."""
    fast, slow = (np.arange(round(seconds * rate) + 1) / rate for rate in rates)
    published, rng = list[Published](), np.random.default_rng(0)
    for t, (_, _, _, elbow, grip) in zip(fast.tolist(), truth(fast).tolist(), strict=True):
        published += [joints(t, t + 1e6 + OFFSETS["joints"], **{"wrist": 0.0, "arm.elbow": elbow}), gripper(t, grip)]
    for t, (x, push, z, _, _) in zip(slow.tolist(), truth(slow).tolist(), strict=True):
        published += [pose(t, t + 1e6 + OFFSETS["pose"], x, 7.0, z), numbers(t, 0.0, push, *rng.random(padding))]
    return sorted(published, key=lambda message: message[0])


@pytest.mark.parametrize("format", FORMATS)
def test_topics_of_other_rates_and_clocks_are_one_demonstration_of_what_truly_was(tmp_path, format):
    path = write_bag(tmp_path, format, walk())
    demonstration, left_out = read_bag(path, MAP)
    assert left_out == []
    assert demonstration.duration == pytest.approx(2.0, abs=0.02)
    np.testing.assert_allclose(np.diff(demonstration.times), 1 / 90, atol=1e-9)
    np.testing.assert_allclose(demonstration.values, truth(demonstration.times), atol=1e-6)


@pytest.mark.parametrize(
    ("format", "compression"),
    [("bag", "bz2"), ("bag", "lz4"), ("db3", "file"), ("db3", "message"), ("mcap", "file"), ("mcap", "storage")],
)
def test_packed_bags_hold_the_same(tmp_path, format, compression):
    published = walk(rates=(100, 60))
    packed, plain = (
        read_bag(write_bag(tmp_path, format, published, name=name, compression=how), MAP)
        for name, how in (("packed", compression), ("plain", ""))
    )
    np.testing.assert_array_equal(packed[0].values, plain[0].values)
    assert packed[1] == plain[1] == []


@pytest.mark.parametrize("format", ["db3", "mcap"])
def test_a_single_file_is_read_as_its_folder(tmp_path, format):
    path = write_bag(tmp_path, format, walk(rates=(100, 60)))
    one, other = read_bag(path, MAP)[0], read_bag(data_file(path), MAP)[0]
    np.testing.assert_array_equal(one.values, other.values)


def test_stamps_of_one_clock_are_believed_where_that_is_said(tmp_path):
    """Both topics come late, one later: the least delay of a clock of its own cannot be told from an offset."""
    times = np.arange(201) / 100
    late = [pose(t + 0.08, t + 1e6, np.sin(t), 0, 0) for t in times] + [joints(t + 0.01, t + 1e6, e=t) for t in times]
    path = write_bag(tmp_path, "mcap", sorted(late, key=lambda message: message[0]))
    places = {"x": "/hand/pose pose.position.x"}, {"e": "/joint_states position[e]"}
    for stamps, shift in (("synchronised", 0.0), ("source", 0.07), ("received", 0.07)):
        whole = read_bag(path, TopicMap(*places, rate=100.0, stamps=stamps))[0]
        x, e = whole.values.T
        inside = np.isfinite(x) & np.isfinite(e) & (whole.times < 1.9)  # at the end one holds
        assert inside.sum() > 150
        np.testing.assert_allclose(x[inside], np.sin(e[inside] - shift), atol=2e-5)


def test_a_data_set_has_the_roles_units_and_order_of_the_map(tmp_path):
    paths = [write_bag(tmp_path, format, walk(rates=(100, 60)), name=format) for format in FORMATS]
    dataset, left_out = read_bags(paths, MAP)
    assert dataset.observed == ("hand_x", "push", "hand_z")
    assert dataset.controlled == ("elbow", "grip")
    assert [channel.unit for channel in dataset.channels] == ["m", "", "m", "", ""]
    assert [demonstration.name for demonstration in dataset] == ["bag", "db3", "mcap"]
    assert left_out == []
    for demonstration in dataset:
        np.testing.assert_array_equal(demonstration.values, dataset[0].values)  # of all formats the same


def test_a_bag_is_played_as_a_sensor(tmp_path):
    write_bag(tmp_path, "bag", walk(rates=(100, 60)))
    toml = tmp_path / "map.toml"
    toml.write_text('rate = 50\n[observed]\nx = "/hand/pose pose.position.x"\n[units]\nx = "m"\n')
    table = {"file": "walk.bag", "map": "map.toml", "speed": 2}  # as a configuration says it
    sensor = Section("live.toml", "", tmp_path, table).call(bag_sensor, name="walk")
    assert sensor.name == "walk"
    assert isinstance(sensor, Sensor)
    assert sensor.signals == (Signal("x", "m"),)
    clock = FakeClock()
    sensor.start(clock)
    clock.advance(0.5)
    samples = sensor.read()
    assert len(samples) == 51
    np.testing.assert_allclose([s.values[0] for s in samples], np.sin(np.arange(51) / 50), atol=1e-4)


# ------------------------------------------------------------------------------------------------------------ listing


@pytest.mark.parametrize("format", FORMATS)
def test_a_listing_says_what_there_is(tmp_path, format):
    path = write_bag(tmp_path, format, walk(rates=(100, 50)), topics=[("/silent", "std_msgs/msg/Float64MultiArray")])
    listing = list_bag(path)
    by_name = {topic.topic: topic for topic in listing.topics}
    assert list(by_name) == ["/forces", "/gripper", "/hand/pose", "/joint_states", "/silent"]
    joint_states, forces, silent = by_name["/joint_states"], by_name["/forces"], by_name["/silent"]
    assert listing.begin == pytest.approx(START * 1e-9)
    assert listing.damage == ""
    assert joint_states.type in ("sensor_msgs/JointState", "sensor_msgs/msg/JointState")
    assert (joint_states.count, joint_states.first, joint_states.last) == (201, 0.0, pytest.approx(2.0))
    assert joint_states.rate == pytest.approx(100)
    assert forces.rate == pytest.approx(50)
    assert joint_states.places == ("position[wrist]", "position[arm.elbow]")
    assert forces.places == ("layout.data_offset", "data[0]", "data[1]")
    assert by_name["/gripper"].places == ("grip", "closed")
    assert [by_name[name].stamped for name in ("/joint_states", "/forces")] == [True, False]
    assert (silent.count, silent.places) == (0, ())
    assert np.isnan([silent.first, silent.rate]).all()


# ----------------------------------------------------------------------------------------------------------- left out


def reasons(path: Path, topic_map: TopicMap = MAP) -> dict[str, str]:
    return {left.what: left.why for left in read_bag(path, topic_map)[1]}


@pytest.mark.parametrize("format", FORMATS)
def test_all_that_is_left_out_is_told(tmp_path, format):
    published = [*walk(rates=(100, 60)), numbers(1.0, 1.0, topic="/other")]
    path = write_bag(tmp_path, format, sorted(published, key=lambda message: message[0]))
    more = TopicMap(
        {**MAP.observed, "gone": "/gone data[0]", "foot": "/joint_states position[foot]"}, MAP.controlled, rate=90.0
    )
    demonstration, left_out = read_bag(path, more)
    told = {left.what: left.why for left in left_out}
    assert set(told) == {"/other", "/gone", "foot"}
    assert told["/other"].startswith("not in the map (std_msgs/")
    assert "so no gone; its topics are /forces, /gripper, /hand/pose, /joint_states, /other" in told["/gone"]
    assert told["foot"] == (
        "never a number at position[foot] of /joint_states; there are position[wrist], position[arm.elbow]"
    )
    blind = np.isnan(demonstration.values).all(axis=0)
    np.testing.assert_array_equal(blind, [False, False, False, True, True, False, False])
    assert str(left_out[0]).startswith(f"{path}: ")


def test_a_type_that_an_old_bag_does_not_define_is_left_out_by_name(tmp_path):
    path = write_bag(tmp_path, "db3", walk(rates=(100, 60)))
    with sqlite3.connect(data_file(path)) as database:
        database.execute("DROP TABLE message_definitions")
    demonstration, left_out = read_bag(path, MAP)
    assert [(left.what, left.why) for left in left_out] == [
        ("/gripper", "the bag has no definition of my_msgs/msg/Gripper, which is none of ROS's own types")
    ]
    assert np.isnan(demonstration.values[:, 4]).all()
    np.testing.assert_allclose(demonstration.values[:, :3], truth(demonstration.times)[:, :3], atol=1e-3)
    problem = {topic.topic: topic.problem for topic in list_bag(path).topics}
    assert problem["/gripper"].startswith("the bag has no definition of my_msgs/msg/Gripper")
    assert problem["/forces"] == ""


def test_messages_that_cannot_be_unpacked_are_counted(tmp_path):
    path = write_bag(tmp_path, "db3", walk(rates=(100, 60)))
    with sqlite3.connect(data_file(path)) as database:
        picked = (
            "id IN (SELECT m.id FROM messages m JOIN topics t ON t.id = m.topic_id WHERE t.name = '/forces' LIMIT 3)"
        )
        database.execute(f"UPDATE messages SET data = x'0001000001' WHERE {picked}")
    assert reasons(path)["/forces"].startswith("3 of 121 messages cannot be read: ")


def test_headers_that_are_set_only_sometimes_are_not_mixed_with_times_of_receipt(tmp_path):
    times = np.arange(201) / 100
    some = [joints(t, None if i % 7 == 0 else t + 1e6, e=t) for i, t in enumerate(times)]
    demonstration, left_out = read_bag(
        write_bag(tmp_path, "mcap", some), TopicMap({"e": "/joint_states position[e]"}, rate=100.0)
    )
    assert [left.why for left in left_out] == ["its stamps, as 29 of 201 messages have none; taken when they came"]
    np.testing.assert_allclose(demonstration.values[:, 0], demonstration.times, atol=1e-6)


def test_a_bag_of_nothing_that_is_mapped_is_left_out_of_many_and_refused_alone(tmp_path):
    good = write_bag(tmp_path, "bag", walk(rates=(100, 60)), name="good")
    empty = write_bag(tmp_path, "bag", [], name="empty")
    other = write_bag(tmp_path, "mcap", [numbers(0.1 * i, 1.0, topic="/other") for i in range(9)], name="other")
    early = [pose(0.01 * i, None, 1, 2, 3) for i in range(99)]
    apart = write_bag(tmp_path, "db3", [*early, *(joints(9 + 0.01 * i, None, e=1) for i in range(99))], name="apart")
    places = {"x": "/hand/pose pose.position.x"}, {"e": "/joint_states position[e]"}
    dataset, left_out = read_bags([good, empty, other], MAP)
    assert len(dataset) == 1
    assert [(left.bag, left.what) for left in left_out] == [(str(empty), ""), (str(other), "")]
    with pytest.raises(DataError, match=r"empty\.bag: expected numbers on a topic of the map, got none: the bag: it"):
        read_bags([empty], MAP)
    with pytest.raises(DataError, match="apart: expected sensors that were recorded at the same time, got /hand/pose"):
        read_bags([apart], TopicMap(*places, rate=60.0))
    assert list_bag(empty).topics == ()


# ------------------------------------------------------------------------------------------------------------- damage


@pytest.mark.parametrize("compression", ["", "bz2", "lz4"])
@pytest.mark.parametrize("share", [0.97, 0.5, 0.2])
def test_a_bag_of_ros_1_that_was_cut_short_is_read_up_to_there(tmp_path, compression, share):
    assert_read_up_to(share, tmp_path, "bag", compression=compression)


@pytest.mark.parametrize("share", [0.97, 0.5])
@pytest.mark.parametrize(("format", "compression"), [("db3", ""), ("mcap", ""), ("mcap", "storage")])
def test_a_bag_of_ros_2_that_was_cut_short_is_read_up_to_there(tmp_path, format, compression, share):
    assert_read_up_to(share, tmp_path, format, compression=compression)


def assert_read_up_to(share: float, *arguments: Any, **options: Any) -> None:
    path = write_bag(*arguments, walk(8.0, rates=(50, 100), padding=1000), **options)
    file = data_file(path)
    with file.open("r+b") as opened:
        opened.truncate(int(share * file.stat().st_size))
    demonstration, left_out = read_bag(path, MAP)
    lost = 0.3 if path.suffix == ".bag" and not options["compression"] else 2.5  # of a packed chunk, all
    assert demonstration.duration > 8.0 * share - lost
    assert [left.what for left in left_out] == [""]
    assert left_out[0].why.startswith(f"{file.name} is damaged, after its message at 17000000")
    np.testing.assert_allclose(demonstration.values, truth(demonstration.times), atol=3e-4)
    listed = list_bag(path)
    assert listed.damage == left_out[0].why
    assert len(listed.topics) == 4


def test_a_bag_of_ros_1_that_was_never_closed_is_read_and_told(tmp_path):
    path = write_bag(tmp_path, "bag", walk(rates=(100, 60)))
    whole = read_bag(path, MAP)[0]
    content = path.read_bytes()
    at = content.index(b"index_pos=") + len(b"index_pos=")
    active = tmp_path / "walk.bag.active"  # as rosbag calls it until it is closed
    active.write_bytes(content[:at] + bytes(8) + content[at + 8 :])
    demonstration, left_out = read_bag(active, MAP)
    np.testing.assert_array_equal(demonstration.values, whole.values)
    assert [left.what for left in left_out] == [""]
    assert left_out[0].why.endswith("it was never closed, and may lack its end")


def test_a_bag_of_ros_2_that_was_never_closed_is_read(tmp_path):
    path = write_bag(tmp_path, "db3", [])
    file = data_file(path)
    source = write_bag(tmp_path, "db3", walk(rates=(100, 60)), name="source")
    code = (  # as a recorder that is killed: the messages are in the log beside the file
        "import os, sqlite3, sys\n"
        "database = sqlite3.connect(sys.argv[1]); database.execute('PRAGMA journal_mode = WAL')\n"
        "database.execute('ATTACH ? AS source', [sys.argv[2]])\n"
        "for table in ('topics', 'message_definitions', 'messages'):\n"
        "    database.execute(f'INSERT INTO main.{table} SELECT * FROM source.{table}')\n"
        "database.commit(); os._exit(9)\n"
    )
    assert subprocess.run([sys.executable, "-c", code, file, data_file(source)]).returncode == 9
    np.testing.assert_array_equal(read_bag(path, MAP)[0].values, read_bag(source, MAP)[0].values)


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("small")
    paths = {format: write_bag(folder, format, walk(0.1, rates=(40, 30)), name=format) for format in FORMATS}
    packed = write_bag(folder, "bag", walk(0.1, rates=(40, 30)), name="packed", compression="lz4")
    zstd = write_bag(folder, "mcap", walk(0.1, rates=(40, 30)), name="zstd", compression="storage")
    return {name: data_file(path).read_bytes() for name, path in {**paths, "packed": packed, "zstd": zstd}.items()}


def test_whatever_a_bag_holds_it_is_read_or_refused(small, tmp_path, rng):
    """No other error comes out, whatever is changed, cut off or both."""
    path, ends = tmp_path / "damaged", Counter[str]()
    for i in range(150):
        content = bytearray(small[sorted(small)[i % len(small)]])
        for at in rng.integers(0, len(content), rng.integers(1, 5)):
            content[at] = rng.integers(256)
        path.write_bytes(content[: rng.integers(len(content))] if i % 3 == 0 else content)
        for read in (list_bag, lambda bag: read_bag(bag, MAP)):
            try:
                read(path)
            except DataError as error:
                ends[str(error).partition(": ")[2]] += 1
            else:
                ends["read"] += 1
    assert ends["read"] > 50
    assert not [reason for reason in ends if "\n" in reason]


# ------------------------------------------------------------------------------------------------------------ refusals


def test_our_own_recordings_are_told_apart(tmp_path):
    path = tmp_path / "run.mcap"
    Recorder(path, make_channels(["a"], ["b"])).close()
    read_recording(path)
    with pytest.raises(DataError, match=r"run\.mcap: expected a bag of ROS, got a run that inphase recorded: "):
        list_bag(path)


def test_what_is_no_bag_is_refused(tmp_path):
    with pytest.raises(DataError, match=r"none\.bag: no such bag"):
        list_bag(tmp_path / "none.bag")
    with pytest.raises(DataError, match=r"expected the folder of one bag, with \.db3 or \.mcap files in it, got none"):
        list_bag(tmp_path)
    text = tmp_path / "text.bag"
    for content in (b"time,x\n0,1\n", b""):
        text.write_bytes(content)
        with pytest.raises(DataError, match=r"text\.bag: expected a bag \(\.bag, \.db3 or \.mcap\), got a file"):
            list_bag(text)
    text.write_bytes(b"#ROSBAG V1.2\n")
    with pytest.raises(DataError, match=r"expected a bag of version 2\.0"):
        list_bag(text)
    with sqlite3.connect(tmp_path / "other.db3") as database:
        database.execute("CREATE TABLE cats (name)")
    with pytest.raises(DataError, match=r"other\.db3: expected a bag of ROS 2, got a database of cats"):
        list_bag(tmp_path / "other.db3")
    (tmp_path / "more.db3").touch()
    with pytest.raises(DataError, match=r"with a metadata\.yaml; name its files: more\.db3, other\.db3"):
        list_bag(tmp_path)


def test_without_rosbags_it_is_said_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(bag_messages, "find_spec", lambda name: None)
    with pytest.raises(OptionError, match=r"pip install 'inphase\[bags\]'"):
        list_bag(tmp_path / "a.bag")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("rate = 60\n", r"at least one channel under \[observed\] or \[controlled\], got none"),
        ('[observed]\nx = "/a b"\n', r"expected a rate \[1/s\], got none"),
        ('rate = 0\n[observed]\nx = "/a b"\n', "rate: expected a number > 0"),
        ('rate = "60"\n[observed]\nx = "/a b"\n', "rate: expected a number > 0"),
        (
            'rate = 60\nspeed = 1\n[observed]\nx = "/a b"\n',
            "unknown speed; there is observed, controlled, rate",
        ),
        (
            'rate = 60\nstamps = "mine"\n[observed]\nx = "/a b"\n',
            "stamps: expected one of source, synchronised",
        ),
        ('rate = 60\n[observed]\nx = "/a"\n', "x: expected a topic and a place, as in '/joint_states position"),
        ('rate = 60\n[observed]\nx = "/a b[[0]"\n', "x: expected a topic and a place"),
        ("rate = 60\n[observed]\nx = 3\n", "observed: expected a text for 'x', got 3"),
        ("rate = 60\nobserved = 3\n", r"observed: expected a table \[observed\]"),
        ('rate = 60\n[observed]\nx = "/a b"\n[controlled]\nx = "/a c"\n', "twice: x"),
        ('rate = 60\n[observed]\nx = "/a b"\n[units]\ny = "m"\n', "no channel fits 'y'"),
        ('rate = 60\n[observed]\nx = "/a b"\n[kinds]\nx = "round"\n', "unknown kind of channel 'round'"),
        ('rate = 60\n[observed]\nx = "/a b"\n[staleness]\nx = -1\n', "staleness of 'x': expected a time > 0"),
        ('rate = 60\n[observed]\nx = "/a b"\ny = "/a c"\n[staleness]\nx = 1\n', "got none of y"),
        ("rate = 60\n[observed\n", ", line 2: expected TOML"),
    ],
)
def test_a_map_that_is_none_is_refused(tmp_path, content, said):
    path = tmp_path / "map.toml"
    path.write_text(content)
    with pytest.raises(DataError, match=f"^{path}.*{said}"), shapes_unchecked():
        read_topic_map(path)


def test_a_map_is_read_as_it_is_written(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(
        'rate = 90\nstamps = "source"\n[observed]\nhand_x = "/hand/pose pose.position.x"\npush = "/forces data[1]"\n'
        'hand_z = "/hand/pose   pose.position.z"\n[controlled]\nelbow = "/joint_states position[arm.elbow]"\n'
        'grip = "/gripper grip"\n[units]\n"hand_?" = "m"\n[staleness]\n"*" = 0.5\n'
    )
    read = read_topic_map(path)
    assert read.channels == MAP.channels
    assert read.topics == MAP.topics
    assert (read.rate, read.staleness) == (90, {"*": 0.5})
    assert inphase.Role.CONTROLLED in {channel.role for channel in read.channels}
