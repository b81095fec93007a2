"""Writes a log as ROS 1 bag or as ROS 2 bag with SQLite storage."""

from collections.abc import Iterator
from heapq import merge
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory

from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from synthetic_logs.simulation import SyntheticLog
from synthetic_logs.writers.gnss_comm import TOPICS, register_types, typed_messages
from synthetic_logs.writers.ros_messages import Encoding, in_time_order, messages_of

__all__ = ["write_ros1", "write_ros2", "write_ros2_file"]


def write_ros1(log: SyntheticLog, path: Path) -> None:
    """A ROS 1 bag, uncompressed; message times are the stamps."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with rosbag1.Writer(path) as writer:
        types, records = _records(log, store, "ros1")
        connections = {topic: writer.add_connection(topic, name, typestore=store) for topic, name in types.items()}
        for t_ns, topic, data in records:
            writer.write(connections[topic], t_ns, data)


def write_ros2(log: SyntheticLog, path: Path) -> None:
    """A ROS 2 bag: the directory path with metadata.yaml and an SQLite file of the same name."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with rosbag2.Writer(path, version=9) as writer:
        types, records = _records(log, store, "cdr")
        connections = {topic: writer.add_connection(topic, name, typestore=store) for topic, name in types.items()}
        for t_ns, topic, data in records:
            writer.write(connections[topic], t_ns, data)


def write_ros2_file(log: SyntheticLog, path: Path) -> None:
    """Only the SQLite file of a ROS 2 bag."""
    with TemporaryDirectory(dir=path.parent) as scratch:
        bag = Path(scratch) / path.stem
        write_ros2(log, bag)
        (bag / f"{path.stem}.db3").rename(path)


def _records(
    log: SyntheticLog, store: Typestore, encoding: Encoding
) -> tuple[dict[str, str], Iterator[tuple[int, str, bytes | memoryview]]]:
    """Message types by topic, and time [UTC ns], topic and serialised message in the order of time."""
    topics = messages_of(log, encoding)
    series = ((t_ns, topics[index].topic, data) for index, t_ns, data in in_time_order(topics))
    types = {topic.topic: topic.type for topic in topics}
    if log.ranges is None:
        return types, series
    register_types(store)
    serialize = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
    ranges = ((t_ns, topic, serialize(message, TOPICS[topic])) for topic, t_ns, message in typed_messages(log, store))
    return types | TOPICS, merge(series, ranges, key=itemgetter(0))
