"""What others take for the same work: readers and writers of MCAP, and filterpy alone.

A reader is asked for every message of the raw topics and `/tick`, with its fields as numbers. What
is not installed is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from gritd.estimator.filter.estimate import Estimate, Update
from gritd.estimator.recording.blocks import Unpacker
from gritd.estimator.recording.cdr import Topic
from gritd.estimator.recording.tables import Fields
from gritd.estimator.recording.topics import RAW_TOPICS, TICK_TOPIC
from gritd.estimator.recording.walk import Walk
from gritd.interface.runs import read

TOPICS: tuple[Topic, ...] = (*RAW_TOPICS, TICK_TOPIC)
WANTED: dict[str, Fields] = {topic.name: None for topic in TOPICS}

Reader = Callable[[Path], int]
Encoded = list[tuple[str, int, bytes]]  # topic, log_time [ns], CDR


def ours(path: Path) -> int:
    """Every message of TOPICS into tables, checked; how many they are. As a user does it."""
    run = read(path)
    return sum(len(run[name]) for topic in TOPICS if (name := topic.name.lstrip("/")) in run)


def rosbags(path: Path) -> int:
    """The same, message by message, by rosbags."""
    with import_module("rosbags.highlevel").AnyReader([path]) as reader:
        chosen = [each for each in reader.connections if each.topic in WANTED]
        return _counted(
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages(connections=chosen)
        )


def mcap_ros2(path: Path) -> int:
    """The same, message by message, by mcap-ros2-support."""
    messages = import_module("mcap_ros2.reader").read_ros2_messages
    return _counted(message.ros_msg for message in messages(str(path), topics=list(WANTED)))


def pybag(path: Path) -> int:
    """The same, message by message, by pybag."""
    readers = import_module("pybag.mcap_reader").McapFileReader
    with readers.from_file(path, enable_crc_check=True) as reader:
        topics = [topic for topic in reader.get_topics() if topic in WANTED]
        return _counted(
            message.data for message in reader.messages(topics, in_log_time_order=False)
        )


READERS: dict[str, tuple[str, Reader]] = {  # name -> what it needs, reader
    "gritd": ("gritd", ours),
    "rosbags": ("rosbags", rosbags),
    "pybag": ("pybag", pybag),
    "mcap_ros2_support": ("mcap_ros2", mcap_ros2),
}


def readers() -> dict[str, Reader]:
    """Those that are installed."""
    return {name: read for name, (module, read) in READERS.items() if find_spec(module)}


def unpacking(path: Path) -> Callable[[], object]:
    """What no reader can leave out: every chunk read and unpacked, its checksum verified."""
    with path.open("rb") as file:
        walk = Walk(file, path.stat().st_size)
        walk.begin()
        blocks = list(walk.blocks())

    def run() -> None:
        unpacker = Unpacker(last=True)
        with path.open("rb") as file:
            for block in blocks:
                assert unpacker.joined(file, [block]) is not None

    return run


def write_by_mcap(path: Path, messages: Encoded) -> None:
    """Messages that are encoded, by the mcap library's writer."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channels = {}
        for topic in TOPICS:
            schema = writer.register_schema(topic.schema_name, "ros2msg", topic.schema.encode())
            channels[topic.name] = writer.register_channel(topic.name, "cdr", schema)

        for name, time, data in messages:
            writer.add_message(channels[name], time, data, time)
        writer.finish()  # type: ignore[no-untyped-call]


def write_by_rosbags(path: Path, messages: Encoded) -> None:
    """Messages that are encoded, by the writer of rosbags: a bag, which is a folder."""
    rosbag2 = import_module("rosbags.rosbag2")
    typesys = import_module("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for topic in TOPICS:
        if topic.schema_name not in store.fielddefs:
            store.register(typesys.get_types_from_msg(topic.schema, topic.schema_name))

    with rosbag2.Writer(
        path, version=9, storage_plugin=import_module("rosbags.rosbag2.enums").StoragePlugin.MCAP
    ) as writer:
        connections = {
            topic.name: writer.add_connection(topic.name, topic.schema_name, typestore=store)
            for topic in TOPICS
        }
        for name, time, data in messages:
            writer.write(connections[name], time, data)


def filterpy_alone(estimate: Estimate, update: Update) -> Callable[[], object]:
    """filterpy's ExtendedKalmanFilter on the same vectors, as its documentation uses it: a filter
    that is there already takes one measurement.
    """
    kalman = import_module("filterpy.kalman")
    size = len(estimate.x)
    ekf = kalman.ExtendedKalmanFilter(dim_x=size, dim_z=len(update.innovation))
    ekf.x = np.zeros(size)
    ekf.P = np.array(estimate.P)
    y, H, R = (np.array(part) for part in update)
    start = ekf.x.copy(), ekf.P.copy()

    def apply() -> object:
        ekf.x, ekf.P = start
        ekf.update(y, lambda _: H, lambda _: np.zeros_like(y), R=R)
        return ekf.x

    return apply


def _counted(messages: Iterator[object]) -> int:
    return sum(1 for _ in messages)
