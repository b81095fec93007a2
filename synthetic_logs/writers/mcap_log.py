"""Writes a log as MCAP with ROS 2 messages in CDR."""

from pathlib import Path

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from synthetic_logs.simulation import SyntheticLog
from synthetic_logs.writers.ros_messages import in_time_order, messages_of

__all__ = ["write_mcap"]


def write_mcap(log: SyntheticLog, path: Path) -> None:
    """One channel per topic, chunks compressed with zstd, with index; log time is the stamp."""
    topics = messages_of(log, "cdr")
    typestore = get_typestore(Stores.ROS2_HUMBLE)
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="navreplay")
        channels = []
        for topic in topics:
            definition, _ = typestore.generate_msgdef(topic.type, ros_version=2)
            schema = writer.register_schema(topic.type, "ros2msg", definition.encode())
            channels.append(writer.register_channel(topic.topic, "cdr", schema))
        for index, t_ns, data in in_time_order(topics):
            writer.add_message(channels[index], log_time=t_ns, data=data, publish_time=t_ns)
        writer.finish()
