"""Writes a log as ROS 1 bag or as ROS 2 bag with SQLite storage."""

from pathlib import Path
from tempfile import TemporaryDirectory

from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from synthetic_logs.simulation import SyntheticLog
from synthetic_logs.writers.ros_messages import in_time_order, messages_of

__all__ = ["write_ros1", "write_ros2", "write_ros2_file"]


def write_ros1(log: SyntheticLog, path: Path) -> None:
    """A ROS 1 bag, uncompressed; message times are the stamps."""
    topics = messages_of(log, "ros1")
    typestore = get_typestore(Stores.ROS1_NOETIC)
    with rosbag1.Writer(path) as writer:
        connections = [writer.add_connection(topic.topic, topic.type, typestore=typestore) for topic in topics]
        for index, t_ns, data in in_time_order(topics):
            writer.write(connections[index], t_ns, data)


def write_ros2(log: SyntheticLog, path: Path) -> None:
    """A ROS 2 bag: the directory path with metadata.yaml and an SQLite file of the same name."""
    topics = messages_of(log, "cdr")
    typestore = get_typestore(Stores.ROS2_HUMBLE)
    with rosbag2.Writer(path, version=9) as writer:
        connections = [writer.add_connection(topic.topic, topic.type, typestore=typestore) for topic in topics]
        for index, t_ns, data in in_time_order(topics):
            writer.write(connections[index], t_ns, data)


def write_ros2_file(log: SyntheticLog, path: Path) -> None:
    """Only the SQLite file of a ROS 2 bag."""
    with TemporaryDirectory(dir=path.parent) as scratch:
        bag = Path(scratch) / path.stem
        write_ros2(log, bag)
        (bag / f"{path.stem}.db3").rename(path)
