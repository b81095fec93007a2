"""A channel that cannot be read, of whatever type and for whatever reason, costs no other anything."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from importers.inspection import inspect_logs
from importers.load import load_timeline
from importers.settings import InputSettings
from navreplay.timeline import LogError
from tests.helpers.log_samples import FIX, IMU, ROS2, START_NS, imu, imu_rows, nav_sat_fix

N = 40
FAULTS: dict[str, tuple[str, bytes, str]] = {
    "text that is no definition": ("ros2msg", b"\xff\x00 %%% float99 x[[", "cdr"),
    "a type that is not defined": ("ros2msg", b"my_msgs/Unknown x\n", "cdr"),
    "another language": ("omgidl", b"module a { struct b { long c; }; };", "cdr"),
    "another encoding": ("", b"", "cbor"),
    "broken descriptors": ("protobuf", b"\xff\xff\xff", "protobuf"),
    "messages cut short": ("ros2msg", b"float64 x\nfloat64 y\n", "cdr"),
}
TYPES = (
    "nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistStamped", "sensor_msgs/msg/TimeReference", "gnss_comm/msg/GnssEphemMsg",
    "gnss_comm/msg/GnssMeasMsg", "novatel_oem7_msgs/msg/INSPVAX", "my_msgs/msg/Own", "sensor_msgs/msg/Image",
)  # fmt: skip


def write_healthy(writer: Writer) -> None:
    serialized = {
        IMU: [imu(ROS2, START_NS + i * 10**7, row) for i, row in enumerate(imu_rows(N))],
        FIX: [nav_sat_fix(ROS2, START_NS + i * 10**8) for i in range(N)],
    }
    for kind, messages in serialized.items():
        schema = writer.register_schema(kind, "ros2msg", ROS2.generate_msgdef(kind, ros_version=2)[0].encode())
        channel = writer.register_channel("/imu" if kind == IMU else "/fix", "cdr", schema)
        for i, message in enumerate(messages):
            writer.add_message(channel, START_NS + i, bytes(ROS2.serialize_cdr(message, kind)), START_NS + i)


def write_bad(path: Path, kind: str, fault: str, topic: str = "/bad") -> Path:
    language, text, encoding = FAULTS[fault]
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        bad = writer.register_channel(topic, encoding, writer.register_schema(kind, language, text))
        write_healthy(writer)
        for i in range(5):
            writer.add_message(bad, START_NS + i, b"\0\1\0\0\1\0\0", START_NS + i)
        writer.finish()
    return path


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("fault", FAULTS)
def test_the_others_are_read(tmp_path: Path, kind: str, fault: str) -> None:
    path = write_bad(tmp_path / "log.mcap", kind, fault)
    timeline = load_timeline([path])
    assert timeline.imu is not None
    assert timeline.fixes is not None
    assert (len(timeline.imu), len(timeline.fixes)) == (N, N)
    inspection = inspect_logs([path])
    assert {channel.name: channel.role for channel in inspection.channels}["/imu"] == "imu"
    assert {channel.name: channel.role for channel in inspection.channels}["/fix"] == "fix"
    assert not {"no-imu", "no-gnss", "unusable"} & {finding.code for finding in inspection.findings}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_channel_that_is_needed_is_told_with_its_reason(tmp_path: Path, fault: str) -> None:
    path = write_bad(tmp_path / "log.mcap", "sensor_msgs/msg/NavSatFix", fault)
    timeline = load_timeline([path])
    assert timeline.fixes is not None, "a channel that cannot be decoded is no choice"
    with pytest.raises(LogError, match=r"channel /bad holds no readable message of 5 \(5 .*\); name another channel, or leave"):
        load_timeline([path], InputSettings.model_validate({"fix": {"channel": "/bad"}}))


def test_velocities_of_another_definition_cost_the_positions_nothing(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        write_healthy(writer)
        schema = writer.register_schema("geometry_msgs/msg/TwistStamped", "ros2msg", b"float64 speed\n")
        channel = writer.register_channel("/vel", "cdr", schema)
        for i in range(N):
            writer.add_message(channel, START_NS + i, b"\0\1\0\0" + bytes(8), START_NS + i)
        writer.finish()
    timeline = load_timeline([path])
    assert timeline.fixes is not None
    assert any("has no field twist.linear; so its velocities are not used" in note for note in timeline.provenance.damage)
    with pytest.raises(LogError, match=r"has no field twist\.linear"):
        load_timeline([path], InputSettings.model_validate({"fix": {"velocity_channel": "/vel"}}))


def test_bag_with_a_type_that_nobody_defines(tmp_path: Path) -> None:
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/imu", IMU, typestore=ROS2)
        for i, row in enumerate(imu_rows(N)):
            t_ns = START_NS + i * 10**7
            writer.write(connection, t_ns, ROS2.serialize_cdr(imu(ROS2, t_ns, row), IMU))
        other = writer.add_connection("/odom", FIX, typestore=ROS2)
        writer.write(other, START_NS, b"\0\1\0\0\1\0\0\0")
    database = next((tmp_path / "bag").glob("*.db3"))
    with sqlite3.connect(database) as connection_:
        connection_.execute("DROP TABLE message_definitions")
        connection_.execute("UPDATE topics SET type = 'my_msgs/msg/Own' WHERE name = '/odom'")
    connection_.close()
    timeline = load_timeline([tmp_path / "bag"])
    assert timeline.imu is not None
    assert np.isfinite(timeline.imu.gyro).all()
