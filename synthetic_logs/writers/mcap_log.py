"""Writes a log as MCAP: ROS 2 messages in CDR, ranges as JSON."""

import json
from collections.abc import Iterator
from heapq import merge
from pathlib import Path

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from navreplay.timeline import RangeSeries
from synthetic_logs.simulation import SyntheticLog
from synthetic_logs.writers.range_messages import SCHEMA, SCHEMA_NAME, TOPIC, range_messages
from synthetic_logs.writers.ros_messages import Messages, in_time_order, messages_of

__all__ = ["write_mcap"]

Record = tuple[int, int, bytes]
"""Time [UTC ns], channel, message."""


def write_mcap(log: SyntheticLog, path: Path) -> None:
    """One channel per topic, chunks compressed with zstd, with index; log time is the stamp."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        # the profile promises that all messages are CDR
        writer.start(profile="ros2" if log.ranges is None else "", library="navreplay")
        records = [_ros_records(writer, messages_of(log, "cdr"))]
        if log.ranges is not None:
            records.append(_range_records(writer, log.ranges))
        for t_ns, channel, data in merge(*records):
            writer.add_message(channel, log_time=t_ns, data=data, publish_time=t_ns)
        writer.finish()


def _ros_records(writer: Writer, topics: tuple[Messages, ...]) -> Iterator[Record]:
    typestore = get_typestore(Stores.ROS2_HUMBLE)
    channels = []
    for topic in topics:
        definition, _ = typestore.generate_msgdef(topic.type, ros_version=2)
        schema = writer.register_schema(topic.type, "ros2msg", definition.encode())
        channels.append(writer.register_channel(topic.topic, "cdr", schema))
    return ((t_ns, channels[index], data) for index, t_ns, data in in_time_order(topics))


def _range_records(writer: Writer, ranges: RangeSeries) -> Iterator[Record]:
    schema = writer.register_schema(SCHEMA_NAME, "jsonschema", json.dumps(SCHEMA).encode())
    channel = writer.register_channel(TOPIC, "json", schema)
    return ((t_ns, channel, data) for t_ns, data in range_messages(ranges))
